/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exact nearest neighbours, both ways, plain C ABI, no array of N x M. Points are sorted along a
 * Z-curve, and blocks out of reach of a tile of queries are left out (nearest_kernel.h).
 * Clouds are row-major float32 (N, 3) at any stride between clouds.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "cloud.h"
#include "workers.h"

#define KERNEL "nearest_kernel.h"
#include "instruction_sets.h"

/* ---- dispatch ---- */

typedef void (*search_tile)(const cloud *, int64_t, const cloud *, float *, float *, int64_t *);

int wildshape_level(void)
{
#if defined(__x86_64__) || defined(_M_X64)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f"))
        return 2;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return 1;
#endif
    return 0;
}

/* ---- work sharing ---- */

typedef struct {
    const float *points;
    int64_t stride;
    const int64_t *sizes;
    int64_t most;
    float *squared; /* of these points to the other side's; NULL: not wanted */
    int64_t *index;
} side;

typedef struct {
    side sides[2];
    int64_t clouds, parts;
    search_tile search;
    int failed;
    int64_t counter;
} search_job;

static void blank(const side *from, int64_t b, int64_t start, float squared)
{
    for (int64_t i = b * from->most + start; i < (b + 1) * from->most; i++) {
        from->squared[i] = squared;
        from->index[i] = 0;
    }
}

/* One part of the tiles of one side; the first part sees to all that has no neighbour too. */
static void search_part(const search_job *job, const side *from, int64_t b, int64_t part,
                        const cloud *queries, const cloud *targets, float *bound)
{
    if (!from->squared)
        return;
    if (part == 0 && targets->count == 0)
        blank(from, b, 0, INFINITY);
    if (part == 0)
        blank(from, b, queries->count, 0.0f);
    float *squared = from->squared + b * from->most;
    int64_t *index = from->index + b * from->most;
    int64_t start = part * queries->blocks / job->parts;
    int64_t stop = targets->count ? (part + 1) * queries->blocks / job->parts : start;
    for (int64_t tile = start; tile < stop; tile++)
        job->search(queries, tile, targets, bound, squared, index);
}

/* Every worker sorts the clouds that it takes part in for itself: no waiting for another. */
static void search_all(search_job *job, cloud held[2], float *bound)
{
    for (int64_t task, at = -1; (task = next_task(&job->counter)) < job->clouds * job->parts;) {
        int64_t b = task / job->parts;
        for (int s = 0; s < 2 && b != at; s++) {
            const side *from = &job->sides[s];
            const int64_t size = size_of(from->sizes, b, from->most);
            cloud_fill(&held[s], from->points + b * from->stride, size);
        }
        at = b;
        for (int s = 0; s < 2; s++)
            search_part(job, &job->sides[s], b, task % job->parts, &held[s], &held[1 - s], bound);
    }
}

static void *search_worker(void *argument)
{
    search_job *job = argument;
    int64_t n = job->sides[0].most, m = job->sides[1].most, boxes = in_blocks(n > m ? n : m) + 1;
    cloud held[2];
    cloud_allocate(&held[0], n);
    cloud_allocate(&held[1], m);
    float *bound = aligned_alloc(BYTES, (size_t)in_blocks(boxes) * BLOCK * sizeof(float));
    if (held[0].axes[0] && held[1].axes[0] && bound)
        search_all(job, held, bound);
    else
        __atomic_store_n(&job->failed, 1, __ATOMIC_RELAXED);
    free(held[0].axes[0]);
    free(held[1].axes[0]);
    free(bound);
    return NULL;
}

/* Nearest b of each a, and nearest a of each b where `b_squared` is not NULL. Sizes may be NULL;
 * strides count floats between clouds. level: instruction set (-1: the widest). Returns 0, or 1 if
 * memory ran out or a cloud has over 2^28 points. */
int wildshape_nearest(const float *a, int64_t a_stride, const int64_t *a_sizes, const float *b,
                      int64_t b_stride, const int64_t *b_sizes, int64_t clouds, int64_t n,
                      int64_t m, float *a_squared, int64_t *a_index, float *b_squared,
                      int64_t *b_index, int threads, int level)
{
    search_job job = {
        .sides = {{a, a_stride, a_sizes, n, a_squared, a_index},
                  {b, b_stride, b_sizes, m, b_squared, b_index}},
        .clouds = clouds,
        .search = OF_LEVEL(search, known_level(level)),
    };
    if (clouds == 0)
        return 0;
    job.parts = clouds < 4 * (int64_t)threads ? (4 * threads + clouds - 1) / clouds : 1;
    if (n > (int64_t)1 << 28 || m > (int64_t)1 << 28)
        return 1;
    int worth = clouds * (n + m) > 4000;
    run_workers(search_worker, &job, worth ? threads : 1);
    return job.failed;
}
