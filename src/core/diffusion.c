/* Building the diffusion weights: corrections of all particles, then weights of all pairs. */
#include "core/diffusion.h"
#include "core/context.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels/diffusion.h"

enum { BLOCK = 256 }; /* particles per unit of work */

/* What both passes read, with lengths in units of h. */
typedef struct build {
    const sphm_neighbours *n;
    const sphm_diffusion_input *in;
    sphm_real inverse_h_per_m;
    sphm_real pair_factor; /* g^ = pair_factor * sphm_pair_...() */
    double along, across;  /* D^, 1/ms */
    sphm_real *b[6];       /* corrections, 1/ms */
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
        free(d->correction);
        d->particles = 0;
        d->correction = malloc(6 * particles * sizeof *d->correction);
        if (!d->correction)
            return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the corrections of %zu particles",
                             particles);
        d->particles = particles;
    }
    return SPHM_OK;
}

/* sum of g^ x^ x^ x^ x^/r^2 over the row of particle i. */
static void fourth_moments(const build *w, size_t i, double moment[SPHM_MOMENT_COUNT]) {
    const sphm_real *x = w->in->x, *y = w->in->y, *z = w->in->z;
    const int32_t *slot = w->n->slot;
    const sphm_real xi = x[i], yi = y[i], zi = z[i], inverse_h = w->inverse_h_per_m;
    const size_t end = w->n->row_start[i + 1];
    sphm_real xxxx = 0, yyyy = 0, zzzz = 0, xxyy = 0, xxzz = 0, yyzz = 0, xxxy = 0, xxxz = 0, xxyz = 0,
              xyyy = 0, xyyz = 0, xyzz = 0, xzzz = 0, yyyz = 0, yzzz = 0;
#pragma omp simd reduction(+ : xxxx, yyyy, zzzz, xxyy, xxzz, yyzz, xxxy, xxxz, xxyz, xyyy, xyyz, xyzz, xzzz, yyyz, yzzz)
    for (size_t k = w->n->row_start[i]; k < end; k++) {
        const int32_t j = slot[k];
        const sphm_real dx = (x[j] - xi) * inverse_h, dy = (y[j] - yi) * inverse_h,
                        dz = (z[j] - zi) * inverse_h;
        const sphm_real xx = dx * dx, yy = dy * dy, zz = dz * dz, xy = dx * dy, xz = dx * dz, yz = dy * dz;
        const sphm_real r2 = xx + yy + zz;
        const sphm_real inverse_r = 1 / sphm_square_root(r2 > 0 ? r2 : 1);
        const sphm_real g = sphm_pair_gradient(r2 * inverse_r, inverse_r) * inverse_r * inverse_r;
        const sphm_real gxx = g * xx, gyy = g * yy, gzz = g * zz;
        xxxx += gxx * xx;
        yyyy += gyy * yy;
        zzzz += gzz * zz;
        xxyy += gxx * yy;
        xxzz += gxx * zz;
        yyzz += gyy * zz;
        xxxy += gxx * xy;
        xxxz += gxx * xz;
        xxyz += gxx * yz;
        xyyy += gyy * xy;
        xyyz += gyy * xz;
        yyyz += gyy * yz;
        xyzz += gzz * xy;
        xzzz += gzz * xz;
        yzzz += gzz * yz;
    }
    const sphm_real all[SPHM_MOMENT_COUNT] = {xxxx, yyyy, zzzz, xxyy, xxzz, yyzz, xxxy, xxxz,
                                              xxyz, xyyy, xyyz, xyzz, xzzz, yyyz, yzzz};
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
    for (int k = 0; k < 6; k++)
        w->b[k][i] = b[k];
    return regular ? 0 : 1;
}

/* Weights of the row of particle i. Every operation is symmetric in i and j, so that w_ij and w_ji are the
 * same to the bit: differences only change sign, and sums of two commute. `bare` is a constant where this is
 * inlined. */
SPHM_FN void weigh_row(const build *w, size_t i, int bare, sphm_real *weight) {
    const sphm_real *x = w->in->x, *y = w->in->y, *z = w->in->z;
    const sphm_real *bxx = w->b[0], *byy = w->b[1], *bzz = w->b[2], *bxy = w->b[3], *bxz = w->b[4],
                    *byz = w->b[5];
    const int32_t *slot = w->n->slot;
    const sphm_real xi = x[i], yi = y[i], zi = z[i], inverse_h = w->inverse_h_per_m;
    const sphm_real bxxi = bxx[i], byyi = byy[i], bzzi = bzz[i], bxyi = bxy[i], bxzi = bxz[i], byzi = byz[i];
    const sphm_real half_factor = w->pair_factor * (sphm_real)0.5;
    const size_t end = w->n->row_start[i + 1];
#pragma omp simd
    for (size_t k = w->n->row_start[i]; k < end; k++) {
        const int32_t j = slot[k];
        const sphm_real dx = (x[j] - xi) * inverse_h, dy = (y[j] - yi) * inverse_h,
                        dz = (z[j] - zi) * inverse_h;
        const sphm_real r2 = dx * dx + dy * dy + dz * dz;
        const sphm_real inverse_r = 1 / sphm_square_root(r2 > 0 ? r2 : 1);
        const sphm_real r = r2 * inverse_r;
        const sphm_real g = bare ? sphm_pair_second_derivative(r) : sphm_pair_gradient(r, inverse_r);
        weight[k] = half_factor * g * inverse_r * inverse_r *
                    sphm_quadratic_form(bxxi + bxx[j], byyi + byy[j], bzzi + bzz[j], bxyi + bxy[j],
                                        bxzi + bxz[j], byzi + byz[j], dx, dy, dz);
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
    const double h = in->support_radius_m, h_mm = h * 1e3;
    build w;
    w.n = n;
    w.in = in;
    w.inverse_h_per_m = (sphm_real)(1 / h);
    w.pair_factor = SPHM_PAIR_FACTOR * (sphm_real)(in->particle_volume_m3 / (h * h * h));
    w.along = in->diffusion_mm2_per_ms / (h_mm * h_mm);
    w.across = w.along / in->anisotropy_ratio;
    for (int k = 0; k < 6; k++)
        w.b[k] = d->correction + (size_t)k * n->count;
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
    free(d->correction);
    memset(d, 0, sizeof *d);
}
