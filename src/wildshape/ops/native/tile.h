/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A tile of BLOCK queries and how far the boxes of a cloud are from it; included once for each
 * instruction set (`instruction_sets.h`). Queries lie in lanes.
 *
 * Bounds are made of the same rounded operations as distances, and rounding is monotone: no bound
 * exceeds a distance that it stands for, so nothing is lost where a block out of reach is left out.
 */

#define ROWS (BLOCK / LANES)
#define LENGTH(dx, dy, dz) FMA(dz, dz, FMA(dy, dy, MUL(dx, dx)))
#define GAP(low, high, from, to) MAX(MAX(SUB(low, to), SUB(from, high)), SET1(0.0f))

typedef struct {
    VECTOR x[ROWS], y[ROWS], z[ROWS], best[ROWS], block[ROWS], tied[ROWS];
} NAME(tile);

TARGET static inline NAME(tile) NAME(tile_of)(const cloud *queries, int64_t tile)
{
    NAME(tile) q;
    for (int r = 0; r < ROWS; r++) {
        const int64_t at = tile * BLOCK + r * LANES;
        q.x[r] = LOAD(queries->axes[0] + at);
        q.y[r] = LOAD(queries->axes[1] + at);
        q.z[r] = LOAD(queries->axes[2] + at);
        q.best[r] = SET1(INFINITY);
        q.block[r] = q.tied[r] = SET1(0.0f);
    }
    return q;
}

/* The farthest that any query of a tile has yet to look, finite. */
TARGET static inline float NAME(farthest)(const NAME(tile) *q)
{
    VECTOR most = q->best[0];
    for (int r = 1; r < ROWS; r++)
        most = MAX(q->best[r], most);
    const float limit = HIGHEST(most);
    return limit < FLT_MAX ? limit : FLT_MAX;
}

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

/* The queries, a bit each, that a block's box is in reach of. */
TARGET static inline unsigned NAME(in_reach)(const NAME(tile) *q, const cloud *targets, int64_t b)
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
        any |= BITS(AT_MOST(LENGTH(gx, gy, gz), q->best[r])) << r * LANES;
    }
    return any;
}
