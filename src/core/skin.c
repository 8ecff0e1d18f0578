/* The surface carried by the particles: reads present positions by id, writes vertices.
 *
 * Moving least squares: the affine map that fits the motion of the 16 particles nearest to vertex v best,
 * with smooth weights w_k that vanish at the 17th, takes the vertex to x_v = sum c_k x_k with c_k = w_k (1 +
 * (X_k - C) . M^-1 (X_v - C)),  C = sum w_k X_k,  M = sum w_k (X_k - C)(X_k - C)^T,  sum w_k = 1 (Levin,
 * Math. Comp. 67, 1517, 1998). So sum c_k = 1 and sum c_k X_k = X_v: affine motions are exact. As w_k changes
 * continuously from vertex to vertex, so does the surface.
 *
 * Where the neighbours span no volume (a thread, a sheet one particle thick), M^-1 is damped along the open
 * direction and the rest of X_v is carried by the rigid motion of the whole muscle. Rejected: the nearest
 * particle's own frame, because particles of a fluid have none. Fields are blended with w_k alone: c_k may be
 * negative and would overshoot. */
#include "core/skin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/observer.h"
#include "core/point_grid.h"
#include "kernels/vector.h"

enum { K = SPHM_SKIN_NEIGHBOURS };

/* Second moments below this many squared spacings, with a full share of the weight, count as open directions.
 * Two layers of particles a spacing apart have some 0.2. */
static const double OPEN_MOMENT = 0.03;
/* A vertex farther from the centre of its neighbours than this many of their standard deviations is carried
 * rigidly over the rest of the way: weights would grow with the distance, and disorder with them. Vertices
 * half a spacing outside a lattice are at 2 to 4. */
static const double FARTHEST = 5;

/* Fills w with smooth weights of sum 1 for the nearest particles; returns how many there are. */
static size_t weigh(const sphm_point_grid *grid, const double vertex[3], int32_t particle[K + 1],
                    double w[K + 1]) {
    double squared[K + 1], sum = 0;
    size_t found = sphm_point_grid_closest(grid, vertex, INFINITY, K + 1, particle, squared);
    double reach = squared[found - 1];
    if (found <= K || reach <= 1.0001 * squared[0])
        reach = 2 * squared[found - 1] + 1e-30; /* too few, or all equally far: nobody is left out */
    if (found > K)
        found = K;
    for (size_t k = 0; k < found; ++k) {
        const double q = squared[k] / reach; /* flat near the vertex: more particles share the work */
        w[k] = (1 - q * q) * (1 - q * q);
        sum += w[k];
    }
    for (size_t k = 0; k < found; ++k)
        w[k] /= sum;
    return found;
}

/* g = M^+ d, damped along open directions and for far vertices; returns how many such directions there are.
 */
static int solve(const double m[9], const double d[3], double spacing_m, double g[3]) {
    double a[4][4] = {{0}}, v[4][4];
    const double unit = spacing_m * spacing_m;
    for (int i = 0; i < 9; ++i)
        a[i / 3][i % 3] = m[i] / unit;
    sphm_symmetric_eigen(a, v, 3);
    g[0] = g[1] = g[2] = 0;
    int open = 0;
    for (int e = 0; e < 3; ++e) {
        const double q = a[e][e] / OPEN_MOMENT;
        if (!(q > 1e-6)) {
            ++open;
            continue;
        }
        const double damp = q < 1 ? q * q * (3 - 2 * q) : 1; /* goes to 0 faster than the moment */
        const double away = v[0][e] * d[0] + v[1][e] * d[1] + v[2][e] * d[2];
        const double farthest = FARTHEST * sqrt(a[e][e] * unit);
        const double along = fmax(-farthest, fmin(farthest, away)) / (a[e][e] * unit);
        open += q < 1 || fabs(away) > farthest;
        for (int i = 0; i < 3; ++i)
            g[i] += damp * along * v[i][e];
    }
    return open;
}

/* Fills row `vertex` of the weights; returns whether its neighbours leave a direction open. */
static int carry_weights(const sphm_point_grid *grid, const double place[3], double spacing_m, size_t vertex,
                         sphm_skin_weights *weights) {
    int32_t particle[K + 1];
    double w[K + 1], centre[3] = {0}, m[9] = {0}, d[3], g[3];
    const size_t found = weigh(grid, place, particle, w);
    for (size_t k = 0; k < found; ++k)
        for (int a = 0; a < 3; ++a)
            centre[a] += w[k] * grid->points[3 * particle[k] + a];
    for (size_t k = 0; k < found; ++k) {
        const double *p = grid->points + 3 * (size_t)particle[k];
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
                m[3 * a + b] += w[k] * (p[a] - centre[a]) * (p[b] - centre[b]);
    }
    for (int a = 0; a < 3; ++a)
        d[a] = place[a] - centre[a];
    const int open = solve(m, d, spacing_m, g);

    double left[3] = {place[0], place[1], place[2]}; /* what the rounded weights do not reach */
    for (size_t k = 0; k < K; ++k) {
        const size_t at = K * vertex + k;
        const double *p = grid->points + 3 * (size_t)particle[k < found ? k : 0];
        const double edge[3] = {p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]};
        weights->particle[at] = particle[k < found ? k : 0];
        weights->carry[at] = k < found ? (float)(w[k] * (1 + sphm_dot3(edge, g))) : 0;
        weights->blend[at] = k < found ? (float)w[k] : 0;
        for (int a = 0; a < 3; ++a)
            left[a] -= weights->carry[at] * p[a];
    }
    for (int a = 0; a < 3; ++a)
        weights->rest_m[3 * vertex + a] = (float)left[a];
    return open > 0;
}

sphm_status sphm_skin_weights_create(const double *vertices_m, size_t vertex_count, const double *particles_m,
                                     size_t particle_count, double spacing_m, int threads,
                                     sphm_skin_weights *weights, sphm_context *context) {
    memset(weights, 0, sizeof *weights);
    sphm_point_grid grid;
    const sphm_status status = sphm_point_grid_create(particles_m, particle_count, spacing_m, &grid, context);
    if (status != SPHM_OK)
        return status;
    weights->vertex_count = vertex_count;
    weights->particle = malloc(K * vertex_count * sizeof *weights->particle);
    weights->carry = malloc(K * vertex_count * sizeof *weights->carry);
    weights->blend = malloc(K * vertex_count * sizeof *weights->blend);
    weights->rest_m = malloc(3 * vertex_count * sizeof *weights->rest_m);
    if (!weights->particle || !weights->carry || !weights->blend || !weights->rest_m) {
        sphm_point_grid_free(&grid);
        sphm_skin_weights_free(weights);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a skin of %zu vertices", vertex_count);
    }
    (void)threads;
    size_t degenerate = 0;
#pragma omp parallel for schedule(static) num_threads(threads) reduction(+ : degenerate)
    for (size_t v = 0; v < vertex_count; ++v)
        degenerate += (size_t)carry_weights(&grid, vertices_m + 3 * v, spacing_m, v, weights);
    weights->degenerate = degenerate;
    sphm_point_grid_free(&grid);
    return SPHM_OK;
}

void sphm_skin_weights_free(sphm_skin_weights *weights) {
    free(weights->particle);
    free(weights->carry);
    free(weights->blend);
    free(weights->rest_m);
    memset(weights, 0, sizeof *weights);
}

void sphm_skin_carry(const sphm_skin_weights *weights, const sphm_real *positions_m, const double rotation[9],
                     const double offset_m[3], int threads, float *vertices_m) {
    (void)threads;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (size_t v = 0; v < weights->vertex_count; ++v) {
        const double rest[3] = {weights->rest_m[3 * v], weights->rest_m[3 * v + 1],
                                weights->rest_m[3 * v + 2]};
        double place[3];
        sphm_multiply3(rotation, rest, place);
        for (size_t k = K * v; k < K * (v + 1); ++k)
            for (int a = 0; a < 3; ++a)
                place[a] += (double)weights->carry[k] * positions_m[3 * (size_t)weights->particle[k] + a];
        for (int a = 0; a < 3; ++a)
            vertices_m[3 * v + a] = (float)(place[a] + offset_m[a]);
    }
}

void sphm_skin_blend(const sphm_skin_weights *weights, const float *field, int threads, float *out) {
    (void)threads;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (size_t v = 0; v < weights->vertex_count; ++v) {
        float sum = 0;
        for (size_t k = K * v; k < K * (v + 1); ++k)
            sum += weights->blend[k] * field[weights->particle[k]];
        out[v] = sum;
    }
}

/* Weights and buffers, when the skin is first asked for. */
static sphm_status prepare(sphm_observer *observer, sphm_context *context) {
    if (observer->vertices_m)
        return SPHM_OK;
    const sphm_surface *surface = &observer->model->body.surface;
    const size_t vertices = surface->vertex_count;
    double *places = malloc(3 * vertices * sizeof *places + 1);
    double *rest = malloc(3 * observer->count * sizeof *rest);
    float *carried = malloc(4 * vertices * sizeof *carried + 1);
    sphm_status status =
        sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a skin of %zu vertices", vertices);
    if (places && rest && carried) {
        for (size_t i = 0; i < 3 * vertices; ++i)
            places[i] = surface->vertices[i] - observer->model->frame_m[i % 3];
        for (size_t i = 0; i < 3 * observer->count; ++i)
            rest[i] = (double)observer->rest_m[i];
        status =
            sphm_skin_weights_create(places, vertices, rest, observer->count, observer->model->body.spacing_m,
                                     observer->threads, &observer->skin, context);
    }
    free(places);
    free(rest);
    if (status != SPHM_OK) {
        free(carried);
        return status;
    }
    observer->vertices_m = carried;
    observer->vertex_field = carried + 3 * vertices;
    observer->memory_bytes += vertices * (4 + 3 * K + 3) * sizeof(float);
    return SPHM_OK;
}

static sphm_status check_field(int field, sphm_context *context) {
    if (field >= 0 && field < SPHM_FIELD_COUNT)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                     "field %d is unknown; it must be 0 ... %d (SPHM_FIELD_...)", field,
                     SPHM_FIELD_COUNT - 1);
}

sphm_status sphm_observer_drape(sphm_observer *observer, const sphm_particles *particles,
                                const sphm_real *places_m, int field, sphm_skin *skin,
                                sphm_context *context) {
    sphm_status status = check_field(field, context);
    if (status == SPHM_OK)
        status = prepare(observer, context);
    if (status != SPHM_OK)
        return status;
    const float *const fields[SPHM_FIELD_COUNT] = {particles->displacement_m, particles->pressure_Pa,
                                                   particles->membrane_potential_mV, particles->activation,
                                                   particles->fibre_stretch};
    sphm_skin_carry(&observer->skin, places_m, observer->shape.motion.rotation, observer->model->frame_m,
                    observer->threads, observer->vertices_m);
    sphm_skin_blend(&observer->skin, fields[field], observer->threads, observer->vertex_field);
    const sphm_surface *surface = &observer->model->body.surface;
    skin->vertex_count = surface->vertex_count;
    skin->triangle_count = surface->triangle_count;
    skin->vertices_m = observer->vertices_m;
    skin->triangles = surface->triangles;
    skin->field = observer->vertex_field;
    return SPHM_OK;
}

sphm_status sphm_observer_skin(sphm_observer *observer, const sphm_state *state, int field, sphm_skin *skin,
                               sphm_context *context) {
    sphm_particles particles;
    sphm_status status = check_field(field, context);
    if (status == SPHM_OK)
        status = sphm_observer_particles(observer, state, &particles, context);
    return status == SPHM_OK
               ? sphm_observer_drape(observer, &particles, observer->present_m, field, skin, context)
               : status;
}
