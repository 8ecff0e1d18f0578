/* Sums over the muscle: reads a state through the observer, writes an observation. */
#include <math.h>
#include <string.h>

#include "core/observer.h"
#include "kernels/vector.h"

_Static_assert(sizeof(sphm_field_sums) <= sizeof(sphm_shape_sums), "the scratch memory is for either");

double sphm_observer_length(const sphm_observer *observer, double *speed_m_per_s) {
    const sphm_look_shape *look = &observer->shape;
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

static void sum_particles(sphm_observer *observer, const sphm_state *state, sphm_field_sums *all) {
    sphm_field_sums *parts = (sphm_field_sums *)observer->scratch;
#pragma omp parallel for schedule(static) num_threads(observer->threads)
    for (size_t block = 0; block < observer->blocks; ++block) {
        const size_t first = block * SPHM_OBSERVER_BLOCK;
        memset(parts + block, 0, sizeof *parts);
        for (size_t i = first; i < first + SPHM_OBSERVER_BLOCK && i < observer->count; ++i) {
            const sphm_look_particle p = sphm_look_particle_of(state, (size_t)observer->slot[i]);
            sphm_look_add_fields(&observer->look, &observer->shape, &observer->role[i],
                                 observer->rest_m + 3 * i, &p, 0, parts + block);
        }
    }
    memset(all, 0, sizeof *all);
    for (size_t block = 0; block < observer->blocks; ++block)
        for (int k = 0; k < SPHM_FIELD_NUMBERS; ++k)
            sphm_look_add_number(k, ((const double *)(parts + block))[k], (double *)all + k);
}

/* Mean distance of the sections' centroids from where the best rigid motion takes their rest centroids. */
static double displacement_of_sections(const sphm_observer *observer) {
    double sum = 0, count = 0;
    for (int k = 0; k < SPHM_SECTIONS; ++k) {
        if (!(observer->look.section_count[k] > 0))
            continue;
        double d[3];
        sphm_look_carry(&observer->shape.motion, observer->rest_section_m[k], d);
        for (int a = 0; a < 3; ++a)
            d[a] = observer->shape.section_m[k][a] - d[a];
        sum += sqrt(sphm_dot3(d, d));
        ++count;
    }
    return sum / count;
}

static double mean(double sum, size_t count) {
    return count ? sum / (double)count : 0;
}

/* Means over all particles and over the regions. */
static void fill_means(const sphm_observer *observer, const sphm_field_sums *all,
                       sphm_observation *observation) {
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

void sphm_observer_fill(const sphm_observer *observer, const sphm_field_sums *all,
                        sphm_observation *observation) {
    memset(observation, 0, sizeof *observation);
    fill_means(observer, all, observation);
    observation->displacement_sections_m = displacement_of_sections(observer);
    observation->length_m = sphm_observer_length(observer, &observation->lengthening_speed_m_per_s);
    if (observer->rest_length_m > 0)
        observation->shortening = 1 - observation->length_m / observer->rest_length_m;
    if (observer->rest_radius_m > 0)
        observation->bulge =
            mean(all->radius_m, observer->region_count[SPHM_REGION_CENTRE]) / observer->rest_radius_m - 1;
    observation->volume_ratio = all->volume_m3 / observer->rest_volume_sum_m3;
    observation->kinetic_energy_J = all->kinetic_J;
    observation->speed_max_m_per_s = sqrt(all->speed_max2);
    observation->nonfinite = (uint64_t)all->nonfinite;
}

sphm_status sphm_observer_observe(sphm_observer *observer, const sphm_state *state,
                                  sphm_observation *observation, sphm_context *context) {
    (void)context;
    sphm_field_sums all;
    sphm_observer_look(observer, state);
    sum_particles(observer, state, &all);
    sphm_observer_fill(observer, &all, observation);
    observation->time_s = state->time_s;
    return SPHM_OK;
}
