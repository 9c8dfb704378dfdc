# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The metrics of METHOD 8 once more: plain Python, loops and quaternions, nothing shared."""

import math
import statistics


def one_way(source, target):
    """Mean distance from each point of `source` to the nearest of `target`."""
    total = 0.0
    for p in source:
        best = math.inf
        for q in target:
            square = 0.0
            for a, b in zip(p, q, strict=True):
                square += (a - b) ** 2
            best = min(best, math.sqrt(square))
        total += best
    return total / len(source)


def quaternion(m):
    """Of a rotation matrix, rows in lists; by its largest component (Shepperd 1978)."""
    trace = m[0][0] + m[1][1] + m[2][2]
    sizes = [trace, m[0][0], m[1][1], m[2][2]]
    big = sizes.index(max(sizes))
    if big == 0:
        q = [1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    else:
        i = big - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = [m[k][j] - m[j][k], 0.0, 0.0, 0.0]
        q[1 + i] = 1 + m[i][i] - m[j][j] - m[k][k]
        q[1 + j] = m[j][i] + m[i][j]
        q[1 + k] = m[k][i] + m[i][k]
    length = math.sqrt(sum(c * c for c in q))
    return [c / length for c in q]


def product(a, b):
    """Hamilton's product of two quaternions."""
    w, x, y, z = a
    W, X, Y, Z = b
    return [
        w * W - x * X - y * Y - z * Z,
        w * X + x * W + y * Z - z * Y,
        w * Y - x * Z + y * W + z * X,
        w * Z + x * Y - y * X + z * W,
    ]


def conjugate(q):
    return [q[0], -q[1], -q[2], -q[3]]


def turned(q, p):
    return product(product(q, [0.0, *p]), conjugate(q))[1:]


def angle_deg(a, b):
    """`2 acos |<a, b>|`, by the sine where the cosine has no digits."""
    dot = abs(sum(x * y for x, y in zip(a, b, strict=True)))
    difference = product(a, conjugate(b))
    return math.degrees(2 * math.atan2(math.hypot(*difference[1:]), dot))


def registration(predicted, pose, middle):
    """Angle, symmetric angle and translation error of one scan.

    Each argument is (quaternion, translation): `T_middle_scan` as predicted, then the true
    `T_scan_object` and `T_middle_object`.
    """
    q, t = predicted
    true = product(middle[0], conjugate(pose[0]))
    # The object turned by half about its own z before it is carried to the middle scan.
    half = product(product(middle[0], [0.0, 0.0, 0.0, 1.0]), conjugate(pose[0]))
    plain, other = angle_deg(q, true), angle_deg(q, half)
    origin = [a + b for a, b in zip(turned(q, pose[1]), t, strict=True)]
    return plain, min(plain, other), math.dist(origin, middle[1])


def accuracy(angles):
    """Share within 30 degrees."""
    return sum(1 for angle in angles if angle <= 30) / len(angles)


median, mean = statistics.median, statistics.fmean


def deviation(values):
    """Sample standard deviation."""
    centre = mean(values)
    return math.sqrt(sum((v - centre) ** 2 for v in values) / (len(values) - 1))
