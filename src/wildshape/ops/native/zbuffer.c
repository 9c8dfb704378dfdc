/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The nearest point of each occupied bin. Bins are looked up in a hash table of the size of the
 * cloud, so that the cost does not depend on the size of the image.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "workers.h"

typedef struct {
    const int64_t *bins;
    const float *depth;
    int64_t clouds, points, n_bins;
    uint8_t *seen;
    int bits, failed;
    int64_t counter;
} zbuffer_job;

static inline float finite_or_far(float depth) { return depth == depth ? depth : INFINITY; }

static void scan_cloud(const int64_t *bins, const float *depth, const zbuffer_job *job,
                       uint8_t *seen, int32_t *table)
{
    const uint64_t last = ((uint64_t)1 << job->bits) - 1;
    memset(table, 0xff, ((size_t)last + 1) * sizeof *table);
    memset(seen, 0, (size_t)job->points);
    for (int64_t i = 0; i < job->points; i++) {
        if (bins[i] < 0 || bins[i] >= job->n_bins)
            continue;
        uint64_t slot = ((uint64_t)bins[i] * 0x9E3779B97F4A7C15u) >> (64 - job->bits);
        while (table[slot] >= 0 && bins[table[slot]] != bins[i])
            slot = (slot + 1) & last;
        int32_t front = table[slot];
        if (front >= 0 && !(finite_or_far(depth[i]) < finite_or_far(depth[front])))
            continue;
        if (front >= 0)
            seen[front] = 0;
        seen[i] = 1;
        table[slot] = (int32_t)i;
    }
}

static void *zbuffer_worker(void *argument)
{
    zbuffer_job *job = argument;
    int32_t *table = malloc(((size_t)1 << job->bits) * sizeof *table);
    if (!table) {
        __atomic_store_n(&job->failed, 1, __ATOMIC_RELAXED);
        return NULL;
    }
    for (int64_t b; (b = next_task(&job->counter)) < job->clouds;) {
        int64_t at = b * job->points;
        scan_cloud(job->bins + at, job->depth + at, job, job->seen + at, table);
    }
    free(table);
    return NULL;
}

/* seen[b, i] = 1 for the point of smallest (depth, index) in its bin, else 0. Bins outside
 * [0, n_bins) are ignored. Returns 0, or 1 if memory ran out or a cloud has over 2^30 points. */
int wildshape_visible(const int64_t *bins, const float *depth, int64_t clouds, int64_t points,
                      int64_t n_bins, uint8_t *seen, int threads)
{
    zbuffer_job job = {
        .bins = bins, .depth = depth, .clouds = clouds, .points = points, .n_bins = n_bins,
        .seen = seen, .bits = 1,
    };
    if (points > (int64_t)1 << 30)
        return 1;
    if (points == 0)
        return 0;
    while (((int64_t)1 << job.bits) < 2 * points)
        job.bits++;
    int worth = clouds * points > 100000;
    run_workers(zbuffer_worker, &job, worth ? threads : 1);
    return job.failed;
}

/* Raised when a signature changes, so that a stale library is not called. */
int wildshape_abi(void) { return 2; }
