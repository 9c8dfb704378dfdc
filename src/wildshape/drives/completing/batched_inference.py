# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The network's looks at many scans, of whatever objects, before any is completed."""

from collections.abc import Iterator, Sequence

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.boxes import box_seen
from wildshape.inference.predictor import BATCH, Predictor
from wildshape.inference.single_scans import Looked
from wildshape.records import Box, Completion, Points


def looks_at(scans: Sequence[Points], predictor: Predictor) -> list[Looked]:
    """What a network says of each scan."""
    parts = [scans[start : start + BATCH] for start in range(0, len(scans), BATCH)]
    return [one for part in parts for one in predictor.look(part).each()]


def completed(
    looks: Sequence[Looked], predictor: Predictor, *, dense: bool
) -> Iterator[Completion]:
    """Each scan that was looked at, completed on its own; `dense` as in `complete_looked`."""
    for start in range(0, len(looks), BATCH):
        some = Looked.joined(looks[start : start + BATCH])
        yield from predictor.complete_looked(some, dense=dense)


def box_of(look: Looked, predictor: Predictor) -> Box:
    """The box of the network's own shape of one scan, not refined."""
    shapes, rotation, translation, *_ = look.found
    pose = SE3(rotation[0], translation[0])
    return box_seen(shapes[0], pose, look.seen[0], predictor.settings, predictor.config.box)
