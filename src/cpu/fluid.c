/* The neighbour sweeps of the fluid, for the slots of one block; see fluid.h.
 *
 * Each particle gathers over its own row in the order of the row. Sums over a row are vectors of partial
 * sums, the same ones whatever the number of threads. Rows are padded with the particle itself: at distance 0
 * every difference vanishes, only the density has to leave the padding out. */
#include "cpu/fluid.h"

#include <math.h>

static const sphm_real one = 1;

static size_t chunk_length(size_t left) {
    return left < SPHM_CHUNK ? left : SPHM_CHUNK;
}

void sphm_fluid_sweep_velocity(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                               sphm_fluid_packs *packs, sphm_state *state, double step_s, size_t begin,
                               size_t end) {
    const double h = (double)constants->support_radius_m;
    const sphm_real unit = (sphm_real)((double)constants->mass_kg * sphm_poly6_factor(h));  /* m W(0) */
    const sphm_real mixing = (sphm_real)(-expm1(-step_s / (double)constants->xsph_time_s)); /* epsilon */
    sphm_row_buffer p, v;

    for (size_t i = begin; i < end; ++i) {
        const sphm_pack pi = packs->position[i], vi = packs->velocity[i];
        const int32_t *row = rows->slot + rows->row_start[i];
        const size_t length = rows->row_start[i + 1] - rows->row_start[i];
        const int32_t neighbours = rows->row_count[i];
        sphm_real density = 0, sx = 0, sy = 0, sz = 0;
        for (size_t done = 0; done < length; done += SPHM_CHUNK) {
            const size_t n = chunk_length(length - done);
            const int32_t real_entries = neighbours - (int32_t)done;
            sphm_row_read(packs->position, row + done, n, &p);
            sphm_row_read(packs->velocity, row + done, n, &v);
#pragma omp simd reduction(+ : density, sx, sy, sz)
            for (int32_t k = 0; k < (int32_t)n; ++k) {
                const sphm_real dx = pi.x - p.x[k], dy = pi.y - p.y[k], dz = pi.z - p.z[k];
                const sphm_real w = sphm_poly6(dx * dx + dy * dy + dz * dz);
                density += k < real_entries ? w : 0;
                const sphm_real share = w / (pi.w + p.w[k]);
                sx += share * (v.x[k] - vi.x);
                sy += share * (v.y[k] - vi.y);
                sz += share * (v.z[k] - vi.z);
            }
        }
        const sphm_real pull = 2 * unit * mixing;
        state->density[i] = unit * (one + density);
        packs->smoothed[i].x = vi.x + pull * sx;
        packs->smoothed[i].y = vi.y + pull * sy;
        packs->smoothed[i].z = vi.z + pull * sz;
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
        packs->position[i].w = pressure;
        packs->smoothed[i].w = one / density;
        packs->rest[i].w = tension;
        if (packs->tension) {
            const sphm_real root = tension > 0 ? tension * sphm_inverse_sqrt(tension) : 0;
            packs->tension[i].x = root * state->fibre_x[i];
            packs->tension[i].y = root * state->fibre_y[i];
            packs->tension[i].z = root * state->fibre_z[i];
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

/* Compiled three times: without rest shape, with parallel fibres, with fibres that differ. */
static inline __attribute__((always_inline)) void force_block(const int kind, const force_factors f,
                                                              const sphm_neighbours *rows,
                                                              const sphm_fluid_packs *packs,
                                                              sphm_state *state, size_t begin, size_t end) {
    sphm_row_buffer p, v, r, t;
    for (size_t i = begin; i < end; ++i) {
        const sphm_pack pi = packs->position[i], vi = packs->smoothed[i], ri = packs->rest[i];
        const sphm_real fx = state->fibre_x[i], fy = state->fibre_y[i], fz = state->fibre_z[i];
        sphm_pack ti;
        ti.x = ti.y = ti.z = ti.w = 0;
        if (kind == OBLIQUE_FIBRES)
            ti = packs->tension[i];
        const int32_t *row = rows->slot + rows->row_start[i];
        const size_t length = rows->row_start[i + 1] - rows->row_start[i];
        const sphm_real pressure = f.pressure * vi.w, viscosity = f.viscosity * vi.w;
        sphm_real ax = 0, ay = 0, az = 0;
        for (size_t done = 0; done < length; done += SPHM_CHUNK) {
            const size_t n = chunk_length(length - done);
            sphm_row_read(packs->position, row + done, n, &p);
            sphm_row_read(packs->smoothed, row + done, n, &v);
            if (kind != FLUID_ONLY)
                sphm_row_read(packs->rest, row + done, n, &r);
            if (kind == OBLIQUE_FIBRES)
                sphm_row_read(packs->tension, row + done, n, &t);
#pragma omp simd reduction(+ : ax, ay, az)
            for (int32_t k = 0; k < (int32_t)n; ++k) {
                const sphm_real dx = pi.x - p.x[k], dy = pi.y - p.y[k], dz = pi.z - p.z[k];
                const sphm_real q2 = dx * dx + dy * dy + dz * dz + SPHM_TINY;
                const sphm_real inverse_q = sphm_inverse_sqrt(q2), q = q2 * inverse_q;
                const sphm_real spiky = sphm_spiky_gradient(q, inverse_q);
                sphm_real push = pressure * v.w[k] * (pi.w + p.w[k]) * spiky;
                const sphm_real drag = viscosity * v.w[k] * sphm_viscosity_laplacian(q);
                if (kind != FLUID_ONLY) {
                    const sphm_real ex = ri.x - r.x[k], ey = ri.y - r.y[k], ez = ri.z - r.z[k];
                    const sphm_real e2 = ex * ex + ey * ey + ez * ez + SPHM_TINY;
                    const sphm_real inverse_e = sphm_inverse_sqrt(e2), e = e2 * inverse_e;
                    const sphm_real weight = sphm_spiky_gradient(e, inverse_e);
                    sphm_real pull = f.pair * (q - e);
                    if (kind == PARALLEL_FIBRES) {
                        const sphm_real along = fx * ex + fy * ey + fz * ez;
                        pull += f.tension * (ri.w + r.w[k]) * sphm_fibre_pull(along * inverse_e);
                    } else {
                        const sphm_real own = ti.x * ex + ti.y * ey + ti.z * ez;
                        const sphm_real other = t.x[k] * ex + t.y[k] * ey + t.z[k] * ez;
                        pull += f.tension *
                                (5 * (own * own + other * other) * inverse_e * inverse_e - (ri.w + r.w[k]));
                    }
                    push -= weight * pull * inverse_q;
                }
                ax += push * dx + drag * (v.x[k] - vi.x);
                ay += push * dy + drag * (v.y[k] - vi.y);
                az += push * dz + drag * (v.z[k] - vi.z);
            }
        }
        state->ax[i] = ax;
        state->ay[i] = ay;
        state->az[i] = az;
    }
}

void sphm_fluid_sweep_forces(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end) {
    const force_factors f = make_factors(constants);
    if (!(constants->pair_matching_Pa > 0) && !(constants->fibre_tension_Pa > 0))
        force_block(FLUID_ONLY, f, rows, packs, state, begin, end);
    else if (!packs->tension)
        force_block(PARALLEL_FIBRES, f, rows, packs, state, begin, end);
    else
        force_block(OBLIQUE_FIBRES, f, rows, packs, state, begin, end);
}
