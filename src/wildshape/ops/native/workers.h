/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Fork and join over plain threads: no second OpenMP runtime beside torch's own, whose idle
 * threads would spin on the same cores, and nothing left running between calls.
 */
#pragma once
#include <pthread.h>
#include <stdint.h>

enum { MAX_WORKERS = 64 };

/* Run `work(job)` on `threads` threads, the caller one of them; fewer if some cannot start. */
static inline void run_workers(void *(*work)(void *), void *job, int threads)
{
    pthread_t started[MAX_WORKERS];
    int count = 0;
    if (threads > MAX_WORKERS)
        threads = MAX_WORKERS;
    while (count < threads - 1 && pthread_create(&started[count], NULL, work, job) == 0)
        count++;
    work(job);
    for (int i = 0; i < count; i++)
        pthread_join(started[i], NULL);
}

/* Take the next task number; tasks at or past the total mean that none is left. */
static inline int64_t next_task(int64_t *counter)
{
    return __atomic_fetch_add(counter, 1, __ATOMIC_RELAXED);
}
