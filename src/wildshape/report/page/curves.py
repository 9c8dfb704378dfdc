# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The curves of a training run, from its `log.jsonl`."""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from wildshape.report.content import Curve

_VALIDATION = "validation/"
_NO_TERMS = ("step", "branch_shares", "steps_per_second")
_TRUTH = {
    "cd": ("Chamfer distance", "metres"),
    "acc30": ("registered within 30 degrees", "share"),
    "rot_median_deg": ("rotation, median", "degrees"),
    "trans_median_m": ("translation, median", "metres"),
}


def training_curves(log: Path) -> tuple[Curve, ...]:
    """The curves of a run's `log.jsonl`."""
    entries = list(whole_entries(log))
    terms = _terms(entries)
    unit = "no unit" if "silhouette" in terms else "metres"  # DPC's count pixels
    validated = _series(entries, tuple(f"{_VALIDATION}{k}" for k in ("observation", "projection")))
    cycle = _series(entries, (f"{_VALIDATION}cycle_deg",))
    curves = (
        Curve("Loss", "step", unit, _series(entries, terms), log_y=True),
        Curve("Share of each pose branch", "step", "share", _shares(entries)),
        Curve("Validation, without truth", "step", "metres", validated, log_y=True),
        Curve("Validation, cycle consistency", "step", "degrees", cycle),
        *(
            Curve(f"Validation against truth: {what}", "step", unit, series)
            for key, (what, unit) in _TRUTH.items()
            for series in (_series(entries, (f"{_VALIDATION}truth_{key}",)),)
        ),
    )
    return tuple(curve for curve in curves if curve.series)


def whole_entries(log: Path) -> Iterable[dict[str, Any]]:
    """The entries of a run's `log.jsonl`; a line cut off by a kill is left out."""
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(entry, dict) and _is_number(entry.get("step")):
            yield entry


def _terms(entries: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """The loss and its terms, whatever their objective calls them, in the order of the log."""
    names = dict.fromkeys(name for entry in entries for name in entry)
    return tuple(n for n in names if n not in _NO_TERMS and not n.startswith(_VALIDATION))


def _series(
    entries: Sequence[Mapping[str, Any]], keys: tuple[str, ...]
) -> tuple[tuple[str, list[float], list[float]], ...]:
    """One series a key that has a number other than zero anywhere."""
    series = []
    for key in keys:
        pairs = [(float(e["step"]), float(e[key])) for e in entries if _is_number(e.get(key))]
        if any(y != 0 for _, y in pairs):
            name = key.removeprefix(_VALIDATION).removesuffix("_deg").removesuffix("_m")
            series.append((name, [x for x, _ in pairs], [y for _, y in pairs]))
    return tuple(series)


def _shares(
    entries: Sequence[Mapping[str, Any]],
) -> tuple[tuple[str, list[float], list[float]], ...]:
    rows = [e for e in entries if _are_numbers(e.get("branch_shares"))]
    branches = min((len(row["branch_shares"]) for row in rows), default=0)
    steps = [float(row["step"]) for row in rows]
    return tuple(
        (f"branch {i}", steps, [float(row["branch_shares"][i]) for row in rows])
        for i in range(branches)
    )


def _are_numbers(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_number(value: object) -> bool:
    """Whether it is a finite number that a float can hold; a JSON integer has no largest."""
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max
