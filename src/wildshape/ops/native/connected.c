/* SPDX-FileCopyrightText: 2026 The Wildshape developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Which points hang together over steps of at most a reach. The first point of each cell stands for
 * all in it. Cells are put into cubes so small that what is in one hangs together; cubes with two
 * points in reach are joined. Cells and cubes are found in hash tables. Most places beside a cube
 * are empty: a small table of bits says so, at sums of hashes, which are linear in the place.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    int64_t x, y, z;
} place;

/* Occupied places of a grid, numbered in the order in which they were first seen. */
typedef struct {
    place *places;
    int32_t *slots; /* numbers by hash, -1 where there is none */
    int32_t count;
    int bits;
} grid;

enum { BITS = 18 }; /* of a hash that tell whether a cube may be there: 32 KiB */

typedef struct {
    const float *points;
    grid cells, cubes;
    uint64_t *mixed, *taken; /* hash of each cube; a bit for the beginning of each hash */
    int32_t *cell;   /* of each point */
    int32_t *first;  /* the first point of each cell */
    int32_t *cube;   /* of each cell */
    int32_t *next;   /* another cell of its cube, -1 after the last */
    int32_t *head;   /* a cell of each cube */
    int32_t *parent; /* of each cube, towards the first of its part */
} parts;

static int grid_allocate(grid *made, int64_t most)
{
    made->bits = 1;
    while (((int64_t)1 << made->bits) < 2 * most)
        made->bits++;
    const size_t bytes = ((size_t)1 << made->bits) * sizeof *made->slots;
    made->places = malloc((size_t)most * sizeof *made->places);
    made->slots = malloc(bytes);
    if (made->slots)
        memset(made->slots, 0xff, bytes);
    return made->places && made->slots;
}

static void grid_free(grid *made)
{
    free(made->places);
    free(made->slots);
}

static uint64_t mixed(place at)
{
    return (uint64_t)at.x * 0x9E3779B97F4A7C15u + (uint64_t)at.y * 0xC2B2AE3D27D4EB4Fu +
           (uint64_t)at.z * 0xD6E8FEB86659FD93u;
}

static int32_t *slot_of(const grid *in, place at)
{
    const uint64_t last = ((uint64_t)1 << in->bits) - 1;
    uint64_t slot = mixed(at) >> (64 - in->bits);
    for (; in->slots[slot] >= 0; slot = (slot + 1) & last) {
        const place held = in->places[in->slots[slot]];
        if (held.x == at.x && held.y == at.y && held.z == at.z)
            break;
    }
    return in->slots + slot;
}

/* The number of a place, a new one if it was not seen before. */
static int32_t number_of(grid *in, place at)
{
    int32_t *slot = slot_of(in, at);
    if (*slot < 0) {
        in->places[in->count] = at;
        *slot = in->count++;
    }
    return *slot;
}

static int32_t root(parts *of, int32_t at)
{
    while (of->parent[at] != at)
        at = of->parent[at] = of->parent[of->parent[at]];
    return at;
}

static void join(parts *of, int32_t a, int32_t b)
{
    a = root(of, a);
    b = root(of, b);
    if (a < b)
        of->parent[b] = a;
    else
        of->parent[a] = b;
}

static int64_t floored(float value)
{
    const int64_t whole = (int64_t)value;
    return whole - ((float)whole > value);
}

static void fill_cells(parts *of, int64_t count, float edge)
{
    for (int64_t i = 0; i < count; i++) {
        const float *point = of->points + 3 * i;
        const place at = {floored(point[0] / edge), floored(point[1] / edge),
                          floored(point[2] / edge)};
        const int32_t before = of->cells.count, number = number_of(&of->cells, at);
        if (number == before)
            of->first[number] = (int32_t)i;
        of->cell[i] = number;
    }
}

static int64_t floor_divided(int64_t value, int64_t by)
{
    return value / by - (value % by < 0);
}

/* `side`: cells along an edge of a cube. */
static void fill_cubes(parts *of, int64_t side)
{
    for (int32_t k = 0; k < of->cells.count; k++) {
        const place cell = of->cells.places[k];
        const place at = {floor_divided(cell.x, side), floor_divided(cell.y, side),
                          floor_divided(cell.z, side)};
        const int32_t before = of->cubes.count, number = number_of(&of->cubes, at);
        of->next[k] = number == before ? -1 : of->head[number];
        of->head[number] = k;
        of->cube[k] = number;
        of->parent[number] = number;
        of->mixed[number] = mixed(at);
        const uint64_t bit = of->mixed[number] >> (64 - BITS);
        of->taken[bit / 64] |= (uint64_t)1 << bit % 64;
    }
}

static int in_reach(const float *a, const float *b, float reach_squared)
{
    const float dx = a[0] - b[0], dy = a[1] - b[1], dz = a[2] - b[2];
    return dx * dx + dy * dy + dz * dz <= reach_squared;
}

static int are_in_reach(const parts *of, int32_t a, int32_t b, float reach_squared)
{
    for (int32_t i = of->head[a]; i >= 0; i = of->next[i])
        for (int32_t j = of->head[b]; j >= 0; j = of->next[j])
            if (in_reach(of->points + 3 * (int64_t)of->first[i],
                         of->points + 3 * (int64_t)of->first[j], reach_squared))
                return 1;
    return 0;
}

/* Whether cubes that are so many apart along an axis may hold points in reach of each other. */
static int may_reach(int64_t dx, int64_t dy, int64_t dz, double edge, double reach)
{
    const int64_t apart[3] = {dx, dy, dz};
    double sum = 0;
    for (int c = 0; c < 3; c++) {
        const double gap = apart[c] ? edge * (double)(llabs(apart[c]) - 1) : 0;
        sum += gap * gap;
    }
    return sum <= reach * reach;
}

/* Join every cube with those one step away, (dx, dy, dz) cubes. */
static void join_over(parts *of, int64_t dx, int64_t dy, int64_t dz, float reach_squared)
{
    const uint64_t step = mixed((place){dx, dy, dz});
    for (int32_t a = 0; a < of->cubes.count; a++) {
        const uint64_t bit = (of->mixed[a] + step) >> (64 - BITS);
        if (!(of->taken[bit / 64] >> bit % 64 & 1))
            continue;
        const place own = of->cubes.places[a];
        const place at = {own.x + dx, own.y + dy, own.z + dz};
        const int32_t b = *slot_of(&of->cubes, at);
        if (b >= 0 && root(of, a) != root(of, b) && are_in_reach(of, a, b, reach_squared))
            join(of, a, b);
    }
}

/* Over half of all steps, the shorter first: the other half are their opposites. */
static void join_all(parts *of, double edge, float reach)
{
    const int64_t most = (int64_t)ceil((double)reach / edge);
    for (int64_t far = 1; far <= most; far++)
        for (int64_t dx = 0; dx <= far; dx++)
            for (int64_t dy = dx ? -far : 0; dy <= far; dy++)
                for (int64_t dz = dx || dy ? -far : 1; dz <= far; dz++)
                    if ((dx == far || llabs(dy) == far || llabs(dz) == far) &&
                        may_reach(dx, dy, dz, edge, reach))
                        join_over(of, dx, dy, dz, reach * reach);
}

/* Parts are numbered by the first of their points. */
static void number_parts(parts *of, int64_t count, int64_t *part)
{
    int32_t *name = of->head, parts_seen = 0; /* no longer needed */
    memset(name, 0xff, (size_t)of->cubes.count * sizeof *name);
    for (int64_t i = 0; i < count; i++) {
        const int32_t own = root(of, of->cube[of->cell[i]]);
        if (name[own] < 0)
            name[own] = parts_seen++;
        part[i] = name[own];
    }
}

/* A number for the part of each of `count` finite row-major points; `edge`: of the cells. The points
 * of each of `pairs` pairs are one part. Returns how many points were too many or lacked memory: 0
 * or 1. */
int wildshape_parts(const float *points, int64_t count, float reach, float edge,
                    const int64_t *pair, int64_t pairs, int64_t *part)
{
    parts of = {.points = points};
    if (count == 0)
        return 0;
    if (count > (int64_t)1 << 28)
        return 1;
    int32_t *room = malloc((size_t)count * 6 * sizeof *room);
    int failed = !room || !grid_allocate(&of.cells, count);
    if (!failed) {
        int32_t **held[6] = {&of.cell, &of.first, &of.cube, &of.next, &of.head, &of.parent};
        for (int k = 0; k < 6; k++)
            *held[k] = room + k * count;
        fill_cells(&of, count, edge);
        of.mixed = malloc((size_t)of.cells.count * sizeof *of.mixed);
        of.taken = calloc(((size_t)1 << BITS) / 64, sizeof *of.taken);
        failed = !grid_allocate(&of.cubes, of.cells.count) || !of.mixed || !of.taken;
    }
    if (!failed) {
        const int64_t whole = (int64_t)(reach / (edge * sqrtf(3))), side = whole > 1 ? whole : 1;
        fill_cubes(&of, side);
        join_all(&of, (double)edge * (double)side, reach);
        for (int64_t k = 0; k < pairs; k++)
            join(&of, of.cube[of.cell[pair[2 * k]]], of.cube[of.cell[pair[2 * k + 1]]]);
        number_parts(&of, count, part);
    }
    grid_free(&of.cells);
    grid_free(&of.cubes);
    free(of.mixed);
    free(of.taken);
    free(room);
    return failed;
}

/* The row of the first point of each occupied cell, in rising order. Returns how many, or -1 if
 * there are too many points or there is no room. */
int wildshape_cells(const float *points, int64_t count, float edge, int32_t *first)
{
    parts of = {.points = points, .first = first};
    if (count == 0)
        return 0;
    if (count > (int64_t)1 << 28)
        return -1;
    of.cell = malloc((size_t)count * sizeof *of.cell);
    const int failed = !grid_allocate(&of.cells, count) || !of.cell;
    if (!failed)
        fill_cells(&of, count, edge);
    grid_free(&of.cells);
    free(of.cell);
    return failed ? -1 : of.cells.count;
}
