# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a benchmark found: a printed table, its bars, and files in `benchmarks/results`."""

import csv
import io
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Any

import torch
from figure import draw
from machine import Kind, header, p95, verdict
from turns import clock_name

from wildshape.io.atomic import write_json, write_text
from wildshape.io.output import provenance
from wildshape.ops.nearest import backend

_OTHERS = ("scipy", "pykdtree", "small_gicp", "pykeops")
Row = dict[str, Any]


@dataclass
class Outcome:
    """Rows and bars of one benchmark; made at its start, published at its end.

    Attributes:
        name: of the files.
        unit: of the rows' `median`.
        rows: one a case and method, with `case`, `method`, `median`, `best`, `p95`, and more.
        bars: printed sentences, each with its verdict.
        notes: what was not measured, and why.
    """

    name: str
    unit: str = "ms"
    rows: list[Row] = field(default_factory=list)
    bars: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, case: str, times: dict[str, list[float]], **more: dict[str, Any]) -> None:
        """Rows of one case and their table; `more` holds further columns by method."""
        first = median(next(iter(times.values())))
        rows = [
            {"case": case, "method": name, "median": median(t), "best": min(t), "p95": p95(t)}
            | {"calls": len(t), "ratio": median(t) / first, "clock": clock_name()}
            | {column: held.get(name, "") for column, held in more.items()}
            for name, t in times.items()
        ]
        self.rows += rows
        print(f"\n{case}\n{table(rows)}", flush=True)

    def note(self, sentence: str) -> None:
        self.notes.append(sentence)
        print(sentence, flush=True)

    def median(self, case: str, method: str) -> float:
        found = (r["median"] for r in self.rows if (r["case"], r["method"]) == (case, method))
        return next(found, float("nan"))

    def at_least(self, case: str, fast: str, slow: str, times: float) -> None:
        """A bar: in this case `fast` is so many times faster than `slow`."""
        ratio = self.median(case, slow) / self.median(case, fast)
        if ratio == ratio:
            self.bar(f"{case}: {slow} / {fast}", ratio, times, least=True, kind="measured")
        else:
            self.note(f"not measured: {case}: {slow} / {fast} >= {times:g}")

    def bar(
        self, name: str, value: float, bar: float, *, least: bool = False, kind: Kind = "exact"
    ) -> None:
        self.bars.append(verdict(name, value, bar, least=least, kind=kind))

    def publish(self, folder: Path, *, small: bool) -> None:
        """Print the bars; write NAME.csv, NAME.json (provenance) and NAME.svg."""
        print("\n" + "\n".join(self.bars) if self.bars else "", flush=True)
        columns = list(dict.fromkeys(column for row in self.rows for column in row))
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: rounded(v) for k, v in row.items()} for row in self.rows)
        write_text(folder / f"{self.name}.csv", text.getvalue())
        write_json(folder / f"{self.name}.json", self.record(small))
        draw(
            folder / f"{self.name}.svg",
            self.rows,
            self.unit,
            f"{header(self.name)}; {clock_name()}",
        )

    def record(self, small: bool) -> dict[str, Any]:
        """Where the numbers come from, and what they say of the bars."""
        made = provenance(
            " ".join(["python", f"benchmarks/{Path(sys.argv[0]).name}", *sys.argv[1:]])
        )
        load = [round(value, 2) for value in os.getloadavg()] if hasattr(os, "getloadavg") else None
        return made | {
            "form": "small" if small else "full",
            "threads": torch.get_num_threads(),
            "nearest_backend": backend(),
            "load_at_the_end": load,
            "competitors": {name: version(name) for name in _OTHERS},
            "unit": self.unit,
            "bars": self.bars,
            "notes": self.notes,
        }


def table(rows: Iterable[Row]) -> str:
    """Aligned text, the case left out."""
    rows = [{k: v for k, v in row.items() if k not in ("case", "clock")} for row in rows]
    columns = list(rows[0])
    cells = [columns] + [[str(rounded(row[c])) for c in columns] for row in rows]
    widths = [max(len(line[i]) for line in cells) for i in range(len(columns))]
    return "\n".join(
        "  ".join(
            c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(line, widths))
        )
        for line in cells
    )


def rounded(value: Any) -> Any:
    return float(f"{value:.4g}") if isinstance(value, float) else value


def version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
