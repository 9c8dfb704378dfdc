/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The k nearest targets of one tile of BLOCK queries; included once for each instruction set
 * (`instruction_sets.h`). Targets lie in lanes, one query after the other.
 *
 * What a query has found is kept as keys, smallest first: the squared distance's bits above the
 * target's place. Distances are not negative, so keys are ordered as distances are, then by place.
 */

#include "tile.h"

/* Search one block for the queries whose bits are set, and look less far for those that found. */
TARGET static inline void NAME(visit_k)(NAME(tile) *q, const cloud *queries, int64_t tile,
                                        const cloud *targets, int64_t b, unsigned wanting,
                                        const k_search *search, uint64_t *keys)
{
    const int64_t start = b * BLOCK, left = targets->count - start;
    const unsigned real = left < BLOCK ? (1u << left) - 1 : (1u << BLOCK) - 1;
    const int k = search->k;
    float squared[BLOCK] ALIGNED, best[BLOCK] ALIGNED;
    for (int r = 0; r < ROWS; r++)
        STORE(best + r * LANES, q->best[r]);
    for (; wanting; wanting &= wanting - 1) {
        const int i = __builtin_ctz(wanting);
        const int64_t at = tile * BLOCK + i;
        const VECTOR x = SET1(queries->axes[0][at]), y = SET1(queries->axes[1][at]);
        const VECTOR z = SET1(queries->axes[2][at]), limit = SET1(best[i]);
        uint64_t *own = keys + i * k;
        unsigned near = 0;
        for (int o = 0; o < BLOCK; o += LANES) {
            VECTOR dx = SUB(x, LOAD(targets->axes[0] + start + o));
            VECTOR dy = SUB(y, LOAD(targets->axes[1] + start + o));
            VECTOR dz = SUB(z, LOAD(targets->axes[2] + start + o));
            VECTOR here = LENGTH(dx, dy, dz);
            STORE(squared + o, here);
            near |= BITS(AT_MOST(here, limit)) << o;
        }
        for (near &= real; near; near &= near - 1) {
            const int j = __builtin_ctz(near);
            const int32_t place = targets->order[start + j];
            const uint64_t key = key_of(squared[j], place);
            if (key < own[k - 1] && apart(search, queries->order[at], place))
                insert_key(own, k, key);
        }
        best[i] = distance_of(own[k - 1]);
    }
    for (int r = 0; r < ROWS; r++)
        q->best[r] = LOAD(best + r * LANES);
}

/* The keys of a tile of queries. `bound` has room for a float a box of the targets, of which there
 * is at least one; `keys` for k a query. */
TARGET static void NAME(search_k)(const cloud *queries, int64_t tile, const cloud *targets,
                                  const k_search *search, float *restrict bound,
                                  uint64_t *restrict keys)
{
    NAME(tile) q = NAME(tile_of)(queries, tile);
    for (int r = 0; r < ROWS; r++)
        q.best[r] = SET1(search->most);
    for (int i = 0; i < BLOCK * search->k; i++)
        keys[i] = key_of(search->most, -1);
    NAME(bounds)(queries, tile, targets, bound);
    if (search->query_group)
        leave_out_own(search, queries, tile, targets, bound);
    /* Near blocks first, so that the others are mostly out of reach. */
    for (int first = 0; first < FIRST || NAME(farthest)(&q) == FLT_MAX; first++) {
        const int64_t b = NAME(nearest_block)(bound, targets->blocks);
        if (!(bound[b] <= NAME(farthest)(&q)))
            break;
        bound[b] = INFINITY;
        NAME(visit_k)(&q, queries, tile, targets, b, NAME(in_reach)(&q, targets, b), search, keys);
    }
    for (int64_t start = 0; start < targets->blocks; start += LANES) {
        unsigned near = BITS(AT_MOST(LOAD(bound + start), SET1(NAME(farthest)(&q))));
        for (; near; near &= near - 1) {
            const int64_t b = start + __builtin_ctz(near);
            const unsigned wanting = NAME(in_reach)(&q, targets, b);
            if (wanting)
                NAME(visit_k)(&q, queries, tile, targets, b, wanting, search, keys);
        }
    }
}
