# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that drives 2 m a turn past a parked car, its points corrected for that or not."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.evaluation.drives.found import Found, FoundDrive
from wildshape.evaluation.drives.labels import Counting, Label, LabelledDrive, LabelledFrame
from wildshape.evaluation.drives.motion import at_scan_times
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.protocol import evaluate_drives
from wildshape.evaluation.drives.results import as_json, markdown
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.tracks import write_track
from wildshape.records import Track

SCANS, STEP_M = 3, 2.0
LEFT = UprightBox(0.0, 8.0, -1.0, 4.0, 1.8, 1.5, 0.0)  # met a quarter of a turn after its middle
CORRECTED = LEFT._replace(x=STEP_M / 4)


def _poses(yaw: float = 0.0) -> SE3:
    """Straight ahead, or about the start, a turn of so many radians each."""
    steps = torch.arange(SCANS, dtype=torch.float64)
    ahead = torch.stack((STEP_M * steps, 0 * steps, 0 * steps), 1)
    return SE3(rotation_z(yaw * steps), ahead if yaw == 0 else 0 * ahead)


def _labelled(folder: Path, poses: SE3 | None, box: UprightBox = LEFT) -> LabelledDrive:
    scans = tuple(folder / f"{i:06d}.bin" for i in range(SCANS))
    frame = LabelledFrame((Label(0, True, box, True),), np.empty((0, 4)))
    return LabelledDrive(folder, (frame,) * SCANS, scans, None, poses, Counting())


@pytest.mark.parametrize(
    ("box", "x"), [(LEFT, 0.5), (LEFT._replace(y=-8.0), -0.5), (LEFT._replace(x=9.0, y=0.0), 9.0)]
)
def test_labels_are_carried_by_the_way_from_the_turns_middle(box: UprightBox, x: float) -> None:
    for frame in at_scan_times(_labelled(Path(), _poses(), box), _poses()).frames:
        assert frame.labels[0].box == pytest.approx(box._replace(x=x))


def test_labels_turn_with_the_sensor() -> None:
    """0.4 radians a turn: after a quarter of one by 0.1."""
    poses = _poses(yaw=0.4)
    box = at_scan_times(_labelled(Path(), poses), poses).frames[1].labels[0].box
    assert box.yaw == pytest.approx(0.1)
    assert (box.x, box.y) == pytest.approx((-8 * math.sin(0.1), 8 * math.cos(0.1)))


@pytest.fixture
def scans(tmp_path: Path) -> np.ndarray:
    """Points on the car as measured, in the file of each scan."""
    on = np.random.default_rng(0).uniform(-0.5, 0.5, (60, 3)) * LEFT[3:6] + LEFT[:3]
    rows = np.column_stack((on, np.zeros(len(on)))).astype("<f4")
    for i in range(SCANS):
        rows.tofile(tmp_path / f"{i:06d}.bin")
    return rows[:, :3]


def _found(folder: Path, box: UprightBox, points: np.ndarray) -> FoundDrive:
    names = tuple(f"{i:06d}" for i in range(SCANS))
    write_track(folder / "tracks" / "7", Track(name="7", scans=(points,) * SCANS, scan_names=names))
    rows = "".join(f"{i},{name},,60\n" for i, name in enumerate(names))
    (folder / "frames.csv").write_text(f"frame,scan,time,points\n{rows}")
    return FoundDrive(folder, ((Found("7", 0.9, box),),) * SCANS, None)


@pytest.mark.parametrize(
    ("box", "way", "correction"), [(LEFT, 0.0, "none"), (CORRECTED, 0.5, "labels carried")]
)
def test_boxes_are_measured_at_their_own_time(
    tmp_path: Path, scans: np.ndarray, box: UprightBox, way: float, correction: str
) -> None:
    found = _found(tmp_path, box, scans + np.array((way, 0, 0), np.float32))
    scores = evaluate_drives([found], [_labelled(tmp_path, _poses())])
    assert scores.corrections == (correction,)
    assert as_json(scores, Counting(), {})["corrections"] == [correction]
    assert [one.average_precision for one in scores.rows[0].detections] == [1, 1, 1, 1]
    assert scores.rows[0].hota is not None
    assert scores.rows[0].hota.hota == pytest.approx(1)


def test_where_labels_cannot_be_carried_it_is_said(tmp_path: Path, scans: np.ndarray) -> None:
    found = _found(tmp_path, CORRECTED, scans + np.array((0.5, 0, 0), np.float32))
    scores = evaluate_drives([found], [_labelled(tmp_path, None)])
    assert scores.corrections == ("labels not carried",)
    assert "boxes and labels are of other times" in markdown(scores, Counting())
