/* How much of a shape each particle of a filling stands for; see volumes.h.
 *
 * Sites of a lattice that are tissue leave a rim of up to half a cell, or reach as far out: the particles'
 * cells are the shape but for stairs. A sum over particles that all weigh the same feels them, by the tissue
 * that its rows have beside the clamps. A particle's surroundings are divided into small cells, each of which
 * belongs to the nearest particle. Rejected: polyhedra (Voronoi cells cut by the triangles), exact and many
 * times the code; points that are inside or not, of which it takes twenty times as many. */
#include "core/volumes.h"
#include "core/context.h"
#include "core/point_grid.h"
#include "core/threads.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* Small cells in a lattice step. Particles on the lattice are halfway to each other where small cells end. */
#define FINENESS 4
#define FINENESS_DISPLACED 6
#define REACH 3 /* lattice steps, of the surroundings' side */
/* A particle's smallest share of a cell. Two scanned muscles have 0.26 at least; with much less than its
 * neighbours a particle would be so light that all had to take shorter steps. */
#define LEAST 0.2
enum { NEAREST = 32, BALLS = 64 };

/* What is the same for all particles. */
typedef struct sampling {
    const sphm_body *body;
    const sphm_winding *winding;
    sphm_point_grid grid;
    int displaced, fineness;
    double half_diagonal_m; /* of a lattice cell */
    size_t count;
    double (*points)[3]; /* [count], middles of the small cells, relative to a particle */
} sampling;

static void place_points(sampling *s) {
    const int side = REACH * s->fineness;
    for (int k = 0; k < side; k++)
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++) {
                const int site[3] = {i, j, k};
                double *point = s->points[s->count++];
                for (int a = 0; a < 3; a++)
                    for (int d = 0; d < 3; d++)
                        point[d] += ((site[a] + 0.5) / s->fineness - 0.5 * REACH) * s->body->step_m[a][d];
            }
}

/* A cell that no surface cuts, with a particle in the middle of each one beside it. */
static int is_whole(const sampling *s, size_t i) {
    return !s->displaced && !s->body->outer[i] &&
           !sphm_winding_near(s->winding, &s->body->positions[3 * i], s->half_diagonal_m);
}

/* The particles nearest to one, relative to it. */
typedef struct company {
    size_t count;
    double position[NEAREST][3], half_square[NEAREST];
} company;

static company company_of(const sampling *s, size_t i) {
    company c;
    int32_t found[NEAREST];
    const double *middle = &s->body->positions[3 * i];
    /* The first of the closest is the particle itself. */
    c.count =
        sphm_point_grid_closest(&s->grid, middle, 4 * s->half_diagonal_m, NEAREST, found, c.half_square) - 1;
    for (size_t k = 0; k < c.count; k++) {
        sphm_subtract3(&s->body->positions[3 * (size_t)found[k + 1]], middle, c.position[k]);
        c.half_square[k] = 0.5 * sphm_dot3(c.position[k], c.position[k]);
    }
    return c;
}

/* A particle's share of a point relative to it: 1 where it is the nearest one, less where others are as near,
 * as halfway between diagonal neighbours on a lattice. Most points are nearer to the particle's company;
 * those left over are asked about once more, of all particles. */
static double share_of(const sampling *s, const company *c, const double point[3], const double x[3]) {
    const double level = 1e-9 * s->body->spacing_m * s->body->spacing_m;
    int equals = 1;
    for (size_t k = 0; k < c->count; k++) {
        const double excess = sphm_dot3(point, c->position[k]) - c->half_square[k];
        if (excess > level)
            return 0;
        equals += excess > -level;
    }
    const double *nearest = &s->body->positions[3 * sphm_point_grid_nearest(&s->grid, x)];
    const double excess = sphm_dot3(point, point) - sphm_distance_squared3(nearest, x);
    return excess > 2 * level ? 0 : 1.0 / equals;
}

/* Balls that no surface cuts are inside or outside as a whole: most small cells need no winding number of
 * their own. */
typedef struct ball {
    double centre[3], radius;
    int inside;
} ball;

typedef struct balls {
    size_t count;
    ball ball[BALLS];
} balls;

/* The ball about x, up to a lattice step wide. */
static ball grow_ball(const sampling *s, const double x[3], int inside) {
    ball b = {{x[0], x[1], x[2]}, sphm_winding_distance(s->winding, x, s->body->spacing_m), inside};
    return b;
}

/* The ball that reaches farthest beyond x, which is in it. NULL: none is known. */
static const ball *ball_around(const balls *known, const double x[3], double *depth) {
    const ball *best = NULL;
    *depth = 0;
    for (size_t k = 0; k < known->count; k++) {
        const ball *b = &known->ball[k];
        double square = sphm_distance_squared3(b->centre, x), reach = b->radius - *depth;
        if (reach <= 0 || square >= reach * reach)
            continue;
        best = b;
        *depth = b->radius - sqrt(square);
    }
    return best;
}

/* Share of a small cell that is inside. A cube cut by a plane at this distance from its middle: whichever way
 * the plane is turned, a ramp as wide as the cube has the right mean and variance. */
static double share_inside(const sampling *s, const double x[3], balls *known) {
    const double width = s->body->spacing_m / s->fineness;
    double depth;
    int inside;
    const ball *around = ball_around(known, x, &depth);
    if (around) {
        inside = around->inside;
        if (depth < 0.5 * width)
            depth = sphm_winding_distance(s->winding, x, 0.5 * width);
    } else {
        const ball b = grow_ball(s, x, sphm_winding_number(s->winding, x) > 0.5);
        if (known->count < BALLS)
            known->ball[known->count++] = b;
        depth = b.radius;
        inside = b.inside;
    }
    return 0.5 + (inside ? 1 : -1) * fmin(depth / width, 0.5);
}

/* In lattice cells. */
static double measure(const sampling *s, size_t i) {
    const double *middle = &s->body->positions[3 * i];
    const company c = company_of(s, i);
    balls known = {1, {grow_ball(s, middle, 1)}};
    double sum = 0;
    for (size_t p = 0; p < s->count; p++) {
        double x[3];
        for (int d = 0; d < 3; d++)
            x[d] = middle[d] + s->points[p][d];
        const double share = share_of(s, &c, s->points[p], x);
        if (share > 0)
            sum += share * share_inside(s, x, &known);
    }
    return sum / (double)(s->fineness * s->fineness * s->fineness);
}

static void measure_all(const sampling *s, int64_t threads, double *volumes) {
#pragma omp parallel for schedule(dynamic, 64) num_threads(sphm_team_size(threads))
    for (size_t i = 0; i < s->body->count; i++)
        volumes[i] = fmax(is_whole(s, i) ? 1 : measure(s, i), LEAST);
}

static void normalise(sphm_body *body) {
    double sum = 0;
    for (size_t i = 0; i < body->count; i++)
        sum += body->volumes[i];
    for (size_t i = 0; i < body->count; i++)
        body->volumes[i] *= body->volume_m3 / sum;
}

sphm_status sphm_body_measure_volumes(sphm_body *body, const sphm_winding *winding, int displaced,
                                      int64_t threads, sphm_context *context) {
    sampling s;
    double diagonal = 0;
    memset(&s, 0, sizeof s);
    s.body = body;
    s.winding = winding;
    s.displaced = displaced;
    s.fineness = displaced ? FINENESS_DISPLACED : FINENESS;
    for (int a = 0; a < 3; a++)
        diagonal += sphm_dot3(body->step_m[a], body->step_m[a]);
    s.half_diagonal_m = 0.5 * sqrt(diagonal);
    const size_t side = (size_t)(REACH * s.fineness);
    s.points = calloc(side * side * side, sizeof *s.points);
    if (!s.points)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to measure the particles' volumes");
    place_points(&s);
    sphm_status status =
        sphm_point_grid_create(body->positions, body->count, body->spacing_m, &s.grid, context);
    if (status == SPHM_OK) {
        measure_all(&s, threads, body->volumes);
        normalise(body);
    }
    sphm_point_grid_free(&s.grid);
    free(s.points);
    return status;
}
