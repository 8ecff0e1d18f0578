/* Gradients on the rest shape; see gradient.h. Reads rest positions and neighbour rows, computes in double,
 * stores what the sweeps read. Particles are independent of each other but for sums over all of them, which
 * are serial: neither the number of threads nor chance touches a bit. */
#include "core/gradient.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/threads.h"

/* Power iterations: each is two sweeps over the pairs; the eigenvalue is then known within a few per cent,
 * from below, which ESTIMATE_MARGIN makes up for. */
#define ITERATIONS 24
#define ESTIMATE_MARGIN 1.05
/* Neighbours count as lying in a plane when det M is below this share of (tr M/3)^3. */
#define SINGULAR 1e-4
/* What is then added to M, as a share of its trace: enough to keep the gradient out of the plane at zero
 * instead of amplifying rounding, little enough to leave the gradient in the plane alone. */
#define REGULARISATION 0.02

void sphm_gradient_free(sphm_gradient *gradient) {
    free(gradient->pair);
    free(gradient->correction);
    memset(gradient, 0, sizeof *gradient);
}

/* (1 - R/h)^4: steep, so that the gradient of a particle at a free surface is not that of a place far inside
 * (doc/solid.md), and bounded, so that two particles that jitter brought together do not outweigh others. */
static double profile(double r, double h) {
    const double q = 1 - r / h;
    return q > 0 ? q * q * q * q : 0;
}

/* One third of the sum of R^2 (1 - R/h)^4 over the sites of an endless cubic lattice, m2: what w is divided
 * by. */
static double lattice_moment(double spacing, double h) {
    const int reach = (int)(h / spacing);
    double sum = 0;
    for (int a = -reach; a <= reach; ++a)
        for (int b = -reach; b <= reach; ++b)
            for (int c = -reach; c <= reach; ++c) {
                const double r2 = spacing * spacing * (a * a + b * b + c * c);
                sum += r2 * profile(sqrt(r2), h) / 3;
            }
    return sum;
}

/* The factor of the profile, 1/m2. On a lattice without neighbours (paper_units) weights are those of the
 * integral over space; only pairs that jitter brought together have any. */
static double weight_scale(double radius, double volume) {
    const double moment = lattice_moment(cbrt(volume), radius);
    return moment > 0 ? 1 / moment : volume * 945 / (2 * 3.14159265358979323846 * pow(radius, 5));
}

/* Inverse of the symmetric matrix m (xx, xy, xz, yy, yz, zz); returns its determinant. */
static double invert_symmetric(const double m[6], double inverse[6]) {
    const double c0 = m[3] * m[5] - m[4] * m[4], c1 = m[2] * m[4] - m[1] * m[5],
                 c2 = m[1] * m[4] - m[2] * m[3];
    const double determinant = m[0] * c0 + m[1] * c1 + m[2] * c2;
    inverse[0] = c0 / determinant;
    inverse[1] = c1 / determinant;
    inverse[2] = c2 / determinant;
    inverse[3] = (m[0] * m[5] - m[2] * m[2]) / determinant;
    inverse[4] = (m[1] * m[2] - m[0] * m[4]) / determinant;
    inverse[5] = (m[0] * m[3] - m[1] * m[1]) / determinant;
    return determinant;
}

enum { WHOLE, ISOLATED, REGULARISED };

/* Says which of the three the particle is. */
static int correct(sphm_gradient *gradient, size_t slot, double m[6]) {
    double inverse[6] = {0, 0, 0, 0, 0, 0};
    const double mean = (m[0] + m[3] + m[5]) / 3;
    int what = WHOLE;
    if (!(mean > 0)) {
        what = ISOLATED;
    } else if (!(invert_symmetric(m, inverse) > SINGULAR * mean * mean * mean)) {
        what = REGULARISED;
        for (int d = 0; d < 6; d += d ? 2 : 3) /* 0, 3, 5 */
            m[d] += 3 * REGULARISATION * mean;
        invert_symmetric(m, inverse);
    }
    for (int d = 0; d < 6; ++d)
        gradient->correction[6 * slot + (size_t)d] = (sphm_real)inverse[d];
    return what;
}

/* Weights of a row and, from the weights as they were rounded, its correction. */
static int build_row(sphm_gradient *gradient, const sphm_neighbours *rows, size_t slot, const sphm_real *x,
                     const sphm_real *y, const sphm_real *z, double radius, double scale) {
    double m[6] = {0, 0, 0, 0, 0, 0};
    for (size_t k = rows->row_start[slot]; k < rows->row_start[slot + 1]; ++k) {
        const int32_t j = rows->slot[k];
        const double X = (double)x[j] - (double)x[slot], Y = (double)y[j] - (double)y[slot],
                     Z = (double)z[j] - (double)z[slot];
        const double r = sqrt(X * X + Y * Y + Z * Z);
        const double w = r > 0 ? scale * profile(r, radius) : 0;
        sphm_real *pair = gradient->pair + 4 * k;
        pair[0] = (sphm_real)(w * X);
        pair[1] = (sphm_real)(w * Y);
        pair[2] = (sphm_real)(w * Z);
        pair[3] = (sphm_real)w;
        m[0] += (double)pair[0] * X;
        m[1] += (double)pair[0] * Y;
        m[2] += (double)pair[0] * Z;
        m[3] += (double)pair[1] * Y;
        m[4] += (double)pair[1] * Z;
        m[5] += (double)pair[2] * Z;
    }
    return correct(gradient, slot, m);
}

/* g = B v */
static void apply_correction(const sphm_gradient *gradient, size_t slot, const double v[3], double g[3]) {
    const sphm_real *b = gradient->correction + 6 * slot;
    g[0] = b[0] * v[0] + b[1] * v[1] + b[2] * v[2];
    g[1] = b[1] * v[0] + b[3] * v[1] + b[4] * v[2];
    g[2] = b[2] * v[0] + b[4] * v[1] + b[5] * v[2];
}

/* grad phi of every particle, and (into `jumps`) the sum of w (phi_j - phi_i). */
static void sweep_gradient(const sphm_gradient *gradient, const sphm_neighbours *rows, const double *phi,
                           int threads, double *grad, double *jumps) {
#pragma omp parallel for schedule(static)                                                                    \
    num_threads(sphm_team_size(threads)) if (gradient->count > SPHM_SERIAL_BELOW)
    for (size_t slot = 0; slot < gradient->count; ++slot) {
        double sum[4] = {0, 0, 0, 0};
        for (size_t k = rows->row_start[slot]; k < rows->row_start[slot + 1]; ++k) {
            const double difference = phi[rows->slot[k]] - phi[slot];
            for (int d = 0; d < 4; ++d)
                sum[d] += (double)gradient->pair[4 * k + (size_t)d] * difference;
        }
        apply_correction(gradient, slot, sum, grad + 3 * slot);
        jumps[slot] = sum[3];
    }
}

/* sum_j w X . (v_i + v_j) */
static double sum_of_both(const sphm_gradient *gradient, const sphm_neighbours *rows, const double *v,
                          size_t slot) {
    double sum = 0;
    for (size_t k = rows->row_start[slot]; k < rows->row_start[slot + 1]; ++k)
        for (size_t d = 0; d < 3; ++d)
            sum += (double)gradient->pair[4 * k + d] * (v[3 * slot + d] + v[3 * (size_t)rows->slot[k] + d]);
    return sum;
}

/* Minus the derivative of half the sum of q |grad phi|^2, q the relative volume. */
static void sweep_adjoint(const sphm_gradient *gradient, const sphm_neighbours *rows,
                          const sphm_real *relative_volume, double *grad, int threads, double *force) {
#pragma omp parallel num_threads(sphm_team_size(threads)) if (gradient->count > SPHM_SERIAL_BELOW)
    {
#pragma omp for schedule(static)
        for (size_t slot = 0; slot < gradient->count; ++slot) {
            double flux[3];
            for (int d = 0; d < 3; ++d)
                flux[d] = (double)relative_volume[slot] * grad[3 * slot + (size_t)d];
            apply_correction(gradient, slot, flux, grad + 3 * slot);
        }
#pragma omp for schedule(static)
        for (size_t slot = 0; slot < gradient->count; ++slot)
            force[slot] = sum_of_both(gradient, rows, grad, slot);
    }
}

/* The same of the hourglass energy, whose derivative with respect to grad phi vanishes (doc/solid.md). */
static void sweep_hourglass_adjoint(const sphm_gradient *gradient, const sphm_neighbours *rows,
                                    const double *grad, const double *jumps, int threads, double *force) {
#pragma omp parallel for schedule(static)                                                                    \
    num_threads(sphm_team_size(threads)) if (gradient->count > SPHM_SERIAL_BELOW)
    for (size_t slot = 0; slot < gradient->count; ++slot)
        force[slot] = jumps[slot] - sum_of_both(gradient, rows, grad, slot) / 2;
}

/* Velocities u whose d-th component is minus the adjoint of the d-th component of the gradient at phi,
 * against the particles' masses: [3 * count]. `flux`: q phi B, three rows of four lanes a particle, the last
 * 0. */
static void sweep_divergence_adjoint(const sphm_gradient *gradient, const sphm_neighbours *rows,
                                     const sphm_real *relative_volume, const double *phi, int threads,
                                     double *flux, double *u) {
#pragma omp parallel num_threads(sphm_team_size(threads)) if (gradient->count > SPHM_SERIAL_BELOW)
    {
#pragma omp for schedule(static)
        for (size_t slot = 0; slot < gradient->count; ++slot)
            for (size_t d = 0; d < 3; ++d) {
                const double unit[3] = {d == 0, d == 1, d == 2};
                apply_correction(gradient, slot, unit, flux + 12 * slot + 4 * d);
                for (size_t c = 0; c < 3; ++c)
                    flux[12 * slot + 4 * d + c] *= (double)relative_volume[slot] * phi[slot];
                flux[12 * slot + 4 * d + 3] = 0;
            }
#pragma omp for schedule(static)
        for (size_t slot = 0; slot < gradient->count; ++slot) {
            const double *here = flux + 12 * slot;
            double sum[4] = {0, 0, 0, 0};
            for (size_t k = rows->row_start[slot]; k < rows->row_start[slot + 1]; ++k) {
                const sphm_real *pair = gradient->pair + 4 * k;
                const double *there = flux + 12 * (size_t)rows->slot[k];
                for (size_t d = 0; d < 4; ++d)
                    sum[d] += (double)pair[0] * (here[d] + there[d]) +
                              (double)pair[1] * (here[4 + d] + there[4 + d]) +
                              (double)pair[2] * (here[8 + d] + there[8 + d]);
            }
            for (size_t d = 0; d < 3; ++d)
                u[3 * slot + d] = sum[d] / (double)relative_volume[slot];
        }
    }
}

/* div u of every particle. */
static void sweep_divergence(const sphm_gradient *gradient, const sphm_neighbours *rows, const double *u,
                             int threads, double *divergence) {
#pragma omp parallel for schedule(static)                                                                    \
    num_threads(sphm_team_size(threads)) if (gradient->count > SPHM_SERIAL_BELOW)
    for (size_t slot = 0; slot < gradient->count; ++slot) {
        double sum[3][4] = {{0}}, g[3];
        for (size_t k = rows->row_start[slot]; k < rows->row_start[slot + 1]; ++k) {
            const sphm_real *pair = gradient->pair + 4 * k;
            const double *there = u + 3 * (size_t)rows->slot[k], *here = u + 3 * slot;
            for (size_t d = 0; d < 4; ++d) { /* four lanes; the last is nothing's */
                sum[0][d] += (double)pair[d] * (there[0] - here[0]);
                sum[1][d] += (double)pair[d] * (there[1] - here[1]);
                sum[2][d] += (double)pair[d] * (there[2] - here[2]);
            }
        }
        divergence[slot] = 0;
        for (int c = 0; c < 3; ++c) {
            apply_correction(gradient, slot, sum[c], g);
            divergence[slot] += g[c];
        }
    }
}

/* sum q phi^2 */
static double norm_of(const double *phi, const sphm_real *relative_volume, size_t n) {
    double sum = 0;
    for (size_t i = 0; i < n; ++i)
        sum += (double)relative_volume[i] * phi[i] * phi[i];
    return sqrt(sum);
}

#define EIGENVALUE_WORK 17

enum { GRADIENT, DIVERGENCE, HOURGLASS };

/* One of the three forms applied to phi, but for its sign. Of the divergence phi is a divergence itself, and
 * the form the divergence of its adjoint, which has the same eigenvalues. `work`: 15 doubles a particle. */
static void apply_form(const sphm_gradient *gradient, const sphm_neighbours *rows,
                       const sphm_real *relative_volume, int form, const double *phi, int threads,
                       double *work, double *force) {
    if (form == DIVERGENCE) {
        double *u = work, *flux = work + 3 * gradient->count;
        sweep_divergence_adjoint(gradient, rows, relative_volume, phi, threads, flux, u);
        sweep_divergence(gradient, rows, u, threads, force);
        return;
    }
    double *jumps = work, *grad = work + gradient->count;
    sweep_gradient(gradient, rows, phi, threads, grad, jumps);
    if (form == GRADIENT)
        sweep_adjoint(gradient, rows, relative_volume, grad, threads, force);
    else
        sweep_hourglass_adjoint(gradient, rows, grad, jumps, threads, force);
    for (size_t i = 0; i < gradient->count; ++i) /* a particle's mass goes with its volume */
        force[i] /= (double)relative_volume[i];
}

/* Largest eigenvalue by power iteration from a start that has no symmetry. `work`: EIGENVALUE_WORK doubles a
 * particle. */
static double largest_eigenvalue(const sphm_gradient *gradient, const sphm_neighbours *rows,
                                 const sphm_real *relative_volume, int form, int threads, double *work) {
    const size_t n = gradient->count;
    double *phi = work, *force = work + n;
    uint32_t random = 12345;
    for (size_t i = 0; i < n; ++i) {
        random = random * 1664525u + 1013904223u;
        phi[i] = (double)random / 4294967296.0 - 0.5;
    }
    double eigenvalue = 0;
    for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
        apply_form(gradient, rows, relative_volume, form, phi, threads, work + 2 * n, force);
        const double norm = norm_of(force, relative_volume, n);
        if (!(norm > 0))
            return 0;
        eigenvalue = norm / norm_of(phi, relative_volume, n);
        for (size_t i = 0; i < n; ++i)
            phi[i] = force[i] / norm;
    }
    return ESTIMATE_MARGIN * eigenvalue;
}

static sphm_status allocate(sphm_gradient *gradient, const sphm_neighbours *rows, sphm_context *context) {
    const size_t n = rows->count, pairs = rows->row_start[n];
    const size_t bytes = (4 * pairs * sizeof(sphm_real) + 127) / 128 * 128;
    gradient->count = n;
    gradient->pair = (sphm_real *)aligned_alloc(128, bytes ? bytes : 128);
    gradient->correction = (sphm_real *)malloc((6 * n + 1) * sizeof(sphm_real));
    if (gradient->pair && gradient->correction)
        return SPHM_OK;
    sphm_gradient_free(gradient);
    return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the gradients of %zu particles, %zu pairs",
                     n, pairs);
}

static void build_rows(sphm_gradient *gradient, const sphm_neighbours *rows, const sphm_real *x,
                       const sphm_real *y, const sphm_real *z, double radius_m, double volume_m3,
                       int threads) {
    const double scale = weight_scale(radius_m, volume_m3);
    size_t pairs = 0, isolated = 0, regularised = 0;
#pragma omp parallel for schedule(static) num_threads(sphm_team_size(threads))                                               \
    reduction(+ : pairs, isolated, regularised) if (rows->count > SPHM_SERIAL_BELOW)
    for (size_t slot = 0; slot < rows->count; ++slot) {
        const int what = build_row(gradient, rows, slot, x, y, z, radius_m, scale);
        pairs += (size_t)rows->row_count[slot];
        isolated += what == ISOLATED;
        regularised += what == REGULARISED;
    }
    gradient->isolated = isolated;
    gradient->regularised = regularised;
    gradient->neighbours_per_particle = rows->count ? (double)pairs / (double)rows->count : 0;
}

static sphm_status estimate_eigenvalues(sphm_gradient *gradient, const sphm_neighbours *rows,
                                        const sphm_real *relative_volume, int threads,
                                        sphm_context *context) {
    double *const eigenvalue[] = {&gradient->gradient_eigenvalue, &gradient->divergence_eigenvalue,
                                  &gradient->hourglass_eigenvalue};
    double *work = (double *)malloc((EIGENVALUE_WORK * gradient->count + 1) * sizeof *work);
    if (!work) {
        const size_t n = gradient->count;
        sphm_gradient_free(gradient);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the eigenvalues of %zu particles", n);
    }
    for (int form = GRADIENT; form <= HOURGLASS; ++form)
        *eigenvalue[form] = largest_eigenvalue(gradient, rows, relative_volume, form, threads, work);
    free(work);
    return SPHM_OK;
}

sphm_status sphm_gradient_create(sphm_gradient *gradient, const sphm_neighbours *rows, const sphm_real *x,
                                 const sphm_real *y, const sphm_real *z, const sphm_real *relative_volume,
                                 double radius_m, double volume_m3, int threads, sphm_context *context) {
    memset(gradient, 0, sizeof *gradient);
    const sphm_status status = allocate(gradient, rows, context);
    if (status != SPHM_OK)
        return status;
    build_rows(gradient, rows, x, y, z, radius_m, volume_m3, threads);
    return estimate_eigenvalues(gradient, rows, relative_volume, threads, context);
}

sphm_status sphm_gradient_rebuild(sphm_gradient *gradient, const sphm_neighbours *rows, const sphm_real *x,
                                  const sphm_real *y, const sphm_real *z, double radius_m, double volume_m3,
                                  int threads, sphm_context *context) {
    sphm_gradient rebuilt;
    memset(&rebuilt, 0, sizeof rebuilt);
    const sphm_status status = allocate(&rebuilt, rows, context);
    if (status != SPHM_OK)
        return status;
    build_rows(&rebuilt, rows, x, y, z, radius_m, volume_m3, threads);
    rebuilt.gradient_eigenvalue = gradient->gradient_eigenvalue;
    rebuilt.divergence_eigenvalue = gradient->divergence_eigenvalue;
    rebuilt.hourglass_eigenvalue = gradient->hourglass_eigenvalue;
    sphm_gradient_free(gradient);
    *gradient = rebuilt;
    return SPHM_OK;
}
