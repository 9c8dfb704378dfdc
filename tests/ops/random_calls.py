# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Random calls of the native kernels through their wrappers, legal and illegal, beside torch.

    python tests/ops/random_calls.py LIBRARY CALLS [SEED]

`test_sanitized.py` runs it on a library that a sanitizer watches. Coordinates are whole numbers,
or so large or small that every backend rounds alike: results must be equal to the bit.
"""

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import torch
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.ops import library
from wildshape.ops.column_argmax import column_argmax_native, column_argmax_torch
from wildshape.ops.connected import connected_parts, first_of_cells, first_sorted
from wildshape.ops.nearest import Neighbours, nearest, nearest_distance
from wildshape.ops.nearest.nearest_k import nearest_k_native, nearest_k_torch
from wildshape.ops.nearest.nearest_native import NativeDistance, nearest_both_native, nearest_native
from wildshape.ops.nearest.nearest_torch import nearest_blocked, nearest_reference
from wildshape.ops.planes import planes_native
from wildshape.ops.point_to_plane import point_to_plane_native
from wildshape.ops.spans import spans, spans_numpy
from wildshape.ops.zbuffer.zbuffer_native import visible_native
from wildshape.ops.zbuffer.zbuffer_torch import visible_reference

SPECIAL = (torch.nan, torch.inf, -torch.inf, 1e30, -1e30, 3.4e38, -3.4e38, 1e-40, -0.0)
TYPES = (torch.float64, torch.float16, torch.int32, torch.uint8, torch.int64)


def most(random: Random) -> int:
    """0 to 300, small ones and ends of blocks more often."""
    return random.choice((0, 1, random.randint(2, 17), random.randint(0, 300), 256, 300))


def strewn(random: Random, values: Tensor) -> Tensor:
    """Some special numbers among the values, or many, or none."""
    share = random.choice((0.0, 0.0, 0.02, 0.2, 1.0))
    special = torch.tensor([random.choice(SPECIAL) for _ in range(8)])
    chosen = special[torch.randint(8, values.shape)]
    return torch.where(torch.rand(values.shape) < share, chosen, values)


def laid_out(random: Random, values: Tensor) -> Tensor:
    """The same values at other strides, inside a larger tensor, or with a row repeated."""
    match random.randrange(5):
        case 0:
            return values.mT.contiguous().mT
        case 1:
            return torch.cat((values, values), -1)[..., : values.shape[-1]]
        case 2:
            return torch.cat((values, values), -2)[..., : values.shape[-2], :]
        case 3 if values.ndim == 3:
            return values[:1].expand(len(values), -1, -1)
        case _:
            return values


def cloud(random: Random, clouds: int) -> Tensor:
    side = random.choice((1, 3, 900))
    return laid_out(random, strewn(random, torch.randint(-side, side, (clouds, most(random), 3))))


def sizes(random: Random, points: Tensor) -> Tensor | None:
    kind = random.choice((torch.int64, torch.int64, torch.int32))
    return random.choice((None, torch.randint(-2, points.shape[1] + 3, points.shape[:1]).to(kind)))


def level(random: Random) -> int:
    loaded = library.library()
    return random.randint(-1, loaded.wildshape_level()) if loaded else 0


def equal(found: Neighbours, expected: Neighbours) -> None:
    assert torch.equal(found.distance_squared, expected.distance_squared)
    assert torch.equal(found.index, expected.index)


def call_nearest(random: Random) -> None:
    clouds = random.choice((0, 1, 1, 2, 9))
    a, b = cloud(random, clouds), cloud(random, clouds)
    n, m = sizes(random, a), sizes(random, b)
    torch.set_num_threads(random.choice((1, 3, 100)))
    there, back = nearest_both_native(a, b, n, m, level=level(random))
    equal(there, nearest_native(a, b, n, m, level=level(random)))
    torch.set_num_threads(1)
    twin = random.choice((nearest_reference, nearest_blocked))
    equal(there, twin(a, b, n, m))
    equal(back, twin(b, a, m, n))


def call_nearest_k(random: Random) -> None:
    """In which order plain torch gives equal ones is not known: `test_nearest_k.py` has that."""
    clouds = random.choice((0, 1, 1, 2))
    a, b = cloud(random, clouds), cloud(random, clouds)
    own, other = (torch.randint(random.choice((1, 1, 3)), part.shape[:2]) for part in (a, b))
    groups = random.choice((None, (own, other)))
    given = random.choice((1, 6, 8, 16, 17, b.shape[1] + 2)), sizes(random, a), sizes(random, b)
    far = random.choice((torch.inf, 0.0, 2.0, 1e25))
    torch.set_num_threads(random.choice((1, 3, 100)))
    found = nearest_k_native(a, b, *given, groups, far, level=level(random))
    torch.set_num_threads(1)
    plain = nearest_k_torch(a, b, *given, groups, far)
    assert torch.equal(found.distance_squared, plain.distance_squared)
    assert ((found.index >= 0) & (found.index < max(b.shape[1], 1))).all()


def call_connected(random: Random) -> None:
    """Parts are for `test_connected.py`."""
    points = (torch.randint(-9, 9, (most(random), 3)) * random.choice((1.0, 0.1, 1e6))).numpy()
    cell, reach = random.choice((0.1, 1.0, 7.0)), random.choice((0.1, 1.0, 7.0))
    kind = random.choice((np.int64, np.int32))
    pairs = np.random.default_rng(0).integers(max(len(points), 1), size=(len(points) // 9, 2))
    part = connected_parts(points[::-1], reach, cell, pairs.astype(kind))
    assert len(part) == len(points)
    assert set(part.tolist()) == set(range(int(part.max(initial=-1)) + 1))
    if len(points):
        assert np.array_equal(first_of_cells(points, cell), first_sorted(points, cell))


def call_spans(random: Random) -> None:
    points = torch.randn(1 + most(random), 3).numpy()[:: random.choice((1, 2, -1))]
    kind = random.choice((torch.float64, torch.float32))
    level_axes = torch.randn(2, random.choice((1, 7, 90)), dtype=kind).numpy()
    for found, expected in zip(spans(points, level_axes), spans_numpy(points, level_axes)):
        assert np.array_equal(found, expected)


def call_gradient(random: Random) -> None:
    """Through autograd, with indices from anywhere, too; values are for `test_nearest.py`."""
    clouds = random.choice((1, 2, 9))
    a, b = (cloud(random, clouds).requires_grad_(random.random() < 0.8) for _ in range(2))
    found = nearest(a, b)
    if random.random() < 0.3:
        wrong = torch.randint(-(2**62), 2**62, found.index.shape)
        wrong = random.choice((wrong, wrong % 400 - 50))
        found = Neighbours(laid_out(random, torch.rand(wrong.shape)), wrong)
    weight = laid_out(random, strewn(random, torch.rand(found.index.shape)))
    torch.set_num_threads(random.choice((1, 3)))
    distance = NativeDistance.apply(a, b, found.distance_squared, found.index)
    if distance.requires_grad:  # pyright: ignore
        distance.backward(weight)  # pyright: ignore


def call_column_argmax(random: Random) -> None:
    rows, columns = max(1, most(random)), random.choice((0, 1, 255, 256, 257, most(random)))
    values = laid_out(random, strewn(random, torch.randint(-3, 3, (rows, columns)) * 1.0))
    assert torch.equal(column_argmax_native(values, level(random)), column_argmax_torch(values))


def call_visible(random: Random) -> None:
    shape, n_bins = (random.choice((0, 1, 3)), most(random)), random.choice((-1, 0, 1, 40, 131072))
    bins = torch.randint(-3, max(n_bins, 1) + 3, shape)
    if random.random() < 0.2:
        bins = torch.randint(-(2**62), 2**62, shape)
    depth = strewn(random, torch.randint(-3, 9, shape) * 1.0)
    bins, depth = laid_out(random, bins), laid_out(random, depth)
    torch.set_num_threads(random.choice((1, 3)))
    seen = visible_native(bins, depth, n_bins)
    if n_bins > 0:
        assert torch.equal(seen, visible_reference(bins, depth, n_bins))


def call_planes(random: Random) -> None:
    """Values are for `test_planes.py`."""
    clouds = random.choice((0, 1, 3))
    points = laid_out(random, strewn(random, torch.rand(clouds, 1 + most(random), 3)))
    shape = clouds, most(random), random.choice((1, 2, 6))
    middle, _ = planes_native(points, torch.randint(0, points.shape[1], shape))
    assert middle.shape == (*shape[:2], 3)


def call_point_to_plane(random: Random) -> None:
    """Values are for `test_planes.py`."""
    points = laid_out(random, strewn(random, torch.rand(random.choice((0, 1, 9)), most(random), 3)))
    onto = strewn(random, torch.rand(1 + most(random), 3))
    counterpart = torch.randint(0, len(onto), points.shape[:2])
    found = point_to_plane_native(points, points[:, :1].sum(1), onto, onto, counterpart, 0.5, 0.1)
    assert found.A.shape == (len(points), 6, 6)


def call_wrongly(random: Random) -> None:
    """Shapes and types that the kernels would read past the end of: refused in one sentence."""
    a, b = torch.rand(2, 1 + most(random), 3), torch.rand(2, 1 + most(random), 3)
    flat, other = torch.rand(2, 5, 2), random.choice(TYPES)
    bins, depth = torch.zeros(2, 9, dtype=torch.int64), torch.rand(2, 9)
    found = nearest(a, b)
    squared, index = found.distance_squared, found.index
    rows, outside = a[0].numpy(), random.choice((-1, a.shape[1], 2**40))
    onto, centre = b[0], a[:, 0]
    refused: list[Callable[[], object]] = [
        lambda: nearest(a, b[:1]),
        lambda: nearest(a[:1], b),
        lambda: nearest(flat, b),
        lambda: nearest(a, flat),
        lambda: nearest(a[0], b[0]),
        lambda: nearest(a, b, torch.ones(1, dtype=torch.int64)),
        lambda: nearest(a, b, None, torch.ones(3, 2, dtype=torch.int64)),
        lambda: nearest(a, b, torch.rand(2)),
        lambda: nearest_native(a.to(other), b),
        lambda: nearest_native(a, b.to(other)),
        lambda: nearest_distance(a, b, Neighbours(squared[:, :-1], index[:, :-1])),
        lambda: nearest_distance(a, b, Neighbours(squared, index.int())),
        lambda: nearest_distance(a, b, Neighbours(squared.double(), index)),
        lambda: nearest_distance(a, b[:1], found),
        lambda: visible_native(bins, depth[:, :-1], 4),
        lambda: visible_native(bins.int(), depth, 4),
        lambda: visible_native(bins, depth.double(), 4),
        lambda: visible_native(bins[0], depth[0], 4),
        lambda: column_argmax_native(a[0].to(other)),
        lambda: column_argmax_native(a[0, :0]),
        lambda: column_argmax_native(a),
        lambda: connected_parts(rows, 0.1, 0.01, np.array([[0, outside]])),
        lambda: planes_native(a[:1], index[..., None] * 0),
        lambda: planes_native(a, index[..., None] * 0 + outside),
        lambda: point_to_plane_native(a, centre, onto, onto[:-1], index * 0 + len(onto) - 1, 1, 1),
        lambda: point_to_plane_native(a, centre, onto, onto, index[:, :-1], 1, 1),
        lambda: point_to_plane_native(a, centre[:1], onto, onto, index, 1, 1),
    ]
    number = random.randrange(len(refused))
    try:
        refused[number]()
    except (BadInputError, IndexError):
        return
    raise AssertionError(f"wrong call {number} was not refused")


KINDS = (
    call_nearest,
    call_nearest,
    call_nearest_k,
    call_connected,
    call_spans,
    call_gradient,
    call_column_argmax,
    call_visible,
    call_planes,
    call_point_to_plane,
    call_wrongly,
)


def main() -> None:
    library._PATH, calls, seed = Path(sys.argv[1]), int(sys.argv[2]), int((*sys.argv, 0)[3])
    assert library.library() is not None, f"{sys.argv[1]}: does not load"
    made = Counter()
    for number in range(seed, seed + calls):
        random = Random(number)
        torch.manual_seed(number)
        kind = random.choice(KINDS)
        try:
            kind(random)
        except Exception:
            sys.stderr.write(f"call {number}: {kind.__name__}\n")
            raise
        made[kind.__name__] += 1
    sys.stdout.write(f"{dict(sorted(made.items()))}\n")


if __name__ == "__main__":
    main()
