# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Equations 2, 3 and 5 against a slow twin that differentiates every branch."""

import pytest
import torch
from tests import naive
from tests.strategies import clouds

from wildshape.geometry.projection.visibility import FacingBins, PixelBins, PolarBins
from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.multiview import LossConfig, multiview_loss, winners
from wildshape.method.observation import observation_term, projection_term

PROJECTIONS = [PolarBins(0.03, 0.03), FacingBins(0.3), PixelBins(1 / 30)]
IN_THE_IMAGE = [PolarBins(0.03, 0.03, flat=True), FacingBins(0.3, True), PixelBins(1 / 30, True)]


def batch(tracks=2, views=3, branches=4, n=30, m=40, seed=0, dtype=torch.float64):
    """Scans some 13 m ahead of a LiDAR and of a camera alike, shapes, and poses as leaves."""
    count = tracks * views
    generator = torch.Generator().manual_seed(seed)
    rotation = random_rotation(count * branches, generator).double()
    rotation, _ = torch.linalg.qr(rotation)
    leaves = {
        "shapes": clouds(seed + 1, tracks, m, 3),
        "rotation": rotation.view(count, branches, 3, 3),
        "translation": clouds(seed + 2, count, branches, 3, scale=0.3),
    }
    scans = {
        "scans": clouds(seed + 3, count, n, 3),
        "centres": clouds(seed + 4, count, 3) + torch.tensor([8.0, 0.5, 10.0]),
    }
    leaves = {k: v.to(dtype).requires_grad_() for k, v in leaves.items()}
    return {k: v.to(dtype) for k, v in scans.items()}, leaves


@pytest.mark.parametrize("projection", [*PROJECTIONS, *IN_THE_IMAGE])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("dtype", "rtol"), [(torch.float64, 1e-9), (torch.float32, 2e-4)])
def test_loss_and_gradients_are_those_of_the_slow_twin(projection, seed, dtype, rtol):
    scans, leaves = batch(seed=seed, dtype=dtype)
    terms = multiview_loss(**scans, **leaves, config=LossConfig(0.25, projection))
    found = torch.autograd.grad(terms.total, list(leaves.values()))
    loss, winner = naive.multiview_loss(**scans, **leaves, beta=0.25, projection=projection)
    expected = torch.autograd.grad(loss, list(leaves.values()))
    assert terms.winner.tolist() == winner
    torch.testing.assert_close(terms.total, loss, rtol=rtol, atol=0)
    for name, a, b in zip(leaves, found, expected):
        size = float(b.abs().max())
        assert size > 0, name
        torch.testing.assert_close(a, b, rtol=rtol, atol=rtol * size)


def test_hindsight_gives_a_gradient_to_the_winning_branch_alone():
    scans, leaves = batch()
    terms = multiview_loss(**scans, **leaves, config=LossConfig(0.25, FacingBins(0.3)))
    terms.total.backward()
    for leaf in ("rotation", "translation"):
        size = leaves[leaf].grad.flatten(2).abs().sum(-1)
        won = torch.nn.functional.one_hot(terms.winner, 4).bool()
        assert (size[won] > 0).all()
        assert (size[~won] == 0).all()


@pytest.mark.parametrize("hindsight", ["scan", "track", "batch"])
def test_hindsight_is_the_least_loss_that_one_branch_a_scan_a_track_or_a_batch_can_have(hindsight):
    """Against the loss of every choice of branches: of a batch there are K of them."""
    scans, leaves = batch()
    config = LossConfig(0.25, FacingBins(0.3), hindsight=hindsight)
    terms = multiview_loss(**scans, **leaves, config=config)
    alone = {k: leaves[k].detach() for k in ("rotation", "translation")}
    of_branch = [
        [
            multiview_loss(
                scans["scans"][b : b + 1],
                scans["centres"][b : b + 1],
                leaves["shapes"][b // 3 : b // 3 + 1],
                *(part[b : b + 1, k : k + 1] for part in alone.values()),
                config=config,
            ).total.detach()
            for k in range(4)
        ]
        for b in range(6)
    ]
    cost = torch.tensor(of_branch, dtype=torch.float64)
    together = {"scan": 1, "track": 3, "batch": 6}[hindsight]
    least = cost.view(-1, together, 4).sum(1).amin(-1).sum() / 2
    torch.testing.assert_close(terms.total.detach(), least)
    assert len(terms.winner.view(-1, together).unique(dim=1).T) == 1


def test_hindsight_for_a_batch_by_hand():
    cost = torch.tensor([[1.0, 3.0], [9.0, 2.0], [1.0, 2.0], [1.0, 2.0]])
    assert winners(cost, 2, "scan").tolist() == [0, 1, 0, 0]
    assert winners(cost, 2, "track").tolist() == [1, 1, 0, 0]
    assert winners(cost, 2, "batch").tolist() == [1, 1, 1, 1]


def test_the_winner_is_the_branch_of_least_cost():
    scans, leaves = batch(seed=5)
    shape = leaves["shapes"].detach().repeat_interleave(3, dim=0)
    posed = shape[:, None] @ leaves["rotation"].mT + leaves["translation"][:, :, None]
    scores = score_hypotheses(
        scans["scans"], scans["centres"], posed.detach(), projection=FacingBins(0.3)
    )
    terms = multiview_loss(**scans, **leaves, config=LossConfig(0.25, FacingBins(0.3)))
    assert torch.equal(terms.winner, scores.cost(0.25).argmin(-1))
    torch.testing.assert_close(scores.cost(0.25), scores.observation + 0.25 * scores.projection)
    # Equation 5: the sum over the views of a track, the mean over tracks.
    summed = scores.cost(0.25).amin(-1).view(2, 3).sum(1).mean()
    torch.testing.assert_close(terms.total.detach(), summed)
    torch.testing.assert_close(terms.observation + 0.25 * terms.projection, summed / 3)


def test_views_add_up_and_tracks_are_averaged():
    """The same view twice doubles the loss; the same track twice does not change it."""
    scans, leaves = batch(tracks=1, views=1)
    config = LossConfig(0.25, FacingBins(0.3))
    once = multiview_loss(**scans, **leaves, config=config).total
    twice = {k: v.repeat(2, *[1] * (v.ndim - 1)) for k, v in {**scans, **leaves}.items()}
    tracks = multiview_loss(**twice, config=config).total
    torch.testing.assert_close(tracks, once)
    views = multiview_loss(**{**twice, "shapes": leaves["shapes"]}, config=config).total
    torch.testing.assert_close(views, 2 * once)


def test_every_view_is_explained_by_the_shape_of_its_own_track():
    scans, leaves = batch(tracks=2, views=3)
    loss = multiview_loss(**scans, **leaves, config=LossConfig(0.25, FacingBins(0.3)))
    half = {k: v[:3] for k, v in {**scans, **leaves}.items()} | {"shapes": leaves["shapes"][:1]}
    other = {k: v[3:] for k, v in {**scans, **leaves}.items()} | {"shapes": leaves["shapes"][1:]}
    config = LossConfig(0.25, FacingBins(0.3))
    apart = (multiview_loss(**half, config=config), multiview_loss(**other, config=config))
    torch.testing.assert_close(loss.total, (apart[0].total + apart[1].total) / 2)


def test_terms_are_one_way_chamfer_distances():
    scans, posed = clouds(1, 2, 20, 3), clouds(2, 2, 25, 3)
    apart = torch.cdist(scans, posed, compute_mode="donot_use_mm_for_euclid_dist")
    seen = torch.rand(2, 25, generator=torch.Generator().manual_seed(0)) < 0.5
    observation = observation_term(scans, posed, apart.argmin(2))
    each = [naive.one_way(x, y) for x, y in zip(scans, posed)]
    torch.testing.assert_close(observation, torch.tensor(each, dtype=torch.float64))
    projection = projection_term(posed, scans, apart.argmin(1), seen)
    each = [naive.one_way(y[own], x) for x, y, own in zip(scans, posed, seen)]
    torch.testing.assert_close(projection, torch.tensor(each, dtype=torch.float64))


def test_hidden_points_feel_no_pull_of_the_projection():
    posed = clouds(2, 1, 25, 3).requires_grad_()
    scans = clouds(1, 1, 20, 3)
    seen = torch.zeros(1, 25, dtype=torch.bool)
    seen[0, :5] = True
    projection_term(posed, scans, torch.zeros(1, 25, dtype=torch.int64), seen).sum().backward()
    assert posed.grad is not None
    assert (posed.grad[0, :5].abs().sum(-1) > 0).all()
    assert (posed.grad[0, 5:] == 0).all()


def test_gradcheck_of_both_terms():
    scans, posed = clouds(1, 1, 6, 3), clouds(2, 1, 7, 3).requires_grad_()
    apart = torch.cdist(scans, posed.detach())
    seen = torch.tensor([[True, False, True, True, False, False, True]])
    assert torch.autograd.gradcheck(lambda y: observation_term(scans, y, apart.argmin(2)), posed)
    assert torch.autograd.gradcheck(
        lambda y: projection_term(y, scans, apart.argmin(1), seen), posed
    )


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_no_nan_where_the_shape_lies_exactly_on_the_scan(dtype):
    scans, _ = batch(tracks=1, views=2, branches=2, n=40, m=40, dtype=dtype)
    eye = torch.eye(3, dtype=dtype).expand(2, 2, 3, 3).clone().requires_grad_()
    zero = torch.zeros(2, 2, 3, dtype=dtype, requires_grad=True)
    shape = scans["scans"][:1].clone().requires_grad_()
    exact = multiview_loss(scans["scans"], scans["centres"], shape, eye, zero, LossConfig(0.25))
    exact.total.backward()
    for leaf in (shape, eye, zero):
        assert leaf.grad is not None
        assert leaf.grad.isfinite().all()


def test_scores_of_the_true_pose_beat_those_of_wrong_ones():
    """A scan of the visible side of a shape costs least under the pose it was taken at."""
    scans, leaves = batch(tracks=1, views=1, branches=4, m=400)
    shape, centre = leaves["shapes"].detach()[0], scans["centres"][0]
    R, t = leaves["rotation"].detach()[0], leaves["translation"].detach()[0]
    true = shape @ R[2].T + t[2]
    seen = naive.visible(true + centre, centre, FacingBins(0.3))
    posed = torch.stack([shape @ R[k].T + t[k] for k in range(4)])[None]
    scores = score_hypotheses(true[None, seen], centre[None], posed, FacingBins(0.3))
    assert int(scores.cost(0.25).argmin()) == 2
    assert float(scores.cost(0.25)[0, 2]) == pytest.approx(0, abs=1e-9)
    assert torch.nonzero(scores.visible[0, 2])[:, 0].tolist() == seen
