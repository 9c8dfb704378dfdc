# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `metrics.json` says, as a table and as sentences."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wildshape.baselines.named import NAMES
from wildshape.evaluation.drives.results import (
    DETECTION,
    TRACKING,
    detection_cells,
    notes,
    tracking_cells,
)
from wildshape.evaluation.protocol import ONE_SCAN
from wildshape.evaluation.summary import FIGURES
from wildshape.evaluation.tables import COUNTED, ROTATE, cell
from wildshape.io.progress import counted
from wildshape.report.content import Table

_TRAINED_RIVALS = ("dpc", "oracle")  # and what their names begin, such as dpc-lidar
_SURE = 0.5


def metrics_table(metrics: Mapping[str, Any]) -> Table:
    """The content of `metrics.json` as a table; our rows, those of no baseline, are bold."""
    return _of_drives(metrics) if "trajectories" in metrics else _of_tracks(metrics)


def _of_drives(metrics: Mapping[str, Any]) -> Table:
    """What `evaluate-drive` wrote, as its table.md has it."""
    return Table(
        title="Drives against labels",
        columns=("boxes", *DETECTION, *TRACKING),
        rows=tuple(
            (name, *detection_cells(figures), *tracking_cells(figures))
            for name, figures in metrics["methods"].items()
        ),
        caption=" ".join(notes(metrics)).replace("**", ""),
        emphasis=(0,),
    )


def _of_tracks(metrics: Mapping[str, Any]) -> Table:
    methods: dict[str, dict[str, Any]] = dict(metrics.get("methods") or {})
    known = {name for row in methods.values() for name in row if row[name] is not None}
    columns = [figure for figure in FIGURES if figure.heading and figure.name in known]
    rotate = str(metrics.get("rotate", ""))
    rows = [
        (name, *(cell(row.get(f.name), (row.get("std") or {}).get(f.name), f) for f in columns))
        for name, row in methods.items()
    ]
    counts = [_counts(row.get("scans_counted") or {}) for row in methods.values()]
    skipped = {
        (one.get("track"), one.get("scan"))
        for one in metrics.get("skipped") or ()
        if ONE_SCAN not in str(one.get("reason"))
    }
    return Table(
        title=ROTATE.get(rotate, rotate or "evaluation").capitalize(),
        columns=("method", *(figure.heading for figure in columns), COUNTED),
        rows=tuple((*row, count) for row, count in zip(rows, counts, strict=True)),
        caption=_caption(len(skipped), len(metrics.get("seeds") or ()) or 1),
        emphasis=tuple(i for i, name in enumerate(methods) if is_ours(name)),
    )


def _counts(counted: Mapping[str, int]) -> str:
    """Of shapes and of poses, as in table.md."""
    return " / ".join(str(counted.get(kind, 0)) for kind in ("completion", "registration"))


def _caption(skipped: int, seeds: int) -> str:
    parts = (
        "CD = precision + coverage, Euclidean, metres; rotation and translation are medians against"
        " the middle scan; acc 30 and heading 30 are shares within 30°; sym counts a half turn as"
        " right; CD floor is that of as many points of the true surface, drawn at random.",
        f"Mean ± standard deviation of {seeds} seeds." if seeds > 1 else "",
        f"{counted(skipped, 'scan')} skipped by some method." if skipped else "",
    )
    return " ".join(part for part in parts if part)


def is_ours(method: str) -> bool:
    """Whether a row is a model of ours: none of the baselines, DPC's variants or the oracle."""
    return method not in NAMES and not method.lower().startswith(_TRAINED_RIVALS)


def of_metrics(metrics: Mapping[str, Any]) -> list[str]:
    """What metrics.json says of each of our rows, beside the best of the others."""
    methods: dict[str, Mapping[str, Any]] = dict(metrics.get("methods") or {})
    rivals = {name: figures for name, figures in methods.items() if not is_ours(name)}
    turned = ROTATE.get(str(metrics.get("rotate")), "scans as recorded")
    lines = []
    for name, figures in methods.items():
        if is_ours(name):
            lines += list(_ours(name, figures, rivals, turned))
    return lines


def _ours(
    name: str, figures: Mapping[str, Any], rivals: Mapping[str, Mapping[str, Any]], turned: str
) -> Iterator[str]:
    if _known(figures, "acc30", "rot_median_deg", "trans_median_m"):
        yield (
            f"Registration, {turned}: {name} brings {_percent(figures['acc30'])} of them "
            "within 30° of their true orientation to the track's middle scan, with a median error "
            f"of {figures['rot_median_deg']:.1f}° and {figures['trans_median_m']:.2f} m"
            f"{_beside(rivals, 'acc30', best=max, text=_percent)}."
        )
    if _known(figures, "cd", "precision", "coverage"):
        floor = figures.get("cd_floor")
        least = (
            f"; as many of the true surface, at random, would have {floor:.3f} m" if floor else ""
        )
        yield (
            f"Shape: a completed point of {name} lies {figures['precision']:.3f} m from the true "
            f"surface on average, a true point {figures['coverage']:.3f} m from the completed one: "
            f"together a Chamfer distance of {figures['cd']:.3f} m"
            f"{_beside(rivals, 'cd', best=min, text=_metres)}{least}."
        )
    if _known(figures, "box_iou", "heading30", "heading30_sym"):
        yield (
            f"Boxes: those of {name} share {_percent(figures['box_iou'])} of their joint volume "
            f"with the true ones on average; {_percent(figures['heading30'])} look within 30° of "
            f"the true heading, {_percent(figures['heading30_sym'])} if half turns are forgiven."
        )

    for words, key in (("heading", "p_pose"), ("box", "p_box")):
        parts = (f"{key}_error", f"{key}_brier", f"{key}_brier_constant")
        if _known(figures, *parts):
            error, brier, constant = (figures[part] for part in parts)
            yield (
                f"Trust: the chance of a right {words} that {name} states is {_percent(error)} off"
                f" on average; its Brier score is {brier:.3f}, that of the best constant"
                f" {constant:.3f}."
            )


def _known(figures: Mapping[str, Any], *keys: str) -> bool:
    return all(figures.get(key) is not None for key in keys)


def _beside(rivals: Mapping[str, Mapping[str, Any]], key: str, best: Any, text: Any) -> str:
    known = {name: f[key] for name, f in rivals.items() if f.get(key) is not None}
    if not known:
        return ""
    winner = best(known, key=known.__getitem__)
    return f" (best of the others: {winner}, {text(known[winner])})"


def of_confidences(confidences: Sequence[float], flagged: int) -> list[str]:
    """What the scans' confidences say, where nothing else is known."""
    if not confidences:
        return []
    unsure = sum(value < _SURE for value in confidences)
    share = _percent(unsure / len(confidences))
    first = f"{unsure:,} of them ({share}) are below {_SURE}: look at these first."
    lines = [
        f"{counted(len(confidences), 'scan')} completed: a median confidence of "
        f"{float(np.median(confidences)):.2f}; {first if unsure else f'none is below {_SURE}.'}"
    ]
    if flagged:
        lines.append(
            f"Results not to be trusted: {flagged:,}; the tables name the reasons of each "
            "(docs/formats.md)."
        )
    return lines


def of_errors(cds: Sequence[float], rotations: Sequence[float]) -> list[str]:
    """What the tracks' errors against their truth say."""
    lines = []
    if cds:
        lines.append(
            f"Against the true shape of {counted(len(cds), 'object')}: their middle scans have a"
            f" median Chamfer distance of {float(np.median(cds)):.3f} m, {max(cds):.3f} m at worst."
        )
    if rotations:
        share = sum(value <= 30 for value in rotations) / len(rotations)
        lines.append(
            f"Against the true poses of {counted(len(rotations), 'object')}: "
            f"{_percent(share)} have a median error of 30° or less to their middle scan."
        )
    return lines


def of_run(record: Mapping[str, Any]) -> str:
    """Which command was run, on what and when, from wildshape.json or metrics.json."""
    made = record.get("provenance") or {}
    if not made.get("command"):
        return ""
    when = str(made.get("time_utc") or "")[:16].replace("T", " ")
    parts = (f"Made by `{made['command']}`", f"on {when} UTC" if when else "")
    return " ".join(part for part in parts if part) + "."


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _metres(value: float) -> str:
    return f"{value:.3f} m"
