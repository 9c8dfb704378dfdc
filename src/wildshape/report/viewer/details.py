# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the panel says of the scan shown: sizes, confidence, and errors where truth is known."""

from collections.abc import Sequence
from html import escape

import numpy as np

from wildshape.evaluation.metrics import completion_error
from wildshape.geometry.sampling import thin
from wildshape.report.scene import TRUTH_POINTS
from wildshape.report.viewer.colours import LEGENDS, css
from wildshape.report.viewer.sources import CompletedScan
from wildshape.report.viewer.stage import Stage, Wish

_ROW = "<div style='display:flex;gap:.8em;justify-content:space-between'><span style='opacity:.65'>"


def details(stage: Stage, wish: Wish, status: str = "") -> str:
    """A piece of HTML; every name is escaped."""
    track, done = stage.track, stage.completions.get(wish.scan, CompletedScan())
    about = ", ".join(part for part in (track.category, track.source) if part)
    parts = [
        f"<b style='overflow-wrap:anywhere'>{escape(track.name)}</b>",
        f"<div style='opacity:.65;overflow-wrap:anywhere'>{escape(about)}</div>" if about else "",
        *(row(label, value) for label, value in _rows(stage, wish)),
        _small(f"Completed shape: {LEGENDS[wish.colouring]}."),
        _small(done.warning, "color:#d55e00"),
        _small(status),
    ]
    return framed(parts)


def framed(parts: Sequence[str]) -> str:
    """Pieces of HTML, as the panel shows them."""
    return (
        f"<div style='font-size:.85em;line-height:1.5;padding:0 .8em .5em'>{''.join(parts)}</div>"
    )


def _rows(stage: Stage, wish: Wish) -> list[tuple[str, str]]:
    scan = stage.track.scans[wish.scan]
    rows = [
        ("scan", escape(stage.track.scan_names[wish.scan])),
        ("measured points", f"{len(scan):,}"),
        ("distance to the sensor", f"{np.linalg.norm(stage.centre(wish.scan)):.1f} m"),
    ]
    return rows + _completed_rows(stage.completions.get(wish.scan)) + _true_rows(stage, wish)


def _completed_rows(done: CompletedScan | None) -> list[tuple[str, str]]:
    if done is None:
        return [("completed shape", "not yet")]
    rows = []
    if done.confidence is not None:
        dot = f"<span style='color:{css(done.confidence)}'>\N{BLACK CIRCLE}</span>"
        rows.append(("confidence", f"{dot} {done.confidence:.2f}"))
    rows += [(words, f"{chance:.2f}") for words, chance in done.chances.items()]
    if done.box is not None:
        size = " \N{MULTIPLICATION SIGN} ".join(f"{side:.2f}" for side in done.box.size)
        rows.append(("box", f"{size} m"))
    if done.seconds:
        rows.append(("time", f"{1000 * done.seconds:.0f} ms"))
    return rows


def _true_rows(stage: Stage, wish: Wish) -> list[tuple[str, str]]:
    """Errors of this scan, and of the whole track by the way of fusing that is chosen."""
    rows, done = [], stage.completions.get(wish.scan)
    truth = stage.truth_in(wish.scan) if stage.track.shape is not None else None
    if truth is not None and done is not None and done.points is not None:
        error = completion_error(done.points, thin(truth, TRUTH_POINTS))
        rows.append(("Chamfer distance to truth", f"{error.cd:.3f} m"))
    way = stage.moves(wish.way)
    if way is not None and way.error is not None and len(stage.track.scans) > 1:
        turned, moved = way.error.rotation_deg[wish.scan], way.error.translation_m[wish.scan]
        rows.append(("pose error to the middle scan", f"{turned:.1f}°, {moved:.2f} m"))
        rows.append((f"all scans, {wish.way}", way.verdict))
    return rows


def row(label: str, value: str) -> str:
    """A line of the panel; `value` is HTML."""
    return f"{_ROW}{escape(label)}</span><span style='text-align:right'>{value}</span></div>"


def _small(text: str, style: str = "opacity:.65") -> str:
    return f"<div style='{style};margin-top:.4em'>{escape(text)}</div>" if text else ""
