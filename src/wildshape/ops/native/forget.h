/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What `instruction_sets.h` and `tile.h` have defined, taken back for the next instruction set.
 */
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
