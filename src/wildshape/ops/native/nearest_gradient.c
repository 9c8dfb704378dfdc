/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Gradient of the distances to neighbours already found: gather and scatter, no search.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "workers.h"

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
