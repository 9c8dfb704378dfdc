# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Slow twins of network and losses: plain modules, all pairs, every branch, autograd throughout."""

import math

import torch
from torch.nn.functional import linear, relu

from wildshape.geometry.projection.visibility import FacingBins, PolarBins


def encode(encoder, points):
    """PCN as its paper draws it: the pooled feature joined to each point, then a shared layer."""
    local = encoder.point2(relu(encoder.point1(points)))
    pooled = local.amax(1, keepdim=True).expand_as(local)
    weight = torch.cat((encoder.join_point.weight, encoder.join_pooled.weight), dim=1)
    joined = linear(torch.cat((local, pooled), dim=-1), weight, encoder.join_point.bias)
    return encoder.point4(relu(joined)).amax(1)


def one_way(source, target):
    """`CD(source -> target)` of two clouds, a double loop."""
    total = 0.0
    for p in source.tolist():
        total += min(math.dist(p, q) for q in target.tolist())
    return total / len(source)


def direction(point, centre, projection):
    """Bin and depth of one point: tuples of integers, no image, no wrapping."""
    if isinstance(projection, PolarBins):
        x, y, z = point
        r = math.hypot(x, y, z)
        phi, theta = math.atan2(y, x), math.asin(z / r)
        return math.floor(phi / projection.d_azimuth), math.floor(theta / projection.d_pitch), r
    if isinstance(projection, FacingBins):
        yaw = math.atan2(centre[1], centre[0])
        level = math.hypot(centre[0], centre[1])
        pitch = math.atan2(centre[2], level)
        x = math.cos(yaw) * point[0] + math.sin(yaw) * point[1]
        y = -math.sin(yaw) * point[0] + math.cos(yaw) * point[1]
        forward = math.cos(pitch) * x + math.sin(pitch) * point[2]
        up = -math.sin(pitch) * x + math.cos(pitch) * point[2]
        r = math.hypot(forward, y, up)
        cell = projection.cell_m / math.hypot(*centre)
        return math.floor(math.atan2(y, forward) / cell), math.floor(math.asin(up / r) / cell), r
    x, y, z = point
    return math.floor(x / z / projection.cell), math.floor(y / z / projection.cell), z


def visible(points, centre, projection):
    """Indices of the nearest point of each direction."""
    front = {}
    for i, point in enumerate(points.tolist()):
        u, v, depth = direction(point, centre.tolist(), projection)
        if (u, v) not in front or depth < front[u, v][0]:
            front[u, v] = (depth, i)
    return sorted(i for _, i in front.values())


def in_image(points, centre, projection):
    """Where centred points lie when seen from far along the line of sight; with a graph."""
    if not isinstance(projection, PolarBins | FacingBins):
        return points[:, :2]
    level = math.hypot(*centre[:2].tolist())
    yaw, pitch = math.atan2(centre[1], centre[0]), math.atan2(centre[2], level)
    places = []
    for x, y, z in points:
        ahead = math.cos(yaw) * x + math.sin(yaw) * y
        left = -math.sin(yaw) * x + math.cos(yaw) * y
        places.append(torch.stack((left, -math.sin(pitch) * ahead + math.cos(pitch) * z)))
    return torch.stack(places)


def multiview_loss(scans, centres, shapes, rotation, translation, beta, projection):
    """Equation 5: sum over views, mean over tracks, the least branch of each view; and the winners.

    Every branch carries a graph; `min` alone decides which of them gets a gradient.
    """
    views = len(scans) // len(shapes)
    total, winner = torch.zeros((), dtype=scans.dtype), []
    for b, scan in enumerate(scans):
        costs = []
        for R, t in zip(rotation[b], translation[b]):
            posed = shapes[b // views] @ R.T + t
            seen = visible(posed.detach() + centres[b], centres[b], projection)
            given, made = scan, posed
            if projection.flat:
                given = in_image(scan, centres[b], projection)
                made = in_image(posed, centres[b], projection)
            apart = torch.cdist(given, made, compute_mode="donot_use_mm_for_euclid_dist")
            costs.append(apart.amin(1).mean() + beta * apart.amin(0)[seen].mean())
        cost, index = torch.stack(costs).min(0)
        total = total + cost
        winner.append(int(index))
    return total / len(shapes), winner
