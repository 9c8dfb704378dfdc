/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Which points hang together over steps of at most a reach. Points are sorted along a Z-curve;
 * blocks whose boxes are apart are left out, as are blocks that are one part already.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "cloud.h"

typedef struct {
    cloud held;
    int32_t *parent; /* of each sorted point, towards the first of its part */
    uint8_t *whole;  /* of each block: it is one part */
    float *bound;
} parts;

static int32_t root(parts *of, int32_t at)
{
    while (of->parent[at] != at)
        at = of->parent[at] = of->parent[of->parent[at]];
    return at;
}

static void join(parts *of, int32_t a, int32_t b)
{
    a = root(of, a);
    b = root(of, b);
    if (a < b)
        of->parent[b] = a;
    else
        of->parent[a] = b;
}

static int is_whole(parts *of, int64_t block)
{
    const int32_t first = root(of, (int32_t)(block * BLOCK));
    for (int i = 1; !of->whole[block] && i < BLOCK; i++) {
        const int64_t at = block * BLOCK + i;
        if (at < of->held.count && root(of, (int32_t)at) != first)
            return 0;
    }
    return of->whole[block] = 1;
}

/* Squared gaps between the box of a block and those that follow it, itself too. */
static void bounds_after(const parts *of, int64_t block)
{
    const cloud *held = &of->held;
    float *restrict bound = of->bound;
    for (int64_t o = block; o < held->blocks; o++)
        bound[o] = 0;
    for (int c = 0; c < 3; c++) {
        const float *restrict low = held->low[c], *restrict high = held->high[c];
        const float from = low[block], to = high[block];
        for (int64_t o = block; o < held->blocks; o++) {
            float under = low[o] - to, over = from - high[o];
            float gap = under > over ? under : over;
            gap = gap > 0 ? gap : 0;
            bound[o] += gap * gap;
        }
    }
}

/* Join what is in reach between two blocks. */
static void join_blocks(parts *of, int64_t a, int64_t b, float reach_squared)
{
    const cloud *held = &of->held;
    const float *x = held->axes[0] + b * BLOCK, *y = held->axes[1] + b * BLOCK;
    const float *z = held->axes[2] + b * BLOCK;
    for (int64_t i = a * BLOCK; i < (a + 1) * BLOCK && i < held->count; i++) {
        const float px = held->axes[0][i], py = held->axes[1][i], pz = held->axes[2][i];
        float squared[BLOCK];
        for (int j = 0; j < BLOCK; j++) {
            const float dx = x[j] - px, dy = y[j] - py, dz = z[j] - pz;
            squared[j] = dx * dx + dy * dy + dz * dz;
        }
        for (int j = 0; j < BLOCK && b * BLOCK + j < held->count; j++)
            if (squared[j] <= reach_squared)
                join(of, (int32_t)i, (int32_t)(b * BLOCK + j));
    }
}

static void join_all(parts *of, float reach_squared)
{
    for (int64_t a = 0; a < of->held.blocks; a++) {
        bounds_after(of, a);
        for (int64_t b = a; b < of->held.blocks; b++) {
            if (!(of->bound[b] <= reach_squared))
                continue;
            const int32_t first = (int32_t)(a * BLOCK), other = (int32_t)(b * BLOCK);
            if (is_whole(of, a) && is_whole(of, b) && root(of, first) == root(of, other))
                continue;
            join_blocks(of, a, b, reach_squared);
        }
    }
}

/* A number for the part of each of `count` row-major points. Returns how many points were too many
 * or lacked memory: 0 or 1. A point that is not finite is a part by itself. */
int wildshape_connected(const float *points, int64_t count, float reach, int64_t *part)
{
    parts of = {0};
    if (count == 0)
        return 0;
    if (count > (int64_t)1 << 28)
        return 1;
    cloud_allocate(&of.held, count);
    of.parent = malloc((size_t)count * sizeof *of.parent);
    of.whole = calloc((size_t)in_blocks(count), 1);
    of.bound = malloc((size_t)in_blocks(count) * sizeof *of.bound);
    const int failed = !(of.held.axes[0] && of.parent && of.whole && of.bound);
    if (!failed) {
        cloud_fill(&of.held, points, count);
        for (int64_t i = 0; i < count; i++)
            of.parent[i] = (int32_t)i;
        join_all(&of, reach * reach);
        for (int64_t i = 0; i < count; i++)
            part[of.held.order[i]] = root(&of, (int32_t)i);
    }
    free(of.held.axes[0]);
    free(of.parent);
    free(of.whole);
    free(of.bound);
    return failed;
}
