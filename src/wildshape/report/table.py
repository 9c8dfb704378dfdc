# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A table as HTML; a sortable one carries each cell's number, by which the page's script sorts."""

import math
from html import escape

from wildshape.report.content import Cell, Table

_DASH = "\N{EN DASH}"
_NUMERIC = f"0123456789-+±{_DASH}"
_SPREAD = " ± "
_MANY = 12


def html_table(table: Table) -> str:
    """The table with its caption, without its title."""
    right = [i > 0 and _numeric([r[i] for r in table.rows]) for i in range(len(table.columns))]
    head = "".join(
        f"<th scope=col{_class(right[i])}>{escape(name)}</th>"
        for i, name in enumerate(table.columns)
    )
    rows = "".join(_row(table, i, right) for i in range(len(table.rows)))
    caption = f"<p class=caption>{escape(table.caption)}</p>" if table.caption else ""
    kinds = ["sortable"] * table.sortable + ["wide"] * (len(table.columns) > _MANY)
    kind = f' class="{" ".join(kinds)}"' if kinds else ""
    grid = f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return f"<div class=scroll>{grid}</div>{caption}"


def _row(table: Table, number: int, right: list[bool]) -> str:
    cells = "".join(
        f"<td{_class(is_right)}>{_content(cell)}</td>"
        for cell, is_right in zip(table.rows[number], right, strict=True)
    )
    ours = " class=ours" if number in table.emphasis else ""
    to = table.objects[number] if number < len(table.objects) else None
    return f"<tr{ours}{'' if to is None else f' data-object={to} tabindex=0'}>{cells}</tr>"


def _class(right: bool) -> str:
    return " class=number" if right else ""


def _numeric(cells: list[Cell]) -> bool:
    """Whether a column holds numbers, some perhaps written as `82.1 ± 1.3` or `–`."""
    return all(not isinstance(cell, str) or cell[:1] in _NUMERIC for cell in cells)


def _content(cell: Cell) -> str:
    """The text; a deviation may stand below its mean where the page is narrow."""
    text = escape(_text(cell))
    mean, spread, deviation = text.partition(_SPREAD)
    if spread and mean[:1] in _NUMERIC:
        return f"{mean} <small>± {deviation}</small>"
    return text


def _text(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return _DASH
    return format(cell, ".3g") if isinstance(cell, float) else str(cell)
