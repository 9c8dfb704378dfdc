/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The k nearest targets of each query, exact, plain C ABI, no array of N x M. Points are sorted
 * along a Z-curve, and blocks out of reach of a query are left out (nearest_k_kernel.h).
 */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "cloud.h"
#include "workers.h"

enum { FIRST = 3 }; /* blocks that every query looks into before it asks which are in reach */

typedef struct {
    int k;
    float most; /* squared; what is farther is not found */
    const int64_t *query_group, *target_group; /* of one cloud; NULL: all are apart */
} k_search;

static inline uint64_t key_of(float squared, int32_t place)
{
    uint32_t bits;
    memcpy(&bits, &squared, sizeof bits);
    return (uint64_t)bits << 32 | (uint32_t)place;
}

static inline float distance_of(uint64_t key)
{
    uint32_t bits = (uint32_t)(key >> 32);
    float squared;
    memcpy(&squared, &bits, sizeof squared);
    return squared;
}

static inline int apart(const k_search *search, int32_t query, int32_t target)
{
    return !search->query_group || search->query_group[query] != search->target_group[target];
}

/* Leave out blocks that hold nothing but the group that all queries of a tile are of: else each
 * such tile would look into its whole group before it met another. */
static void leave_out_own(const k_search *search, const cloud *queries, int64_t tile,
                          const cloud *targets, float *bound)
{
    const int32_t *query = queries->order + tile * BLOCK;
    for (int i = 1; i < BLOCK; i++)
        if (search->query_group[query[i]] != search->query_group[query[0]])
            return;
    for (int64_t b = 0; b < targets->blocks; b++) {
        int i = 0;
        while (i < BLOCK && !apart(search, query[0], targets->order[b * BLOCK + i]))
            i++;
        if (i == BLOCK)
            bound[b] = INFINITY;
    }
}

/* Put a key among `k` in order; the largest falls out. No branch: it would be guessed wrongly. */
static inline __attribute__((always_inline)) void insert_among(uint64_t *keys, int k, uint64_t key)
{
    for (int i = k - 1; i > 0; i--) {
        const uint64_t above = keys[i - 1] > key ? keys[i - 1] : key;
        keys[i] = keys[i] < above ? keys[i] : above;
    }
    keys[0] = keys[0] < key ? keys[0] : key;
}

/* The same; known lengths are unrolled. */
static inline void insert_key(uint64_t *keys, int k, uint64_t key)
{
    if (k == 16)
        insert_among(keys, 16, key);
    else if (k == 8)
        insert_among(keys, 8, key);
    else if (k == 6)
        insert_among(keys, 6, key);
    else if (k == 1)
        insert_among(keys, 1, key);
    else
        insert_among(keys, k, key);
}

#define KERNEL "nearest_k_kernel.h"
#include "instruction_sets.h"

typedef void (*search_tile)(const cloud *, int64_t, const cloud *, const k_search *, float *,
                            uint64_t *);

typedef struct {
    const float *points;
    const int64_t *sizes, *group;
    int64_t most;
} side;

typedef struct {
    side query, target;
    int64_t clouds, parts, k;
    float most, *squared;
    int64_t *index;
    search_tile search;
    int failed;
    int64_t counter;
} k_job;

static void write_found(const k_job *job, int64_t query, const uint64_t *keys)
{
    for (int64_t j = 0; j < job->k; j++) {
        const int found = (uint32_t)keys[j] != UINT32_MAX;
        job->squared[query * job->k + j] = found ? distance_of(keys[j]) : INFINITY;
        job->index[query * job->k + j] = found ? (int64_t)(uint32_t)keys[j] : 0;
    }
}

static void search_part(const k_job *job, int64_t b, int64_t part, const cloud *queries,
                        const cloud *targets, float *bound, uint64_t *keys)
{
    const int64_t start = part * queries->blocks / job->parts, n = job->query.most;
    const int64_t stop = (part + 1) * queries->blocks / job->parts;
    const k_search search = {
        .k = (int)job->k,
        .most = job->most,
        .query_group = job->query.group ? job->query.group + b * n : NULL,
        .target_group = job->target.group ? job->target.group + b * job->target.most : NULL,
    };
    for (int64_t tile = start; tile < stop; tile++) {
        if (targets->count)
            job->search(queries, tile, targets, &search, bound, keys);
        else
            for (int64_t i = 0; i < BLOCK * job->k; i++)
                keys[i] = UINT64_MAX;
        for (int64_t i = 0; i < BLOCK && tile * BLOCK + i < queries->count; i++)
            write_found(job, b * n + queries->order[tile * BLOCK + i], keys + i * job->k);
    }
    for (int64_t i = queries->count; part == 0 && i < n; i++)
        for (int64_t j = 0; j < job->k; j++) {
            job->squared[(b * n + i) * job->k + j] = 0.0f;
            job->index[(b * n + i) * job->k + j] = 0;
        }
}

static void search_all(k_job *job, cloud held[2], float *bound, uint64_t *keys)
{
    const side *sides[2] = {&job->query, &job->target};
    for (int64_t task, at = -1; (task = next_task(&job->counter)) < job->clouds * job->parts;) {
        const int64_t b = task / job->parts;
        for (int s = 0; s < 2 && b != at; s++) {
            const int64_t most = sides[s]->most;
            cloud_fill(&held[s], sides[s]->points + 3 * b * most, size_of(sides[s]->sizes, b, most));
        }
        at = b;
        search_part(job, b, task % job->parts, &held[0], &held[1], bound, keys);
    }
}

static void *search_worker(void *argument)
{
    k_job *job = argument;
    const int64_t boxes = in_blocks(job->target.most) + 1;
    cloud held[2];
    cloud_allocate(&held[0], job->query.most);
    cloud_allocate(&held[1], job->target.most);
    float *bound = aligned_alloc(BYTES, (size_t)in_blocks(boxes) * BLOCK * sizeof(float));
    uint64_t *keys = aligned_alloc(BYTES, (size_t)(BLOCK * job->k) * sizeof(uint64_t));
    if (held[0].axes[0] && held[1].axes[0] && bound && keys)
        search_all(job, held, bound, keys);
    else
        __atomic_store_n(&job->failed, 1, __ATOMIC_RELAXED);
    free(held[0].axes[0]);
    free(held[1].axes[0]);
    free(bound);
    free(keys);
    return NULL;
}

/* The k nearest targets of each query, nearest first, those of the query's own group left out
 * where groups are given, and those whose squared distance is above `most`. Sizes and groups may
 * be NULL. Clouds are dense, row-major. level: instruction set (-1: the widest). Returns 0, or 1
 * if memory ran out or a cloud has over 2^28 points. */
int wildshape_nearest_k(const float *query, const int64_t *query_sizes, const int64_t *query_group,
                        const float *target, const int64_t *target_sizes,
                        const int64_t *target_group, int64_t clouds, int64_t n, int64_t m,
                        int64_t k, float most, float *squared, int64_t *index, int threads,
                        int level)
{
    k_job job = {
        .query = {query, query_sizes, query_group, n},
        .target = {target, target_sizes, target_group, m},
        .clouds = clouds,
        .k = k,
        .most = most < FLT_MAX ? most : FLT_MAX,
        .squared = squared,
        .index = index,
        .search = OF_LEVEL(search_k, known_level(level)),
    };
    if (clouds == 0 || n == 0 || k == 0)
        return 0;
    if (n > (int64_t)1 << 28 || m > (int64_t)1 << 28)
        return 1;
    job.parts = clouds < 4 * (int64_t)threads ? (4 * threads + clouds - 1) / clouds : 1;
    const int worth = clouds * (n + m) > 4000;
    job.parts = worth ? job.parts : 1;
    run_workers(search_worker, &job, worth ? threads : 1);
    return job.failed;
}
