# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from operator import is_
from pathlib import Path

import numpy as np
import pytest
from tests.refusal import refused
from tests.report.viewer.shown import perfect, track

from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.transforms.se3 import stack
from wildshape.io.poses import write_poses
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import write_track
from wildshape.records import Completion, Sensor, Track
from wildshape.report.viewer.live_completion import from_model
from wildshape.report.viewer.sources import from_results, worst_first


def _written(folder: Path, shown: Track, left_out: int) -> list[int]:
    """Results of all scans but one, as `complete` writes them."""
    kept = [i for i in range(len(shown.scans)) if i != left_out]
    made = {i: perfect(shown, i) for i in kept}
    scans = []
    for i in kept:
        name, box, points = shown.scan_names[i], made[i].box, made[i].points
        assert box is not None
        assert points is not None
        write_ply(folder / "completed" / f"{name}.ply", points)
        scans.append({"scan": name, "box": asdict(box), "confidence": 0.5, "p_box": 0.6})
    poses = [pose for i in kept if (pose := made[i].pose) is not None]
    write_poses(folder / "poses.txt", stack(poses))
    said = {"track": shown.name, "input": str(folder.parent.parent / "data"), "scans": scans}
    (folder / "objects.json").write_text(json.dumps(said), encoding="utf-8")
    return kept


@pytest.mark.parametrize("moved", [False, True])
def test_results_come_back_scan_by_scan(tmp_path: Path, moved: bool) -> None:
    shown = track(name="car")
    write_track(tmp_path / "data" / "car", shown)
    kept = _written(tmp_path / "out" / "car", shown, left_out=1)
    if moved:
        (tmp_path / "data").rename(tmp_path / "elsewhere")
    source = from_results(tmp_path / "out")
    assert source.labels == ("car",)
    found = source.track(0)
    assert found.scan_names == tuple(shown.scan_names[i] for i in kept)
    made = list(source.make(0, found, 2))
    assert [number for number, _ in made] == [2, 0, 1, 3]
    for number, one in made:
        truth = perfect(shown, kept[number])
        assert one.chances == {"box right": 0.6}
        assert one.pose is not None
        assert truth.pose is not None
        np.testing.assert_allclose(one.pose.matrix, truth.pose.matrix, atol=1e-5)
        assert one.points is not None
        assert truth.points is not None
        np.testing.assert_allclose(one.points, truth.points, atol=1e-5)
        if not moved:
            np.testing.assert_allclose(found.scans[number], shown.scans[kept[number]], atol=1e-6)
    assert [len(scan) for scan in found.scans] == [0 if moved else 300] * 4


class _Model:
    """Completes with the scan itself; keeps what it was given with each."""

    def __init__(self) -> None:
        self.given: list[tuple[object, ...]] = []

    def complete_many(
        self, scans: Sequence[object], sensor: Sensor | None, *, rays: Sequence[object] = ()
    ) -> Iterator[Completion]:
        self.given += [(scan, sensor, beside) for scan, beside in zip(scans, rays, strict=True)]
        shown = track()
        done = perfect(shown, 0)
        for scan in scans:
            assert isinstance(scan, np.ndarray)
            assert done.box is not None
            assert done.pose is not None
            yield Completion(scan, done.pose, done.box, 0.7, 0, 0.1)


def test_a_model_is_loaded_when_first_needed_and_begins_with_the_scan_shown() -> None:
    ahead = np.array([[1, 0, 0]], np.float32)
    rays = tuple(SightLines(ahead, np.array([5 + i], np.float32)) for i in range(5))
    shown, loaded = replace(track(), sensor=Sensor(resolution_deg=(0.2, 0.4)), rays=rays), []
    source = from_model("t", ["a"], lambda _: shown, lambda: loaded.append(_Model()) or loaded[0])
    assert source.track(0) is shown
    assert loaded == []
    made = list(source.make(0, shown, 3))
    list(source.make(0, shown, 0))
    assert len(loaded) == 1
    assert [number for number, _ in made] == [3, 0, 1, 2, 4]
    for number, one in made:
        np.testing.assert_array_equal(one.points, shown.scans[number])
    expected = [(shown.scans[i], shown.sensor, rays[i]) for i, _ in made]
    assert [all(map(is_, *pair)) for pair in zip(loaded[0].given, expected)] == [True] * 5


def test_worst_objects_come_first(tmp_path: Path) -> None:
    def row(name: str, precision: float) -> dict:
        return {"track": name, "error": {"precision": precision, "coverage": 0.1}}

    methods = [
        {"name": "icp", "completions": [row("a", 9.0)], "registrations": []},
        {
            "name": "wildshape",
            "completions": [row("a", 0.1), row("a", 0.3), row("b", 0.4)],
            "registrations": [],
        },
    ]
    path = tmp_path / "scores.json"
    path.write_text(json.dumps({"runs": [{"methods": methods}]}), encoding="utf-8")
    found = worst_first(path, "wildshape")
    assert [name for name, _ in found] == ["b", "a"]
    assert found[1][1] == pytest.approx(0.3)
    path.write_text("{}", encoding="utf-8")
    refused(worst_first, path, "wildshape", match=r"scores\.json")


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    refused(from_results, tmp_path, match=r"no objects\.json")
