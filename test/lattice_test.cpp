// The lattice found in a filling.
#include "solid_scene.h"

#include <set>

#include <gtest/gtest.h>

namespace {

using solid::Scene;
using solid::Vector;

constexpr double kSpacing = 0.002;

struct Found {
    Scene scene;
    sphm_lattice lattice{};
    explicit Found(const std::vector<Vector> &points, double ratio = 2.6)
        : scene(points, kSpacing, std::pow(kSpacing, 3), ratio, 1, false) {
        sphm_context context{};
        const sphm_real *const position[3] = {scene.rest[0].data(), scene.rest[1].data(),
                                              scene.rest[2].data()};
        Scene::require(sphm_lattice_find(&lattice, &scene.rows, position, &context), context);
    }
    Found(const Found &) = delete;
    ~Found() { sphm_lattice_free(&lattice); }
};

// Sites determine positions: position = position of one + the site's steps in three directions.
void expect_a_lattice(const std::vector<Vector> &points) {
    const Found found(points);
    ASSERT_NE(found.lattice.site, nullptr);
    const size_t n = found.scene.count;
    std::set<std::array<int32_t, 3>> sites;
    int32_t low[3] = {9999, 9999, 9999}, high[3] = {-9999, -9999, -9999};
    for (size_t i = 0; i < n; ++i) {
        const int32_t *site = found.lattice.site + 3 * i;
        sites.insert({site[0], site[1], site[2]});
        for (int d = 0; d < 3; ++d) {
            low[d] = std::min(low[d], site[d]);
            high[d] = std::max(high[d], site[d]);
        }
    }
    EXPECT_EQ(sites.size(), n); // each its own
    EXPECT_GE(high[0] - low[0], high[2] - low[2]);
    EXPECT_GE(high[2] - low[2], high[1] - low[1]);

    std::vector<int32_t> order(n), seen(n, 0);
    sphm_context context{};
    Scene::require(sphm_lattice_order(&found.lattice, order.data(), &context), context);
    size_t along = 0;
    for (size_t slot = 0; slot < n; ++slot) {
        ++seen[size_t(order[slot])];
        if (slot == 0)
            continue;
        const int32_t *a = found.lattice.site + 3 * order[slot - 1],
                      *b = found.lattice.site + 3 * order[slot];
        along += a[0] + 1 == b[0] && a[1] == b[1] && a[2] == b[2];
        EXPECT_TRUE(std::make_tuple(a[2], a[1], a[0]) < std::make_tuple(b[2], b[1], b[0]));
    }
    EXPECT_EQ(seen, std::vector<int32_t>(n, 1));
    EXPECT_GT(along, n / 2); // most particles follow their neighbour
}

TEST(Lattice, IsFoundInABlock) {
    expect_a_lattice(solid::block({0.012, 0.04, 0.02}, kSpacing));
}

TEST(Lattice, IsFoundAtAnyAngle) {
    std::vector<Vector> points = solid::block({0.03, 0.012, 0.016}, kSpacing);
    const double c = std::cos(0.7), s = std::sin(0.7);
    for (Vector &p : points) {
        p = {c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
        p = {c * p[0] - s * p[2], p[1], s * p[0] + c * p[2]};
    }
    expect_a_lattice(points);
}

TEST(Lattice, IsFoundWithUnevenSpacings) {
    std::vector<Vector> points = solid::block({0.03, 0.012, 0.016}, kSpacing);
    for (Vector &p : points)
        p = {1.1 * p[0], 0.9 * p[1] + 0.2 * p[0], 0.95 * p[2]};
    expect_a_lattice(points);
}

TEST(Lattice, IsNotFoundInDisorder) {
    EXPECT_EQ(Found(solid::block({0.03, 0.012, 0.016}, kSpacing, 0.1)).lattice.site, nullptr);
    EXPECT_EQ(Found({{0, 0, 0}}).lattice.site, nullptr);
    EXPECT_EQ(Found({{0, 0, 0}, {kSpacing, 0, 0}, {0, kSpacing, 0}}).lattice.site, nullptr); // a plane
}

} // namespace
