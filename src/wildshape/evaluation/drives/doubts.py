# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is odd about labels that can be read: figures by them may be worth nothing."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wildshape.evaluation.drives.found import FoundDrive
from wildshape.evaluation.drives.labels import LabelledDrive
from wildshape.evaluation.drives.overlap import overlaps
from wildshape.evaluation.drives.protocol import DriveScores

_FEW = 0.1  # of the average precision from above, in space: heights do not meet
_FRAMES, _BETTER = 20, 1.15  # are looked at for labels of a neighbouring scan that fit better
_FITS = 0.1  # mean IoU; less is chance
_CURE = (
    "check that they are of these scans and in KITTI's frame and order: height, width, length, the"
    " middle of the floor, the turn"
)


def doubts_of(
    found: Sequence[FoundDrive], labelled: Sequence[LabelledDrive], scores: DriveScores
) -> list[str]:
    """A sentence on scans without labels, on labels of other scans, and on those no box meets."""
    return [
        *(told for drive in labelled for told in _unlabelled(drive)),
        *(told for pair in zip(found, labelled, strict=True) for told in _shifted(*pair)),
        *(f"{labelled[0].path}: {told}; {_CURE}" for told in _unmet(scores)),
    ]


def _unlabelled(drive: LabelledDrive) -> Iterator[str]:
    empty: list[Path] = [
        scan
        for scan, frame in zip(drive.scans, drive.frames)
        if not frame.labels and not len(frame.regions)
    ]
    if empty:
        yield (
            f"{drive.path}: {len(empty)} of {len(drive.scans)} scans without a label, the first"
            f" {empty[0].name}; what is found in them counts as a mistake"
        )


def _shifted(found: FoundDrive, labelled: LabelledDrive) -> Iterator[str]:
    """Of labels that would fit better one scan earlier or later."""
    if len(found.frames) < 3:
        return
    now, before, after = (_fit(found, labelled, by) for by in (0, -1, 1))
    if max(before, after) > max(_BETTER * now, _FITS):
        other = "before" if before > after else "after"
        yield (
            f"{labelled.path}: what is found in a scan fits the labels of the one {other} it better"
            f" ({max(before, after):.2f} against {now:.2f}, mean IoU from above); check that labels"
            " and scans are numbered alike"
        )


def _fit(found: FoundDrive, labelled: LabelledDrive, by: int) -> float:
    """The mean IoU of a label with the best box found so many scans earlier, of some frames."""
    total, count = 0.0, 0
    for frame in np.unique(np.linspace(1, len(found.frames) - 2, _FRAMES).astype(int)):
        labels = [one.box for one in labelled.frames[frame + by].labels if one.counted]
        met = overlaps([one.box for one in found.frames[frame]], labels).bev
        total, count = total + float(met.max(0, initial=0.0).sum()), count + len(labels)
    return total / max(count, 1)


def _unmet(scores: DriveScores) -> Iterator[str]:
    ours = scores.rows[0]
    above, space = (
        next(one.average_precision or 0.0 for one in ours.detections if one.kind == kind)
        for kind in ("bev", "3d")
    )
    if ours.boxes and not above:
        yield "no box found lies on a label"
    elif space < _FEW * above:
        yield "boxes found lie on labels from above, but at other heights"
