/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Products of vectors of three numbers.
 */
#pragma once

static inline void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
