/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exact nearest neighbours of small clouds by brute force, plain C ABI, no array of N x M.
 * Clouds are row-major float32 (N, 3) at any stride between clouds.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "workers.h"

#define ALIGNED __attribute__((aligned(64)))
enum { BLOCK = 64, PART = 256 };

/* ---- portable: vectors of four, by the compiler's own means (SSE2, NEON, ...) ---- */

typedef float four __attribute__((vector_size(16)));
typedef int32_t four_bits __attribute__((vector_size(16)));

static inline four four_load(const float *p)
{
    four v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline four four_min(four a, four b)
{
    four_bits less = a < b;
    return (four)(((four_bits)a & less) | ((four_bits)b & ~less));
}
static inline unsigned four_equal(four a, four b)
{
    four_bits bits = (a == b) & (four_bits){1, 2, 4, 8};
    return (unsigned)(bits[0] | bits[1] | bits[2] | bits[3]);
}

#define TILE_NAME tile_portable
#define TARGET
#define VECTOR four
#define LANES 4
#define ROWS 2
#define LOAD(p) four_load(p)
#define STORE(p, v) memcpy(p, &(v), sizeof(four))
#define SET1(s) ((four){(s), (s), (s), (s)})
#define SUB(a, b) ((a) - (b))
#define MUL(a, b) ((a) * (b))
#define FMA(a, b, c) ((a) * (b) + (c))
#define MIN(a, b) four_min(a, b)
#define EQUAL_MASK(a, b) four_equal(a, b)
#include "nearest_kernel.h"

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>

#define TILE_NAME tile_avx2
#define TARGET __attribute__((target("avx2,fma")))
#define VECTOR __m256
#define LANES 8
#define ROWS 2
#define LOAD(p) _mm256_load_ps(p)
#define STORE(p, v) _mm256_store_ps(p, v)
#define SET1(s) _mm256_set1_ps(s)
#define SUB(a, b) _mm256_sub_ps(a, b)
#define MUL(a, b) _mm256_mul_ps(a, b)
#define FMA(a, b, c) _mm256_fmadd_ps(a, b, c)
#define MIN(a, b) _mm256_min_ps(a, b)
#define EQUAL_MASK(a, b) (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_EQ_OQ))
#include "nearest_kernel.h"

#define TILE_NAME tile_avx512
#define TARGET __attribute__((target("avx512f")))
#define VECTOR __m512
#define LANES 16
#define ROWS 4
#define LOAD(p) _mm512_load_ps(p)
#define STORE(p, v) _mm512_store_ps(p, v)
#define SET1(s) _mm512_set1_ps(s)
#define SUB(a, b) _mm512_sub_ps(a, b)
#define MUL(a, b) _mm512_mul_ps(a, b)
#define FMA(a, b, c) _mm512_fmadd_ps(a, b, c)
#define MIN(a, b) _mm512_min_ps(a, b)
#define EQUAL_MASK(a, b) (unsigned)_mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ)
#include "nearest_kernel.h"
#endif

/* ---- dispatch ---- */

typedef void (*tile_function)(const float *, int, const float *, int64_t, float *, int64_t *);
enum { PORTABLE = 0, AVX2 = 1, AVX512 = 2 };

/* The widest instruction set of this processor: 0 portable, 1 AVX2 + FMA, 2 AVX-512. */
int wildshape_level(void)
{
#if defined(__x86_64__) || defined(_M_X64)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f"))
        return AVX512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return AVX2;
#endif
    return PORTABLE;
}

static tile_function choose(int level, int *tile)
{
    int widest = wildshape_level();
    if (level < 0 || level > widest)
        level = widest;
#if defined(__x86_64__) || defined(_M_X64)
    if (level == AVX512)
        return *tile = 64, tile_avx512;
    if (level == AVX2)
        return *tile = 16, tile_avx2;
#endif
    return *tile = 8, tile_portable;
}

/* ---- work sharing ---- */

typedef struct {
    const float *query, *target;
    int64_t query_stride, target_stride;
    const int64_t *query_sizes, *target_sizes;
    int64_t clouds, queries, targets, parts;
    float *squared;
    int64_t *index;
    tile_function tile_of;
    int tile, failed;
    int64_t counter;
} search_job;

static int64_t clamp_size(const int64_t *sizes, int64_t b, int64_t most)
{
    if (!sizes || sizes[b] > most)
        return most;
    return sizes[b] < 0 ? 0 : sizes[b];
}

/* Row-major targets to three aligned axes, padded to whole blocks with points out of reach. */
static void spread(const float *points, int64_t count, int64_t padded, float *axes)
{
    for (int64_t j = 0; j < count; j++)
        for (int c = 0; c < 3; c++)
            axes[c * padded + j] = points[3 * j + c];
    for (int c = 0; c < 3; c++)
        for (int64_t j = count; j < padded; j++)
            axes[c * padded + j] = INFINITY;
}

static void search_part(const search_job *job, int64_t b, int64_t start, int64_t stop,
                        const float *axes, int64_t padded)
{
    const float *query = job->query + b * job->query_stride;
    float *squared = job->squared + b * job->queries;
    int64_t *index = job->index + b * job->queries;
    int64_t size = clamp_size(job->query_sizes, b, job->queries);
    int64_t i = start;
    for (; i < stop && i < size; i += job->tile) {
        int64_t end = stop < size ? stop : size, left = end - i;
        int count = (int)(left < job->tile ? left : job->tile);
        job->tile_of(query + 3 * i, count, axes, padded, squared + i, index + i);
    }
    for (i = start > size ? start : size; i < stop; i++) {
        squared[i] = 0.0f;
        index[i] = 0;
    }
}

static void *search_worker(void *argument)
{
    search_job *job = argument;
    int64_t room = (job->targets + BLOCK - 1) / BLOCK * BLOCK, at = -1, padded = 0;
    float *axes = aligned_alloc(64, (size_t)(room ? room : BLOCK) * 3 * sizeof(float));
    if (!axes) {
        __atomic_store_n(&job->failed, 1, __ATOMIC_RELAXED);
        return NULL;
    }
    for (;;) {
        int64_t task = next_task(&job->counter), b = task / job->parts, part = task % job->parts;
        if (task >= job->clouds * job->parts)
            break;
        if (b != at) {
            int64_t count = clamp_size(job->target_sizes, b, job->targets);
            padded = (count + BLOCK - 1) / BLOCK * BLOCK;
            spread(job->target + b * job->target_stride, count, padded, axes);
            at = b;
        }
        int64_t start = job->parts == 1 ? 0 : part * PART;
        int64_t stop = job->parts == 1 || start + PART > job->queries ? job->queries : start + PART;
        search_part(job, b, start, stop, axes, padded);
    }
    free(axes);
    return NULL;
}

/* Nearest target of each query; sizes may be NULL; strides count floats between clouds.
 * level: instruction set (-1: the widest). Returns 0, or 1 if memory ran out. */
int wildshape_nearest(const float *query, int64_t query_stride, const int64_t *query_sizes,
                      const float *target, int64_t target_stride, const int64_t *target_sizes,
                      int64_t clouds, int64_t queries, int64_t targets, float *squared,
                      int64_t *index, int threads, int level)
{
    search_job job = {
        .query = query, .target = target,
        .query_stride = query_stride, .target_stride = target_stride,
        .query_sizes = query_sizes, .target_sizes = target_sizes,
        .clouds = clouds, .queries = queries, .targets = targets,
        .squared = squared, .index = index,
    };
    job.tile_of = choose(level, &job.tile);
    job.parts = clouds >= 4 * (int64_t)threads ? 1 : (queries + PART - 1) / PART;
    if (clouds == 0 || queries == 0)
        return 0;
    int worth = clouds * queries * targets > 500000;
    run_workers(search_worker, &job, worth ? threads : 1);
    return job.failed;
}

/* ---- gradient of the distances ---- */

typedef struct {
    const float *query, *target;
    int64_t query_stride, target_stride;
    const int64_t *index;
    const float *distance, *gradient;
    int64_t clouds, queries, targets;
    float *to_query, *to_target;
    int64_t counter;
} gradient_job;

static void *gradient_worker(void *argument)
{
    gradient_job *job = argument;
    for (int64_t b; (b = next_task(&job->counter)) < job->clouds;) {
        const float *query = job->query + b * job->query_stride;
        const float *target = job->target + b * job->target_stride;
        float *to_query = job->to_query ? job->to_query + b * job->queries * 3 : NULL;
        float *to_target = job->to_target ? job->to_target + b * job->targets * 3 : NULL;
        if (to_target)
            memset(to_target, 0, (size_t)job->targets * 3 * sizeof(float));
        for (int64_t i = 0; i < job->queries; i++) {
            int64_t at = b * job->queries + i, j = job->index[at];
            float distance = job->distance[at];
            int active = distance > 0 && distance < INFINITY && j >= 0 && j < job->targets;
            float scale = active ? job->gradient[at] / distance : 0.0f;
            for (int c = 0; c < 3; c++) {
                float pull = active ? scale * (query[3 * i + c] - target[3 * j + c]) : 0.0f;
                if (to_query)
                    to_query[3 * i + c] = pull;
                if (to_target && active)
                    to_target[3 * j + c] -= pull;
            }
        }
    }
    return NULL;
}

/* d distance / d query and / d target, times `gradient`; each output may be NULL. Targets are
 * summed in the order of the queries, one thread a cloud: the same bits at any thread count. */
void wildshape_nearest_gradient(const float *query, int64_t query_stride, const float *target,
                                int64_t target_stride, const int64_t *index,
                                const float *distance, const float *gradient, int64_t clouds,
                                int64_t queries, int64_t targets, float *to_query,
                                float *to_target, int threads)
{
    gradient_job job = {
        .query = query, .target = target,
        .query_stride = query_stride, .target_stride = target_stride,
        .index = index, .distance = distance, .gradient = gradient,
        .clouds = clouds, .queries = queries, .targets = targets,
        .to_query = to_query, .to_target = to_target,
    };
    int worth = clouds * (queries + targets) > 100000;
    run_workers(gradient_worker, &job, worth ? threads : 1);
}
