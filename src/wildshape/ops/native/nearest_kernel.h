/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * One tile of queries against all targets of a cloud; included once for each instruction set.
 * The includer defines TILE_NAME, TARGET, VECTOR, LANES, ROWS (vectors in a tile) and LOAD STORE
 * SET1 SUB MUL FMA MIN EQUAL_MASK. Queries lie in lanes, targets are broadcast.
 *
 * First pass: the minimum of each block of BLOCK targets and the first block that holds the
 * minimum of all (no index bookkeeping in the inner loop). Second pass: the winning block alone
 * is computed again, in the same operations, to find the first target that attains the minimum.
 */

TARGET static void TILE_NAME(const float *restrict query, int count,
                             const float *restrict targets, int64_t padded,
                             float *restrict squared, int64_t *restrict index)
{
    enum { TILE = LANES * ROWS };
    const float *tx = targets, *ty = targets + padded, *tz = targets + 2 * padded;
    float axis[3][TILE] ALIGNED, found[TILE] ALIGNED, best[TILE] ALIGNED;
    int32_t block[TILE] ALIGNED;
    for (int k = 0; k < TILE; k++) {
        int from = 3 * (k < count ? k : count - 1);
        for (int c = 0; c < 3; c++)
            axis[c][k] = query[from + c];
        best[k] = INFINITY;
        block[k] = 0;
    }
    VECTOR x[ROWS], y[ROWS], z[ROWS];
    for (int r = 0; r < ROWS; r++) {
        x[r] = LOAD(axis[0] + r * LANES);
        y[r] = LOAD(axis[1] + r * LANES);
        z[r] = LOAD(axis[2] + r * LANES);
    }
    for (int64_t start = 0; start < padded; start += BLOCK) {
        VECTOR least[ROWS];
        for (int r = 0; r < ROWS; r++)
            least[r] = SET1(INFINITY);
        for (int64_t j = start; j < start + BLOCK; j++) {
            VECTOR px = SET1(tx[j]), py = SET1(ty[j]), pz = SET1(tz[j]);
            for (int r = 0; r < ROWS; r++) {
                VECTOR dx = SUB(x[r], px), dy = SUB(y[r], py), dz = SUB(z[r], pz);
                least[r] = MIN(FMA(dz, dz, FMA(dy, dy, MUL(dx, dx))), least[r]);
            }
        }
        for (int r = 0; r < ROWS; r++)
            STORE(found + r * LANES, least[r]);
        for (int k = 0; k < TILE; k++) {
            int closer = found[k] < best[k];
            best[k] = closer ? found[k] : best[k];
            block[k] = closer ? (int32_t)start : block[k];
        }
    }
    for (int k = 0; k < count; k++) {
        VECTOR qx = SET1(axis[0][k]), qy = SET1(axis[1][k]), qz = SET1(axis[2][k]);
        VECTOR wanted = SET1(best[k]);
        uint64_t mask = 0;
        for (int o = 0; o < BLOCK; o += LANES) {
            const int64_t j = block[k] + o;
            VECTOR dx = SUB(qx, LOAD(tx + j)), dy = SUB(qy, LOAD(ty + j)), dz = SUB(qz, LOAD(tz + j));
            VECTOR d = FMA(dz, dz, FMA(dy, dy, MUL(dx, dx)));
            mask |= (uint64_t)EQUAL_MASK(d, wanted) << o;
        }
        int reached = mask != 0 && best[k] < INFINITY;
        squared[k] = best[k];
        index[k] = reached ? block[k] + __builtin_ctzll(mask) : 0;
    }
}

#undef TILE_NAME
#undef TARGET
#undef VECTOR
#undef LANES
#undef ROWS
#undef LOAD
#undef STORE
#undef SET1
#undef SUB
#undef MUL
#undef FMA
#undef MIN
#undef EQUAL_MASK
