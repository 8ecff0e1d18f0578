// A heap of particles of the solid tissue with the sweeps of the CPU back end and nothing else: no muscle, no
// membrane. Tests prescribe or integrate its motion themselves.
#ifndef SPHM_TEST_SOLID_SCENE_H
#define SPHM_TEST_SOLID_SCENE_H

#include "core/gradient.h"
#include "core/solid_limits.h"
#include "cpu/grid.h"
#include "cpu/neighbours.h"
#include "cpu/parallel.h"
#include "cpu/solid_sweeps.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numeric>
#include <random>
#include <stdexcept>
#include <vector>

namespace solid {

using Vector = std::array<double, 3>;

// Table 3 of the paper, with what it leaves out as FEM practice has it.
inline sphm_solid_constants table3(int coupling = SPHM_FIBRE_TRUE_STRETCH) {
    sphm_solid_constants c{};
    c.along_fibre_shear_Pa = 500;
    c.cross_fibre_shear_Pa = 500;
    c.bulk_Pa = 1e5;
    c.max_isometric_stress_Pa = 3e5;
    c.optimal_stretch = sphm_real(1.07);
    c.passive_linear_stretch = sphm_real(1.4);
    c.passive_coefficient = sphm_real(0.05);
    c.passive_exponent = sphm_real(6.6);
    c.fibre_coupling = coupling;
    return c;
}

// Lattice points of the box (centred) that satisfy `inside`, displaced by up to `jitter` spacings.
inline std::vector<Vector> fill(const Vector &size, double spacing, double jitter,
                                const std::function<bool(const Vector &)> &inside) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-jitter, jitter);
    std::vector<Vector> points;
    const int n[3] = {int(size[0] / spacing + 0.5), int(size[1] / spacing + 0.5),
                      int(size[2] / spacing + 0.5)};
    for (int i = 0; i < n[0]; ++i)
        for (int j = 0; j < n[1]; ++j)
            for (int k = 0; k < n[2]; ++k) {
                Vector p = {(i + 0.5 - n[0] / 2.0) * spacing, (j + 0.5 - n[1] / 2.0) * spacing,
                            (k + 0.5 - n[2] / 2.0) * spacing};
                if (!inside(p))
                    continue;
                for (double &c : p)
                    c += jitter > 0 ? uniform(random) * spacing : 0;
                points.push_back(p);
            }
    return points;
}

inline std::vector<Vector> block(const Vector &size, double spacing, double jitter = 0) {
    return fill(size, spacing, jitter, [](const Vector &) { return true; });
}

// As uneven as the particles beside a surface, without any order; 1 on the mean.
inline std::vector<double> uneven_volumes(size_t count) {
    std::mt19937 random(17);
    std::uniform_real_distribution<double> uniform(0.4, 1.7);
    std::vector<double> relative(count);
    for (double &q : relative)
        q = uniform(random);
    const double mean = std::accumulate(relative.begin(), relative.end(), 0.0) / double(count);
    for (double &q : relative)
        q /= mean;
    return relative;
}

struct Scene {
    size_t count = 0;
    double spacing = 0, volume = 0, mass = 0; // means
    std::vector<sphm_real> rest[3], fibre[3], shift[3], velocity[3], activation, density, pressure,
        relative_volume;
    std::vector<int32_t> particle; // the point of each slot
    std::vector<uint8_t> held;     // 0 free, 1 origin, 2 insertion
    sphm_grid grid{};
    sphm_neighbours rows{};
    sphm_gradient gradient{};
    sphm_lattice lattice{};
    sphm_solid_lines lines{};
    sphm_solid_field field{};

    // `relative`: of each point its volume over the mean, volume_m3; none: 1.
    Scene(const std::vector<Vector> &points, double spacing_m, double volume_m3, double ratio = 2.2,
          int threads = 1, bool columns = true, const std::vector<double> &relative = {})
        : count(points.size()), spacing(spacing_m), volume(volume_m3), mass(1112 * volume_m3) {
        std::vector<sphm_real> p[3];
        for (int d = 0; d < 3; ++d) {
            for (const Vector &point : points)
                p[d].push_back(sphm_real(point[d]));
            rest[d].resize(count);
            fibre[d].assign(count, sphm_real(d == 0));
            shift[d].assign(count, 0);
            velocity[d].assign(count, 0);
            field.shift[d] = shift[d].data();
            field.velocity[d] = velocity[d].data();
        }
        activation.assign(count, 0);
        held.assign(count, 0);
        std::vector<int32_t> id(count);
        std::iota(id.begin(), id.end(), 0);
        sphm_context context{};
        require(sphm_grid_sort(&grid, p[0].data(), p[1].data(), p[2].data(), id.data(), count,
                               ratio * spacing, &context),
                context);
        particle.assign(grid.order, grid.order + count);
        for (size_t slot = 0; slot < count; ++slot)
            for (int d = 0; d < 3; ++d)
                rest[d][slot] = p[d][size_t(particle[slot])];
        require(sphm_neighbours_build(&rows, &grid, rest[0].data(), rest[1].data(), rest[2].data(), count,
                                      ratio * spacing, 1, &context),
                context);
        if (columns)
            follow_lattice();
        relative_volume.assign(count, 1);
        for (size_t slot = 0; slot < count && !relative.empty(); ++slot)
            relative_volume[slot] = sphm_real(relative[size_t(particle[slot])]);
        require(sphm_gradient_create(&gradient, &rows, rest[0].data(), rest[1].data(), rest[2].data(),
                                     relative_volume.data(), ratio * spacing, volume, 1, &context),
                context);
        require(sphm_solid_lines_create(&lines, &rows, &gradient, rest[0].data(), rest[1].data(),
                                        rest[2].data(), columns ? &lattice : nullptr, &context),
                context);
        field.fibre_x = fibre[0].data();
        field.fibre_y = fibre[1].data();
        field.fibre_z = fibre[2].data();
        field.activation = activation.data();
        field.relative_volume = relative_volume.data();
        density.resize(count);
        pressure.resize(count);
        field.density = density.data();
        field.pressure = pressure.data();
        field.density_kg_per_m3 = 1112;
        field.constants = table3();
        field.particle_volume_m3 = sphm_real(volume);
        field.threads = threads;
    }
    Scene(const Scene &) = delete;
    Scene &operator=(const Scene &) = delete;
    ~Scene() {
        sphm_solid_lines_free(&lines);
        sphm_gradient_free(&gradient);
        sphm_lattice_free(&lattice);
        sphm_neighbours_free(&rows);
        sphm_grid_free(&grid);
    }

    template <typename T> static void reorder(std::vector<T> &values, const std::vector<int32_t> &order) {
        const std::vector<T> old = values;
        for (size_t slot = 0; slot < order.size(); ++slot)
            values[slot] = old[size_t(order[slot])];
    }

    void follow_lattice() {
        sphm_context context{};
        const sphm_real *const position[3] = {rest[0].data(), rest[1].data(), rest[2].data()};
        require(sphm_lattice_find(&lattice, &rows, position, &context), context);
        if (!lattice.site)
            return;
        std::vector<int32_t> order(count), scratch(3 * count);
        require(sphm_lattice_order(&lattice, order.data(), &context), context);
        require(sphm_neighbours_reorder(&rows, order.data(), &context), context);
        sphm_lattice_permute(&lattice, order.data(), scratch.data());
        reorder(particle, order);
        for (auto &r : rest)
            reorder(r, order);
    }

    static void require(sphm_status status, const sphm_context &context) {
        if (status != SPHM_OK)
            throw std::runtime_error(context.message);
    }

    // Displacement [0 ... 2] and velocity [4 ... 6] of a particle.
    struct Motion {
        Scene &scene;
        size_t slot;
        sphm_real &operator[](int d) const {
            return d < 3 ? scene.shift[d][slot] : scene.velocity[d - 4][slot];
        }
    };
    Motion motion(size_t slot) { return {*this, slot}; }
    std::array<sphm_real, 3> force(size_t slot) const {
        return {lines.force[0][slot], lines.force[1][slot], lines.force[2][slot]};
    }
    double mass_of(size_t slot) const { return mass * double(relative_volume[slot]); }
    Vector rest_at(size_t slot) const { return {rest[0][slot], rest[1][slot], rest[2][slot]}; }

    // Displacements u = (A - 1) X + t and velocities L X on every particle.
    void prescribe(const double A[9], const Vector &t, const double L[9] = nullptr) {
        for (size_t slot = 0; slot < count; ++slot) {
            const Vector X = rest_at(slot);
            for (int i = 0; i < 3; ++i) {
                double u = t[i], v = 0;
                for (int j = 0; j < 3; ++j) {
                    u += (A[3 * i + j] - (i == j)) * X[j];
                    v += L ? L[3 * i + j] * X[j] : 0;
                }
                motion(slot)[i] = sphm_real(u);
                motion(slot)[4 + i] = sphm_real(v);
            }
        }
    }

    void sweep() {
        sphm_solid_stress_sweep(&field, &lines);
        sphm_solid_force_sweep(&field, &lines);
    }

    // P at a particle, without viscosity, of fibres along x; and the rate of F. At the last sweep.
    void stress(size_t slot, sphm_real P[9], sphm_real rate[9]) const {
        sphm_real F[9];
        sphm_fibre_stress fibre_stress;
        const sphm_real f0[3] = {1, 0, 0};
        sphm_solid_deformation(&lines, slot, F, rate);
        for (int d = 0; d < 9; d += 4)
            F[d] += 1;
        sphm_solid_stress(F, f0, activation[slot], &field.constants, P, &fibre_stress);
    }

    double stiffest() const {
        double modulus = 0;
        for (size_t b = 0; b < lines.blocks; ++b)
            modulus = std::fmax(modulus, lines.block_modulus_Pa[b]);
        return modulus;
    }

    // The largest step at which the leap-frog is stable, as the back ends count.
    double stable_step() const {
        sphm_model model{};
        model.parameters.density = mass / volume;
        model.parameters.mass_scaling = 1;
        model.parameters.bulk_modulus = field.constants.bulk_Pa;
        model.parameters.tissue_viscosity = field.viscosity_Pa_s;
        model.parameters.hourglass_stiffness = field.hourglass_Pa;
        return sphm_solid_limits(&model, &gradient, stiffest()).smallest / SPHM_SOLID_STEP_SHARE;
    }

    // One step of free particles; held ones stay where they are. drag in 1/s.
    void step(double dt, double drag = 0) {
        sweep();
        const double keep = std::exp(-drag * dt);
        for (size_t slot = 0; slot < count; ++slot) {
            if (held[slot])
                continue;
            const Motion m = motion(slot);
            for (int d = 0; d < 3; ++d) {
                m[4 + d] = sphm_real(keep * m[4 + d] + dt * force(slot)[d] / mass_of(slot));
                m[d] += sphm_real(dt) * m[4 + d];
            }
        }
    }

    Vector end_force(int end) const {
        Vector sum = {0, 0, 0};
        for (size_t slot = 0; slot < count; ++slot)
            if (held[slot] == end)
                for (int d = 0; d < 3; ++d)
                    sum[d] += force(slot)[d];
        return sum;
    }

    double kinetic_energy() {
        double sum = 0;
        for (size_t slot = 0; slot < count; ++slot)
            for (int d = 4; d < 7; ++d)
                sum += mass_of(slot) / 2 * motion(slot)[d] * motion(slot)[d];
        return sum;
    }
};

// The stand-in belly: 0.20 m long, r(x) = 6 mm + (R - 6 mm) sin(pi x/L), R = 25 mm (y) and 18 mm (z), about
// `wanted` particles, 10 % of the volume held at each end.
inline double belly_radius(double x, double R) {
    return 0.006 + (R - 0.006) * std::sin(M_PI * (x + 0.1) / 0.2);
}
inline bool in_belly(const Vector &p) {
    if (std::fabs(p[0]) > 0.1)
        return false;
    const double y = p[1] / belly_radius(p[0], 0.025), z = p[2] / belly_radius(p[0], 0.018);
    return y * y + z * z <= 1;
}
constexpr double belly_volume = 168.65e-6;
inline std::vector<Vector> belly(size_t wanted, double *spacing) {
    double low = 0.5e-3, high = 20e-3;
    for (int i = 0; i < 40; ++i) {
        *spacing = (low + high) / 2;
        (fill({0.2 + *spacing, 0.05 + *spacing, 0.036 + *spacing}, *spacing, 0, in_belly).size() > wanted
             ? low
             : high) = *spacing;
    }
    return fill({0.2 + *spacing, 0.05 + *spacing, 0.036 + *spacing}, *spacing, 0, in_belly);
}

} // namespace solid

#endif
