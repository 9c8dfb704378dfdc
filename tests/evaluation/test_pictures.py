# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Objects chosen by their error, and how they are drawn."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import torch
from tests.cars import drive_by
from tests.disk import full_disk
from tests.evaluation.scores import completion

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.identity import OneScan
from wildshape.baselines.pairs import Chained
from wildshape.errors import BadInputError
from wildshape.evaluation.examples import gather, pick
from wildshape.evaluation.pictures import (
    draw_confidence,
    draw_errors,
    draw_examples,
    project,
    write_figures,
)
from wildshape.evaluation.protocol import run
from wildshape.evaluation.results import MethodScores, Results, pooled
from wildshape.evaluation.summary import curve_of


def test_examples_are_picked_by_error():
    rows = tuple(completion(name, cd, 0.0) for name, cd in zip("abcde", (0.5, 0.1, 0.9, 0.2, 0.3)))
    extra = completion("a", 0.1, 0.0)  # The mean of a is 0.3: a tie with e, settled by name.
    chosen = pick(MethodScores("m", (*rows, extra), (), ()))
    assert {label: name for label, (name, _) in chosen.items()} == {
        "best": "b",
        "median": "a",
        "worst": "c",
    }
    assert pick(MethodScores("m", (), (), ())) == {}


class Method(OneScan, Chained):
    def __init__(self):
        Chained.__init__(self, LocalIcp())


class Refusing(Method):
    def register_track(self, scans, sensor):
        raise BadInputError("a scan lies outside of the picture.")


def test_an_object_whose_scans_are_refused_is_drawn_without_their_fusion():
    tracks = [drive_by(scans=3, points=100)]
    results = run({"m": Refusing()}, tracks)
    assert [one.fused for one in gather(tracks, results, "m", Refusing())] == 3 * [None]


class Counting(Method):
    threads: ClassVar[set[int]] = set()

    def complete(self, points, sensor):
        self.threads.add(torch.get_num_threads())
        return super().complete(points, sensor)


def test_what_is_drawn_is_made_on_one_thread_as_what_is_measured():
    """Sums depend on the number of threads: on other cores the picture showed other shapes."""
    tracks, before = [drive_by(scans=3, points=100)], torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        gather(tracks, run({"m": Counting()}, tracks), "m", Counting())
        assert (Counting.threads, torch.get_num_threads()) == ({1}, 2)
    finally:
        torch.set_num_threads(before)


def test_the_picture_counts_a_tracks_cloud_for_each_of_its_scans():
    rows = (replace(completion("a", 0.1, 0.3), scans=3), completion("b", 0.5, 0.5))
    (line,) = draw_errors(Results("none", 0, (MethodScores("m", rows, (), ()),))).axes[1].lines
    x, y = map(np.asarray, line.get_data())
    assert y[x <= 0.5].max() == pytest.approx(75)


def test_the_pictures_are_of_all_seeds_as_metrics_json_is():
    rows = [
        replace(completion(name, cd, 0.0), confidence=sure)
        for name, cd, sure in (("a", 0.1, 0.9), ("b", 0.3, 0.2), ("a", 0.7, 0.6), ("b", 0.2, 0.1))
    ]
    seeds = [MethodScores("m", tuple(rows[i : i + 2]), (), ()) for i in (0, 2)]
    other = MethodScores("selected", seeds[1].completions, (), ())
    runs = [Results("yaw", 0, (seeds[0],)), Results("yaw", 1, (seeds[1], other))]
    shown = pooled(runs)
    assert [len(row.completions) for row in shown.methods] == [4, 2]
    figure, curve = draw_confidence(shown), curve_of(seeds)
    assert figure is not None
    assert curve is not None
    assert figure.axes[0].lines[0].get_ydata() == pytest.approx(curve.risk)


def test_a_figure_that_the_disk_has_no_room_for_is_named_and_not_half_there(tmp_path):
    results = Results("yaw", 0, (MethodScores("m", (completion("a", 0.1, 0.0),), (), ()),))
    with full_disk(5_000, tmp_path / "errors.png"):
        write_figures(tmp_path, results, [])
    assert not list(tmp_path.iterdir())


def test_examples_and_figures(tmp_path):
    tracks = [drive_by(f"t{i}", scans=3, points=100 + 50 * i, seed=i) for i in range(4)]
    results = run({"m": Method()}, tracks, "so3", seed=3)
    examples = gather(tracks, results, "m", Method())
    assert [e.label for e in examples] == ["best", "median", "worst"]
    assert examples[0].cd <= examples[1].cd <= examples[2].cd
    for example in examples:
        # Back in the object's frame although the input was turned.
        assert np.abs(example.scan).max(axis=0) == pytest.approx([2.1, 0.85, 0.75], abs=0.15)
        assert example.fused is not None
    paths = write_figures(tmp_path, results, examples)
    assert [p.name for p in paths] == ["errors.png", "examples.png"]
    assert all(p.read_bytes()[:4] == b"\x89PNG" for p in paths)
    axes = draw_examples(examples).axes
    assert len(axes) == 3 * 4
    titles = [ax.get_title() for ax in axes[:4]]
    assert titles == ["one scan", "truth", "m, completed", "m, fused"]
    icp, scan = Chained(LocalIcp()), OneScan()
    beside = gather(
        tracks, results, "m", Method(), fused_by={"ICP": icp}, completed_by={"scan": scan}
    )
    same = (("ICP", examples[0].fused), ("scan", examples[0].completed))  # by the same methods
    for title, cloud in same:
        made = beside[0].rivals[title]
        assert made is not None
        assert cloud is not None
        assert np.array_equal(made, cloud)
    titles = [ax.get_title() for ax in draw_examples(beside).axes[:6]]
    assert titles == ["one scan", "truth", "ICP", "scan", "ours, completed", "ours, fused"]


def test_names_are_drawn_as_they_are(tmp_path):
    """A track's `a$^$` ended evaluate in a traceback; a model's `_mine` stood in no legend."""
    tracks = [replace(drive_by(scans=3, points=100), name="a$^$ 車")]
    results = run({name: Method() for name in ("_mine", "$^$")}, tracks)
    drawn = write_figures(tmp_path, results, gather(tracks, results, "$^$", Method()))
    assert [path.name for path in drawn] == ["errors.png", "examples.png"]
    for axes in draw_errors(results).axes:
        assert set(axes.get_legend_handles_labels()[1]) >= {" _mine", r"\$^\$"}


def test_drawing_keeps_aspect_and_survives_gaps():
    tracks = [drive_by(scans=2, points=60)]
    results = run({"scan": OneScan()}, tracks)
    examples = gather(tracks, results, "scan", OneScan())
    assert examples[0].fused is None
    figure = draw_examples(examples)
    assert all(ax.get_aspect() == 1.0 for ax in figure.axes)
    assert len(draw_errors(Results("none", 0, ())).axes) == 2


def test_projection_is_orthographic():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3)).astype(np.float32)
    lengths = np.linalg.norm(project(points), axis=1)
    assert lengths == pytest.approx(np.linalg.norm(points, axis=1), rel=1e-5)
    assert project(np.array([[0, 0, 1]], np.float32))[0, 1] > 0.9
