# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Statistics as tables for a terminal, each with a small histogram, and as JSON values."""

import io
import sys
from typing import TYPE_CHECKING

from wildshape.io.progress import printable
from wildshape.report.statistics.drawing import number
from wildshape.report.statistics.sheet import read_line, summary_line
from wildshape.report.statistics.statistics import Quantity, Statistics

if TYPE_CHECKING:
    from rich.table import Table


_BLOCKS, _PLAIN = " ▁▂▃▄▅▆▇█", " .:-=+*#@"
_BINS, _WIDTH, _LISTED = 24, 110, 12


def table_text(title: str, found: Statistics) -> str:
    """Everything, as wide as the terminal, in characters that it can show."""
    from rich.console import Console

    buffer = io.StringIO()
    on_terminal = sys.stdout.isatty()
    width = None if on_terminal else _WIDTH
    console = Console(file=buffer, width=width, force_terminal=on_terminal, highlight=False)
    glyphs = _BLOCKS if _shows_blocks() else _PLAIN
    console.print(f"[bold]{_plain(title)}[/bold]: {_plain(summary_line(found))}", soft_wrap=True)
    console.print(_distributions(found, glyphs, ascii_only=glyphs is _PLAIN))
    for text in _bases(found):
        console.print(_plain(text), soft_wrap=True, style="dim")
    for name, counts in _counted(found):
        console.print(f"[bold]{name}[/bold]: {_plain(_listed(counts))}", soft_wrap=True)
    return buffer.getvalue().rstrip("\n")


def _distributions(found: Statistics, glyphs: str, *, ascii_only: bool) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.ASCII2 if ascii_only else box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for name in ("least", "5 %", "median", "95 %", "most"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True, style="cyan")
    for quantity in found.quantities:
        tally = quantity.tally
        numbers = (tally.least, *(tally.quantile(s) for s in (0.05, 0.5, 0.95)), tally.most)
        unit = f", {quantity.unit}" if quantity.unit else ""
        bars = _bars(quantity, glyphs)
        table.add_row(f"{quantity.title}{unit}", *map(number, numbers), bars)
    return table


def _bars(quantity: Quantity, glyphs: str) -> str:
    """A histogram of one line; what occurs at all is never drawn as nothing."""
    shares = quantity.tally.bars(_BINS)[1]
    top = shares.max() or 1.0
    steps = [0 if s == 0 else max(1, round(s / top * (len(glyphs) - 1))) for s in shares]
    return "".join(glyphs[step] for step in steps)


def _bases(found: Statistics) -> list[str]:
    """What the numbers were taken from, each once."""
    told: dict[str, list[str]] = {}
    for quantity in found.quantities:
        told.setdefault(quantity.basis, []).append(quantity.title)
    lines = [f"{', '.join(titles)}: {basis}" for basis, titles in told.items()]
    return [*lines, read_line(found)]


def _counted(found: Statistics) -> list[tuple[str, dict[str, int]]]:
    origin = found.provenance
    words = {str(origin[k]): 0 for k in ("command", "time_utc") if origin.get(k)}
    tables = [
        ("categories", found.categories),
        ("sensors", found.sensors),
        ("sources", found.sources),
        ("left out when they were made", found.left_out),
        ("made by", words),
    ]
    return [(name, counts) for name, counts in tables if counts and set(counts) != {""}]


def _listed(counts: dict[str, int]) -> str:
    shown = list(counts.items())[:_LISTED]
    words = [f"{word or 'not said'} {count:,}" if count else word for word, count in shown]
    more = [f"and {len(counts) - _LISTED} more"] if len(counts) > _LISTED else []
    return "; ".join([*words, *more])


def _plain(text: str) -> str:
    """No markup and no control characters, whatever a file says."""
    from rich.markup import escape

    return escape(printable(text))


def _shows_blocks() -> bool:
    try:
        _BLOCKS.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True
