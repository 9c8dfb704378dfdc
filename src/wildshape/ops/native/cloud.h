/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A cloud's points along a Z-curve, in blocks of points that lie close together, and each block's
 * box. Copies of the last point fill the last block; boxes past the last are out of reach.
 *
 * Points that are not finite are held as NaN and are in no box: they find nothing, nothing finds
 * them, and no difference of two bounds of boxes is ever inf - inf, which would be in reach of all.
 */
#pragma once
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

enum { BLOCK = 16, DIGIT = 256, DIGITS = 3, BYTES = 64 };

typedef struct {
    int64_t count, blocks;
    float *axes[3], *low[3], *high[3];
    int32_t *order; /* the place of each point among the caller's */
    uint32_t *spare;
} cloud;

static inline int64_t in_blocks(int64_t n) { return (n + BLOCK - 1) / BLOCK; }

/* How many of at most `most` points cloud `b` has; all where there are no sizes. */
static inline int64_t size_of(const int64_t *sizes, int64_t b, int64_t most)
{
    if (!sizes || sizes[b] > most)
        return most;
    return sizes[b] < 0 ? 0 : sizes[b];
}

/* Room for `most` points in one allocation, which begins at axes[0]; NULL there if there is none. */
static inline void cloud_allocate(cloud *made, int64_t most)
{
    int64_t points = in_blocks(most ? most : 1) * BLOCK, boxes = in_blocks(points / BLOCK) * BLOCK;
    float *at = aligned_alloc(BYTES, (size_t)(5 * points + 6 * boxes) * sizeof(float));
    for (int c = 0; c < 3; c++) {
        made->axes[c] = at ? at + c * points : NULL;
        made->low[c] = at ? at + 5 * points + 2 * c * boxes : NULL;
        made->high[c] = at ? at + 5 * points + (2 * c + 1) * boxes : NULL;
    }
    made->order = (int32_t *)(at ? at + 3 * points : NULL);
    made->spare = (uint32_t *)(at ? at + 4 * points : NULL);
}

/* Eight bits, two places apart. */
static inline uint32_t spread_bits(uint32_t v)
{
    v = (v | v << 8) & 0x00F00F;
    v = (v | v << 4) & 0x0C30C3;
    return (v | v << 2) & 0x249249;
}

/* 0 for a finite point, else NaN: added to its coordinates it makes all of them NaN. */
static inline float broken(const float *point)
{
    return (point[0] - point[0]) + (point[1] - point[1]) + (point[2] - point[2]);
}

/* Place of each point's cell on the Z-curve of a grid of 256 cells along the longest side. */
static inline void cloud_cells(const float *points, int64_t count, uint32_t *cell)
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t i = 0; i < count; i++) {
        const float gone = broken(points + 3 * i);
        for (int c = 0; c < 3; c++) {
            float v = points[3 * i + c] + gone;
            low[c] = v < low[c] ? v : low[c];
            high[c] = v > high[c] ? v : high[c];
        }
    }
    float side = 0;
    for (int c = 0; c < 3; c++)
        side = high[c] - low[c] > side ? high[c] - low[c] : side;
    const float scale = side > 0 ? 256 / side : 0;
    for (int64_t i = 0; i < count; i++) {
        cell[i] = 0;
        for (int c = 0; c < 3; c++) {
            float v = (points[3 * i + c] - low[c]) * scale;
            v = v > 0 ? v : 0; /* NaN too */
            cell[i] |= spread_bits((uint32_t)(v < 255 ? v : 255)) << c;
        }
    }
}

/* Sort cells and places by one digit of the cells; without `from_place` they are 0, 1, ... */
static inline void cloud_pass(int64_t count, uint32_t *start, int digit, const uint32_t *from,
                              const uint32_t *from_place, uint32_t *to, uint32_t *to_place)
{
    for (uint32_t k = 0, sum = 0; k < DIGIT; k++) {
        uint32_t here = start[k];
        start[k] = sum;
        sum += here;
    }
    for (int64_t i = 0; i < count; i++) {
        uint32_t at = start[from[i] >> 8 * digit & (DIGIT - 1)]++;
        to[at] = from[i];
        to_place[at] = from_place ? from_place[i] : (uint32_t)i;
    }
}

/* Fill `order`; equal cells keep the caller's order. The axes' room serves as scratch. */
static inline void cloud_sort(cloud *made, const float *points)
{
    uint32_t *a = (uint32_t *)made->axes[0], *b = (uint32_t *)made->axes[1];
    uint32_t *place = (uint32_t *)made->order, start[DIGITS][DIGIT] = {{0}};
    cloud_cells(points, made->count, a);
    for (int64_t i = 0; i < made->count; i++)
        for (int d = 0; d < DIGITS; d++)
            start[d][a[i] >> 8 * d & (DIGIT - 1)]++;
    cloud_pass(made->count, start[0], 0, a, NULL, b, place);
    cloud_pass(made->count, start[1], 1, b, place, a, made->spare);
    cloud_pass(made->count, start[2], 2, a, made->spare, b, place);
}

static inline void cloud_boxes(cloud *made)
{
    for (int c = 0; c < 3; c++)
        for (int64_t b = 0; b < in_blocks(made->blocks) * BLOCK; b++) {
            float low = INFINITY, high = -INFINITY;
            for (int k = 0; b < made->blocks && k < BLOCK; k++) {
                float v = made->axes[c][b * BLOCK + k];
                low = v < low ? v : low;
                high = v > high ? v : high;
            }
            made->low[c][b] = low;
            made->high[c][b] = high;
        }
}

/* Take in `count` row-major points, for which there must be room. */
static inline void cloud_fill(cloud *made, const float *points, int64_t count)
{
    made->count = count;
    made->blocks = in_blocks(count);
    cloud_sort(made, points);
    for (int64_t i = 0; i < made->blocks * BLOCK; i++) {
        made->order[i] = made->order[i < count ? i : count - 1];
        const float *point = points + 3 * (int64_t)made->order[i];
        const float gone = broken(point);
        for (int c = 0; c < 3; c++)
            made->axes[c][i] = point[c] + gone;
    }
    cloud_boxes(made);
}
