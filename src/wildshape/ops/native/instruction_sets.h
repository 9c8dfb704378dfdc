/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Vectors of each instruction set under one set of names; the file that KERNEL names is included
 * once for each. It finds NAME(x), TARGET, VECTOR, MASK, LANES and LOAD STORE SET1 SUB MUL FMA MIN
 * MAX HIGHEST LESS AT_MOST SAME PICK BITS.
 */
#include <stdint.h>
#include <string.h>

#define ALIGNED __attribute__((aligned(64)))

/* ---- portable: vectors of four, by the compiler's own means (SSE2, NEON, ...) ---- */

typedef float four __attribute__((vector_size(16)));
typedef int32_t four_bits __attribute__((vector_size(16)));

static inline four four_load(const float *p)
{
    four v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline void four_store(float *p, four v) { memcpy(p, &v, sizeof v); }
static inline four four_pick(four_bits mask, four yes, four no)
{
    return (four)(((four_bits)yes & mask) | ((four_bits)no & ~mask));
}
static inline float four_highest(four v)
{
    float a = v[0] > v[1] ? v[0] : v[1], b = v[2] > v[3] ? v[2] : v[3];
    return a > b ? a : b;
}
static inline unsigned four_flags(four_bits mask)
{
    four_bits bits = mask & (four_bits){1, 2, 4, 8};
    return (unsigned)(bits[0] | bits[1] | bits[2] | bits[3]);
}

#define NAME(x) portable_##x
#define TARGET
#define VECTOR four
#define MASK four_bits
#define LANES 4
#define LOAD(p) four_load(p)
#define STORE(p, v) four_store(p, v)
#define SET1(s) ((four){(s), (s), (s), (s)})
#define SUB(a, b) ((a) - (b))
#define MUL(a, b) ((a) * (b))
#define FMA(a, b, c) ((a) * (b) + (c))
#define MIN(a, b) four_pick((a) < (b), a, b)
#define MAX(a, b) four_pick((a) > (b), a, b)
#define HIGHEST(v) four_highest(v)
#define LESS(a, b) ((a) < (b))
#define AT_MOST(a, b) ((a) <= (b))
#define SAME(a, b) ((a) == (b))
#define PICK(mask, yes, no) four_pick(mask, yes, no)
#define BITS(mask) four_flags(mask)
#include KERNEL
#include "forget.h"

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>

__attribute__((target("avx2"))) static inline float eight_highest(__m256 v)
{
    __m128 a = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
    a = _mm_max_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_max_ss(a, _mm_movehdup_ps(a)));
}

#define NAME(x) avx2_##x
#define TARGET __attribute__((target("avx2,fma")))
#define VECTOR __m256
#define MASK __m256
#define LANES 8
#define LOAD(p) _mm256_load_ps(p)
#define STORE(p, v) _mm256_store_ps(p, v)
#define SET1(s) _mm256_set1_ps(s)
#define SUB(a, b) _mm256_sub_ps(a, b)
#define MUL(a, b) _mm256_mul_ps(a, b)
#define FMA(a, b, c) _mm256_fmadd_ps(a, b, c)
#define MIN(a, b) _mm256_min_ps(a, b)
#define MAX(a, b) _mm256_max_ps(a, b)
#define HIGHEST(v) eight_highest(v)
#define LESS(a, b) _mm256_cmp_ps(a, b, _CMP_LT_OQ)
#define AT_MOST(a, b) _mm256_cmp_ps(a, b, _CMP_LE_OQ)
#define SAME(a, b) _mm256_cmp_ps(a, b, _CMP_EQ_OQ)
#define PICK(mask, yes, no) _mm256_blendv_ps(no, yes, mask)
#define BITS(mask) (unsigned)_mm256_movemask_ps(mask)
#include KERNEL
#include "forget.h"

#define NAME(x) avx512_##x
#define TARGET __attribute__((target("avx512f")))
#define VECTOR __m512
#define MASK __mmask16
#define LANES 16
#define LOAD(p) _mm512_load_ps(p)
#define STORE(p, v) _mm512_store_ps(p, v)
#define SET1(s) _mm512_set1_ps(s)
#define SUB(a, b) _mm512_sub_ps(a, b)
#define MUL(a, b) _mm512_mul_ps(a, b)
#define FMA(a, b, c) _mm512_fmadd_ps(a, b, c)
#define MIN(a, b) _mm512_min_ps(a, b)
#define MAX(a, b) _mm512_max_ps(a, b)
#define HIGHEST(v) _mm512_reduce_max_ps(v)
#define LESS(a, b) _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ)
#define AT_MOST(a, b) _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ)
#define SAME(a, b) _mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ)
#define PICK(mask, yes, no) _mm512_mask_blend_ps(mask, no, yes)
#define BITS(mask) (unsigned)(mask)
#include KERNEL
#include "forget.h"

#define OF_LEVEL(name, n) ((n) == 2 ? avx512_##name : (n) == 1 ? avx2_##name : portable_##name)
#else
#define OF_LEVEL(name, n) portable_##name
#endif

/* The widest level of this processor: 0 portable, 1 AVX2 + FMA, 2 AVX-512. */
int wildshape_level(void);

/* A level that this processor has; -1 asks for the widest. */
static inline int known_level(int level)
{
    const int widest = wildshape_level();
    return level < 0 || level > widest ? widest : level;
}
