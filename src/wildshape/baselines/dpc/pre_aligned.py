# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC judged as its authors judge it: by shapes alone, in a frame that other objects' truth tells.

One rotation, the same for all objects, brings canonical shapes to the true frame. The paper prints
such rows as "pre-aligned".
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from wildshape.baselines.dpc.completer import Dpc
from wildshape.evaluation.metrics import completion_error
from wildshape.records import Points, Sensor, Track

Known = tuple[Points, Points, Float[np.ndarray, "3 3"]]


@dataclass(frozen=True)
class PreAligned:
    """Completes in the object's own frame.

    Attributes:
        R_object_canonical: found by `pre_aligned`.
    """

    method: Dpc
    R_object_canonical: Float[np.ndarray, "3 3"]

    @property
    def about(self) -> str:
        """What it is, and what it is told."""
        return f"{self.method.about}; shapes alone, in a frame aligned by the truth of others"

    def complete_canonical(self, scans: list[Points], sensor: Sensor) -> Iterator[Points]:
        """The complete shape `(m, 3)` of each scan, object frame, metres."""
        for scan in scans:
            cloud, _ = self.method.canonical(scan, sensor)
            yield _turned(cloud, self.R_object_canonical)


def pre_aligned(method: Dpc, tracks: Iterable[Track]) -> PreAligned:
    """Of the turns that its poses propose, the one under which shapes are nearest to the truth.

    Args:
        method: trained.
        tracks: with truth, neither trained on nor tested; their middle scans are looked at.
    """
    known = [_known(method, track) for track in tracks]
    turns = [turn for _, _, turn in known]
    return PreAligned(method, min(turns, key=lambda turn: _distance(known, turn)))


def _known(method: Dpc, track: Track) -> Known:
    """Canonical shape, true shape and `R_object_canonical` of a track's middle scan."""
    assert track.T_sensor_object is not None
    assert track.shape is not None
    cloud, T_sensor_canonical = method.canonical(track.scans[track.middle], track.sensor)
    R_sensor_object = track.T_sensor_object.rotation[track.middle]
    return cloud, track.shape, (R_sensor_object.mT @ T_sensor_canonical.rotation).numpy()


def _turned(cloud: Points, R: Float[np.ndarray, "3 3"]) -> Points:
    return cloud @ R.T.astype(cloud.dtype)


def _distance(known: list[Known], turn: Float[np.ndarray, "3 3"]) -> float:
    """Mean Chamfer distance, metres, of all shapes turned so."""
    errors = [completion_error(_turned(cloud, turn), truth).cd for cloud, truth, _ in known]
    return float(np.mean(errors))
