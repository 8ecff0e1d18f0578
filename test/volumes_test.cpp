/* What each particle of a filling stands for: closed forms of a box, sections and moments of round shapes,
 * the nearest particle of every point by brute force. */
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <numeric>
#include <utility>

#include "core/vec3.h"
#include "shapes.h"

namespace {

using shapes::Body;
using Vector = std::array<double, 3>;

/* Where the shape lies: turned about all axes and moved. Rows are its own axes. */
struct Place {
    double axis[3][3], middle[3] = {0.013, -0.022, 0.007};
    Place() {
        const double a = 0.3, b = -0.2, c = 0.4, sa = std::sin(a), ca = std::cos(a), sb = std::sin(b),
                     cb = std::cos(b), sc = std::sin(c), cc = std::cos(c);
        const double turn[3][3] = {{cb * cc, cb * sc, -sb},
                                   {sa * sb * cc - ca * sc, sa * sb * sc + ca * cc, sa * cb},
                                   {ca * sb * cc + sa * sc, ca * sb * sc - sa * cc, ca * cb}};
        std::memcpy(axis, turn, sizeof axis);
    }
    Vector from(const double x[3]) const { /* in the shape's own frame */
        Vector own;
        for (size_t k = 0; k < 3; k++) {
            own[k] = 0;
            for (size_t d = 0; d < 3; d++)
                own[k] += axis[k][d] * (x[d] - middle[d]);
        }
        return own;
    }
    void put(shapes::Surface &s) const {
        for (size_t v = 0; v < s.surface.vertex_count; v++) {
            double *x = &s.surface.vertices[3 * v], own[3] = {x[0], x[1], x[2]};
            for (size_t d = 0; d < 3; d++) {
                x[d] = middle[d];
                for (size_t k = 0; k < 3; k++)
                    x[d] += axis[k][d] * own[k];
            }
        }
    }
};

shapes::Surface stretched(shapes::Surface s, const double half[3]) {
    for (size_t v = 0; v < s.surface.vertex_count; v++)
        for (size_t d = 0; d < 3; d++)
            s.surface.vertices[3 * v + d] *= half[d];
    return s;
}

/* A box with a vertex amid each face: as symmetric as a box, so that the lattice lies along its axes. */
shapes::Surface box_of(const double half[3]) {
    std::vector<double> v;
    std::vector<int32_t> t;
    for (int d = 0; d < 3; d++)
        for (int side = -1; side <= 1; side += 2) {
            const int32_t first = (int32_t)v.size() / 3;
            const int a = (d + 1) % 3, b = (d + 2) % 3,
                      round[5][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {0, 0}};
            for (const int *at : round) {
                double x[3];
                x[d] = side * half[d];
                x[a] = at[0] * half[a];
                x[b] = at[1] * half[b];
                v.insert(v.end(), x, x + 3);
            }
            for (int32_t k = 0; k < 4; k++) {
                const int32_t from = first + k, to = first + (k + 1) % 4;
                t.insert(t.end(), {first + 4, side > 0 ? from : to, side > 0 ? to : from});
            }
        }
    return shapes::Surface(v, t);
}

sphm_parameters solid(int64_t particles, double jitter = 0) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.particles = particles;
    p.jitter = jitter;
    p.threads = 2;
    return p;
}

double cell_of(const sphm_body &b) {
    double cross[3];
    sphm_cross3(b.step_m[1], b.step_m[2], cross);
    return std::fabs(sphm_dot3(b.step_m[0], cross));
}

/* Positive, finite, and together the whole. */
void expect_whole(const sphm_body &b) {
    double sum = 0;
    for (size_t i = 0; i < b.count; i++) {
        ASSERT_TRUE(std::isfinite(b.volumes[i])) << i;
        ASSERT_GT(b.volumes[i], 0.19 * b.volume_m3 / (double)b.count) << i;
        ASSERT_LT(b.volumes[i], 4 * b.volume_m3 / (double)b.count) << i;
        sum += b.volumes[i];
    }
    EXPECT_NEAR(sum, b.volume_m3, 1e-12 * b.volume_m3);
}

bool are_equal(const sphm_body &b) {
    return std::all_of(b.volumes, b.volumes + b.count, [&](double v) {
        return std::fabs(v * (double)b.count - b.volume_m3) < 1e-12 * b.volume_m3;
    });
}

TEST(Volumes, SumToThatOfTheShape) {
    for (int preset : {SPHM_PRESET_TRICEPS_LONG_HEAD, SPHM_PRESET_VASTUS_LATERALIS, SPHM_PRESET_BELLY})
        for (double jitter : {0.0, 0.3}) {
            sphm_parameters p = solid(900, jitter);
            p.preset = preset;
            Body made(p);
            ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
            expect_whole(made.body);
            EXPECT_FALSE(are_equal(made.body));
        }
}

/* In the tips of an octahedron there is less tissue than a particle may be made of. */
TEST(Volumes, AreNeverNearlyNothing) {
    const double half[3] = {0.06, 0.023, 0.014};
    const Place place;
    shapes::Surface tips = stretched(shapes::sphere(1, 0), half);
    place.put(tips);
    Body made(solid(150), &tips.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    expect_whole(made.body);
    const double *least = std::min_element(made.body.volumes, made.body.volumes + made.body.count);
    EXPECT_NEAR(*least / cell_of(made.body), 0.2, 0.01);
}

TEST(Volumes, OfTheFluidAndOfABarAreAllTheSame) {
    sphm_parameters p = solid(500);
    p.preset = SPHM_PRESET_BAR;
    p.belly_length = 0.06;
    p.belly_width = p.belly_thickness = 0.015;
    Body bar(p);
    p.jitter = 0.2;
    Body jittered(p);
    p.tissue = SPHM_TISSUE_FLUID;
    Body fluid_bar(p);
    p = solid(500, 0.2);
    p.tissue = SPHM_TISSUE_FLUID;
    Body fluid(p);
    for (const Body *made : {&bar, &jittered, &fluid_bar, &fluid}) {
        ASSERT_EQ(made->status, SPHM_OK) << made->context.message;
        expect_whole(made->body);
        EXPECT_EQ(are_equal(made->body), made != &jittered);
    }
}

/* Of a box: the length that a particle stands for along each axis is that from halfway to the layer before to
 * halfway to the layer behind, or to the face. */
struct Layers {
    std::vector<double> places; /* ascending */
    double half;
    void add(double x) {
        for (double place : places)
            if (std::fabs(place - x) < 1e-7)
                return;
        places.push_back(x);
        std::sort(places.begin(), places.end());
    }
    bool is_last(double x) const {
        return std::fabs(x - places.front()) < 1e-7 || std::fabs(x - places.back()) < 1e-7;
    }
    double extent(double x) const {
        size_t at = 0;
        while (std::fabs(places[at] - x) > 1e-7)
            at++;
        const double lower = at ? (places[at - 1] + places[at]) / 2 : -half,
                     upper = at + 1 < places.size() ? (places[at + 1] + places[at]) / 2 : half;
        return upper - lower;
    }
};

TEST(Volumes, OfABoxAreProductsOfLengths) {
    const Place place;
    const double halves[3][3] = {
        {0.0401, 0.0172, 0.0113}, {0.0377, 0.0151, 0.0124}, {0.0415, 0.0188, 0.0097}};
    double least = 10, most = 0;
    for (const double *half : halves)
        for (int64_t particles : {800, 1900}) {
            shapes::Surface box = box_of(half);
            place.put(box);
            Body made(solid(particles), &box.surface);
            ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
            const sphm_body &b = made.body;
            expect_whole(b);
            Layers layers[3];
            for (size_t d = 0; d < 3; d++) {
                layers[d].half = half[d];
                for (size_t i = 0; i < b.count; i++)
                    layers[d].add(place.from(&b.positions[3 * i])[d]);
                ASSERT_LT(layers[d].places.size(), 60u); /* the lattice is along the axes */
            }
            const double cell = cell_of(b);
            double worst[4] = {0, 0, 0, 0}; /* by how many faces are beside the particle */
            for (size_t i = 0; i < b.count; i++) {
                const Vector own = place.from(&b.positions[3 * i]);
                double exact = 1 / cell;
                size_t faces = 0;
                for (size_t d = 0; d < 3; d++) {
                    exact *= layers[d].extent(own[d]);
                    faces += layers[d].is_last(own[d]);
                }
                least = std::fmin(least, exact);
                most = std::fmax(most, exact);
                worst[faces] = std::fmax(worst[faces], std::fabs(b.volumes[i] / cell - exact));
            }
            /* A small cell that two faces cut counts as cut by the nearer one. */
            EXPECT_LT(worst[0], 0.005);
            EXPECT_LT(worst[1], 0.005);
            EXPECT_LT(worst[2], 0.02);
            EXPECT_LT(worst[3], 0.04);
        }
    EXPECT_LT(least, 0.5);
    EXPECT_GT(most, 1.4);
}

/* Of an ellipsoid. The polyhedron is a little smaller: a factor makes up for it. */
const double ellipsoid[3] = {0.06, 0.023, 0.014};

shapes::Surface ellipsoid_at(const Place &place) {
    shapes::Surface s = stretched(shapes::sphere(1, 5), ellipsoid);
    place.put(s);
    return s;
}

/* Volume of the unit sphere below a section. */
double cap(double x) {
    x = std::fmin(std::fmax(x, -1), 1);
    return M_PI * (x - x * x * x / 3 + 2. / 3);
}

/* How far the sums over layers are from the volume of the slab, rms, over the rms slab. */
double section_error(const sphm_body &b, const Place &place, const std::function<double(size_t)> &volume) {
    Layers layers;
    layers.half = ellipsoid[0];
    std::map<double, double> sums;
    for (size_t i = 0; i < b.count; i++) {
        const double x = place.from(&b.positions[3 * i])[0];
        layers.add(x);
        const double at =
            *std::min_element(layers.places.begin(), layers.places.end(),
                              [&](double p, double q) { return std::fabs(p - x) < std::fabs(q - x); });
        sums[at] += volume(i);
    }
    double square = 0, scale = b.volume_m3 / (4 * M_PI / 3), all = 0;
    const std::vector<double> &at = layers.places;
    for (size_t k = 1; k + 1 < at.size(); k++) { /* the layers at the tips have no neighbour */
        const double exact = scale * (cap((at[k] + at[k + 1]) / 2 / ellipsoid[0]) -
                                      cap((at[k - 1] + at[k]) / 2 / ellipsoid[0]));
        const double error = sums[at[k]] - exact;
        square += error * error;
        all += exact * exact;
    }
    return std::sqrt(square / all);
}

TEST(Volumes, GiveSectionsTheirArea) {
    const Place place;
    shapes::Surface s = ellipsoid_at(place);
    double sum = 0, sum_equal = 0;
    for (int64_t particles : {700, 2000, 6000}) {
        Body made(solid(particles), &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        const double own = section_error(b, place, [&](size_t i) { return b.volumes[i]; });
        const double equal = section_error(b, place, [&](size_t) { return b.volume_m3 / (double)b.count; });
        EXPECT_LT(own, 0.01);
        EXPECT_GT(equal, 0.02);
        sum += own;
        sum_equal += equal;
    }
    EXPECT_GT(sum_equal, 4 * sum);
}

/* An ellipsoid that grows towards one end: its section is (1 - x^2)(1 + x/2)^2, x over the half axis. Means
 * over its volume. */
struct Tapered {
    double first, second[3];
    Tapered() {
        double volume = 0, x1 = 0, x2 = 0, y2 = 0;
        for (int i = 0; i < 4000; i++) {
            const double x = (i + 0.5) / 2000 - 1, area = (1 - x * x) * std::pow(1 + x / 2, 2);
            volume += area;
            x1 += area * x;
            x2 += area * x * x;
            y2 += area * area / 4; /* of a disc a quarter of its radius squared */
        }
        first = x1 / volume;
        second[0] = x2 / volume;
        second[1] = second[2] = y2 / volume;
    }
    static shapes::Surface at(const Place &place) {
        shapes::Surface round = shapes::sphere(1, 5);
        for (size_t v = 0; v < round.surface.vertex_count; v++)
            for (size_t d = 1; d < 3; d++)
                round.surface.vertices[3 * v + d] *= 1 + round.surface.vertices[3 * v] / 2;
        shapes::Surface s = stretched(std::move(round), ellipsoid);
        place.put(s);
        return s;
    }
};

/* How far the moments of a filling are off, in those of the shape: [0] first, along the axis, [1] second.
 * Within a cell they have those of the cell. */
std::array<double, 2> moment_errors(const sphm_body &b, const Place &place, bool own) {
    const Tapered exact;
    double first = 0, second[3] = {0, 0, 0}, square = 0;
    for (size_t d = 0; d < 3; d++) {
        double step = 0; /* the lattice's, along this axis or nearly so */
        for (size_t a = 0; a < 3; a++)
            step = std::fmax(step, std::fabs(sphm_dot3(b.step_m[a], place.axis[d])) / ellipsoid[d]);
        for (size_t i = 0; i < b.count; i++) {
            const double x = place.from(&b.positions[3 * i])[d] / ellipsoid[d];
            const double share = own ? b.volumes[i] / b.volume_m3 : 1 / (double)b.count;
            first += d == 0 ? share * x : 0;
            second[d] += share * (x * x + step * step / 12);
        }
        square += std::pow(second[d] / exact.second[d] - 1, 2);
    }
    return {std::fabs(first / exact.first - 1), std::sqrt(square / 3)};
}

TEST(Volumes, GiveTheMomentsOfTheShape) {
    const Place place;
    shapes::Surface s = Tapered::at(place);
    double sum[2][2] = {{0, 0}, {0, 0}}; /* all the same, own; first, second */
    for (int64_t particles : {700, 1000, 1400, 2000, 2800}) {
        Body made(solid(particles), &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        for (int own = 0; own < 2; own++) {
            const std::array<double, 2> off = moment_errors(made.body, place, own);
            for (size_t k = 0; k < 2; k++)
                sum[own][k] += off[k];
        }
    }
    for (size_t k = 0; k < 2; k++)
        EXPECT_GT(sum[0][k], 3 * sum[1][k]) << k;
}

/* Points halfway between particles are shared alike: what stands for the two halves of a symmetric shape
 * weighs the same. */
TEST(Volumes, OfMirrorImagesAreTheSame) {
    const Place place;
    shapes::Surface s = ellipsoid_at(place);
    for (int64_t particles : {700, 1400}) {
        Body made(solid(particles), &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        size_t pairs = 0;
        double worst = 0;
        for (size_t i = 0; i < b.count; i++)
            for (size_t j = 0; j < b.count; j++) {
                const Vector x = place.from(&b.positions[3 * i]), y = place.from(&b.positions[3 * j]);
                const Vector mirrored = {y[0], -y[1], y[2]};
                if (sphm_distance_squared3(x.data(), mirrored.data()) > 1e-4 * b.spacing_m * b.spacing_m)
                    continue;
                worst = std::fmax(worst, std::fabs(b.volumes[i] - b.volumes[j]) / cell_of(b));
                pairs++;
            }
        EXPECT_EQ(pairs, b.count);
        EXPECT_LT(worst, 0.01);
    }
}

/* Every point belongs to the nearest particle: of an ellipsoid, inside which is by formula. Points of an
 * additive sequence, evenly spread and in no step with the lattice. */
std::vector<double> by_brute_force(const sphm_body &b, const Place &place, double points) {
    std::vector<double> volumes(b.count);
    std::vector<Vector> particle(b.count);
    for (size_t i = 0; i < b.count; i++)
        particle[i] = place.from(&b.positions[3 * i]);
    const double root = 1.2207440846057596; /* x^4 = x + 1 */
    for (double n = 0; n < points; n++) {
        Vector at;
        double square = 0, part = 1;
        for (size_t d = 0; d < 3; d++) {
            part /= root;
            at[d] = 2 * std::fmod(0.5 + n * part, 1) - 1;
            square += at[d] * at[d];
            at[d] *= ellipsoid[d];
        }
        if (square > 1)
            continue;
        size_t best = 0;
        double nearest = INFINITY;
        for (size_t i = 0; i < b.count; i++) {
            const double gap = sphm_distance_squared3(particle[i].data(), at.data());
            best = gap < nearest ? i : best;
            nearest = std::fmin(gap, nearest);
        }
        volumes[best]++;
    }
    const double sum = std::accumulate(volumes.begin(), volumes.end(), 0.0);
    for (double &v : volumes)
        v *= b.volume_m3 / sum;
    return volumes;
}

TEST(Volumes, AreOfWhatIsNearest) {
    const Place place;
    shapes::Surface s = ellipsoid_at(place);
    for (double jitter : {0.0, 0.15, 0.3}) {
        Body made(solid(500, jitter), &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        const double cell = cell_of(b);
        const std::vector<double> exact = by_brute_force(b, place, 1e6);
        double square = 0, spread = 0, worst = 0;
        for (size_t i = 0; i < b.count; i++) {
            const double off = std::fabs(b.volumes[i] - exact[i]) / cell;
            square += off * off / (double)b.count;
            worst = std::fmax(worst, off);
            spread += std::pow(exact[i] * (double)b.count / b.volume_m3 - 1, 2) / (double)b.count;
        }
        EXPECT_GT(std::sqrt(spread), 0.15);
        EXPECT_LT(std::sqrt(square), 0.045);
        EXPECT_LT(worst, 0.2);
    }
}

TEST(Volumes, AreTheSameForAnyNumberOfThreads) {
    for (double jitter : {0.0, 0.2})
        shapes::expect_threads_do_not_matter(solid(1500, jitter));
}

TEST(Volumes, OfASurfaceWithAHole) {
    const Place place;
    shapes::Surface s = stretched(shapes::sphere(1, 4), ellipsoid);
    s.keep([](const double x[3]) { return x[0] < 0.04 && x[2] < 0.011; });
    place.put(s);
    for (double jitter : {0.0, 0.3}) {
        Body made(solid(900, jitter), &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        ASSERT_GT(made.body.report.open_edges, 0u);
        expect_whole(made.body);
        EXPECT_FALSE(are_equal(made.body));
    }
}

} // namespace
