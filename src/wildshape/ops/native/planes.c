/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Planes of neighbourhoods, one after the other, in double precision.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

static const double TINY = 1e-30, TURN = 2.0943951023931953; /* a third of a whole one */

/* Unit eigenvector of the smallest eigenvalue of a symmetric matrix xx, xy, xz, yy, yz, zz: Smith
 * (1961). It lies across the rows of the matrix less the eigenvalue. */
static void thinnest_axis(const double *m, double *axis)
{
    const double middle = (m[0] + m[3] + m[5]) / 3, b = m[1], c = m[2], e = m[4];
    double a = m[0] - middle, d = m[3] - middle, f = m[5] - middle;
    double spread = (a * a + d * d + f * f + 2 * (b * b + c * c + e * e)) / 6;
    spread = sqrt(spread > TINY ? spread : TINY);
    const double determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);
    const double cosine = determinant / (2 * spread * spread * spread);
    const double least = 2 * spread * cos(acos(fmin(fmax(cosine, -1), 1)) / 3 + TURN);
    a -= least;
    d -= least;
    f -= least;
    const double rows[3][3] = {{a, b, c}, {b, d, e}, {c, e, f}};
    double longest = TINY;
    axis[0] = axis[1] = 0;
    axis[2] = 1;
    for (int k = 0; k < 3; k++) {
        double crossed[3];
        cross(rows[k == 2], rows[2 - (k == 0)], crossed);
        const double length = dot(crossed, crossed);
        if (length > longest) {
            longest = length;
            memcpy(axis, crossed, sizeof crossed);
        }
    }
    const double length = sqrt(dot(axis, axis));
    for (int i = 0; i < 3; i++)
        axis[i] /= length;
}

/* The middle of each of `count` neighbourhoods of a cloud, `k` points each, and the unit normal of
 * the plane through it. Returns 0. */
int wildshape_planes(const double *points, const int64_t *around, int64_t count, int64_t k,
                     double *middle, double *normal)
{
    for (int64_t n = 0; n < count; n++) {
        const int64_t *own = around + n * k;
        const double *first = points + 3 * own[0];
        double sum[3] = {0}, spread[6] = {0};
        for (int64_t j = 1; j < k; j++) {
            const double *at = points + 3 * own[j];
            const double x = at[0] - first[0], y = at[1] - first[1], z = at[2] - first[2];
            sum[0] += x;
            sum[1] += y;
            sum[2] += z;
            spread[0] += x * x;
            spread[1] += x * y;
            spread[2] += x * z;
            spread[3] += y * y;
            spread[4] += y * z;
            spread[5] += z * z;
        }
        for (int i = 0, at = 0; i < 3; i++) {
            middle[3 * n + i] = first[i] + sum[i] / (double)k;
            for (int j = i; j < 3; j++)
                spread[at++] -= sum[i] * sum[j] / (double)k;
        }
        thinnest_axis(spread, normal + 3 * n);
    }
    return 0;
}
