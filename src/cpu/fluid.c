/* The neighbour sweeps of the fluid, for the slots of one block; see fluid.h.
 *
 * Each particle gathers over its own row in the order of the row. Sums over a row are vectors of partial
 * sums, the same ones whatever the number of threads. Rows are padded with the particle itself: at distance 0
 * every difference vanishes, only the density has to leave the padding out. */
#include "cpu/fluid.h"

#include <math.h>

static const sphm_real one = 1;

void sphm_fluid_sweep_velocity(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                               sphm_fluid_packs *packs, sphm_state *state, double step_s, size_t begin,
                               size_t end) {
    const double h = (double)constants->support_radius_m;
    const sphm_real unit = (sphm_real)((double)constants->mass_kg * sphm_poly6_factor(h));  /* m W(0) */
    const sphm_real mixing = (sphm_real)(-expm1(-step_s / (double)constants->xsph_time_s)); /* epsilon */

    for (size_t i = begin; i < end; ++i) {
        const sphm_pack pi = packs->predicted[i].first, vi = packs->predicted[i].second;
        const int32_t *row = rows->slot + rows->row_start[i];
        const int32_t length = (int32_t)(rows->row_start[i + 1] - rows->row_start[i]);
        const int32_t neighbours = rows->row_count[i];
        sphm_lanes density = {0}, sx = {0}, sy = {0}, sz = {0};
        for (int32_t k = 0; k < length; k += SPHM_LANES) {
            const sphm_row_twins other = sphm_row_read_twins(packs->predicted, row + k);
            const sphm_row_packs p = other.first, v = other.second;
            const sphm_lanes dx = pi.x - p.x, dy = pi.y - p.y, dz = pi.z - p.z;
            const sphm_lanes t = sphm_lanes_positive(1 - (dx * dx + dy * dy + dz * dz));
            const sphm_lanes w = t * t * t; /* sphm_poly6 */
            density += sphm_lanes_first(w, neighbours - k);
            const sphm_lanes share = w * sphm_lanes_inverse(pi.w + p.w);
            sx += share * (v.x - vi.x);
            sy += share * (v.y - vi.y);
            sz += share * (v.z - vi.z);
        }
        const sphm_real pull = 2 * unit * mixing;
        const sphm_pack sums = sphm_lanes_sums(sx, sy, sz, density);
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

/* Factors of the force sweep that do not depend on the particle. */
typedef struct force_factors {
    sphm_real pressure, viscosity, tension, pair;
} force_factors;

static force_factors make_factors(const sphm_fluid_constants *c) {
    const double h = (double)c->support_radius_m, m = (double)c->mass_kg;
    const double volume = m / (double)c->density_kg_per_m3;
    force_factors f;
    f.pressure = (sphm_real)(m * sphm_spiky_factor(h));
    f.viscosity = (sphm_real)((double)c->viscosity_Pa_s * m * sphm_viscosity_factor(h));
    f.tension = (sphm_real)((double)f.pressure * SPHM_TENSION_STIFFNESS);
    f.pair = (sphm_real)((double)c->pair_matching_Pa * SPHM_PAIR_STIFFNESS * volume * volume /
                         (m * h * h * h * h));
    return f;
}

enum { FLUID_ONLY, PARALLEL_FIBRES, OBLIQUE_FIBRES };

/* Compiled three times: without rest shape, with parallel fibres, with fibres that differ. `t` is
 * (1 - q)+, so that t is sphm_viscosity_laplacian(q) and t t/q sphm_spiky_gradient(q). */
SPHM_INLINE void force_block(const int kind, const force_factors f, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
        const sphm_quad *own = &packs->smoothed[i];
        const sphm_pack pi = own->moving.first, vi = own->moving.second, ri = own->third;
        const sphm_real fx = state->fibre_x[i], fy = state->fibre_y[i], fz = state->fibre_z[i];
        sphm_pack ti;
        ti.x = ti.y = ti.z = ti.w = 0;
        if (kind == OBLIQUE_FIBRES)
            ti = own->fourth;
        const int32_t *row = rows->slot + rows->row_start[i];
        const size_t length = rows->row_start[i + 1] - rows->row_start[i];
        const sphm_real pressure = f.pressure * vi.w, viscosity = f.viscosity * vi.w;
        sphm_lanes ax = {0}, ay = {0}, az = {0};
        for (size_t k = 0; k < length; k += SPHM_LANES) {
            sphm_row_twins moving;
            sphm_row_packs r;
            sphm_row_read_quads(packs->smoothed, row + k, &moving, &r);
            const sphm_row_packs p = moving.first, v = moving.second;
            const sphm_lanes dx = pi.x - p.x, dy = pi.y - p.y, dz = pi.z - p.z;
            const sphm_lanes q2 = dx * dx + dy * dy + dz * dz + SPHM_TINY;
            const sphm_lanes inverse_q = sphm_lanes_inverse_sqrt(q2), gap = 1 - q2 * inverse_q;
            const sphm_lanes t = sphm_lanes_positive(gap), share = t * v.w;
            const sphm_lanes drag = viscosity * share;
            sphm_lanes push = pressure * share * (pi.w + p.w) * t;
            if (kind != FLUID_ONLY) {
                const sphm_lanes ex = ri.x - r.x, ey = ri.y - r.y, ez = ri.z - r.z;
                const sphm_lanes e2 = ex * ex + ey * ey + ez * ez + SPHM_TINY;
                const sphm_lanes inverse_e = sphm_lanes_inverse_sqrt(e2), rest_gap = 1 - e2 * inverse_e;
                const sphm_lanes rest_t = sphm_lanes_positive(rest_gap);
                /* q - e, from 1 - q and 1 - e: made alike, they are equal to the bit at rest, whatever
                 * products and differences the compiler fuses. Written as q - e only one of the two was
                 * rounded. */
                sphm_lanes pull = f.pair * (rest_gap - gap);
                if (kind == PARALLEL_FIBRES) {
                    const sphm_lanes cosine = (fx * ex + fy * ey + fz * ez) * inverse_e;
                    pull += f.tension * (ri.w + r.w) * (5 * cosine * cosine - 1); /* sphm_fibre_pull */
                } else {
                    const sphm_row_packs other_tension = sphm_row_read_fourth(packs->smoothed, row + k);
                    const sphm_lanes mine = ti.x * ex + ti.y * ey + ti.z * ez;
                    const sphm_lanes other =
                        other_tension.x * ex + other_tension.y * ey + other_tension.z * ez;
                    pull += f.tension *
                            (5 * (mine * mine + other * other) * inverse_e * inverse_e - (ri.w + r.w));
                }
                push -= rest_t * rest_t * inverse_e * pull;
            }
            push *= inverse_q;
            ax += push * dx + drag * (v.x - vi.x);
            ay += push * dy + drag * (v.y - vi.y);
            az += push * dz + drag * (v.z - vi.z);
        }
        const sphm_pack sums = sphm_lanes_sums(ax, ay, az, ax);
        state->ax[i] = sums.x;
        state->ay[i] = sums.y;
        state->az[i] = sums.z;
    }
}

void sphm_fluid_sweep_forces(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end) {
    const force_factors f = make_factors(constants);
    if (!(constants->pair_matching_Pa > 0) && !(constants->fibre_tension_Pa > 0))
        force_block(FLUID_ONLY, f, rows, packs, state, begin, end);
    else if (!packs->oblique)
        force_block(PARALLEL_FIBRES, f, rows, packs, state, begin, end);
    else
        force_block(OBLIQUE_FIBRES, f, rows, packs, state, begin, end);
}
