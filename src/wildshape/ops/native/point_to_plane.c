/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What points say of the motion that takes them onto planes, in double precision, one pass over them.
 */
#include <stdint.h>
#include <string.h>

#include "vectors.h"

/* Add what one point says of the motion of its scan: `arm` from the turning point, `off` from its
 * plane's point, `kernel` its weight. Row (arm x normal, normal) along the normal and, `holding` as
 * heavy, such a row along each axis. */
static void add_point(const double *arm, const double *normal, const double *off, double kernel,
                      double holding, double (*A)[6], double *b)
{
    double row[6], pull[6];
    const double held = kernel * holding, square = dot(arm, arm), residual = dot(off, normal);
    cross(arm, normal, row);
    memcpy(row + 3, normal, 3 * sizeof *normal);
    cross(arm, off, pull);
    memcpy(pull + 3, off, 3 * sizeof *off);
    for (int i = 0; i < 6; i++) {
        const double weighted = kernel * row[i];
        b[i] += weighted * residual + held * pull[i];
        for (int j = i; j < 6; j++)
            A[i][j] += weighted * row[j];
    }
    for (int i = 0; i < 3; i++) {
        A[i][i] += held * square;
        A[3 + i][3 + i] += held;
        for (int j = i; j < 3; j++)
            A[i][j] -= held * arm[i] * arm[j];
    }
    const double across[3] = {held * arm[0], held * arm[1], held * arm[2]};
    A[0][4] -= across[2];
    A[0][5] += across[1];
    A[1][3] += across[2];
    A[1][5] -= across[0];
    A[2][3] -= across[1];
    A[2][4] += across[0];
}

/* A and b of a Gauss-Newton step, A x = -b, of each of `scans` scans of `count` points about its
 * `centre`, and the sum of its points' weights. Each point has a counterpart, a place in `onto` and
 * `normals`; its weight is Geman-McClure's, of such a width. Returns 0. */
int wildshape_point_to_plane(const float *points, const double *centre, int64_t scans,
                             int64_t count, const float *onto, const float *normals,
                             const int64_t *counterpart, double width, double holding, double *A,
                             double *b, double *weight)
{
    for (int64_t v = 0; v < scans; v++) {
        double(*own)[6] = (double(*)[6])(A + 36 * v), total = 0;
        memset(own, 0, 36 * sizeof *A);
        memset(b + 6 * v, 0, 6 * sizeof *b);
        for (int64_t n = v * count; n < (v + 1) * count; n++) {
            const float *point = points + 3 * n, *at = onto + 3 * counterpart[n];
            const float *across = normals + 3 * counterpart[n];
            double arm[3], off[3], normal[3];
            for (int i = 0; i < 3; i++) {
                arm[i] = (double)point[i] - centre[3 * v + i];
                off[i] = (double)point[i] - at[i];
                normal[i] = across[i];
            }
            const double inverse = 1 / (1 + dot(off, off) / (width * width));
            total += inverse * inverse;
            add_point(arm, normal, off, inverse * inverse, holding, own, b + 6 * v);
        }
        weight[v] = total;
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < i; j++)
                own[i][j] = own[j][i];
    }
    return 0;
}
