/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Row of the maximum of each column of a row-major matrix, in one pass. Columns are taken in
 * blocks whose running maxima stay in the first cache; the compiler vectorises over them.
 */
#include <math.h>
#include <stdint.h>

enum { COLUMNS = 256 };

int wildshape_level(void);

static inline __attribute__((always_inline)) void
scan_block(const float *restrict values, int64_t rows, int64_t stride, int width,
           int64_t *restrict row)
{
    float best[COLUMNS];
    int32_t at[COLUMNS], broken[COLUMNS];
    for (int k = 0; k < width; k++) {
        best[k] = -INFINITY;
        at[k] = broken[k] = 0;
    }
    for (int64_t i = 0; i < rows; i++) {
        const float *restrict v = values + i * stride;
        for (int k = 0; k < width; k++) {
            at[k] = v[k] > best[k] ? (int32_t)i : at[k];
            best[k] = v[k] > best[k] ? v[k] : best[k];
            broken[k] |= v[k] != v[k];
        }
    }
    for (int k = 0; k < width; k++)
        row[k] = broken[k] ? rows - 1 : at[k];
}

static void scan_portable(const float *values, int64_t rows, int64_t stride, int width,
                          int64_t *row)
{
    scan_block(values, rows, stride, width, row);
}

#if defined(__x86_64__) || defined(_M_X64)
__attribute__((target("avx2"))) static void scan_avx2(const float *values, int64_t rows,
                                                      int64_t stride, int width, int64_t *row)
{
    scan_block(values, rows, stride, width, row);
}
#endif

/* First row of each column's maximum; the last row where the column holds a NaN. `rows` is at
 * least 1 and below 2^31. level: 0 portable, above that the widest there is (-1 too). */
void wildshape_column_argmax(const float *values, int64_t rows, int64_t columns, int64_t *row,
                             int level)
{
    void (*scan)(const float *, int64_t, int64_t, int, int64_t *) = scan_portable;
#if defined(__x86_64__) || defined(_M_X64)
    if (level != 0 && wildshape_level() >= 1)
        scan = scan_avx2;
#endif
    for (int64_t start = 0; start < columns; start += COLUMNS) {
        int64_t left = columns - start;
        scan(values + start, rows, columns, (int)(left < COLUMNS ? left : COLUMNS), row + start);
    }
}
