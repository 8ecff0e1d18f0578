/* The neighbour sweeps of the fluid, for the slots of one block; see fluid.h.
 *
 * Each particle gathers over its own row in the order of the row. Sums over a row are vectors of partial
 * sums, the same ones whatever the number of threads. Rows are padded with the particle itself: at distance 0
 * every difference vanishes, only the density has to leave the padding out. */
#include "cpu/fluid.h"

#include <string.h>

static const sphm_real one = 1;

void sphm_fluid_sweep_velocity(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                               sphm_fluid_packs *packs, sphm_state *state, double step_s, size_t begin,
                               size_t end) {
    const sphm_real unit = sphm_smooth_unit(constants), mixing = sphm_smooth_mixing(constants, step_s);

    for (size_t i = begin; i < end; ++i) {
        const sphm_pack pi = packs->predicted[i].first, vi = packs->predicted[i].second;
        const int32_t *row = rows->slot + rows->row_start[i];
        const int32_t length = (int32_t)(rows->row_start[i + 1] - rows->row_start[i]);
        const int32_t neighbours = rows->row_count[i];
        sphm_lanes density = {0};
        sphm_row_packs sum;
        memset(&sum, 0, sizeof sum);
        for (int32_t k = 0; k < length; k += SPHM_LANES) {
            const sphm_row_twins other = sphm_row_read_twins(packs->predicted, row + k);
            const sphm_lanes w = sphm_smooth_pair_lanes(pi, vi, other.first, other.second, &sum);
            density += sphm_lanes_first(w, neighbours - k);
        }
        const sphm_real pull = 2 * unit * mixing;
        const sphm_pack sums = sphm_lanes_sums(sum.x, sum.y, sum.z, density);
        state->density[i] = unit * (one + sums.w);
        sphm_twin *out = &packs->smoothed[i].moving;
        out->first.x = pi.x;
        out->first.y = pi.y;
        out->first.z = pi.z;
        out->second.x = vi.x + pull * sums.x;
        out->second.y = vi.y + pull * sums.y;
        out->second.z = vi.z + pull * sums.z;
    }
}

void sphm_fluid_set_pressure(const sphm_fluid_constants *constants, sphm_fluid_packs *packs,
                             sphm_state *state, size_t begin, size_t end) {
    const sphm_fluid_constants c = *constants;
    const sphm_real share = 1 / (c.density_kg_per_m3 * c.density_kg_per_m3);
    for (size_t i = begin; i < end; ++i) {
        const sphm_real density = state->density[i];
        const sphm_real pressure = sphm_fluid_pressure(&c, density, state->rest_density[i]) +
                                   sphm_fluid_electrical_pressure(&c, state->membrane_potential[i]);
        const sphm_real tension = c.fibre_tension_Pa * state->activation[i] * share;
        state->pressure[i] = pressure;
        sphm_quad *out = &packs->smoothed[i];
        out->moving.first.w = pressure;
        out->moving.second.w = one / density;
        out->third.w = tension;
        if (packs->oblique) {
            const sphm_real root = tension > 0 ? tension * sphm_inverse_sqrt(tension) : 0;
            out->fourth.x = root * state->fibre_x[i];
            out->fourth.y = root * state->fibre_y[i];
            out->fourth.z = root * state->fibre_z[i];
        }
    }
}

/* Compiled three times: for every kind. */
SPHM_INLINE void force_block(const int kind, const sphm_force_factors f, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
        const sphm_quad *line = &packs->smoothed[i];
        sphm_force_own own;
        own.p = line->moving.first;
        own.v = line->moving.second;
        own.r = line->third;
        own.tension = line->fourth;
        own.fibre.x = state->fibre_x[i];
        own.fibre.y = state->fibre_y[i];
        own.fibre.z = state->fibre_z[i];
        own.fibre.w = 0;
        own.pressure = f.pressure * own.v.w;
        own.viscosity = f.viscosity * own.v.w;
        const int32_t *row = rows->slot + rows->row_start[i];
        const size_t length = rows->row_start[i + 1] - rows->row_start[i];
        sphm_row_packs sum, tension;
        memset(&sum, 0, sizeof sum);
        memset(&tension, 0, sizeof tension);
        for (size_t k = 0; k < length; k += SPHM_LANES) {
            sphm_row_twins moving;
            sphm_row_packs rest;
            sphm_row_read_quads(packs->smoothed, row + k, &moving, &rest);
            if (kind == SPHM_FORCE_OBLIQUE_FIBRES)
                tension = sphm_row_read_fourth(packs->smoothed, row + k);
            sphm_force_pair_lanes(kind, f, own, moving.first, moving.second, rest, tension, &sum);
        }
        const sphm_pack sums = sphm_lanes_sums(sum.x, sum.y, sum.z, sum.x);
        state->ax[i] = sums.x;
        state->ay[i] = sums.y;
        state->az[i] = sums.z;
    }
}

void sphm_fluid_sweep_forces(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end) {
    const sphm_force_factors f = sphm_force_factors_of(constants);
    switch (sphm_force_kind(constants, packs->oblique)) {
    case SPHM_FORCE_FLUID_ONLY:
        force_block(SPHM_FORCE_FLUID_ONLY, f, rows, packs, state, begin, end);
        break;
    case SPHM_FORCE_PARALLEL_FIBRES:
        force_block(SPHM_FORCE_PARALLEL_FIBRES, f, rows, packs, state, begin, end);
        break;
    default:
        force_block(SPHM_FORCE_OBLIQUE_FIBRES, f, rows, packs, state, begin, end);
    }
}
