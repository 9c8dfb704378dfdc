# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch
from tests.strategies import clouds

from wildshape.method.encoders.neighbourhood import first_copies, nearest_distinct, rows_of


def with_copies():
    points = clouds(1, 2, 30, 3)
    pick = torch.randint(30, (2, 50), generator=torch.Generator().manual_seed(0))
    return points.gather(1, pick[..., None].expand(-1, -1, 3))


def test_first_copies_are_those_of_a_loop():
    points = with_copies()
    for cloud, found in zip(points.tolist(), first_copies(points).tolist()):
        assert found == [cloud.index(point) == i for i, point in enumerate(cloud)]
        assert 0 < sum(found) < len(found)


def test_neighbours_are_those_of_a_loop():
    places, queries = with_copies(), clouds(2, 2, 7, 3)
    found = nearest_distinct(queries, places, first_copies(places), 6)
    for cloud, asked, rows in zip(places.tolist(), queries, found.tolist()):
        for query, row in zip(asked, rows):
            apart = [float((query - torch.tensor(point).double()).norm()) for point in cloud]
            order = sorted(range(len(cloud)), key=lambda j: apart[j])
            distinct = [j for j in order if cloud.index(cloud[j]) == j]
            assert row == distinct[:6]


def test_where_there_are_fewer_the_nearest_is_repeated():
    places = clouds(3, 1, 4, 3).repeat(1, 5, 1)
    found = nearest_distinct(places, places, first_copies(places), 16)
    assert set(found.flatten().tolist()) == {0, 1, 2, 3}
    assert torch.equal(found[0, :, 0], torch.arange(20) % 4)
    assert torch.equal(found[..., 4:], found[..., :1].expand(-1, -1, 12))
    assert (
        nearest_distinct(places[:, :2], places[:, :2], first_copies(places[:, :2]), 16).shape[-1]
        == 2
    )


def test_rows_are_the_rows_and_carry_a_gradient():
    features = clouds(4, 2, 9, 5).requires_grad_()
    index = torch.randint(9, (2, 4, 3), generator=torch.Generator().manual_seed(0))
    rows = rows_of(features, index)
    for b, s, k in torch.cartesian_prod(torch.arange(2), torch.arange(4), torch.arange(3)):
        assert torch.equal(rows[b, s, k], features[b, index[b, s, k]])
    rows.sum().backward()
    counts = torch.stack([torch.bincount(one.flatten(), minlength=9) for one in index])
    assert features.grad is not None
    assert torch.equal(features.grad, counts[..., None].expand(-1, -1, 5).double())
