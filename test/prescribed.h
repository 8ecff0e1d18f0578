// A made muscle whose state is prescribed: an elliptical column of particles on a lattice, a tube of vertices
// around it, and functions that put the particles where a map takes them. For tests of what looks at a state.
#ifndef SPHM_TEST_PRESCRIBED_H
#define SPHM_TEST_PRESCRIBED_H

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <vector>

#include "core/observer.h"

namespace prescribed {

using Place = std::array<double, 3>;
using Map = std::function<Place(const Place &)>;

// The line of action runs along x, from 0 to length; the muscle lies at `corner`.
class Muscle {
  public:
    Muscle(int along = 60, int across = 8, double spacing = 0.002, Place corner = {0.1, -0.2, 0.3},
           double attached = 0.1) {
        for (int i = 0; i < along; ++i)
            for (int j = 0; j < across; ++j)
                for (int k = 0; k < across; ++k) {
                    const double y = (j - 0.5 * (across - 1)), z = (k - 0.5 * (across - 1));
                    if (y * y + z * z <= 0.25 * across * across)
                        add(spacing,
                            {corner[0] + (i + 0.5) * spacing, corner[1] + y * spacing,
                             corner[2] + z * spacing},
                            (i + 0.5) / along, attached);
                }
        sphm_body &body = model.body;
        body.count = attachment.size();
        body.spacing_m = spacing;
        body.length_m = along * spacing;
        body.mid_radius_m = 0.5 * across * spacing;
        body.axis[0] = 1, body.axis[1] = 0, body.axis[2] = 0;
        for (int a = 0; a < 3; ++a) {
            body.origin_m[a] = corner[a];
            body.insertion_m[a] = corner[a] + (a == 0 ? along * spacing : 0);
            model.frame_m[a] = corner[a] + (a == 0 ? 0.5 * along * spacing : 0);
        }
        make_tube(along, across, spacing, corner);
        body.positions = positions.data();
        body.fibres = fibres.data();
        body.axial_fraction = axial_fraction.data();
        body.attachment = attachment.data();
        body.region = region.data();
        body.outer = outer.data();
        body.surface.vertices = vertices.data();
        body.surface.vertex_count = vertices.size() / 3;
        body.surface.triangles = triangles.data();
        body.surface.triangle_count = triangles.size() / 3;
        model.particle_volume_m3 = spacing * spacing * spacing;
        model.particle_mass_kg = 1112 * model.particle_volume_m3;
        model.parameters = sphm_parameters_default();
        sphm_state_create(&state, body.count, nullptr);
        shuffle();
        rest();
        sphm_observer_create(&model, &state, &observer, nullptr);
    }
    ~Muscle() {
        sphm_observer_destroy(observer);
        sphm_state_free(&state);
    }
    Muscle(const Muscle &) = delete;
    Muscle &operator=(const Muscle &) = delete;

    // Where the particle of a slot is at rest, relative to the frame.
    Place rest_of(size_t slot) const {
        return {double(state.rest_x[slot]), double(state.rest_y[slot]), double(state.rest_z[slot])};
    }
    void rest() {
        std::fill(state.relative_volume, state.relative_volume + state.count, sphm_real(1));
        for (size_t s = 0; s < state.count; ++s) {
            const double *p = positions.data() + 3 * size_t(state.id[s]);
            state.rest_x[s] = sphm_real(p[0] - model.frame_m[0]);
            state.rest_y[s] = sphm_real(p[1] - model.frame_m[1]);
            state.rest_z[s] = sphm_real(p[2] - model.frame_m[2]);
            state.rest_density[s] = state.density[s] = sphm_real(1000 + state.id[s] % 7);
            state.membrane_potential[s] = -85;
        }
        move([](const Place &x) { return x; });
    }
    // Puts every particle where `map` takes its rest place, both relative to the frame.
    void move(const Map &map) {
        for (size_t s = 0; s < state.count; ++s) {
            const Place x = map(rest_of(s));
            state.x[s] = sphm_real(x[0]), state.y[s] = sphm_real(x[1]), state.z[s] = sphm_real(x[2]);
        }
    }
    void set_velocity(const Map &map) {
        for (size_t s = 0; s < state.count; ++s) {
            const Place v = map({double(state.x[s]), double(state.y[s]), double(state.z[s])});
            state.vx[s] = sphm_real(v[0]), state.vy[s] = sphm_real(v[1]), state.vz[s] = sphm_real(v[2]);
        }
    }
    sphm_observation observe() {
        sphm_observation observation;
        std::memset(&observation, 0xff, sizeof observation);
        sphm_observer_observe(observer, &state, &observation, nullptr);
        return observation;
    }
    sphm_particles particles() {
        sphm_particles particles;
        std::memset(&particles, 0, sizeof particles);
        sphm_observer_particles(observer, &state, &particles, nullptr);
        return particles;
    }
    sphm_skin skin(int field = SPHM_FIELD_DISPLACEMENT) {
        sphm_skin skin;
        std::memset(&skin, 0, sizeof skin);
        sphm_observer_skin(observer, &state, field, &skin, nullptr);
        return skin;
    }

    sphm_model model{};
    sphm_state state{};
    sphm_observer *observer = nullptr;
    std::vector<double> positions, fibres, axial_fraction, vertices;
    std::vector<uint8_t> attachment, region, outer;
    std::vector<int32_t> triangles;

  private:
    void add(double spacing, const Place &x, double fraction, double attached) {
        (void)spacing;
        positions.insert(positions.end(), x.begin(), x.end());
        fibres.insert(fibres.end(), {1, 0, 0});
        axial_fraction.push_back(fraction);
        attachment.push_back(fraction < attached       ? SPHM_ATTACHED_ORIGIN
                             : fraction > 1 - attached ? SPHM_ATTACHED_INSERTION
                                                       : SPHM_FREE);
        region.push_back(fraction < 0.2   ? SPHM_REGION_ORIGIN
                         : fraction > 0.8 ? SPHM_REGION_INSERTION
                                          : SPHM_REGION_CENTRE);
        outer.push_back(attachment.size() % 5 == 0);
    }
    void make_tube(int along, int across, double spacing, const Place &corner) {
        const int rings = 2 * along + 1, round = 24;
        const double radius = 0.5 * (across + 1) * spacing;
        for (int i = 0; i < rings; ++i)
            for (int j = 0; j < round; ++j) {
                const double angle = 2 * M_PI * j / round;
                vertices.insert(vertices.end(),
                                {corner[0] + i * spacing / 2, corner[1] + radius * std::cos(angle),
                                 corner[2] + radius * std::sin(angle)});
                if (i == 0)
                    continue;
                const int a = i * round + j, b = i * round + (j + 1) % round;
                triangles.insert(triangles.end(), {a - round, b - round, a, b - round, b, a});
            }
    }
    // Slots in an order of their own, as cell sorting leaves them.
    void shuffle() {
        for (size_t s = 0; s < state.count; ++s)
            state.id[s] = int32_t((s * 7919 + 13) % state.count);
    }
};

// Rotation about an axis by an angle, then a shift.
inline Map rigid(double angle, Place axis, Place shift) {
    const double length = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    for (double &a : axis)
        a /= length;
    return [=](const Place &x) {
        const double c = std::cos(angle), s = std::sin(angle);
        const double along = axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
        const Place cross = {axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2],
                             axis[0] * x[1] - axis[1] * x[0]};
        Place out;
        for (int a = 0; a < 3; ++a)
            out[a] = c * x[a] + s * cross[a] + (1 - c) * along * axis[a] + shift[a];
        return out;
    };
}

// One rounding of a position of this size, in the precision of the build.
inline double rounding(double size) {
    return size * (sizeof(sphm_real) == 4 ? 6e-8 : 1.2e-16);
}

} // namespace prescribed

#endif
