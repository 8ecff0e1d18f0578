/* Building the diffusion weights: corrections of all particles, then weights of all pairs. Rows are read as
 * the sweeps read them (cpu/row.h): with loops over plain arrays, nine of which were gathered, the weights
 * took four times as long. */
#include "core/diffusion.h"
#include "core/context.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cpu/row.h"
#include "kernels/diffusion.h"

enum { BLOCK = 256 }; /* particles per unit of work */

/* What both passes read, with lengths in units of h. */
typedef struct build {
    const sphm_neighbours *n;
    const sphm_diffusion_input *in;
    sphm_real inverse_h_per_m;
    sphm_real pair_factor; /* g^ = pair_factor * sphm_pair_...() */
    double along, across;  /* D^, 1/ms */
    sphm_twin *twin;       /* first: x y z, unused; second: correction xx yy zz xy, 1/ms */
    sphm_real *bxz, *byz;  /* the rest of it */
} build;

static sphm_status reserve(sphm_diffusion *d, size_t particles, size_t pairs, sphm_context *context) {
    if (pairs > d->capacity) {
        free(d->weight);
        d->capacity = 0;
        /* Some more than now: lists vary in length while the tissue deforms. Whole cache lines. */
        const size_t capacity = (pairs + pairs / 8 + SPHM_ROW_ALIGN) / SPHM_ROW_ALIGN * SPHM_ROW_ALIGN;
        d->weight = aligned_alloc(64, capacity * sizeof *d->weight);
        if (!d->weight)
            return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu diffusion weights", capacity);
        d->capacity = capacity;
    }
    if (particles > d->particles) {
        free(d->scratch);
        d->particles = 0;
        const size_t rounded = (particles + SPHM_ROW_ALIGN - 1) / SPHM_ROW_ALIGN * SPHM_ROW_ALIGN;
        d->scratch = aligned_alloc(64, SPHM_DIFFUSION_SCRATCH * rounded * sizeof *d->scratch);
        if (!d->scratch)
            return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the corrections of %zu particles",
                             particles);
        d->particles = rounded;
    }
    return SPHM_OK;
}

/* sum of g^ x^ x^ x^ x^/r^2 over the row of particle i. */
static void fourth_moments(const build *w, size_t i, double moment[SPHM_MOMENT_COUNT]) {
    const sphm_pack own = w->twin[i].first;
    const int32_t *slot = w->n->slot;
    const size_t end = w->n->row_start[i + 1];
    sphm_moments_lanes m;
    memset(&m, 0, sizeof m);
    for (size_t k = w->n->row_start[i]; k < end; k += SPHM_LANES)
        sphm_moments_pair_lanes(own, sphm_row_read_first(w->twin, slot + k), &m);
    /* In the order of the enumeration. */
    const sphm_pack sums[4] = {
        sphm_lanes_sums(m.xxxx, m.yyyy, m.zzzz, m.xxyy), sphm_lanes_sums(m.xxzz, m.yyzz, m.xxxy, m.xxxz),
        sphm_lanes_sums(m.xxyz, m.xyyy, m.xyyz, m.xyzz), sphm_lanes_sums(m.xzzz, m.yyyz, m.yzzz, m.yzzz)};
    sphm_real all[16];
    memcpy(all, sums, sizeof all);
    for (int k = 0; k < SPHM_MOMENT_COUNT; k++)
        moment[k] = (double)all[k] * (double)w->pair_factor;
}

/* D^ of particle i. */
static void tensor_of(const build *w, size_t i, double tensor[6]) {
    if (w->along == w->across)
        sphm_diffusion_tensor(w->along, w->across, 0, 0, 0, tensor);
    else
        sphm_diffusion_tensor(w->along, w->across, (double)w->in->fibre_x[i], (double)w->in->fibre_y[i],
                              (double)w->in->fibre_z[i], tensor);
}

static void place(const build *w, size_t i) {
    sphm_pack *p = &w->twin[i].first;
    p->x = w->in->x[i] * w->inverse_h_per_m;
    p->y = w->in->y[i] * w->inverse_h_per_m;
    p->z = w->in->z[i] * w->inverse_h_per_m;
    p->w = 0;
}

/* Returns 1 where the six equations were singular. */
static size_t correct(const build *w, size_t i) {
    double tensor[6], moment[SPHM_MOMENT_COUNT];
    sphm_real b[6];
    int regular = 1;
    tensor_of(w, i, tensor);
    if (w->in->laplacian == SPHM_LAPLACIAN_CORRECTED) {
        fourth_moments(w, i, moment);
        regular = sphm_diffusion_correct(moment, tensor, b);
    } else {
        sphm_diffusion_bulk_form(tensor, 1, b);
    }
    w->twin[i].second.x = b[0];
    w->twin[i].second.y = b[1];
    w->twin[i].second.z = b[2];
    w->twin[i].second.w = b[3];
    w->bxz[i] = b[4];
    w->byz[i] = b[5];
    return regular ? 0 : 1;
}

/* Weights of the row of particle i. `bare` is a constant where this is inlined. */
SPHM_INLINE void weigh_row(const build *w, size_t i, const int bare, sphm_real *weight) {
    const sphm_pack own = w->twin[i].first, b = w->twin[i].second;
    const sphm_real bxz = w->bxz[i], byz = w->byz[i];
    const sphm_real half_factor = w->pair_factor * (sphm_real)0.5;
    const int32_t *slot = w->n->slot;
    const size_t end = w->n->row_start[i + 1];
    for (size_t k = w->n->row_start[i]; k < end; k += SPHM_LANES) {
        const sphm_row_twins other = sphm_row_read_twins(w->twin, slot + k);
        const sphm_lanes value = sphm_weight_pair_lanes(bare, half_factor, own, b, other.first, other.second,
                                                        bxz + sphm_row_gather(w->bxz, slot + k),
                                                        byz + sphm_row_gather(w->byz, slot + k));
        memcpy(weight + k, &value, sizeof value);
    }
}

static void weigh(const build *w, size_t i, sphm_real *weight) {
    if (w->in->laplacian == SPHM_LAPLACIAN_PAPER)
        weigh_row(w, i, 1, weight);
    else
        weigh_row(w, i, 0, weight);
}

/* Gershgorin: every eigenvalue of the sweep lies in 0 ... sum (w + |w|), and forward Euler needs dt times it
 * below 2. With positive weights this is dt sum w <= 1. */
static double row_bound(const build *w, size_t i, const sphm_real *weight, size_t *negative) {
    const size_t end = w->n->row_start[i + 1];
    sphm_real sum = 0;
    int32_t below = 0;
#pragma omp simd reduction(+ : sum, below)
    for (size_t k = w->n->row_start[i]; k < end; k++) {
        sum += weight[k] > 0 ? weight[k] : 0;
        below += weight[k] < 0;
    }
    *negative += (size_t)below;
    return 2 * (double)sum;
}

static build prepare(const sphm_diffusion *d, const sphm_neighbours *n, const sphm_diffusion_input *in) {
    const double h = in->support_radius_m;
    build w;
    w.n = n;
    w.in = in;
    w.inverse_h_per_m = (sphm_real)(1 / h);
    w.pair_factor = sphm_pair_factor(in->particle_volume_m3, h);
    w.along = sphm_diffusion_in_h(in->diffusion_mm2_per_ms, h);
    w.across = w.along / in->anisotropy_ratio;
    w.twin = (sphm_twin *)d->scratch;
    w.bxz = d->scratch + 8 * d->particles;
    w.byz = d->scratch + 9 * d->particles;
    return w;
}

sphm_status sphm_diffusion_build(sphm_diffusion *d, const sphm_neighbours *n, const sphm_diffusion_input *in,
                                 int threads, sphm_context *context) {
    const sphm_status status = reserve(d, n->count, n->row_start[n->count], context);
    if (status != SPHM_OK)
        return status;
    const build w = prepare(d, n, in);
    const size_t blocks = (n->count + BLOCK - 1) / BLOCK;
    size_t fallbacks = 0, negative = 0;
    double bound = 0;
#ifndef _OPENMP
    (void)threads;
#endif
#pragma omp parallel num_threads(threads)
    {
#pragma omp for schedule(static)
        for (size_t b = 0; b < blocks; b++)
            for (size_t i = b * BLOCK; i < (b + 1) * BLOCK && i < n->count; i++)
                place(&w, i);
#pragma omp for schedule(static) reduction(+ : fallbacks)
        for (size_t b = 0; b < blocks; b++)
            for (size_t i = b * BLOCK; i < (b + 1) * BLOCK && i < n->count; i++)
                fallbacks += correct(&w, i);
#pragma omp for schedule(static) reduction(+ : negative) reduction(max : bound)
        for (size_t b = 0; b < blocks; b++)
            for (size_t i = b * BLOCK; i < (b + 1) * BLOCK && i < n->count; i++) {
                weigh(&w, i, d->weight);
                bound = fmax(bound, row_bound(&w, i, d->weight, &negative));
            }
    }
    d->stable_step_ms = bound > 0 ? 2 / bound : INFINITY;
    d->fallbacks = fallbacks;
    d->negative = negative;
    return SPHM_OK;
}

void sphm_diffusion_free(sphm_diffusion *d) {
    free(d->weight);
    free(d->scratch);
    memset(d, 0, sizeof *d);
}
