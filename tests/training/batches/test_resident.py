# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Batches drawn on the device are those of `ViewSampler`, but for the numbers that chance gave."""

import math
import shutil

import numpy as np
import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import face
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.records import Track
from wildshape.training.batches.host import HostViews
from wildshape.training.batches.resident import ResidentViews
from wildshape.training.batches.views import Batch, ViewConfig, ViewSampler

CPU = torch.device("cpu")
EXACT = "donot_use_mm_for_euclid_dist"
VIEWS, WINDOW = 3, 5
# Long, with gaps of scans too sparse to use, shorter than a window, shorter than the views.
TRACKS = [[150] * 12, [150 if i % 4 else 50 for i in range(20)], [150] * 4, [150, 150], [50] * 9]
USABLE = 4


def scan_of(track, frame, count, rng):
    """Points whose azimuth tells the track and whose range tells the frame."""
    angle, reach = 0.5 * track - 1.0, 10.0 * (frame + 1)
    at = np.array([math.cos(angle), math.sin(angle), 0.1]) * reach
    return (at + rng.uniform(-0.5, 0.5, size=(count, 3))).astype(np.float32)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    rng, path = np.random.default_rng(0), tmp_path_factory.mktemp("marked") / "store"
    with StoreWriter(path, {}) as writer:
        for track, sizes in enumerate(TRACKS):
            scans = tuple(scan_of(track, i, n, rng) for i, n in enumerate(sizes))
            names = tuple(f"{i:06d}" for i in range(len(sizes)))
            writer.add(Track(name=f"{track}", scans=scans, scan_names=names))
    return open_store(path)


def both(store, **config):
    """The sampler, and its scans resident."""
    plain = {"tracks": 4, "views": VIEWS, "points": 32, "window": WINDOW}
    sampler = ViewSampler(store, np.arange(len(store)), ViewConfig(**{**plain, **config}))
    return sampler, ResidentViews(sampler, 0, 0, CPU)


def marks(batch, views=VIEWS):
    """Track and frames of each group of views, read back from where the scans lie."""
    reach = batch.centres.norm(dim=1)
    track = torch.round((torch.atan2(batch.centres[:, 1], batch.centres[:, 0]) + 1.0) / 0.5).long()
    frame = torch.round(reach / (10.0 * 1.005) - 1).long()
    return track.view(-1, views), frame.view(-1, views)


def drawn(draw, count=200):
    """Of many groups: which track, which frame first, which pairs, which reference."""
    tracks, first, pairs, references = [], [], [], []
    for step in range(count):
        batch = draw(step)
        track, frame = marks(batch)
        assert bool((track == track[:, :1]).all())
        low, high = frame.amin(1), frame.amax(1)
        assert int((high - low).max()) < WINDOW
        tracks.append(track[:, 0])
        first.append(track[:, 0] * 32 + frame[:, 0])
        # Neither of a pair comes first, so that a pair and its mirror count alike.
        pairs.append(track[:, 0] * 1024 + frame[:, 0] * 32 + frame[:, 1])
        references.append(batch.reference % VIEWS)
    return [torch.cat(part) for part in (tracks, first, pairs, references)]


def test_who_is_drawn_with_whom(store):
    """Two samples of 6000 groups each: chi-squared over every outcome that either has seen."""
    sampler, resident = both(store, tracks=30, points=4)
    expected = drawn(lambda step: sampler.draw(1, step))
    found = drawn(lambda step: resident.batch(torch.tensor(step)))
    for a, b in zip(expected, found):
        hits = torch.stack([torch.bincount(x, minlength=4096).double() for x in (a, b)])
        hits = hits[:, hits.sum(0) > 0]
        freedom = hits.shape[1] - 1
        chi_squared = float(((hits[0] - hits[1]).square() / hits.sum(0)).sum())
        assert abs(chi_squared - freedom) < 4.5 * (2 * freedom) ** 0.5, hits


def test_views_are_distinct_where_there_are_enough(store):
    _, resident = both(store)
    for step in range(50):
        for track, frames in zip(*(m.tolist() for m in marks(resident.batch(torch.tensor(step))))):
            enough = track[0] != 3
            assert (len(set(frames)) == VIEWS) or not enough
            assert track[0] < USABLE


def test_points_are_the_scans_and_every_point_comes_up(store):
    _, resident = both(store, points=128)
    seen = set()
    for step in range(12):
        batch = resident.batch(torch.tensor(step))
        track, frame = (m.flatten().tolist() for m in marks(batch))
        for i in range(len(track)):
            number = int(store.track_starts[track[i]]) + frame[i]
            points = torch.from_numpy(np.array(store.scan_points(number)))
            torch.testing.assert_close(batch.centres[i], scan_centre(points, "lidar"))
            back = batch.scans[i] + batch.centres[i]
            apart = (back[:, None] - points).norm(dim=-1).min(1)
            assert float(apart.values.max()) < 1e-5 * float(points.norm(dim=1).max())
            if track[i] == 3 and frame[i] == 0:
                seen |= set(apart.indices.tolist())
    assert len(seen) > 100  # of 150


@pytest.mark.parametrize(("turn", "sensor"), [("none", "lidar"), ("yaw", "lidar"), ("so3", "lidar"),
                                              ("yaw", "camera"), ("so3", "camera")])  # fmt: skip
def test_centres_are_those_of_the_whole_turned_scan(store, turn, sensor):
    """As they will be when a turned scan is posed; for either sampler."""
    sampler, resident = both(store, turn=turn, sensor=sensor)
    numbers = np.concatenate(sampler.scans_of)
    whole = [torch.from_numpy(np.array(store.scan_points(int(n)))) for n in numbers]
    for batch in (sampler.draw(0, 0), resident.batch(torch.tensor(0))):
        eye = torch.eye(3).expand(12, 3, 3)
        torch.testing.assert_close(batch.turn @ batch.turn.mT, eye, atol=1e-5, rtol=0)
        recorded = ((batch.scans + batch.centres[:, None]) @ batch.turn)[:, 0]
        for i in range(12):
            points = min(whole, key=lambda scan: float((scan - recorded[i]).norm(dim=1).min()))
            expected = scan_centre(points @ batch.turn[i].mT, sensor)
            torch.testing.assert_close(batch.centres[i], expected, atol=2e-4, rtol=0)


def test_scans_face_their_object_and_roll_as_those_of_the_host(store):
    sampler, resident = both(store, turn="facing", roll=0.5, tracks=200, points=4)
    numbers = np.concatenate(sampler.scans_of)
    scans = [torch.from_numpy(np.array(store.scan_points(int(n)))) for n in numbers]
    turns, points = torch.stack([face(s).turn for s in scans]), torch.stack(scans)
    rolls = []
    for batch in (sampler.draw(0, 0), resident.batch(torch.tensor(0))):
        assert float(batch.centres[:, 1:].abs().max()) == 0
        recorded = (batch.scans + batch.centres[:, None]) @ batch.turn
        apart = torch.cdist(recorded[:, 0], points.flatten(0, 1), compute_mode=EXACT)
        assert float(apart.amin(1).max()) < 1e-3
        # What is left between the facing frame and the drawn one is a roll about x.
        left = batch.turn @ turns[apart.argmin(1) // points.shape[1]].mT
        torch.testing.assert_close(left[:, 0, 0], torch.ones(600), atol=1e-5, rtol=0)
        rolls.append(torch.atan2(left[:, 2, 1], left[:, 2, 2]).abs())
    bounds = torch.tensor([0.05, 0.1, 0.3, 1.0, 2.0])
    host, device = ((r[:, None] > bounds).float().mean(0) for r in rolls)
    torch.testing.assert_close(device, host, atol=4 * (0.5 / 600) ** 0.5, rtol=0)


def test_turns_are_spread_like_those_of_the_host(store):
    for turn in ("yaw", "so3"):
        _, resident = both(store, turn=turn, tracks=300, points=4)
        turns = torch.cat([resident.batch(torch.tensor(step)).turn for step in range(2)])
        assert float(turns.mean(0)[:2, :2].abs().max()) < 0.08
        assert (float(turns[:, 2, 2].std()) > 0.5) == (turn == "so3")


def test_a_batch_depends_on_seed_step_and_process_alone(store):
    sampler, resident = both(store, turn="yaw")
    one = resident.batch(torch.tensor(3))
    resident.batch(torch.tensor(4))
    again = ResidentViews(sampler, 0, 0, CPU).batch(torch.tensor(3))
    assert all(torch.equal(a, b) for a, b in zip(one, again))
    for seed, process, step in ((1, 0, 3), (0, 1, 3), (0, 0, 4)):
        other = ResidentViews(sampler, seed, process, CPU).batch(torch.tensor(step))
        assert not torch.equal(one.scans, other.scans)


def held_batch(views):
    batch = views.batch(torch.tensor(0))
    assert isinstance(batch, Batch)
    return batch


def test_scans_are_held_to_their_own_headings(store):
    sampler, resident = both(store)
    host = HostViews(sampler, 0, 0, CPU)
    anchors = torch.arange(len(store.scan_sizes)).float()[:, None, None].expand(-1, 3, 3)
    for views in (resident, host):
        views.prepare(0)
        assert not held_batch(views).anchor.any()
        views.hold(anchors)
        views.prepare(0)
        batch = held_batch(views)
        track, frame = marks(batch)
        expected = torch.from_numpy(store.track_starts)[track] + frame
        assert torch.equal(batch.anchor[:, 0, 0].long(), expected.flatten())


def test_scans_that_take_too_much_memory_are_refused(store):
    sampler, _ = both(store)
    with pytest.raises(BadInputError, match=r"its scans take 0\.00 GB, more than the 0\.00 GB"):
        ResidentViews(sampler, 0, 0, CPU, most_bytes=1000)


def test_a_damaged_store_never_reaches_the_device(store, tmp_path):
    path = shutil.copytree(store.path, tmp_path / "damaged")
    shard = path / "points-00000.safetensors"
    bad = bytearray(shard.read_bytes())
    bad[300] ^= 1
    shard.write_bytes(bad)
    with pytest.raises(BadInputError, match=r"points-00000\.safetensors: .*damaged"):
        both(open_store(path))
