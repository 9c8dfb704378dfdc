# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive as a recording for Rerun (https://rerun.io), to open with `rerun drive.rrd`.

| entity | archetype |
|---|---|
| world/way | LineStrips3D |
| world/sensor | Transform3D |
| world/sensor/scan | Points3D |
| world/vehicles/NAME | Transform3D; cleared where the vehicle is not seen |
| world/vehicles/NAME/box | Boxes3D |
| world/vehicles/NAME/shape | Points3D |

Timelines are `frame` and `time`. `world` is the first frame's sensor frame with z vertical.
"""

from pathlib import Path
from typing import Any

import numpy as np

from wildshape.drives.writing.finished import FinishedDrive
from wildshape.drives.writing.playback.moments import (
    SHAPE_POINTS,
    Moment,
    Present,
    moments,
)
from wildshape.errors import load_library
from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.se3 import SE3

_SCAN_DOT_M, _SHAPE_DOT_M, _LINE_M = 0.03, 0.035, 0.03


def load_rerun() -> Any:
    """The library.

    Raises:
        MissingExtraError: it is not installed.
    """
    return load_library(
        "rerun", "an RRD recording needs rerun-sdk", "pip install 'wildshape[rerun]'"
    )


def write_rerun(found: FinishedDrive, path: Path) -> None:
    """Write the recording, atomically; a drive without times is taken to have ten scans a second.

    Raises:
        MissingExtraError: rerun-sdk is not installed.
    """
    rr = load_rerun()
    unfinished = path.with_name(f".{path.name}.part")
    recording = rr.RecordingStream("wildshape drive", recording_id=found.name)
    recording.save(unfinished)
    try:
        _log(rr, recording, found)
        recording.flush()
        recording.disconnect()
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _log(rr: Any, recording: Any, found: FinishedDrive) -> None:
    way = found.T_level_sensor.translation.numpy()
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("world/way", rr.LineStrips3D([way], radii=_LINE_M), static=True)
    before: set[str] = set()
    for moment in moments(found):
        recording.set_time("frame", sequence=moment.frame)
        recording.set_time("time", duration=moment.seconds)
        recording.log("world/sensor", _transform(rr, moment.T_level_sensor))
        recording.log("world/sensor/scan", _scan(rr, moment, found.ground_m))
        now = {one.vehicle.name: one for one in moment.present}
        for name in before - set(now):
            recording.log(_entity(name), rr.Clear(recursive=True))
        for name, one in now.items():
            recording.log(_entity(name), _transform(rr, one.T_level_box))
            if name not in before:
                _log_new(rr, recording, found, one)
        before = set(now)


def _log_new(rr: Any, recording: Any, found: FinishedDrive, one: Present) -> None:
    """Box and shape of a vehicle that appears; it stays until it is cleared."""
    known = one.vehicle
    half = [side / 2 for side in known.size]
    box = rr.Boxes3D(
        half_sizes=[half], colors=[one.colour], radii=_LINE_M, labels=[known.name], show_labels=True
    )
    points = thin(found.shape(known), SHAPE_POINTS)
    shape = rr.Points3D(points, colors=[one.colour], radii=_SHAPE_DOT_M)
    recording.log([*_entity(known.name), "box"], box)
    recording.log([*_entity(known.name), "shape"], shape)


def _entity(name: str) -> list[str]:
    return ["world", "vehicles", name]


def _transform(rr: Any, T: SE3) -> Any:
    return rr.Transform3D(translation=T.translation.tolist(), mat3x3=T.rotation.numpy())


def _scan(rr: Any, moment: Moment, ground_m: float) -> Any:
    """Grey, brighter the higher above the ground."""
    height = moment.scan @ moment.T_level_sensor.rotation.numpy()[2] + ground_m
    grey = (70 + 150 * np.clip(height / 4.0, 0.0, 1.0)).astype(np.uint8)
    colours = np.repeat(grey[:, None], 3, axis=1)
    return rr.Points3D(moment.scan, colors=colours, radii=_SCAN_DOT_M)
