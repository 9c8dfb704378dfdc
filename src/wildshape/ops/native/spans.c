/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * How far points reach along level directions, point by point, all directions at once.
 */
#include <math.h>
#include <stdint.h>

/* The least and the greatest coordinate of `count` row-major points along each of `many` directions,
 * all x before all y. Returns 0. */
int wildshape_spans(const float *points, int64_t count, const double *directions, int64_t many,
                    double *restrict least, double *restrict most)
{
    const double *ahead = directions, *aside = directions + many;
    for (int64_t k = 0; k < many; k++) {
        least[k] = INFINITY;
        most[k] = -INFINITY;
    }
    for (int64_t i = 0; i < count; i++) {
        const double x = points[3 * i], y = points[3 * i + 1];
        for (int64_t k = 0; k < many; k++) {
            const double along = ahead[k] * x + aside[k] * y;
            least[k] = along < least[k] ? along : least[k];
            most[k] = along > most[k] ? along : most[k];
        }
    }
    return 0;
}
