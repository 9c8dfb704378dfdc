/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * One tile of BLOCK queries against the targets of a cloud; included once for each instruction
 * set. The includer defines NAME(x), TARGET, VECTOR, MASK, LANES and LOAD STORE SET1 SUB MUL FMA
 * MIN MAX HIGHEST LESS AT_MOST SAME PICK BITS. Queries lie in lanes, targets are broadcast.
 *
 * A block of targets is left out where its box is farther from every query than what that has
 * found already. Bounds are made of the same rounded operations as distances, and rounding is
 * monotone: no bound exceeds a distance that it stands for, so nothing is lost, ties included.
 *
 * The inner loop keeps no index, only each query's minimum and the block that holds it; then that
 * block alone is computed again, in the same operations, to find the targets that attain it. Where
 * another block attained it too, all that are in reach are.
 */

#include "tile.h"

/* Search one block. */
TARGET static inline void NAME(visit)(NAME(tile) *q, const cloud *targets, int64_t b)
{
    const float *tx = targets->axes[0] + b * BLOCK, *ty = targets->axes[1] + b * BLOCK;
    const float *tz = targets->axes[2] + b * BLOCK;
    VECTOR least[ROWS];
    for (int r = 0; r < ROWS; r++)
        least[r] = SET1(INFINITY);
    for (int j = 0; j < BLOCK; j++) {
        VECTOR px = SET1(tx[j]), py = SET1(ty[j]), pz = SET1(tz[j]);
        for (int r = 0; r < ROWS; r++) {
            VECTOR dx = SUB(q->x[r], px), dy = SUB(q->y[r], py), dz = SUB(q->z[r], pz);
            least[r] = MIN(LENGTH(dx, dy, dz), least[r]);
        }
    }
    for (int r = 0; r < ROWS; r++) {
        MASK closer = LESS(least[r], q->best[r]), same = SAME(least[r], q->best[r]);
        q->tied[r] = PICK(closer, SET1(0.0f), PICK(same, SET1(1.0f), q->tied[r]));
        q->block[r] = PICK(closer, SET1((float)b), q->block[r]);
        q->best[r] = MIN(least[r], q->best[r]);
    }
}

/* Visit those of LANES blocks that are in reach, bar the seed: first which, then one by one, for a
 * wrongly predicted branch costs as much as a visit. A block infinitely far has nothing to give. */
TARGET static inline void NAME(visit_near)(NAME(tile) *q, const cloud *targets, int64_t start,
                                           const float *bound, int64_t seed)
{
    unsigned near = BITS(AT_MOST(LOAD(bound + start), SET1(NAME(farthest)(q))));
    unsigned left = 0;
    if (seed >= start && seed < start + LANES)
        near &= ~(1u << (seed - start));
    for (; near; near &= near - 1) {
        const int bit = __builtin_ctz(near);
        left |= (unsigned)(NAME(in_reach)(q, targets, start + bit) != 0) << bit;
    }
    for (; left; left &= left - 1)
        NAME(visit)(q, targets, start + __builtin_ctz(left));
}

/* The smallest place of a target in the block that lies `wanted` from a point, or `first`. */
TARGET static inline int32_t NAME(first)(const cloud *targets, int64_t b, const VECTOR at[3],
                                         VECTOR wanted, int32_t first)
{
    const float *tx = targets->axes[0] + b * BLOCK, *ty = targets->axes[1] + b * BLOCK;
    const float *tz = targets->axes[2] + b * BLOCK;
    uint64_t attained = 0;
    for (int o = 0; o < BLOCK; o += LANES) {
        VECTOR dx = SUB(at[0], LOAD(tx + o)), dy = SUB(at[1], LOAD(ty + o));
        VECTOR dz = SUB(at[2], LOAD(tz + o));
        attained |= (uint64_t)BITS(SAME(LENGTH(dx, dy, dz), wanted)) << o;
    }
    for (; attained; attained &= attained - 1) {
        int32_t place = targets->order[b * BLOCK + __builtin_ctzll(attained)];
        first = place < first ? place : first;
    }
    return first;
}

/* Nearest targets of a tile of queries, written at the queries' own places. `bound` has room for a
 * float a box of the targets, of which there is at least one. */
TARGET static void NAME(search)(const cloud *queries, int64_t tile, const cloud *targets,
                                float *restrict bound, float *restrict squared,
                                int64_t *restrict index)
{
    const float *qx = queries->axes[0] + tile * BLOCK, *qy = queries->axes[1] + tile * BLOCK;
    const float *qz = queries->axes[2] + tile * BLOCK;
    const int64_t blocks = targets->blocks;
    NAME(tile) q = NAME(tile_of)(queries, tile);
    NAME(bounds)(queries, tile, targets, bound);
    const int64_t seed = NAME(nearest_block)(bound, blocks);
    NAME(visit)(&q, targets, seed);
    for (int64_t k = 0; k < blocks; k += LANES)
        NAME(visit_near)(&q, targets, k, bound, seed);
    float best[BLOCK] ALIGNED, block[BLOCK] ALIGNED, tied[BLOCK] ALIGNED;
    for (int r = 0; r < ROWS; r++) {
        STORE(best + r * LANES, q.best[r]);
        STORE(block + r * LANES, q.block[r]);
        STORE(tied + r * LANES, q.tied[r]);
    }
    for (int k = 0; k < BLOCK; k++) {
        const int32_t to = queries->order[tile * BLOCK + k];
        VECTOR at[3] = {SET1(qx[k]), SET1(qy[k]), SET1(qz[k])}, wanted = SET1(best[k]);
        int32_t first = NAME(first)(targets, (int64_t)block[k], at, wanted, INT32_MAX);
        for (int64_t j = 0; tied[k] > 0 && best[k] < INFINITY && j < blocks; j += LANES)
            for (unsigned near = BITS(AT_MOST(LOAD(bound + j), wanted)); near; near &= near - 1)
                first = NAME(first)(targets, j + __builtin_ctz(near), at, wanted, first);
        squared[to] = best[k];
        index[to] = best[k] < INFINITY ? first : 0;
    }
}
