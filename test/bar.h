// A bar of particles on a cubic lattice, with neighbour rows built independently of the CPU back end, and
// the membrane on it. Shared by the tests of diffusion, membrane and plane wave. Lengths in mm, times in ms.
#ifndef SPHM_TEST_BAR_H
#define SPHM_TEST_BAR_H

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <random>
#include <vector>

#include "core/diffusion.h"
#include "core/membrane_constants.h"
#include "core/state.h"
#include "cpu/membrane.h"

namespace bar {

struct Shape {
    double spacing = 1, length = 80, width = 6, thickness = 6; // mm
    double smoothing_ratio = 2.6, jitter = 0, skin = 0;        // in spacings
    unsigned seed = 1;
};

class Bar {
  public:
    explicit Bar(const Shape &s) : shape(s) {
        const std::array<int, 3> cells = {int(std::lround(s.length / s.spacing)),
                                          int(std::lround(s.width / s.spacing)),
                                          int(std::lround(s.thickness / s.spacing))};
        EXPECT_EQ(sphm_state_create(&state, size_t(cells[0]) * cells[1] * cells[2], nullptr), SPHM_OK);
        fill(cells);
        build_rows(cells);
    }
    ~Bar() {
        sphm_diffusion_free(&diffusion);
        sphm_state_free(&state);
    }
    Bar(const Bar &) = delete;
    Bar &operator=(const Bar &) = delete;

    double support_m() const { return shape.smoothing_ratio * shape.spacing * 1e-3; }
    double x_mm(size_t i) const { return 1e3 * double(state.x[i]); }
    double y_mm(size_t i) const { return 1e3 * double(state.y[i]); }
    double z_mm(size_t i) const { return 1e3 * double(state.z[i]); }
    // Farther than `margin` mm from every side.
    bool inside(size_t i, double margin) const {
        return x_mm(i) > margin && x_mm(i) < shape.length - margin && y_mm(i) > margin &&
               y_mm(i) < shape.width - margin && z_mm(i) > margin && z_mm(i) < shape.thickness - margin;
    }
    void set_fibre(double fx, double fy, double fz) {
        const double length = std::sqrt(fx * fx + fy * fy + fz * fz);
        for (size_t i = 0; i < state.count; i++) {
            state.fibre_x[i] = sphm_real(fx / length);
            state.fibre_y[i] = sphm_real(fy / length);
            state.fibre_z[i] = sphm_real(fz / length);
        }
    }
    sphm_diffusion_input input(int laplacian, double along, double ratio = 1) const {
        sphm_diffusion_input in{};
        in.laplacian = laplacian;
        in.support_radius_m = support_m();
        in.particle_volume_m3 = std::pow(shape.spacing * 1e-3, 3);
        in.diffusion_mm2_per_ms = along;
        in.anisotropy_ratio = ratio;
        in.x = state.x, in.y = state.y, in.z = state.z;
        in.fibre_x = state.fibre_x, in.fibre_y = state.fibre_y, in.fibre_z = state.fibre_z;
        return in;
    }
    void weigh(int laplacian, double along, double ratio = 1) {
        const sphm_diffusion_input in = input(laplacian, along, ratio);
        ASSERT_EQ(sphm_diffusion_build(&diffusion, &rows, &in, 1, nullptr), SPHM_OK);
    }
    // sum_j w_ij (V_j - V_i) in double.
    double rate(size_t i, const std::vector<double> &v) const {
        double sum = 0;
        for (size_t k = rows.row_start[i]; k < rows.row_start[i + 1]; k++)
            sum += double(diffusion.weight[k]) * (v[size_t(rows.slot[k])] - v[i]);
        return sum;
    }
    template <class F> std::vector<double> sample(F f) const {
        std::vector<double> v(state.count);
        for (size_t i = 0; i < state.count; i++)
            v[i] = f(x_mm(i), y_mm(i), z_mm(i));
        return v;
    }
    void rest(const sphm_membrane_constants &c) {
        for (size_t i = 0; i < state.count; i++) {
            state.membrane_potential[i] = c.resting_mV;
            state.recovery[i] = 0;
            state.activation[i] = 0;
        }
    }
    void step(const sphm_membrane_constants &c, const sphm_drive &drive, double step_ms) {
        sphm_cpu_membrane_step(&state, &rows, &diffusion, &c, &drive, step_ms * 1e-3, threads, nullptr);
    }

    Shape shape;
    int threads = 1;
    sphm_state state{};
    sphm_neighbours rows{};
    sphm_diffusion diffusion{};

  private:
    void fill(const std::array<int, 3> &cells) {
        std::mt19937 random(shape.seed);
        std::uniform_real_distribution<double> shift(-shape.jitter, shape.jitter);
        size_t i = 0;
        for (int a = 0; a < cells[0]; a++)
            for (int b = 0; b < cells[1]; b++)
                for (int c = 0; c < cells[2]; c++, i++) {
                    state.x[i] = sphm_real((a + 0.5 + shift(random)) * shape.spacing * 1e-3);
                    state.y[i] = sphm_real((b + 0.5 + shift(random)) * shape.spacing * 1e-3);
                    state.z[i] = sphm_real((c + 0.5 + shift(random)) * shape.spacing * 1e-3);
                    state.fibre_x[i] = 1;
                }
    }
    // The lattice tells where to look: no farther than the support and the jitter of both particles.
    void build_rows(const std::array<int, 3> &n) {
        const int reach = int(std::ceil(shape.smoothing_ratio + shape.skin + 2 * shape.jitter));
        const double radius = support_m() + shape.skin * shape.spacing * 1e-3, radius2 = radius * radius;
        row_start.push_back(0);
        for (size_t i = 0; i < state.count; i++) {
            const int c = int(i) % n[2], b = int(i) / n[2] % n[1], a = int(i) / n[2] / n[1];
            int found = 0;
            for (int aa = std::max(0, a - reach); aa <= std::min(n[0] - 1, a + reach); aa++)
                for (int bb = std::max(0, b - reach); bb <= std::min(n[1] - 1, b + reach); bb++)
                    for (int cc = std::max(0, c - reach); cc <= std::min(n[2] - 1, c + reach); cc++) {
                        const size_t j = (size_t(aa) * size_t(n[1]) + size_t(bb)) * size_t(n[2]) + size_t(cc);
                        const double dx = double(state.x[j]) - double(state.x[i]),
                                     dy = double(state.y[j]) - double(state.y[i]),
                                     dz = double(state.z[j]) - double(state.z[i]);
                        if (j == i || dx * dx + dy * dy + dz * dz >= radius2)
                            continue;
                        slot.push_back(int32_t(j));
                        found++;
                    }
            row_count.push_back(found);
            while (slot.size() % SPHM_ROW_ALIGN)
                slot.push_back(int32_t(i));
            row_start.push_back(slot.size());
        }
        rows.count = state.count;
        rows.row_start = row_start.data();
        rows.row_count = row_count.data();
        rows.slot = slot.data();
        rows.capacity = slot.size();
    }
    std::vector<size_t> row_start;
    std::vector<int32_t> row_count, slot;
};

// Speed of a plane wave along the bar, mm/ms: the front 1/(1 + exp(x sqrt(k/2D))) starts at one end and the
// times at which the particles between `from` and `to` pass half way are fitted by a line.
inline double wave_speed(Bar &b, const sphm_membrane_constants &c, double step_ms, double from_mm,
                         double to_mm, double start_mm) {
    const double middle = (double(c.resting_mV) + double(c.plateau_mV)) / 2;
    const double range = double(c.plateau_mV) - double(c.resting_mV);
    const double width = sphm_membrane_front_width_mm(&c) / 4.3944491546724388;
    b.rest(c);
    for (size_t i = 0; i < b.state.count; i++)
        b.state.membrane_potential[i] =
            sphm_real(double(c.resting_mV) + range / (1 + std::exp((b.x_mm(i) - start_mm) / width)));
    std::vector<double> passed(b.state.count, -1), before(b.state.count);
    const sphm_drive none{};
    size_t waiting = 0;
    for (size_t i = 0; i < b.state.count; i++)
        waiting += b.x_mm(i) >= from_mm && b.x_mm(i) <= to_mm;
    const double limit = 4 * (to_mm - start_mm) / sphm_membrane_wave_speed_mm_per_ms(&c);
    for (double t = 0; waiting > 0 && t < limit; t += step_ms) {
        before.assign(b.state.membrane_potential, b.state.membrane_potential + b.state.count);
        b.step(c, none, step_ms);
        for (size_t i = 0; i < b.state.count; i++) {
            const double now = double(b.state.membrane_potential[i]);
            if (passed[i] >= 0 || now < middle || before[i] >= middle)
                continue;
            passed[i] = t + step_ms * (middle - before[i]) / (now - before[i]);
            waiting -= b.x_mm(i) >= from_mm && b.x_mm(i) <= to_mm;
        }
    }
    if (waiting > 0)
        return 0; // the wave did not arrive
    double n = 0, sx = 0, st = 0, sxx = 0, sxt = 0;
    for (size_t i = 0; i < b.state.count; i++)
        if (b.x_mm(i) >= from_mm && b.x_mm(i) <= to_mm) {
            n++, sx += b.x_mm(i), st += passed[i];
            sxx += b.x_mm(i) * b.x_mm(i), sxt += b.x_mm(i) * passed[i];
        }
    return (n * sxx - sx * sx) / (n * sxt - sx * st);
}

} // namespace bar

#endif
