/* The generalized winding number: closed forms, and the tree against the plain sum. */
#include <gtest/gtest.h>

#include <random>

#include "core/winding.h"
#include "shapes.h"

namespace {

struct Tree {
    sphm_winding *tree = nullptr;
    explicit Tree(const sphm_surface &surface) {
        EXPECT_EQ(sphm_winding_create(&surface, &tree, nullptr), SPHM_OK);
    }
    ~Tree() { sphm_winding_destroy(tree); }
    double at(double x, double y, double z) const {
        double p[3] = {x, y, z};
        return sphm_winding_number(tree, p);
    }
};

TEST(Winding, IsOneInsideAndZeroOutsideACube) {
    shapes::Surface cube = shapes::cube(1);
    Tree w(cube.surface);
    EXPECT_NEAR(w.at(0, 0, 0), 1, 1e-12);
    EXPECT_NEAR(w.at(0.99, 0.99, -0.99), 1, 1e-12);
    EXPECT_NEAR(w.at(1.01, 0, 0), 0, 1e-12);
    EXPECT_NEAR(w.at(100, 0, 0), 0, 1e-6);
}

TEST(Winding, IsTheSolidAngleOfAnOpenHemisphere) {
    /* From the middle of the sphere half of all directions meet the bowl. */
    shapes::Surface bowl = shapes::sphere(1, 5);
    bowl.keep([](const double x[3]) { return x[2] < 0; });
    Tree w(bowl.surface);
    double middle[3] = {0, 0, 0};
    EXPECT_NEAR(sphm_winding_number_exact(&bowl.surface, middle), 0.5, 1e-12);
    EXPECT_NEAR(w.at(0, 0, 0), 0.5, 0.03);
    /* On the axis at height z the rim is seen at the angle whose cosine is z / sqrt(1 + z^2). */
    for (double z : {-0.5, 0.5, 2.0}) {
        double open =
            0.5 * (1 - std::fabs(z) / std::sqrt(1 + z * z)); /* share of directions through the hole */
        double p[3] = {0, 0, z};
        EXPECT_NEAR(sphm_winding_number_exact(&bowl.surface, p), z < 0 ? 1 - open : open, 1e-3) << z;
        EXPECT_NEAR(w.at(0, 0, z), z < 0 ? 1 - open : open, 0.03) << z;
    }
}

TEST(Winding, TreeAgreesWithThePlainSum) {
    shapes::Surface closed = shapes::sphere(1, 5), open = shapes::sphere(1, 5);
    open.keep([](const double x[3]) { return x[0] + 0.3 * x[1] < 0.5; });
    for (const sphm_surface *s : {&closed.surface, &open.surface}) {
        Tree w(*s);
        std::mt19937 random(7);
        std::uniform_real_distribution<double> box(-1.5, 1.5), shell(0.97, 1.03);
        double worst = 0;
        for (int i = 0; i < 300; i++) {
            double p[3] = {box(random), box(random), box(random)};
            if (i % 2) { /* near the surface, where it decides */
                double scale = shell(random) / std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
                for (double &x : p)
                    x *= scale;
            }
            worst =
                std::fmax(worst, std::fabs(sphm_winding_number(w.tree, p) - sphm_winding_number_exact(s, p)));
        }
        EXPECT_LT(worst, 0.05);
        EXPECT_GT(worst, 1e-9); /* the tree is in use */
        RecordProperty("worst_error", std::to_string(worst));
    }
}

TEST(Winding, NearIsNeverMissed) {
    shapes::Surface s = shapes::sphere(1, 4);
    Tree w(s.surface);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> box(-2, 2);
    size_t away = 0;
    for (int i = 0; i < 2000; i++) {
        double p[3] = {box(random), box(random), box(random)};
        double gap = std::fabs(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 1);
        EXPECT_EQ(sphm_winding_near(w.tree, p, gap + 0.02),
                  1); /* the polyhedron is within 0.006 of the sphere */
        away += !sphm_winding_near(w.tree, p, 0.25 * gap);
    }
    EXPECT_GT(away, 1000u);
}

TEST(Winding, RefusesNothing) {
    shapes::Surface none({}, {});
    sphm_winding *tree;
    EXPECT_EQ(sphm_winding_create(&none.surface, &tree, nullptr), SPHM_REFUSED_GEOMETRY);
    EXPECT_EQ(tree, nullptr);
    sphm_winding_destroy(nullptr);
}

} // namespace
