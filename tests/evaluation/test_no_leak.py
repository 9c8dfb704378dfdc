# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Guard: poses, boxes and shapes of the truth change no bit of what any method answers."""

from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
import torch
from tests.cars import drive_by, poses_of
from tests.models import CONFIG, SETTINGS

from wildshape.baselines.dpc.checkpoint import DpcSettings
from wildshape.baselines.dpc.completer import Dpc
from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.baselines.dpc.viewing_volume import PolarVolume
from wildshape.baselines.named import NAMES, baseline
from wildshape.errors import MissingExtraError
from wildshape.evaluation.examples import gather
from wildshape.evaluation.protocol import run
from wildshape.evaluation.summary import figures_of
from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import Predictor
from wildshape.method.network import ShapePoseNet
from wildshape.records import Box, Completion

LEARNED, DPC = "learned", "dpc-lidar"
OFFERED = (
    "complete",
    "complete_many",
    "complete_track",
    "register_track",
)


def learned():
    """A network that learned nothing: what it sees is all that matters here."""
    torch.manual_seed(0)
    return Learned(Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS))


def dpc():
    """A DPC-LIDAR that learned nothing."""
    torch.manual_seed(0)
    config = DpcConfig(volume=PolarVolume(), image=16, voxels=8, points=50, channels=4, code=16)
    return Dpc(DpcNet(config).eval(), DpcSettings(config))


def method_named(name):
    made = {LEARNED: learned, DPC: dpc}
    try:
        return made[name]() if name in made else baseline(name)
    except MissingExtraError as error:
        pytest.skip(str(error))


class Listening:
    """A method whose every answer is kept, to the bit; offers just what the method offers."""

    def __init__(self, method):
        self.answers = []
        for name in OFFERED:
            if hasattr(method, name):
                setattr(self, name, self._kept(getattr(method, name)))

    def _kept(self, function):
        def answer(given, sensor):
            made = function(given, sensor)
            made = made if isinstance(made, (SE3, np.ndarray)) else list(made)
            for one in made if isinstance(made, list) else [made]:
                self.answers.append(to_the_bit(one))
            return made

        return answer


def to_the_bit(answer):
    """A pose, a cloud, a number, a box, or several of them."""
    if isinstance(answer, tuple):
        return tuple(to_the_bit(part) for part in answer)
    if isinstance(answer, Completion):
        return to_the_bit((answer.points, answer.confidence, answer.box, answer.pose))
    if isinstance(answer, SE3 | np.ndarray):
        array = answer.matrix.numpy() if isinstance(answer, SE3) else answer
        return array.shape, array.tobytes()
    if isinstance(answer, Box):
        return "Box", astuple(answer)
    return repr(answer)


def listen(method) -> Any:
    """Whether it completes or registers is seen when it runs."""
    return Listening(method)


def other_truth(track):
    """The same scans; every pose, the accumulated cloud, its box and the shape are others."""
    generator = torch.Generator().manual_seed(9)
    u, _, vt = torch.linalg.svd(random_rotation(len(track.scans), generator).double())
    shift = 9 * torch.randn(len(track.scans), 3, generator=generator).double()
    shape = np.random.default_rng(9).normal(size=(77, 3)).astype(np.float32) * [9, 2, 5]
    return replace(
        track,
        T_sensor_object=SE3(u @ vt, shift),
        shape=None if track.shape is None else shape.astype(np.float32),
    )


@pytest.mark.parametrize(
    ("rotate", "accumulated"), [("none", False), ("yaw", True), ("so3", False)]
)
@pytest.mark.parametrize("name", [*NAMES, LEARNED, DPC])
def test_no_bit_of_an_answer_depends_on_the_truth(name, accumulated, rotate):
    track = drive_by(scans=3, points=150)
    track = replace(track, shape=None) if accumulated else track
    heard, figures = [], []
    for given in (track, other_truth(track)):
        listening = listen(method_named(name))
        results = run({name: listening}, [given], rotate, seed=4)
        heard.append(listening.answers)
        figures += [figures_of(row) for row in results.methods]
    assert len(heard[0]) >= 1
    assert heard[0] == heard[1]
    if name == LEARNED:
        assert any("'Box'" in str(one) for one in heard[0])
    # The guard guards: it is other truth that the answers were held against.
    half = len(figures) // 2
    assert figures[:half] != figures[half:]


def test_the_guard_hears_a_method_that_looks_at_the_truth():
    class Peeking:
        """Its answer is the truth, behind the protocol's back."""

        def __init__(self, track):
            self.track = track

        def register_track(self, scans, sensor):
            poses = poses_of(self.track)
            return poses[self.track.middle] @ poses.inverse()

    track = drive_by(scans=3, points=60)
    heard = []
    for given in (track, other_truth(track)):
        listening = listen(Peeking(given))
        run({"peeking": listening}, [given])
        heard.append(listening.answers)
    assert heard[0] != heard[1]


def test_drawn_examples_come_from_the_same_blind_answers():
    track = drive_by(scans=3, points=150)
    heard = []
    for given in (track, other_truth(track)):
        listening = listen(learned())
        gather([given], run({"it": listening}, [given]), "it", listening)
        heard.append(listening.answers)
    assert heard[0] == heard[1]
