/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Planes of neighbourhoods, one after the other, in double precision.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

/* LINE: squared, how far off a line a neighbourhood is at least that has a plane, of its size. */
static const double LINE = 1e-20, TURN = 2.0943951023931953; /* a third of a whole one */

/* Some vector across `row`. */
static void across(const double *row, double *out)
{
    int least = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(row[i]) < fabs(row[least]))
            least = i;
    const double unit[3] = {least == 0, least == 1, least == 2};
    cross(row, unit, out);
}

/* Unit eigenvector of the smallest eigenvalue of a symmetric matrix xx, xy, xz, yy, yz, zz: Smith
 * (1961). It lies across the rows of the matrix less the eigenvalue. These are shares of the
 * spread: a small cloud is as a large one. */
static void thinnest_axis(const double *m, double *axis)
{
    const double middle = (m[0] + m[3] + m[5]) / 3;
    double a = m[0] - middle, b = m[1], c = m[2], d = m[3] - middle, e = m[4], f = m[5] - middle;
    const double spread = sqrt((a * a + d * d + f * f + 2 * (b * b + c * c + e * e)) / 6);
    axis[0] = axis[1] = 0;
    axis[2] = 1;
    if (!(spread > 0))
        return;
    a /= spread, b /= spread, c /= spread, d /= spread, e /= spread, f /= spread;
    const double determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);
    const double least = 2 * cos(acos(fmin(fmax(determinant / 2, -1), 1)) / 3 + TURN);
    a -= least;
    d -= least;
    f -= least;
    const double rows[3][3] = {{a, b, c}, {b, d, e}, {c, e, f}}, *longest_row = rows[0];
    double longest = LINE;
    for (int k = 0; k < 3; k++) {
        double crossed[3];
        cross(rows[k == 2], rows[2 - (k == 0)], crossed);
        const double length = dot(crossed, crossed);
        if (length > longest) {
            longest = length;
            memcpy(axis, crossed, sizeof crossed);
        }
        if (dot(rows[k], rows[k]) > dot(longest_row, longest_row))
            longest_row = rows[k];
    }
    if (longest == LINE)
        across(longest_row, axis);
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
