# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The box of a completed shape, in the frame of the scan.

Labels are of the body: mirrors, aerials and stray points stick out of it. They are few, on the
shape and in a scan, and do not count at the ends and sides. A decoder draws towards what is usual:
where more of a scan than that lies outside of the shape, the box ends where the scan does. Of a
LiDAR this is of the side seen alone: reflected, it would count the mirror plane's error twice.
At an end that scans came near without seeing it more points do not count: a decoder spreads them
over where such ends may be.
Ground that was left around the wheels is no end or side.
"""

import math
from collections.abc import Iterable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.box import FittedBox, fit_box
from wildshape.geometry.surface import is_mirrored
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import BoxConfig
from wildshape.method.checkpoint import ModelSettings
from wildshape.records import Box, Points

_PART = 64
_COARSE_DEG = 1.0
_DEFAULT = BoxConfig()
_WHOLE = {"shape_share": 0.0, "hidden_share": 0.0, "seen_share": 0.0}


def box_seen(
    shape: Float[Tensor, "P 3"],
    T_sensor_canonical: SE3,
    scan: Points,
    settings: ModelSettings,
    config: BoxConfig = _DEFAULT,
) -> Box:
    """The box of the shape of one scan; see `fit_to_scans`."""
    T = T_sensor_canonical.to(torch.float64)
    seen = T.inverse().apply(torch.from_numpy(scan).double())
    return carried(fit_for(settings, shape, [seen], config), T)


def fit_for(
    settings: ModelSettings,
    shape: Float[Tensor, "P 3"],
    seen: Iterable[Tensor],
    config: BoxConfig = _DEFAULT,
    bottom: Float[Tensor, "3"] | None = None,
) -> FittedBox:
    """`fit_to_scans` of what a network with these settings completes."""
    mirror, body = settings.network.mirror, settings.sensor == "lidar"
    known = {"mirror": mirror, "body": body, "unit": settings.unit, "bottom": bottom}
    return fit_to_scans(shape, seen, config=config, **known)


def fit_to_scans(
    shape: Float[Tensor, "P 3"],
    seen: Iterable[Tensor],
    *,
    mirror: bool,
    body: bool = True,
    unit: float = 1.0,
    bottom: Float[Tensor, "3"] | None = None,
    config: BoxConfig = _DEFAULT,
) -> FittedBox:
    """The box around a shape and what scans saw of it, in the canonical frame.

    The heading is the canonical frame's x where the network is mirror-symmetric, else that of the
    upright rectangle of least area.

    Args:
        shape: canonical frame.
        seen: points `(n, 3)` of each scan in that frame. Those far outside the shape's own box are
            strays. Of every four scans the one that reaches furthest is not believed.
        mirror: the object is symmetric in the plane y = 0.
        body: what little sticks out does not count, as of a vehicle; of an aeroplane wings do, and
            what was seen of one side, by an exact camera, is believed of the other.
        unit: `unit_of` such objects, by which lengths of `config` shrink.
        bottom: a point that the box reaches down to at least, if known: a mean of shapes ends above
            their floors.
        config: what is not believed.
    """
    exact = shape.double()
    axes = _level(exact, config, body=body) if mirror else fit_box(exact).rotation
    reflect = mirror and not body
    config = config if body else replace(config, **_WHOLE)
    shown = _rows(exact, axes)
    low, high = _ends(shown, config)
    reach = config.reach * (high - low).norm()
    soil = low[2] + config.ground_share * (high[2] - low[2]) if body else -math.inf
    if bottom is not None:
        low[2] = torch.minimum(low[2], axes[:, 2] @ bottom)
    lows, highs, scans = [], [], 0
    for points in seen:
        scans += 1
        rows = _rows(points.double(), axes)
        if reflect:
            rows[1].abs_()
        near = rows[:, ((rows > (low - reach)[:, None]) & (rows < (high + reach)[:, None])).all(0)]
        if (near[2] > soil).any():
            begins, ends = _seen_ends(near, soil, config)
            highs.append(ends)
            lows.append(_reflected(begins, ends) if reflect else begins)
    rank = scans // config.scans_a_witness
    if rank < len(lows):
        first = torch.stack(lows).sort(0).values[rank]
        last = torch.stack(highs).sort(0).values[-1 - rank]
        low[0], high[0] = _drawn_back(shown, (low[0], high[0]), (first[0], last[0]), unit, config)
        low, high = torch.minimum(low, first), torch.maximum(high, last)
    return FittedBox(axes @ ((low + high) / 2), high - low, axes)


def carried(fitted: FittedBox, T_sensor_canonical: SE3) -> Box:
    """A box of the canonical frame in the sensor's."""
    T = T_sensor_canonical.to(torch.float64)
    x, y, z = _rounded(T.apply(fitted.centre.double()[None])[0])
    length, width, height = _rounded(fitted.size)
    qw, qx, qy, qz = _rounded(quaternion_from_rotation(T.rotation @ fitted.rotation.double()))
    return Box((x, y, z), (length, width, height), (qw, qx, qy, qz))


def _level(shape: Float[Tensor, "P 3"], config: BoxConfig, *, body: bool) -> Float[Tensor, "3 3"]:
    """The small turn about y after which the rectangle around the side view has least area.

    The canonical frame is level on average, not for each shape; a degree is 8 cm of a car's length.
    That of depth views need not be level at all: nothing says what is up. There a large turn is
    taken where the rectangle becomes much smaller, and none else: with their fins, aeroplanes are
    not level where it is smallest.
    """
    if body:
        angle, _ = _least_area(shape, config.level_deg, config.step_deg, config)
    else:
        level, area = _least_area(shape, 0.0, config.step_deg, config)
        far, _ = _least_area(shape, config.tipped_deg, _COARSE_DEG, config)
        far, less = _least_area(shape, _COARSE_DEG, config.step_deg, config, about=far)
        angle = far if less < (1 - config.tipped_gain) * area else level
    c, s = angle.cos(), angle.sin()
    zero, one = torch.zeros_like(c), torch.ones_like(c)
    return torch.stack((c, zero, s, zero, one, zero, -s, zero, c)).view(3, 3)


def _least_area(
    shape: Float[Tensor, "P 3"],
    most_deg: float,
    step_deg: float,
    config: BoxConfig,
    about: Tensor | float = 0.0,
) -> tuple[Tensor, Tensor]:
    """Of turns about y by up to `most_deg` from `about` the best, and its rectangle's area.

    Turns are in radians but for `most_deg` and `step_deg`.
    """
    steps = round(most_deg / step_deg)
    angles = torch.deg2rad(torch.arange(-steps, steps + 1, dtype=shape.dtype) * step_deg)
    angles = angles[angles.abs().argsort(stable=True)] + about  # of equals the smallest
    cos, sin = angles.cos()[:, None], angles.sin()[:, None]
    x, _, z = shape.T.contiguous()
    strays = config.strays
    if is_mirrored(shape[None]):  # each x and z is there twice
        x, z, strays = x[: len(x) // 2], z[: len(z) // 2], strays // 2
    low, high = _without_outermost(torch.stack((x * cos - z * sin, x * sin + z * cos)), strays)
    across = high - low
    area, best = (across[0] * across[1]).min(0)
    return angles[best], area


def _rows(points: Float[Tensor, "n 3"], axes: Float[Tensor, "3 3"]) -> Float[Tensor, "3 n"]:
    return axes.mT @ points.T.contiguous()


def _ends(rows: Float[Tensor, "3 n"], config: BoxConfig) -> tuple[Tensor, Tensor]:
    """Where a shape begins and ends; beside it more stands out than above it."""
    count = max(int(config.shape_share * rows.shape[1]), config.strays)
    low, high = _without_outermost(rows, count)
    bottom, top = _without_outermost(rows[2:], config.strays)
    return torch.cat((low[:2], bottom)), torch.cat((high[:2], top))


def _seen_ends(
    rows: Float[Tensor, "3 n"], floor: Tensor | float, config: BoxConfig
) -> tuple[Tensor, Tensor]:
    """Where what a scan saw begins and ends; what lies below the floor is no end or side.

    Some of it lies above.
    """
    bottom, top = _without_outermost(rows[2:], config.strays)
    above = rows[:2, rows[2] > floor]
    low, high = _without_outermost(above, int(config.seen_share * above.shape[1]))
    return torch.cat((low, bottom)), torch.cat((high, top))


def _drawn_back(
    rows: Float[Tensor, "3 n"],
    ends: tuple[Tensor, Tensor],
    seen: tuple[Tensor, Tensor],
    unit: float,
    config: BoxConfig,
) -> tuple[Tensor, Tensor]:
    """Front and rear end of a shape, drawn back where the scans ended a little before.

    Args:
        rows: the shape's points along the box's axes.
        ends: lowest and highest x of the shape.
        seen: the same of the scans.
        unit: see `fit_to_scans`.
        config: how far.
    """
    share = max(config.hidden_share, config.shape_share)
    count = max(int(share * rows.shape[1]), config.strays)
    least, most = (end[0] for end in _without_outermost(rows[:1], count))
    (low, high), (first, last) = ends, seen
    near, unknown = unit * config.near_m, unit * config.unknown_m
    if first - low < unknown:
        low = (first - near).clamp(low, least)
    if high - last < unknown:
        high = (last + near).clamp(most, high)
    return low, high


def _without_outermost(rows: Float[Tensor, "*k n"], count: int) -> tuple[Tensor, Tensor]:
    """Where each row begins and ends without its `count` outermost values at either end."""
    kept = min(count + 1, rows.shape[-1])
    return -_nth_largest(-rows, kept), _nth_largest(rows, kept)


def _nth_largest(rows: Float[Tensor, "*k n"], count: int) -> Float[Tensor, "*k"]:
    """The `count`th value of each row; it lies in one of the parts of the `count` largest maxima.

    `topk` of whole rows takes several times as long.
    """
    if rows.shape[-1] % _PART or rows.shape[-1] < 2 * count * _PART:
        return rows.topk(count).values[..., -1]
    parts = rows.unflatten(-1, (-1, _PART))
    best = parts.amax(-1).topk(count).indices[..., None].expand(*rows.shape[:-1], count, _PART)
    return parts.gather(-2, best).flatten(-2).topk(count).values[..., -1]


def _reflected(low: Float[Tensor, "3"], high: Float[Tensor, "3"]) -> Float[Tensor, "3"]:
    """Of a scan and its reflection in y = 0, where it begins; `high` is where |y| ends."""
    return torch.stack((low[0], -high[1], low[2]))


def _rounded(values: Tensor) -> list[float]:
    return [round(value, 6) for value in values.tolist()]
