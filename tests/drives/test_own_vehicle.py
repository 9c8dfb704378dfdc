# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A bonnet that goes with the sensor is told from what stands or drives beside it."""

import json

import numpy as np
import pytest
import torch
from tests.drives.cuts import write_cut
from tests.drives.street import street, write_scans

import wildshape
from wildshape.drives.completing.own_vehicle import carries_sensor
from wildshape.drives.config import OwnVehicleConfig
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.table import read_box_table

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")

FRAMES = 10
NEAREST_M = 2.0


def carried(folder, ahead, beside, step=1.0):
    """Whether a plate so far ahead and beside in each frame is of a vehicle that goes by steps."""
    plate = np.random.default_rng(0).uniform((0, -0.9, -1), (0.6, 0.9, -0.7), (200, 3))
    for frame in range(FRAMES):
        write_cut(folder, frame, [np.add(plate, (ahead[frame], beside[frame], 0))], 200)
    places = torch.zeros(FRAMES, 3, dtype=torch.float64)
    places[:, 0] = step * torch.arange(FRAMES)
    poses = SE3(torch.eye(3).double().expand(FRAMES, 3, 3), places)
    seen = Sightings("0", tuple(range(FRAMES)), ((0,),) * FRAMES, (200,) * FRAMES)
    return carries_sensor(seen, folder, poses, NEAREST_M, OwnVehicleConfig())


def test_a_bonnet_goes_with_the_sensor_and_a_neighbour_does_not(tmp_path):
    here, there = np.zeros(FRAMES), np.ones(FRAMES)
    runs = {
        "bonnet": (2.05 * there, here),
        "far": (3.5 * there, here),
        "passed": (2.05 + 0.2 * np.arange(FRAMES), here),
        "parked": (9.0 - np.arange(FRAMES), 3 * there),
        "still": (2.05 * there, here, 0.0),
    }
    found = set()
    for name, run in runs.items():
        (tmp_path / name).mkdir()
        if carried(tmp_path / name, *run):
            found.add(name)
    assert found == {"bonnet"}


def test_ones_own_bonnet_is_no_vehicle(tmp_path):
    truth = street(frames=12)
    rng = np.random.default_rng(0)
    bonnet = rng.uniform((1.0, -0.85, -0.8), (3.0, 0.85, -0.7), (3000, 3)).astype(np.float32)
    write_scans(tmp_path / "own", [np.concatenate((scan, bonnet)) for scan in truth.scans])
    found = wildshape.drive(tmp_path / "own", tmp_path / "found")
    said = json.loads((found.out / "stages" / "vehicles.json").read_text())
    assert ["own_vehicle"] in [one["reasons"] for one in said]
    boxes = read_box_table(found.out / "boxes.csv")
    assert min(np.hypot(*(one.x, one.y)[:2]) for one in boxes) > 4.0
