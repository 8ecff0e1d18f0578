/* Filling a surface with particles on a lattice: cubic, or with a whole number of layers between two
 * sections. Reads the surface and its winding number, writes positions and the flags of the outermost layer.
 *
 * A site is tissue where the winding number is above one half. The spacing is found by regula falsi on the
 * number of sites, starting from volume / count; three or four fillings do. Between two sections the layers
 * have theirs from the distance, and only the spacing within a layer is varied. Rejected: Poisson sampling
 * and relaxed packings, which cost more and whose disorder adds noise to SPH sums at rest (`jitter` is there
 * for those who want disorder). */
#include "core/filling.h"
#include "core/context.h"
#include "core/threads.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* A first guess this near is not improved further. */
#define GOOD_ENOUGH 0.002
#define ATTEMPTS_PER_OFFSET 14
#define BLOCK_SIZE 16 /* sites along a side; a power of two */
#define MOST_SITES ((size_t)1 << 33)
/* Connected sites that make up less than this share of all are strays. */
#define STRAY_SHARE 0.01

/* Where the middle of the surface's box lies between lattice sites. Half a spacing everywhere is a lattice of
 * cell middles; the symmetric ones go first, because they leave a symmetric shape symmetric. The last ones
 * reach counts that are no multiple of 2, 4 or 8. */
static const double offsets[][3] = {{0.5, 0.5, 0.5}, {0, 0.5, 0.5},   {0.5, 0, 0},      {0, 0, 0},
                                    {0.5, 0, 0.5},   {0.5, 0.5, 0},   {0, 0, 0.5},      {0, 0.5, 0},
                                    {0.5, 0.5, 0.3}, {0.5, 0.3, 0.2}, {0.4, 0.25, 0.1}, {0.15, 0.35, 0.45}};

typedef struct lattice {
    double corner[3], step[3][3]; /* site i, j, k is at corner + i step[0] + j step[1] + k step[2] */
    size_t n[3], sites;
    double spacing[3];
    uint8_t *inside; /* [sites], i fastest: 0 outside, 1 tissue, 2 tissue, already visited */
    size_t count, strays;
} lattice;

static void lattice_free(lattice *l) {
    free(l->inside);
    memset(l, 0, sizeof *l);
}

/* Box of the surface in the lattice's frame. */
static void frame_box(const sphm_filling_task *task, double middle[3], double extent[3]) {
    const sphm_surface *surface = task->surface;
    for (int k = 0; k < 3; k++) {
        double lower = INFINITY, upper = -INFINITY;
        for (size_t v = 0; v < surface->vertex_count; v++) {
            double x = sphm_dot3(&surface->vertices[3 * v], task->frame[k]);
            lower = fmin(lower, x);
            upper = fmax(upper, x);
        }
        middle[k] = 0.5 * (lower + upper);
        extent[k] = upper - lower;
    }
}

/* How many steps lie between the sections where this many layers do, the outermost SPHM_CLAMP_DEPTH inside.
 */
static double steps_between(int64_t layers) {
    return (double)layers - 1 + 2 * SPHM_CLAMP_DEPTH;
}

static double section_distance(const sphm_filling_task *task) {
    return task->sections_m[1] - task->sections_m[0];
}

/* Layers lie where the sections say, not where the offset does. */
static double first_offset(const sphm_filling_task *task, double middle, double spacing) {
    double places = (task->sections_m[0] - middle) / spacing + SPHM_CLAMP_DEPTH;
    return places - floor(places);
}

/* `layers` between the sections, 0: a cubic lattice. */

static sphm_status lattice_place(const sphm_filling_task *task, int64_t layers, double spacing,
                                 const double offset[3], lattice *l, sphm_context *context) {
    double middle[3], extent[3], product = 1;
    memset(l, 0, sizeof *l);
    frame_box(task, middle, extent);
    for (int k = 0; k < 3; k++) {
        l->spacing[k] = k == 0 && layers ? section_distance(task) / steps_between(layers) : spacing;
        product *= extent[k] / l->spacing[k] + 5;
    }
    if (!(product < (double)MOST_SITES))
        return sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                         "a lattice of %g m over the mesh has %.3g sites; at most %.3g can be handled",
                         spacing, product, (double)MOST_SITES);
    l->sites = 1;
    for (int a = 0; a < 3; a++) {
        /* One site more than reaches the box on either side, whatever the offset: the rim is cleared. */
        size_t half = (size_t)(0.5 * extent[a] / l->spacing[a]) + 2;
        l->n[a] = 2 * half + 1;
        l->sites *= l->n[a];
        double shift = a == 0 && layers ? first_offset(task, middle[a], l->spacing[a]) : offset[a];
        double start = middle[a] + (shift - (double)half) * l->spacing[a];
        for (int k = 0; k < 3; k++) {
            l->corner[k] += start * task->frame[a][k];
            l->step[a][k] = l->spacing[a] * task->frame[a][k];
        }
    }
    l->inside = calloc(l->sites, 1);
    if (!l->inside)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a lattice of %zu sites", l->sites);
    return SPHM_OK;
}

static void site_position(const lattice *l, size_t site, double x[3]) {
    double i = (double)(site % l->n[0]), j = (double)(site / l->n[0] % l->n[1]),
           k = (double)(site / (l->n[0] * l->n[1]));
    for (int d = 0; d < 3; d++)
        x[d] = l->corner[d] + i * l->step[0][d] + j * l->step[1][d] + k * l->step[2][d];
}

/* A block of sites, `size` along each side unless the lattice ends before. */
typedef struct block {
    size_t first[3], size;
} block;

static void fill_block(lattice *l, const block *b, const size_t end[3], uint8_t inside) {
    for (size_t k = b->first[2]; k < end[2]; k++)
        for (size_t j = b->first[1]; j < end[1]; j++)
            memset(&l->inside[(k * l->n[1] + j) * l->n[0] + b->first[0]], inside, end[0] - b->first[0]);
}

/* Where no triangle is near, the winding number is harmonic and a block may be decided by its middle. By
 * Harnack's inequality a harmonic function between 0 and 1 that is below 1/12 in the middle of a ball is
 * below (1 + 1/2) / (1 - 1/2)^2 / 12 = 1/2 out to half the radius; likewise above 11/12. Else the block is
 * divided. */
static void classify_block(const sphm_winding *winding, lattice *l, const block *b) {
    size_t end[3];
    double middle[3], radius = 0;
    memcpy(middle, l->corner, sizeof middle);
    for (int a = 0; a < 3; a++) {
        end[a] = b->first[a] + b->size < l->n[a] ? b->first[a] + b->size : l->n[a];
        if (end[a] <= b->first[a])
            return;
        double half = 0.5 * (double)(end[a] - 1 - b->first[a]);
        for (int k = 0; k < 3; k++)
            middle[k] += ((double)b->first[a] + half) * l->step[a][k];
        radius += half * half * l->spacing[a] * l->spacing[a];
    }
    radius = sqrt(radius);
    if (b->size == 1 || !sphm_winding_near(winding, middle, 2 * radius)) {
        double w = sphm_winding_number(winding, middle);
        if (b->size == 1 || fabs(w - 0.5) > 0.5 - 1.0 / 12) {
            fill_block(l, b, end, w > 0.5);
            return;
        }
    }
    for (int child = 0; child < 8; child++) {
        block part;
        part.size = b->size / 2;
        for (int a = 0; a < 3; a++)
            part.first[a] = b->first[a] + (child >> a & 1) * part.size;
        classify_block(winding, l, &part);
    }
}

static void lattice_classify(const sphm_filling_task *task, lattice *l) {
    size_t blocks[3];
    for (int a = 0; a < 3; a++)
        blocks[a] = (l->n[a] + BLOCK_SIZE - 1) / BLOCK_SIZE;
    const int64_t count = (int64_t)(blocks[0] * blocks[1] * blocks[2]);
#pragma omp parallel for schedule(dynamic, 4) num_threads(sphm_team_size(task->threads))
    for (int64_t n = 0; n < count; n++) {
        block b;
        b.first[0] = (size_t)n % blocks[0] * BLOCK_SIZE;
        b.first[1] = (size_t)n / blocks[0] % blocks[1] * BLOCK_SIZE;
        b.first[2] = (size_t)n / (blocks[0] * blocks[1]) * BLOCK_SIZE;
        b.size = BLOCK_SIZE;
        classify_block(task->winding, l, &b);
    }
}

/* Puts the 26 neighbours of a site that are tissue and unvisited on the stack. The lattice has an empty rim,
 * so that no neighbour lies beyond it. */
static size_t visit_neighbours(lattice *l, size_t site, size_t *stack, size_t depth) {
    for (int k = -1; k <= 1; k++)
        for (int j = -1; j <= 1; j++)
            for (int i = -1; i <= 1; i++) {
                size_t to = site + (size_t)((ptrdiff_t)l->n[0] * ((ptrdiff_t)l->n[1] * k + j) + i);
                if (l->inside[to] == 1) {
                    l->inside[to] = 2;
                    stack[depth++] = to;
                }
            }
    return depth;
}

/* Sites that hang together with few others (thin flaps of a mesh that the lattice hits here and there) would
 * be particles floating beside the muscle. */
static sphm_status drop_strays(lattice *l, sphm_context *context) {
    size_t total = 0;
    for (size_t s = 0; s < l->sites; s++)
        total += l->inside[s];
    l->count = total;
    size_t *piece = malloc((total ? total : 1) * sizeof *piece);
    size_t *stack = malloc((total ? total : 1) * sizeof *stack);
    if (!piece || !stack) {
        free(piece);
        free(stack);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu lattice sites", total);
    }
    for (size_t s = 0; s < l->sites; s++) {
        if (l->inside[s] != 1)
            continue;
        size_t size = 0, depth = 1;
        stack[0] = s;
        l->inside[s] = 2;
        while (depth > 0) {
            size_t site = stack[--depth];
            piece[size++] = site;
            depth = visit_neighbours(l, site, stack, depth);
        }
        if ((double)size < STRAY_SHARE * (double)total) {
            l->strays += size;
            for (size_t p = 0; p < size; p++)
                l->inside[piece[p]] = 0;
        }
    }
    l->count = total - l->strays;
    free(piece);
    free(stack);
    return SPHM_OK;
}

static void clear_rim(lattice *l) {
    for (size_t s = 0; s < l->sites; s++) {
        size_t i = s % l->n[0], j = s / l->n[0] % l->n[1], k = s / (l->n[0] * l->n[1]);
        if (i == 0 || j == 0 || k == 0 || i == l->n[0] - 1 || j == l->n[1] - 1 || k == l->n[2] - 1)
            l->inside[s] = 0;
    }
}

static sphm_status lattice_fill(const sphm_filling_task *task, int64_t layers, double spacing,
                                const double offset[3], lattice *l, sphm_context *context) {
    sphm_status status = lattice_place(task, layers, spacing, offset, l, context);
    if (status != SPHM_OK)
        return status;
    lattice_classify(task, l);
    clear_rim(l);
    status = drop_strays(l, context);
    if (status != SPHM_OK)
        lattice_free(l);
    return status;
}

static double misfit(const lattice *l, int64_t particles) {
    return fabs((double)l->count - (double)particles) / (double)particles;
}

/* The spacing at which cells of the tissue's volume are as many as asked for. */
static double first_guess(const sphm_filling_task *task, int64_t layers) {
    double cell = task->volume_m3 / (double)task->particles;
    return layers ? sqrt(cell / section_distance(task) * steps_between(layers)) : cbrt(cell);
}

/* Improves `best` by fillings with one offset: the count goes like spacing^-3 (^-2 between sections), so the
 * next guess is s (n/N)^(1/3), kept between the spacings that gave too many and too few. */
static sphm_status search_spacing(const sphm_filling_task *task, int64_t layers, const double offset[3],
                                  lattice *best, sphm_context *context) {
    double spacing = first_guess(task, layers), many = 0, few = INFINITY;
    for (int attempt = 0; attempt < ATTEMPTS_PER_OFFSET; attempt++) {
        lattice l;
        sphm_status status = lattice_fill(task, layers, spacing, offset, &l, context);
        if (status != SPHM_OK)
            return status;
        double ratio = (double)l.count / (double)task->particles;
        if (ratio >= 1)
            many = fmax(many, spacing);
        else
            few = fmin(few, spacing);
        if (!best->inside || misfit(&l, task->particles) < misfit(best, task->particles)) {
            lattice_free(best);
            *best = l;
        } else {
            lattice_free(&l);
        }
        if (misfit(best, task->particles) <= GOOD_ENOUGH)
            break;
        spacing *= ratio > 0 ? pow(ratio, layers ? 1.0 / 2 : 1.0 / 3) : 0.7;
        if (!(spacing > many && spacing < few))
            spacing = few < INFINITY ? 0.5 * (many + few) : 1.02 * many;
    }
    return SPHM_OK;
}

/* Turns the lattice's tissue sites into particles, in the order of the sites. */
static sphm_status take_particles(const lattice *l, sphm_filling *filling, sphm_context *context) {
    filling->positions = malloc(3 * l->count * sizeof *filling->positions);
    filling->outer = malloc(l->count);
    if (!filling->positions || !filling->outer) {
        sphm_filling_free(filling);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu particles", l->count);
    }
    size_t stride[3] = {1, l->n[0], l->n[0] * l->n[1]};
    for (size_t s = 0; s < l->sites; s++) {
        if (!l->inside[s])
            continue;
        site_position(l, s, &filling->positions[3 * filling->count]);
        uint8_t outer = 0;
        for (int a = 0; a < 3; a++)
            outer |= !l->inside[s - stride[a]] || !l->inside[s + stride[a]];
        filling->outer[filling->count++] = outer;
    }
    memcpy(filling->step_m, l->step, sizeof filling->step_m);
    filling->spacing_m = l->spacing[1]; /* no rounding where cells are cubes */
    if (l->spacing[0] != l->spacing[1])
        filling->spacing_m = cbrt(l->spacing[0] * l->spacing[1] * l->spacing[2]);
    filling->strays = l->strays;
    return SPHM_OK;
}

static int is_met(const lattice *best, const sphm_filling_task *task) {
    return best->inside && misfit(best, task->particles) <= SPHM_COUNT_TOLERANCE;
}

static sphm_status search_offsets(const sphm_filling_task *task, int64_t layers, lattice *best,
                                  sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (size_t o = 0; o < sizeof offsets / sizeof offsets[0] && status == SPHM_OK && !is_met(best, task);
         o++) {
        /* The first offset has no say where there are layers (first_offset); each with 0 there comes after
         * the one with 0.5 that is its like otherwise, and would repeat its search. */
        if (layers && offsets[o][0] == 0)
            continue;
        status = search_spacing(task, layers, offsets[o], best, context);
    }
    return status;
}

/* The number of layers between the sections whose cells are nearest to cubes; where it cannot meet the count,
 * those beside it. */
static sphm_status search_layers(const sphm_filling_task *task, lattice *best, sphm_context *context) {
    static const int64_t beside[] = {0, 1, -1, 2};
    if (!(section_distance(task) > 0))
        return search_offsets(task, 0, best, context);
    double cubes = section_distance(task) / cbrt(task->volume_m3 / (double)task->particles);
    int64_t nearest = (int64_t)(cubes + 1 - 2 * SPHM_CLAMP_DEPTH + 0.5);
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < sizeof beside / sizeof beside[0] && status == SPHM_OK && !is_met(best, task); k++)
        if (nearest + beside[k] > 0)
            status = search_offsets(task, nearest + beside[k], best, context);
    return status;
}

sphm_status sphm_filling_create(const sphm_filling_task *task, sphm_filling *filling, sphm_context *context) {
    lattice best;
    memset(&best, 0, sizeof best);
    memset(filling, 0, sizeof *filling);
    sphm_status status = search_layers(task, &best, context);
    if (status == SPHM_OK && is_met(&best, task))
        status = take_particles(&best, filling, context);
    else if (status == SPHM_OK)
        status =
            sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                      "particles: %lld cannot be met within %g %%; the nearest filling of this shape has "
                      "%zu particles",
                      (long long)task->particles, 100 * SPHM_COUNT_TOLERANCE, best.count);
    lattice_free(&best);
    return status;
}

/* A surface with holes may say any volume: a thousand cubes that take it are few or many, but they say better
 * what four thousand would take. */
sphm_status sphm_filling_create_fine(const sphm_filling_task *task, sphm_filling *filling,
                                     sphm_context *context) {
    static const double wanted[] = {1000, 4000, SPHM_FINE_CUBES};
    double volume = task->volume_m3;
    lattice l;
    memset(&l, 0, sizeof l);
    memset(filling, 0, sizeof *filling);
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < sizeof wanted / sizeof wanted[0] && status == SPHM_OK; k++) {
        double spacing = cbrt(volume / wanted[k]);
        lattice_free(&l);
        status = lattice_fill(task, 0, spacing, offsets[0], &l, context);
        if (l.count > 0)
            volume = (double)l.count * pow(spacing, 3);
    }
    if (status == SPHM_OK && l.count > 0)
        status = take_particles(&l, filling, context);
    else if (status == SPHM_OK)
        status =
            sphm_fail(context, SPHM_REFUSED_GEOMETRY,
                      "no cube of %.3g mm lies inside the mesh: it is a sheet, or its holes are too large",
                      1e3 * l.spacing[0]);
    lattice_free(&l);
    return status;
}

void sphm_filling_free(sphm_filling *filling) {
    free(filling->positions);
    free(filling->outer);
    memset(filling, 0, sizeof *filling);
}
