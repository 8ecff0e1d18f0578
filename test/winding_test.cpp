/* The generalized winding number: closed forms, and the tree against the plain sum. */
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
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

using Point = std::array<double, 3>;

Point along(const Point &a, const Point &b, double t) {
    return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}
double product(const Point &a, const Point &b, const Point &c, const Point &d) { /* (b - a) . (d - c) */
    double sum = 0;
    for (size_t k = 0; k < 3; k++)
        sum += (b[k] - a[k]) * (d[k] - c[k]);
    return sum;
}
double gap(const Point &a, const Point &b) {
    return std::sqrt(product(a, b, a, b));
}
double to_segment(const Point &a, const Point &b, const Point &q) {
    return gap(along(a, b, std::min(std::max(product(a, b, a, q) / product(a, b, a, b), 0.0), 1.0)), q);
}

/* The foot of the perpendicular is a + u (b - a) + v (c - a), by the normal equations; where it is no mixture
 * of the corners, a side is nearest. */
double to_triangle(const Point &a, const Point &b, const Point &c, const Point &q) {
    double bb = product(a, b, a, b), bc = product(a, b, a, c), cc = product(a, c, a, c),
           bq = product(a, b, a, q), cq = product(a, c, a, q), d = bb * cc - bc * bc;
    double u = (bq * cc - cq * bc) / d, v = (cq * bb - bq * bc) / d;
    if (u >= 0 && v >= 0 && u + v <= 1) {
        Point foot = along(a, b, u);
        for (size_t k = 0; k < 3; k++)
            foot[k] += v * (c[k] - a[k]);
        return gap(foot, q);
    }
    return std::min({to_segment(a, b, q), to_segment(b, c, q), to_segment(c, a, q)});
}

Point corner_of(const sphm_surface &s, size_t triangle, size_t corner) {
    const double *x = &s.vertices[3 * (size_t)s.triangles[3 * triangle + corner]];
    return {x[0], x[1], x[2]};
}

double to_surface(const sphm_surface &s, const Point &q) {
    double nearest = INFINITY;
    for (size_t t = 0; t < s.triangle_count; t++)
        nearest =
            std::min(nearest, to_triangle(corner_of(s, t, 0), corner_of(s, t, 1), corner_of(s, t, 2), q));
    return nearest;
}

/* Anywhere, and close to faces, sides and corners, on either side of them. */
std::vector<Point> points_about(const sphm_surface &s) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> box(-1.5, 1.5), unit(0, 1);
    std::vector<Point> points;
    for (int i = 0; i < 800; i++) {
        const size_t t = random() % s.triangle_count, c = random() % 3;
        const Point a = corner_of(s, t, c), b = corner_of(s, t, (c + 1) % 3),
                    side = along(a, b, unit(random)),
                    face = along(side, corner_of(s, t, (c + 2) % 3), unit(random));
        const Point beside[3] = {a, side, face};
        Point q = i % 4 ? beside[i % 4 - 1] : Point{0, 0, 0};
        for (double &x : q)
            x += box(random) * (i % 4 ? 0.03 : 1);
        points.push_back(q);
    }
    return points;
}

TEST(Winding, DistanceIsThatToTheNearestTriangle) {
    shapes::Surface flat = shapes::sphere(1, 4), cube = shapes::cube(0.8), open = shapes::sphere(1, 4);
    for (size_t v = 0; v < flat.surface.vertex_count; v++) /* slivers */
        flat.surface.vertices[3 * v] *= 0.05;
    open.keep([](const double x[3]) { return x[0] + 0.3 * x[1] < 0.5; });
    for (const sphm_surface *s : {&flat.surface, &cube.surface, &open.surface}) {
        Tree w(*s);
        size_t within = 0, beyond = 0;
        for (const Point &q : points_about(*s)) {
            const double exact = to_surface(*s, q);
            EXPECT_NEAR(sphm_winding_distance(w.tree, q.data(), 10), exact, 1e-12);
            for (double limit : {0.02, 0.3}) {
                const double found = sphm_winding_distance(w.tree, q.data(), limit);
                if (exact < limit)
                    EXPECT_NEAR(found, exact, 1e-12) << "limit " << limit;
                else
                    EXPECT_EQ(found, limit);
                ++(exact < limit ? within : beyond);
            }
        }
        EXPECT_GT(within, 300u);
        EXPECT_GT(beyond, 300u);
    }
}

TEST(Winding, RefusesNothing) {
    shapes::Surface none({}, {});
    sphm_winding *tree;
    EXPECT_EQ(sphm_winding_create(&none.surface, &tree, nullptr), SPHM_REFUSED_GEOMETRY);
    EXPECT_EQ(tree, nullptr);
    sphm_winding_destroy(nullptr);
}

} // namespace
