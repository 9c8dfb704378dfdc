# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What newcomers hand in from Python: taken where it can be meant in one way, else one sentence."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch

from wildshape.arguments import as_path, check_fields, expect, expect_whole
from wildshape.errors import BadInputError


@dataclass(frozen=True)
class _Inner:
    number: float = 0.0


@dataclass(frozen=True)
class _Options:
    path: Path | None = None
    count: int = 1
    share: float = 0.5
    sure: bool = False
    name: str = ""
    kind: Literal["a", "b"] = "a"
    paths: tuple[Path, ...] = ()
    pair: tuple[float, float] = (0.0, 1.0)
    inner: _Inner = _Inner()


@pytest.mark.parametrize(
    ("field", "given", "taken"),
    [
        ("path", "a/b", Path("a/b")),
        ("path", None, None),
        ("count", np.int64(3), 3),
        ("share", 2, 2),
        ("share", torch.tensor(0.25), 0.25),
        ("sure", np.True_, True),
        ("name", Path("a"), "a"),
        ("paths", "a", (Path("a"),)),
        ("paths", ["a", Path("b")], (Path("a"), Path("b"))),
        ("pair", np.array((1.0, 2.0)), (1.0, 2.0)),
    ],
)
def test_what_can_be_meant_in_one_way_is_taken(field, given, taken):
    options = _Options(**{field: given})
    check_fields(options)
    found = getattr(options, field)
    assert found == taken
    assert type(found) is type(taken)


@pytest.mark.parametrize(
    ("field", "given", "said"),
    [
        ("path", 3, "_Options.path: expected a path, found 3."),
        ("count", "3", "_Options.count: expected a whole number, found '3'."),
        ("count", 3.0, "_Options.count: expected a whole number, found 3.0."),
        ("count", True, "_Options.count: expected a whole number, found True."),
        ("count", None, "_Options.count: expected a whole number, found None."),
        ("share", "0.5", "_Options.share: expected a number, found '0.5'."),
        ("sure", "no", "_Options.sure: expected True or False, found 'no'."),
        ("kind", "c", "_Options.kind: expected a, b, found 'c'."),
        ("kind", np.zeros(3), "_Options.kind: expected a, b, found array([0., 0., 0.])."),
        ("paths", [3], "_Options.paths: expected a path, found 3."),
        ("pair", 3.0, "_Options.pair: expected a tuple of 2 values, found 3.0."),
        ("pair", (1.0,), "_Options.pair: expected a tuple of 2 values, found (1.0,)."),
        ("inner", {}, "_Options.inner: expected _Inner, found {}."),
        ("inner", "x" * 99, "_Options.inner: expected _Inner, found an object of type str."),
    ],
)
def test_what_is_something_else_is_refused_by_its_name(field, given, said):
    with pytest.raises(BadInputError) as refused:
        check_fields(_Options(**{field: given}))
    assert str(refused.value) == said


def test_single_arguments():
    assert as_path("a", "out") == Path("a")
    assert expect_whole(np.int32(2), "seed") == 2
    with pytest.raises(BadInputError, match=r"^seed: expected 0 or more, found -1\.$"):
        expect_whole(-1, "seed")
    with pytest.raises(BadInputError, match=r"^files: expected a path, found 3; pass a Path\.$"):
        expect(3, Path, "files", "pass a Path")


# Types are not checked at run time there, as they are in this process.
_PROGRAM = """
import json, sys
import numpy as np, torch
from pathlib import Path
import wildshape
from wildshape.baselines.compare import ComparisonOptions, compare
from wildshape.datasets.convert import ConversionOptions, convert
from wildshape.drives.adapting.adapt import adapt_to
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.writing.files import DriveFiles
from wildshape.evaluation.drives.found import read_found
from wildshape.evaluation.drives.labels import read_labels
from wildshape.evaluation.drives.protocol import evaluate_drives
from wildshape.evaluation.metrics import completion_error
from wildshape.evaluation.protocol import run
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.inference.folders.complete_folder import FolderOptions, complete_folder
from wildshape.inference.registration import fuse_scans, inlier_ratio, to_middle
from wildshape.io.inputs import open_tracks
from wildshape.io.poses import read_poses, write_poses, write_tum
from wildshape.io.scans.points import Coordinates, read_points, read_scan
from wildshape.io.scans.writers import ply_bytes, write_cloud
from wildshape.io.store.store import Store
from wildshape.io.store.writer import StoreWriter
from wildshape.io.tracks import read_track, write_track
from wildshape.io.write_tracks import write_tracks
from wildshape.records import Box, Sensor, Track
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.generate import simulate_tracks
from wildshape.training.options import TrainingOptions
from wildshape.training.train import train

scan = np.random.default_rng(0).normal(size=(60, 3)).astype(np.float32)
graded = torch.tensor(scan, requires_grad=True)
eye, out = np.eye(4), sys.argv[1] + "/out"
two, model = SE3.from_matrix(np.stack([eye, eye])), wildshape.load()
tracks, street = sys.argv[1] + "/tracks", Path(sys.argv[1], "street")
street.mkdir()
for number in range(3):
    np.save(street / f"{number}.npy", 20 * scan)
write_track(tracks + "/a", Track("a", (scan, scan), ("0", "1")))

def said(expression):
    try:
        eval(expression)
    except wildshape.BadInputError as error:
        return str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""

print(json.dumps({expression: said(expression) for expression in json.load(sys.stdin)}))
"""
_REFUSED = {
    "wildshape.load(config={})": "config: expected InferenceConfig",
    "wildshape.load(raw='no')": "raw: expected True or False, found 'no'",
    "wildshape.Predictor('a', 'b')": "wildshape.load",
    "model.complete_track(read_track(tracks + '/a'))": "pass its .scans",
    "wildshape.drive(None)": "source: expected a path",
    "wildshape.drive([scan])": "source: expected a path",
    "wildshape.drive(street, out, model)": "config: expected DriveConfig",
    "wildshape.drive(street, out, detections='no.json')": "no.json: no such file",
    "wildshape.drive(street, out, detections=[scan])": "detections: expected a path",
    "wildshape.drive(street, out, adapt=300)": "adapt: expected Adaptation, found 300",
    "wildshape.drive(street, out, workers='2')": "workers: expected a whole number",
    "wildshape.drive(street, out, files='mcap')": "DriveFiles(mcap=True)",
    "wildshape.drive(street, out, predictor='no')": "no such",
    "DriveFiles(mesh='stl')": "DriveFiles.mesh: expected ply, obj, glb",
    "adapt_to(tracks, out, model, AdaptConfig())": "put it in a list",
    "AdaptConfig(steps='3')": "AdaptConfig.steps: expected a whole number",
    "complete_folder(None, out)": "source: expected a path",
    "complete_folder(tracks, out, {'track': True})": "options: expected FolderOptions",
    "FolderOptions(workers='2')": "FolderOptions.workers: expected a whole number",
    "FolderOptions(overwrite='no')": "FolderOptions.overwrite: expected True or False",
    "FolderOptions(model=model)": "FolderOptions.model: expected a path",
    "FolderOptions(boxes='kitti')": "FolderOptions.boxes: expected BoxFiles",
    "compare(tracks, out, {})": "options: expected ComparisonOptions",
    "ComparisonOptions(seeds='2')": "ComparisonOptions.seeds: expected a whole number",
    "train(None, out)": "data: expected a path",
    "train(tracks, out, {'steps': 3})": "options: expected TrainingOptions",
    "TrainingOptions(steps=2.0)": "TrainingOptions.steps: expected a whole number",
    "convert(tracks, out)": "open_source makes one",
    "ConversionOptions(layout='zip')": "ConversionOptions.layout: expected packed, folders",
    "list(simulate_tracks(SimulationConfig(tracks=1), None))": "seed: expected a whole number",
    "list(simulate_tracks(SimulationConfig(tracks=1), 0, '2'))": "workers: expected a whole",
    "SimulationConfig(tracks='3')": "SimulationConfig.tracks: expected a whole number",
    "evaluate_drives(tracks, tracks)": "read_found makes one of a path",
    "evaluate_drives([], [])": "pass the labels of each drive",
    "run(model, [], 'none', 0)": "pass a dict",
    "run({}, tracks, 'none', 0)": "pass what open_tracks gives",
    "completion_error(scan[:0], scan)": "a cloud without points",
    "read_labels('no')": "no: no label_02",
    "read_found('no', 3)": "no/boxes.csv: no such file",
    "read_points(scan)": "path: expected a path",
    "read_scan(tracks + '/a/scans/0.ply', 'mm')": "pass Coordinates('mm')",
    "Coordinates('m', (0, 0))": "Coordinates.origin: expected a tuple of 3",
    "open_tracks([scan])": "path: expected a path",
    "read_poses(None)": "path: expected a path",
    "SE3.from_matrix(eye) @ 'T'": "SE3.from_matrix makes one",
    "SE3.from_matrix(eye).apply(scan)": "apply_numpy takes arrays",
    "SE3.from_matrix(eye).apply_numpy(torch.tensor(scan))": "np.asarray makes one",
    "stack([])": "expected at least one",
    "to_middle(two[0])": "expected several transforms",
    "to_middle(two[:0])": "found none",
    "fuse_scans([scan], two)": "1 scans, 2 poses",
    "fuse_scans([scan] * 3, two)": "3 scans, 2 poses",
    "inlier_ratio(eye, scan, scan)": "SE3.from_matrix makes one",
    "inlier_ratio(two[0], scan[:0], scan)": "found none",
    "Box((0, 0), (1, 1, 1), (1, 0, 0, 0))": "Box.centre: expected a tuple of 3",
    "Sensor('lidar', 0.2)": "Sensor.resolution_deg: expected a tuple of 2",
    "Track('a', scan, ('0',))": "found one array; put it in a tuple",
    "Track('a', (scan,), (0,))": "pass text",
    "write_track(out, scan)": "track: expected Track",
    "write_track(out, Track('a', (np.c_[scan, scan],), ('0',)))": "leave out what is more",
    "write_tracks(Track('a', (scan,), ('0',)), out, 'packed', command='', settings={})": "a list",
    "write_tracks([], out, 'zip', command='', settings={})": "there are packed and folders",
    "StoreWriter(out, {}).add(scan)": "track: expected Track",
    "ply_bytes(np.c_[scan, scan])": "pass x, y and z alone",
    "write_cloud(out + '.ply', scan.tolist())": "save takes lists",
    "write_poses(out, SE3(two.rotation * np.nan, two.translation))": "NaN or infinite",
    "write_tum(out, two, [0.0])": "1 times for 2 poses",
}
_TAKEN = (
    "complete_folder(tracks, out + '1', FolderOptions(workers=1, boxes=BoxFiles('json')))",
    "list(write_tracks([read_track(tracks + '/a')], out + '2', 'packed', command='', settings={})"
    " and [Store(out + '2')])",
    "wildshape.load(level=np.False_)",
    "to_middle(np.stack([eye, eye]))",
    "to_middle([two[0], two[1]])",
    "fuse_scans((one for one in [scan, scan]), np.stack([eye, eye]))",
    "stack(one for one in [two[0]])",
    "hash(Box(np.zeros(3), np.ones(3), np.array((1.0, 0, 0, 0))))",
    "write_poses(out + '3', np.stack([eye, eye]))",
    "write_track(out + '4', Track('a', [scan.tolist()], ['0'], T_sensor_object=eye[None]))",
    "wildshape.save(graded, out + '5.ply')",
    "write_cloud(out + '6.ply', scan)",
)


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What each call raises, by its text; nothing where it goes through."""
    folder = str(tmp_path_factory.mktemp("api"))
    found = subprocess.run(
        [sys.executable, "-c", _PROGRAM, folder],
        input=json.dumps([*_REFUSED, *_TAKEN]),
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(found.stdout.splitlines()[-1])


@pytest.mark.parametrize("call", _REFUSED)
def test_a_mistake_in_python_is_told_in_one_sentence(call: str, said: dict[str, str]) -> None:
    assert _REFUSED[call] in said[call]
    assert "Error:" not in said[call]
    assert said[call].endswith(".")


@pytest.mark.parametrize("call", _TAKEN)
def test_a_sensible_reading_is_taken(call: str, said: dict[str, str]) -> None:
    assert said[call] == ""
