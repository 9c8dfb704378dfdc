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

#define ROWS (BLOCK / LANES)
#define LENGTH(dx, dy, dz) FMA(dz, dz, FMA(dy, dy, MUL(dx, dx)))
#define GAP(low, high, from, to) MAX(MAX(SUB(low, to), SUB(from, high)), SET1(0.0f))

typedef struct {
    VECTOR x[ROWS], y[ROWS], z[ROWS], best[ROWS], block[ROWS], tied[ROWS];
} NAME(tile);

/* Squared distance of a tile's box to each block's box. */
TARGET static inline void NAME(bounds)(const cloud *queries, int64_t tile, const cloud *targets,
                                       float *bound)
{
    VECTOR low[3], high[3];
    for (int c = 0; c < 3; c++) {
        low[c] = SET1(queries->low[c][tile]);
        high[c] = SET1(queries->high[c][tile]);
    }
    for (int64_t k = 0; k < targets->blocks; k += LANES) {
        VECTOR gap[3];
        for (int c = 0; c < 3; c++)
            gap[c] = GAP(LOAD(targets->low[c] + k), LOAD(targets->high[c] + k), low[c], high[c]);
        STORE(bound + k, LENGTH(gap[0], gap[1], gap[2]));
    }
}

/* The block of the smallest bound. */
TARGET static inline int64_t NAME(nearest_block)(const float *bound, int64_t blocks)
{
    float starts[LANES] ALIGNED;
    VECTOR least = SET1(INFINITY), start = SET1(0.0f);
    for (int64_t k = 0; k < blocks; k += LANES) {
        VECTOR here = LOAD(bound + k);
        start = PICK(LESS(here, least), SET1((float)k), start);
        least = MIN(here, least);
    }
    float lowest = -HIGHEST(SUB(SET1(0.0f), least));
    int lane = __builtin_ctz(BITS(SAME(least, SET1(lowest))));
    STORE(starts, start);
    return (int64_t)starts[lane] + lane;
}

/* Whether a block's box is in reach of any query. */
TARGET static inline int NAME(in_reach)(const NAME(tile) *q, const cloud *targets, int64_t b)
{
    VECTOR low[3], high[3];
    unsigned any = 0;
    for (int c = 0; c < 3; c++) {
        low[c] = SET1(targets->low[c][b]);
        high[c] = SET1(targets->high[c][b]);
    }
    for (int r = 0; r < ROWS; r++) {
        VECTOR gx = GAP(low[0], high[0], q->x[r], q->x[r]);
        VECTOR gy = GAP(low[1], high[1], q->y[r], q->y[r]);
        VECTOR gz = GAP(low[2], high[2], q->z[r], q->z[r]);
        any |= BITS(AT_MOST(LENGTH(gx, gy, gz), q->best[r]));
    }
    return any != 0;
}

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
    VECTOR most = q->best[0];
    for (int r = 1; r < ROWS; r++)
        most = MAX(q->best[r], most);
    const float limit = HIGHEST(most);
    unsigned near = BITS(AT_MOST(LOAD(bound + start), SET1(limit < FLT_MAX ? limit : FLT_MAX)));
    unsigned left = 0;
    if (seed >= start && seed < start + LANES)
        near &= ~(1u << (seed - start));
    for (; near; near &= near - 1) {
        const int bit = __builtin_ctz(near);
        left |= (unsigned)NAME(in_reach)(q, targets, start + bit) << bit;
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
    NAME(tile) q;
    for (int r = 0; r < ROWS; r++) {
        q.x[r] = LOAD(qx + r * LANES);
        q.y[r] = LOAD(qy + r * LANES);
        q.z[r] = LOAD(qz + r * LANES);
        q.best[r] = SET1(INFINITY);
        q.block[r] = q.tied[r] = SET1(0.0f);
    }
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

#undef LENGTH
#undef GAP
#undef NAME
#undef TARGET
#undef VECTOR
#undef MASK
#undef LANES
#undef ROWS
#undef LOAD
#undef STORE
#undef SET1
#undef SUB
#undef MUL
#undef FMA
#undef MIN
#undef MAX
#undef HIGHEST
#undef LESS
#undef AT_MOST
#undef SAME
#undef PICK
#undef BITS
