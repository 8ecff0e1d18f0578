/* Sums over the muscle: reads a state through the observer, writes an observation. */
#include <math.h>
#include <string.h>

#include "core/observer.h"
#include "kernels/vector.h"

/* Sums over one block of ids; only doubles, so that blocks add up component by component. */
typedef struct sums {
    double activation, volume_m3, kinetic_J, electrical_Pa, nonfinite;
    double displacement_m, surface_m;
    double region_m[3], region_plane_m[3][3], region_mV[3], region_Pa[3];
    double speed_max2, displacement_max2_m2; /* greatest values, not sums */
} sums;
_Static_assert(sizeof(sums) <= SPHM_OBSERVER_NUMBERS * sizeof(double), "raise SPHM_OBSERVER_NUMBERS");

double sphm_electrical_pressure(const sphm_model *model, double membrane_potential_mV) {
    const double above = membrane_potential_mV - model->parameters.resting_potential;
    if (model->parameters.coupling != SPHM_COUPLING_PRESSURE || above <= 0)
        return 0;
    return model->parameters.electrical_pressure * above;
}

double sphm_observer_length(const sphm_observer *observer, double *speed_m_per_s) {
    const sphm_sums *look = &observer->sums;
    const double *axis = observer->model->body.axis, *w = look->motion.turning_rad_per_s;
    const double swing[3] = {w[1] * axis[2] - w[2] * axis[1], w[2] * axis[0] - w[0] * axis[2],
                             w[0] * axis[1] - w[1] * axis[0]};
    double span[3], drift[3], carried[3], turned[3];
    for (int a = 0; a < 3; ++a) {
        span[a] = look->end_m[1][a] - look->end_m[0][a];
        drift[a] = look->end_m_per_s[1][a] - look->end_m_per_s[0][a];
    }
    sphm_multiply3(look->motion.rotation, axis, carried);
    sphm_multiply3(look->motion.rotation, swing, turned);
    if (speed_m_per_s) /* d/dt (span . R axis); the second term keeps a turning muscle at speed 0 */
        *speed_m_per_s = sphm_dot3(drift, carried) + sphm_dot3(span, turned);
    return sphm_dot3(span, carried);
}

/* Distance of particle i from its section's centroid, across `axis`. */
static double radius_of(const sphm_observer *observer, size_t i, const double axis[3]) {
    const double *centroid = observer->sums.section_m[observer->section[i]];
    double d[3];
    for (int a = 0; a < 3; ++a)
        d[a] = (double)observer->present_m[3 * i + a] - centroid[a];
    const double along = sphm_dot3(d, axis);
    for (int a = 0; a < 3; ++a)
        d[a] -= along * axis[a];
    return sqrt(sphm_dot3(d, d));
}

double sphm_observer_radius(const sphm_observer *observer) {
    const uint8_t *region = observer->model->body.region;
    double axis[3], sum = 0;
    sphm_multiply3(observer->sums.motion.rotation, observer->model->body.axis, axis);
    double *part = observer->scratch;
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t block = 0; block < observer->blocks; ++block) {
        const size_t first = block * SPHM_OBSERVER_BLOCK;
        part[block] = 0;
        for (size_t i = first; i < first + SPHM_OBSERVER_BLOCK && i < observer->count; ++i)
            if (region[i] == SPHM_REGION_CENTRE)
                part[block] += radius_of(observer, i, axis);
    }
    for (size_t block = 0; block < observer->blocks; ++block)
        sum += part[block];
    const size_t count = observer->region_count[SPHM_REGION_CENTRE];
    return count ? sum / (double)count : 0;
}

/* Whether everything a step starts from is finite in this slot. */
static int is_finite(const sphm_state *state, size_t s) {
    const sphm_real values[] = {state->x[s],        state->y[s],         state->z[s],
                                state->vx[s],       state->vy[s],        state->vz[s],
                                state->density[s],  state->pressure[s],  state->membrane_potential[s],
                                state->recovery[s], state->activation[s]};
    for (size_t k = 0; k < sizeof values / sizeof *values; ++k)
        if (!isfinite(values[k]))
            return 0;
    return 1;
}

static void add_displacement(const sphm_observer *observer, size_t i, sums *part) {
    static const int plane_axes[3][2] = {{0, 1}, {1, 2}, {0, 2}};
    const int region = observer->model->body.region[i];
    double d[3];
    sphm_observer_displacement(observer, i, d);
    const double squared = sphm_dot3(d, d), length = sqrt(squared);
    part->displacement_m += length;
    part->region_m[region] += length;
    for (int p = 0; p < 3; ++p) {
        const double u = d[plane_axes[p][0]], v = d[plane_axes[p][1]];
        part->region_plane_m[region][p] += sqrt(u * u + v * v);
    }
    if (observer->model->body.outer[i])
        part->surface_m += length;
    if (!(squared <= part->displacement_max2_m2)) /* a NaN shows */
        part->displacement_max2_m2 = squared;
}

static void add_fields(const sphm_observer *observer, const sphm_state *state, size_t i, sums *part) {
    const size_t s = (size_t)observer->slot[i];
    const int region = observer->model->body.region[i];
    const double v[3] = {(double)state->vx[s], (double)state->vy[s], (double)state->vz[s]};
    const double speed2 = sphm_dot3(v, v), mass_kg = observer->model->particle_mass_kg;
    part->activation += (double)state->activation[s];
    part->volume_m3 += mass_kg / (double)state->density[s];
    part->kinetic_J += 0.5 * mass_kg * speed2;
    part->region_mV[region] += (double)state->membrane_potential[s];
    part->region_Pa[region] += (double)state->pressure[s];
    part->electrical_Pa += sphm_electrical_pressure(observer->model, (double)state->membrane_potential[s]);
    part->nonfinite += !is_finite(state, s);
    if (!(speed2 <= part->speed_max2))
        part->speed_max2 = speed2;
}

static void add_up(sums *all, const sums *parts, size_t count) {
    memset(all, 0, sizeof *all);
    const size_t summed = offsetof(sums, speed_max2) / sizeof(double);
    for (size_t block = 0; block < count; ++block) {
        for (size_t k = 0; k < summed; ++k)
            ((double *)all)[k] += ((const double *)(parts + block))[k];
        if (!(parts[block].speed_max2 <= all->speed_max2))
            all->speed_max2 = parts[block].speed_max2;
        if (!(parts[block].displacement_max2_m2 <= all->displacement_max2_m2))
            all->displacement_max2_m2 = parts[block].displacement_max2_m2;
    }
}

static void sum_particles(sphm_observer *observer, const sphm_state *state, sums *all) {
    sums *parts = (sums *)observer->scratch;
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t block = 0; block < observer->blocks; ++block) {
        const size_t first = block * SPHM_OBSERVER_BLOCK;
        memset(parts + block, 0, sizeof *parts);
        for (size_t i = first; i < first + SPHM_OBSERVER_BLOCK && i < observer->count; ++i) {
            add_displacement(observer, i, parts + block);
            add_fields(observer, state, i, parts + block);
        }
    }
    add_up(all, parts, observer->blocks);
}

/* Mean distance of the sections' centroids from where the best rigid motion takes their rest centroids. */
static double displacement_of_sections(const sphm_observer *observer) {
    double sum = 0, count = 0;
    for (int k = 0; k < SPHM_SECTIONS; ++k) {
        if (!observer->section_count[k])
            continue;
        double d[3];
        sphm_observer_carry(observer, observer->rest_section_m[k], d);
        for (int a = 0; a < 3; ++a)
            d[a] = observer->sums.section_m[k][a] - d[a];
        sum += sqrt(sphm_dot3(d, d));
        ++count;
    }
    return sum / count;
}

static double mean(double sum, size_t count) {
    return count ? sum / (double)count : 0;
}

/* Means over all particles and over the regions. */
static void fill_means(const sphm_observer *observer, const sums *all, sphm_observation *observation) {
    const sphm_body *body = &observer->model->body;
    for (int r = 0; r < SPHM_REGION_COUNT; ++r) {
        const size_t count = observer->region_count[r];
        observation->membrane_potential_region_mV[r] = mean(all->region_mV[r], count);
        observation->pressure_region_Pa[r] = mean(all->region_Pa[r], count);
        observation->displacement_region_m[r] = mean(all->region_m[r], count);
        for (int p = 0; p < 3; ++p)
            observation->displacement_plane_m[r][p] = mean(all->region_plane_m[r][p], count);
    }
    observation->activation = mean(all->activation, observer->count);
    observation->membrane_potential_mV =
        mean(all->region_mV[0] + all->region_mV[1] + all->region_mV[2], observer->count);
    observation->pressure_mean_Pa =
        mean(all->region_Pa[0] + all->region_Pa[1] + all->region_Pa[2], observer->count);
    observation->electrical_pressure_mean_Pa = mean(all->electrical_Pa, observer->count);
    observation->displacement_mean_m = mean(all->displacement_m, observer->count);
    observation->displacement_max_m = sqrt(all->displacement_max2_m2);
    observation->displacement_surface_m = mean(all->surface_m, observer->outer_count);
    observation->deformation_by_radius =
        body->mid_radius_m > 0 ? observation->displacement_mean_m / body->mid_radius_m : 0;
    observation->deformation_by_length =
        body->length_m > 0 ? observation->displacement_mean_m / body->length_m : 0;
}

sphm_status sphm_observer_observe(sphm_observer *observer, const sphm_state *state,
                                  sphm_observation *observation, sphm_context *context) {
    (void)context;
    sums all;
    sphm_observer_look(observer, state);
    sum_particles(observer, state, &all);
    memset(observation, 0, sizeof *observation);
    fill_means(observer, &all, observation);
    observation->time_s = state->time_s;
    observation->displacement_sections_m = displacement_of_sections(observer);
    observation->length_m = sphm_observer_length(observer, &observation->lengthening_speed_m_per_s);
    if (observer->rest_length_m > 0)
        observation->shortening = 1 - observation->length_m / observer->rest_length_m;
    if (observer->rest_radius_m > 0)
        observation->bulge = sphm_observer_radius(observer) / observer->rest_radius_m - 1;
    observation->volume_ratio = all.volume_m3 / observer->rest_volume_sum_m3;
    observation->kinetic_energy_J = all.kinetic_J;
    observation->speed_max_m_per_s = sqrt(all.speed_max2);
    observation->nonfinite = (uint64_t)all.nonfinite;
    return SPHM_OK;
}
