# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Batches: their own scans, within the window, repeatable, turned as promised."""

import numpy as np
import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.centring import box_centre, frustum_centre
from wildshape.geometry.projection.spherical import to_spherical
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.records import Track
from wildshape.training.batches.views import ViewConfig, ViewSampler

STEP = 10.0
EXACT = "donot_use_mm_for_euclid_dist"


def marked_scan(frame, count, rng):
    """Points about (10 + 10 frame, 0, 0): the centre's range tells the frame."""
    at = np.array([STEP * (frame + 1), 0.0, 0.0])
    return (at + rng.uniform(-0.2, 0.2, size=(count, 3))).astype(np.float32)


def store_of(path, tracks):
    """Each track a list of scan sizes."""
    rng = np.random.default_rng(0)
    with StoreWriter(path, {}) as writer:
        for number, sizes in enumerate(tracks):
            scans = tuple(marked_scan(i, n, rng) for i, n in enumerate(sizes))
            names = tuple(f"{i:06d}" for i in range(len(sizes)))
            writer.add(Track(name=f"{number:06d}", scans=scans, scan_names=names))
    return open_store(path)


def sampler_of(path, sizes, **config):
    store = store_of(path, sizes)
    plain = {"tracks": 4, "views": 3, "points": 64, "window": 5}
    return ViewSampler(store, np.arange(len(store)), ViewConfig(**{**plain, **config}))


def frames(batch, views):
    """Frame numbers read back from the centres, `(I, V)`."""
    return torch.round(batch.centres.norm(dim=1) / STEP - 1).long().view(-1, views)


def test_a_batch_depends_on_its_seeds_alone(tmp_path):
    first = sampler_of(tmp_path / "a", [[200] * 12] * 5, turn="yaw")
    second = sampler_of(tmp_path / "b", [[200] * 12] * 5, turn="yaw")
    for step in range(5):
        second.draw(9, step)
    one, two = first.draw(1, 3, 0), second.draw(1, 3, 0)
    assert torch.equal(one.scans, two.scans)
    assert torch.equal(one.centres, two.centres)
    assert torch.equal(one.reference, two.reference)
    for other in ((1, 4, 0), (2, 3, 0), (1, 3, 1)):
        assert not torch.equal(first.draw(1, 3, 0).scans, first.draw(*other).scans)


def test_shapes_reference_and_centring(tmp_path):
    sampler = sampler_of(tmp_path / "a", [[200] * 12] * 5)
    seen = set()
    for step in range(20):
        batch = sampler.draw(0, step)
        assert batch.scans.shape == (12, 64, 3)
        assert torch.equal(batch.reference // 3, torch.arange(4))
        seen |= set((batch.reference % 3).tolist())
        assert float(batch.scans.abs().max()) < 0.45
    assert seen == {0, 1, 2}


def test_points_are_the_scan_itself_about_its_own_centre(tmp_path):
    sampler = sampler_of(tmp_path / "a", [[150]], views=1, window=1, tracks=1)
    batch = sampler.draw(0)
    scan = torch.from_numpy(np.array(sampler.store.scan_points(0)))
    torch.testing.assert_close(batch.centres[0], frustum_centre(scan))
    back = batch.scans[0] + batch.centres[0]
    assert float(torch.cdist(back, scan, compute_mode=EXACT).amin(1).max()) < 1e-5
    camera = sampler_of(tmp_path / "b", [[150]], views=1, window=1, tracks=1, sensor="camera")
    torch.testing.assert_close(camera.draw(0).centres[0], box_centre(scan))


def test_points_are_drawn_with_replacement(tmp_path):
    """METHOD 2: of as many draws as points a share of 1 - 1/e is distinct, 95 of 150."""
    sampler = sampler_of(tmp_path / "a", [[150]], views=1, window=1, tracks=1, points=150)
    distinct = [len(sampler.draw(step).scans[0].unique(dim=0)) for step in range(50)]
    assert np.mean(distinct) == pytest.approx(150 * (1 - (149 / 150) ** 150), abs=3)


def test_views_are_distinct_and_lie_within_the_window(tmp_path):
    sampler = sampler_of(tmp_path / "a", [[200] * 30] * 2)
    spans, seen = set(), set()
    for step in range(60):
        found = frames(sampler.draw(0, step), 3)
        for row in found.tolist():
            assert len(set(row)) == 3
            spans.add(max(row) - min(row))
            seen |= set(row)
    assert max(spans) == 4
    assert seen == set(range(30))


def test_sparse_scans_are_never_drawn_and_leave_the_window_its_length(tmp_path):
    """Usable frames 0-2, 20-22 and 40: none of the first may meet one of the second."""
    usable = {0, 1, 2, 20, 21, 22, 40}
    sizes = [150 if i in usable else 99 for i in range(41)]
    sampler = sampler_of(tmp_path / "a", [sizes])
    seen = set()
    for step in range(100):
        found = frames(sampler.draw(0, step), 3)
        seen |= set(found.flatten().tolist())
        assert int((found.amax(1) - found.amin(1)).max()) < 5
    assert seen == usable


def test_tracks_with_fewer_scans_than_views_repeat_them(tmp_path):
    sampler = sampler_of(tmp_path / "a", [[200], [200, 200], [50, 50]], views=4)
    for step in range(20):
        assert frames(sampler.draw(0, step), 4).max() <= 1
    assert len(sampler.scans_of) == 2


def test_nothing_to_train_on(tmp_path):
    with pytest.raises(BadInputError, match="no track has a scan of 100 points or more"):
        sampler_of(tmp_path / "a", [[99, 99], [16]])


def test_only_the_given_tracks_are_drawn(tmp_path):
    store = store_of(tmp_path / "a", [[200] * 3, [200] * 20])
    sampler = ViewSampler(store, np.array([0]), ViewConfig(tracks=8, views=2, points=8))
    assert frames(sampler.draw(0), 2).max() <= 2


def test_yaw_keeps_pitch_and_range_of_centres(tmp_path):
    still = sampler_of(tmp_path / "a", [[200] * 12] * 5).draw(7)
    turned = sampler_of(tmp_path / "b", [[200] * 12] * 5, turn="yaw").draw(7)
    before, after = to_spherical(still.centres), to_spherical(turned.centres)
    torch.testing.assert_close(after.pitch, before.pitch, atol=1e-6, rtol=0)
    torch.testing.assert_close(after.range, before.range)
    assert float((after.azimuth - before.azimuth).std()) > 0.5
    # Height stays; the cloud is turned, not bent.
    torch.testing.assert_close(turned.scans[..., 2], still.scans[..., 2])
    torch.testing.assert_close(turned.scans.norm(dim=-1), still.scans.norm(dim=-1))


@pytest.mark.parametrize("turn", ["yaw", "so3"])
def test_a_scan_and_its_centre_turn_together_about_the_sensor(tmp_path, turn):
    still = sampler_of(tmp_path / "a", [[200] * 12] * 5).draw(7)
    turned = sampler_of(tmp_path / "b", [[200] * 12] * 5, turn=turn).draw(7)
    for i in range(12):
        before = torch.cat((still.scans[i] + still.centres[i], torch.zeros(1, 3)))
        after = torch.cat((turned.scans[i] + turned.centres[i], torch.zeros(1, 3)))
        apart = [torch.cdist(x.double(), x.double(), compute_mode=EXACT) for x in (before, after)]
        torch.testing.assert_close(*apart, atol=1e-4, rtol=0)
    headings = torch.nn.functional.normalize(turned.centres, dim=1)
    assert float((headings @ headings.T).amin()) < 0


def test_extents(tmp_path):
    sampler = sampler_of(tmp_path / "a", [[200] * 12] * 5)
    low, high = sampler.extent_range()
    assert 0.6 < low <= high < 0.4 * 3**0.5 + 1e-3


@pytest.mark.parametrize("turn", ["none", "facing"])
def test_other_scans_are_centred_and_turned_as_those_of_the_store(tmp_path, turn):
    sampler = sampler_of(tmp_path / "a", [[200] * 4], turn=turn)
    whole = torch.stack([torch.from_numpy(sampler.store.scan_points(i).copy()) for i in range(4)])
    scans, centres, turns = sampler.as_posed(whole)
    _, centres_kept, turns_kept = sampler.gather_as_posed([0, 1, 2, 3], np.random.default_rng(0))
    torch.testing.assert_close(centres, centres_kept)
    torch.testing.assert_close(turns, turns_kept)
    torch.testing.assert_close((scans + centres[:, None]) @ turns, whole)
