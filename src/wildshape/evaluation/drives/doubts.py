# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is odd about labels that can be read: figures by them may be worth nothing."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from wildshape.evaluation.drives.labels import LabelledDrive
from wildshape.evaluation.drives.protocol import DriveScores

_FEW = 0.1  # of the average precision from above, in space: heights do not meet
_CURE = (
    "check that they are of these scans and in KITTI's frame and order: height, width, length, the"
    " middle of the floor, the turn"
)


def doubts_of(labelled: Sequence[LabelledDrive], scores: DriveScores) -> list[str]:
    """A sentence on scans without labels, and on labels that no found box meets."""
    return [told for drive in labelled for told in _unlabelled(drive)] + [
        f"{labelled[0].path}: {told}; {_CURE}" for told in _unmet(scores)
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
