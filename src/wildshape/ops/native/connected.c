/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Which points hang together over steps of at most a reach. Points are sorted along a Z-curve;
 * blocks whose boxes are apart are left out, many at a time, as are blocks that are one part already.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "cloud.h"

typedef struct {
    float low[3], high[3];
} box;

typedef struct {
    cloud held;
    int32_t *parent; /* of each sorted point, towards the first of its part */
    uint8_t *whole;  /* of each block: it is one part */
    box *wide;       /* of each `BLOCK` blocks */
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

/* Whether two blocks are each one part. */
static int are_whole(parts *of, int64_t a, int64_t b)
{
    return is_whole(of, a) && is_whole(of, b);
}

/* Whether both are one and the same. */
static int are_one(parts *of, int64_t a, int64_t b)
{
    const int32_t first = (int32_t)(a * BLOCK), other = (int32_t)(b * BLOCK);
    return are_whole(of, a, b) && root(of, first) == root(of, other);
}

static box box_of(const cloud *held, int64_t block)
{
    box made;
    for (int c = 0; c < 3; c++) {
        made.low[c] = held->low[c][block];
        made.high[c] = held->high[c][block];
    }
    return made;
}

static void widen(parts *of)
{
    for (int64_t b = 0; b < of->held.blocks; b++) {
        const box one = box_of(&of->held, b);
        box *wide = of->wide + b / BLOCK;
        for (int c = 0; c < 3; c++) {
            if (b % BLOCK == 0 || one.low[c] < wide->low[c])
                wide->low[c] = one.low[c];
            if (b % BLOCK == 0 || one.high[c] > wide->high[c])
                wide->high[c] = one.high[c];
        }
    }
}

static float squared_gap(const box *a, const box *b)
{
    float sum = 0;
    for (int c = 0; c < 3; c++) {
        const float under = a->low[c] - b->high[c], over = b->low[c] - a->high[c];
        const float gap = under > over ? under : over;
        sum += gap > 0 ? gap * gap : 0;
    }
    return sum;
}

/* Join what is in reach between two blocks; one pair is enough where each is one part. */
static void join_blocks(parts *of, int64_t a, int64_t b, float reach_squared)
{
    const cloud *held = &of->held;
    const int whole = a != b && are_whole(of, a, b);
    const float *x = held->axes[0] + b * BLOCK, *y = held->axes[1] + b * BLOCK;
    const float *z = held->axes[2] + b * BLOCK;
    for (int64_t i = a * BLOCK; i < (a + 1) * BLOCK && i < held->count; i++) {
        const float px = held->axes[0][i], py = held->axes[1][i], pz = held->axes[2][i];
        float squared[BLOCK];
        int near = 0;
        for (int j = 0; j < BLOCK; j++) {
            const float dx = x[j] - px, dy = y[j] - py, dz = z[j] - pz;
            squared[j] = dx * dx + dy * dy + dz * dz;
            near |= squared[j] <= reach_squared;
        }
        for (int j = 0; near && j < BLOCK && b * BLOCK + j < held->count; j++) {
            const int32_t other = (int32_t)(b * BLOCK + j);
            if (!(squared[j] <= reach_squared) || of->parent[other] == of->parent[i])
                continue;
            join(of, (int32_t)i, other);
            if (whole)
                return;
        }
    }
}

/* Join a block with those that follow it. */
static void join_after(parts *of, int64_t a, float reach_squared)
{
    const box own = box_of(&of->held, a);
    for (int64_t b = a + 1; b < of->held.blocks; b++) {
        const box *wide = of->wide + b / BLOCK, other = box_of(&of->held, b);
        if (b % BLOCK == 0 && !(squared_gap(&own, wide) <= reach_squared))
            b += BLOCK - 1; /* none of them */
        else if (squared_gap(&own, &other) <= reach_squared && !are_one(of, a, b))
            join_blocks(of, a, b, reach_squared);
    }
}

static void join_all(parts *of, float reach_squared)
{
    widen(of);
    for (int64_t a = 0; a < of->held.blocks; a++)
        join_blocks(of, a, a, reach_squared);
    for (int64_t a = 0; a < of->held.blocks; a++)
        join_after(of, a, reach_squared);
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
    of.wide = malloc((size_t)in_blocks(in_blocks(count)) * sizeof *of.wide);
    const int failed = !(of.held.axes[0] && of.parent && of.whole && of.wide);
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
    free(of.wide);
    return failed;
}
