/* Fibres along the gradient of a Laplace field. Reads positions and the line of action, writes directions.
 *
 * phi = 0 on the outermost layer of particles at the origin, 1 at the insertion, no flux through the sides:
 *     sum_j w_ij (phi_j - phi_i) = 0,   w_ij = (1 - r_ij/R)^2 > 0,
 * so phi has no maximum inside and its gradient leads from end to end, along whatever bend the muscle has
 * (Choi and Blemker 2013 do the same on finite elements). Scalar positive weights rather than the corrected
 * ones of the membrane: those can be negative near the surface and lose that property. */
#include "core/context.h"
#include "core/fibres.h"
#include "core/point_grid.h"
#include "core/threads.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* Support over spacing: the 26 neighbours on a lattice. Less than two spacings, so that the fixed layer hides
 * the missing neighbours beyond it and a bar's field is exactly linear. */
#define SUPPORT 1.8
#define MOST_NEIGHBOURS 96
#define RESIDUAL 1e-8
#define BLOCK 1024
/* Below this the hand-over between threads costs more than they save, and much more on a busy machine. */
#define SERIAL_BELOW 50000
#define FEWEST_FIXED 6
/* A gradient below this share of 1/length says nothing about a direction. */
#define FLAT 1e-3

typedef struct laplace {
    size_t count;
    int64_t threads;
    size_t *row;                                           /* [count + 1] */
    int32_t *column;                                       /* [row[count]] */
    double *weight;                                        /* [row[count]] */
    double *diagonal, *phi, *residual, *direction, *image; /* [count] */
    uint8_t *fixed;                                        /* [count] */
} laplace;

static void laplace_free(laplace *l) {
    free(l->row);
    free(l->column);
    free(l->weight);
    free(l->diagonal);
    free(l->phi);
    free(l->residual);
    free(l->direction);
    free(l->image);
    free(l->fixed);
}

static sphm_status allocate(laplace *l, size_t count, sphm_context *context) {
    memset(l, 0, sizeof *l);
    l->count = count;
    l->row = malloc((count + 1) * sizeof *l->row);
    l->diagonal = calloc(count, sizeof(double));
    l->phi = calloc(count, sizeof(double));
    l->residual = calloc(count, sizeof(double));
    l->direction = calloc(count, sizeof(double));
    l->image = calloc(count, sizeof(double));
    l->fixed = calloc(count, 1);
    if (l->row && l->diagonal && l->phi && l->residual && l->direction && l->image && l->fixed)
        return SPHM_OK;
    laplace_free(l);
    return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the Laplace field of %zu particles", count);
}

/* Rows of neighbours and weights. Two passes: count, then fill. */
static sphm_status connect(laplace *l, const sphm_body *body, const sphm_point_grid *grid,
                           sphm_context *context) {
    double support = SUPPORT * body->spacing_m;
    int32_t found[MOST_NEIGHBOURS];
    l->row[0] = 0;
    for (size_t p = 0; p < l->count; p++) {
        size_t n = sphm_point_grid_within(grid, &body->positions[3 * p], support, found, MOST_NEIGHBOURS);
        l->row[p + 1] = l->row[p] + (n < MOST_NEIGHBOURS ? n : MOST_NEIGHBOURS);
    }
    l->column = malloc(l->row[l->count] * sizeof *l->column);
    l->weight = malloc(l->row[l->count] * sizeof *l->weight);
    if (!l->column || !l->weight)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu neighbours", l->row[l->count]);
    for (size_t p = 0; p < l->count; p++) {
        int32_t *column = &l->column[l->row[p]];
        size_t n = l->row[p + 1] - l->row[p];
        sphm_point_grid_within(grid, &body->positions[3 * p], support, column, n);
        for (size_t k = 0; k < n; k++) {
            double r = sqrt(
                sphm_distance_squared3(&body->positions[3 * p], &body->positions[3 * (size_t)column[k]]));
            double w = (size_t)column[k] == p ? 0 : (1 - r / support) * (1 - r / support);
            l->weight[l->row[p] + k] = w;
            l->diagonal[p] += w;
        }
    }
    return SPHM_OK;
}

/* Fixes the particles less than a spacing from the outermost one at each end, and more where those are but a
 * few, as at a pointed tip. Starts the field from a straight line between the ends. */
static void fix_ends(laplace *l, const sphm_body *body) {
    double ends[2] = {INFINITY, -INFINITY};
    for (size_t p = 0; p < l->count; p++) {
        double along = sphm_dot3(&body->positions[3 * p], body->axis);
        ends[0] = fmin(ends[0], along);
        ends[1] = fmax(ends[1], along);
    }
    double length = fmax(ends[1] - ends[0], 1e-300);
    for (int end = 0; end < 2; end++) {
        size_t fixed = 0;
        for (double depth = 0.75 * body->spacing_m; fixed < FEWEST_FIXED && depth < 0.25 * length;
             depth += 0.5 * body->spacing_m)
            for (size_t p = 0; p < l->count; p++) {
                double along = sphm_dot3(&body->positions[3 * p], body->axis);
                if (!l->fixed[p] && fabs(along - ends[end]) < depth) {
                    l->fixed[p] = 1;
                    l->phi[p] = end;
                    fixed++;
                }
            }
    }
    for (size_t p = 0; p < l->count; p++)
        if (!l->fixed[p])
            l->phi[p] = (sphm_dot3(&body->positions[3 * p], body->axis) - ends[0]) / length;
}

/* image = A x on the free particles, A x_i = sum_j w_ij (x_i - x_j); 0 on the fixed ones. */
static void apply(const laplace *l, const double *x, double *image) {
    const int64_t count = (int64_t)l->count;
#pragma omp parallel for schedule(static) num_threads(sphm_team_size(l->threads)) if (count > SERIAL_BELOW)
    for (int64_t p = 0; p < count; p++) {
        double sum = l->diagonal[p] * x[p];
        for (size_t k = l->row[p]; k < l->row[p + 1]; k++)
            sum -= l->weight[k] * x[l->column[k]];
        image[p] = l->fixed[p] ? 0 : sum;
    }
}

/* sum a b over the particles, or sum a b / divisor, leaving out where that is 0. In blocks, for the digits.
 */
static double sum_products(const laplace *l, const double *a, const double *b, const double *divisor) {
    double sum = 0;
    for (size_t first = 0; first < l->count; first += BLOCK) {
        double part = 0;
        size_t end = first + BLOCK < l->count ? first + BLOCK : l->count;
        for (size_t p = first; p < end; p++)
            part += !divisor ? a[p] * b[p] : divisor[p] > 0 ? a[p] * b[p] / divisor[p] : 0;
        sum += part;
    }
    return sum;
}

/* Conjugate gradients, preconditioned by the diagonal. Particles that hang together with neither end keep the
 * straight line they started with, up to a constant. */
static int solve(laplace *l) {
    apply(l, l->phi, l->residual);
    for (size_t p = 0; p < l->count; p++) {
        l->residual[p] = -l->residual[p];
        l->direction[p] = l->diagonal[p] > 0 ? l->residual[p] / l->diagonal[p] : 0;
    }
    double rho = sum_products(l, l->residual, l->residual, l->diagonal);
    /* Measured against the residual of a field that is off by 1 everywhere. */
    double small = 0;
    for (size_t p = 0; p < l->count; p++)
        small += l->diagonal[p];
    small *= RESIDUAL * RESIDUAL;
    for (size_t iteration = 0; iteration < 4 * l->count + 1000; iteration++) {
        if (rho <= small)
            return 1;
        apply(l, l->direction, l->image);
        double curvature = sum_products(l, l->direction, l->image, NULL);
        if (!(curvature > 0))
            return 0;
        double step = rho / curvature;
        for (size_t p = 0; p < l->count; p++) {
            l->phi[p] += step * l->direction[p];
            l->residual[p] -= step * l->image[p];
        }
        double next = sum_products(l, l->residual, l->residual, l->diagonal);
        for (size_t p = 0; p < l->count; p++)
            l->direction[p] =
                (l->diagonal[p] > 0 ? l->residual[p] / l->diagonal[p] : 0) + next / rho * l->direction[p];
        rho = next;
    }
    return 0;
}

/* grad phi = B sum_j w_ij (phi_j - phi_i) x_ij with B the inverse of sum_j w_ij x_ij x_ij: exact for a linear
 * field. The axis where that is singular or the field is flat. Returns 1 if the axis was taken. */
static int gradient(const laplace *l, const sphm_body *body, size_t p, double f[3]) {
    double moment[3][3] = {{0}}, right[3] = {0, 0, 0}, x[3];
    for (size_t n = l->row[p]; n < l->row[p + 1]; n++) {
        size_t q = (size_t)l->column[n];
        sphm_subtract3(&body->positions[3 * q], &body->positions[3 * p], x);
        for (int i = 0; i < 3; i++) {
            right[i] += l->weight[n] * (l->phi[q] - l->phi[p]) * x[i];
            for (int j = 0; j < 3; j++)
                moment[i][j] += l->weight[n] * x[i] * x[j];
        }
    }
    if (sphm_solve_symmetric3(moment, right, f) && sphm_norm3(f) * body->length_m > FLAT) {
        sphm_normalise3(f);
        return 0;
    }
    memcpy(f, body->axis, sizeof body->axis);
    return 1;
}

sphm_status sphm_body_lay_laplace(sphm_body *body, int64_t threads, sphm_context *context) {
    laplace l;
    sphm_point_grid grid;
    sphm_status status =
        sphm_point_grid_create(body->positions, body->count, SUPPORT * body->spacing_m, &grid, context);
    if (status != SPHM_OK)
        return status;
    status = allocate(&l, body->count, context);
    if (status != SPHM_OK) {
        sphm_point_grid_free(&grid);
        return status;
    }
    l.threads = threads;
    status = connect(&l, body, &grid, context);
    sphm_point_grid_free(&grid);
    if (status == SPHM_OK) {
        size_t straight = 0;
        fix_ends(&l, body);
        if (!solve(&l))
            sphm_log(context, SPHM_LOG_WARNING,
                     "fibres: the Laplace field did not converge; its best is used");
        for (size_t p = 0; p < body->count; p++)
            straight += (size_t)gradient(&l, body, p, &body->fibres[3 * p]);
        if (straight > 0)
            sphm_log(
                context, SPHM_LOG_WARNING,
                "fibres: %zu particles have no gradient of the Laplace field and follow the line of action",
                straight);
    }
    laplace_free(&l);
    return status;
}
