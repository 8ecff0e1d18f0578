/* The line of action: its ends, the shares along it, attachments and the mid-belly section. */
#include <gtest/gtest.h>

#include "core/line_of_action.h"
#include "core/vec3.h"
#include "shapes.h"

namespace {

using shapes::Body;

/* A sphere stretched along a direction: an ellipsoid with half axes a > b, b. */
shapes::Surface ellipsoid(double a, double b, const double direction[3]) {
    shapes::Surface s = shapes::sphere(b, 3);
    for (size_t v = 0; v < s.surface.vertex_count; v++) {
        double *x = &s.surface.vertices[3 * v], along = sphm_dot3(x, direction);
        for (int k = 0; k < 3; k++)
            x[k] += (a / b - 1) * along * direction[k];
    }
    return s;
}

TEST(LineOfAction, IsThePrincipalAxisOfAMesh) {
    double direction[3] = {0.2, -0.1, 1};
    sphm_normalise3(direction);
    shapes::Surface s = ellipsoid(0.06, 0.02, direction);
    Body made(sphm_parameters_default(), &s.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    /* Along z the origin is the upper end. */
    EXPECT_LT(sphm_dot3(made.body.axis, direction), -std::cos(1 * M_PI / 180));
    EXPECT_GT(made.body.origin_m[2], made.body.insertion_m[2]);
    EXPECT_NEAR(made.body.length_m, 0.12, 0.001); /* one of the fine cubes */
    EXPECT_NEAR(made.body.mid_radius_m, 0.02, 0.0006);
}

/* A spindle that thins out into a tail, with a hole at its thick end. */
shapes::Surface spindle_with_a_tail() {
    shapes::Surface s = shapes::sphere(0.03, 4);
    for (size_t v = 0; v < s.surface.vertex_count; v++) {
        double *x = &s.surface.vertices[3 * v], along = x[0] / 0.03, thin = along > 0 ? 1 - along : 1;
        x[0] *= 4;
        for (int k = 1; k < 3; k++)
            x[k] *= thin * thin;
    }
    s.keep([](const double x[3]) { return x[0] > -0.11; });
    return s;
}

/* Few particles miss the tail: the line of action and the sections in which the tissue is clamped are the
 * shape's, not theirs. */
TEST(LineOfAction, OfAMeshDoesNotDependOnTheParticles) {
    shapes::Surface s = spindle_with_a_tail();
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.particles = 2000;
    Body reference(p, &s.surface);
    ASSERT_EQ(reference.status, SPHM_OK) << reference.context.message;
    const sphm_body &r = reference.body;
    ASSERT_GT(r.report.open_edges, 0u);
    const double jitters[] = {0, 0, 0.2};
    const int64_t counts[] = {500, 8000, 2000};
    for (int c = 0; c < 3; c++) {
        p.particles = counts[c];
        p.jitter = jitters[c];
        Body made(p, &s.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        EXPECT_NEAR(b.length_m, r.length_m, 1e-9) << b.count;
        for (int k = 0; k < 3; k++) {
            EXPECT_NEAR(b.origin_m[k], r.origin_m[k], 1e-9) << b.count;
            EXPECT_NEAR(b.insertion_m[k], r.insertion_m[k], 1e-9) << b.count;
        }
        for (int end = 0; end < 2; end++)
            EXPECT_NEAR(b.clamp_m[end], r.clamp_m[end], 1e-9) << b.count;
    }
}

/* All but the last millimetres of a tail of 0.12 m, where it is thinner than 1 mm. */
TEST(LineOfAction, OfAMeshReachesIntoAThinTail) {
    shapes::Surface s = spindle_with_a_tail();
    sphm_parameters p = sphm_parameters_default();
    p.particles = 500;
    Body made(p, &s.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    EXPECT_GT(made.body.insertion_m[0], 0.09);
    EXPECT_LT(made.body.insertion_m[0], 0.12);
    EXPECT_NEAR(made.body.origin_m[0], -0.11, 0.003);
}

TEST(LineOfAction, RunsFromTheLowerEndAlongX) {
    double direction[3] = {1, 0, 0};
    shapes::Surface s = ellipsoid(0.06, 0.02, direction);
    Body made(sphm_parameters_default(), &s.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    EXPECT_GT(made.body.axis[0], 0.999);
    EXPECT_LT(made.body.origin_m[0], 0);
}

TEST(LineOfAction, TakesGivenPoints) {
    sphm_parameters p = sphm_parameters_default();
    double origin[3] = {0.2, 0.01, 0}, insertion[3] = {-0.2, 0.01, 0};
    std::memcpy(p.origin, origin, sizeof origin);
    Body one(p); /* the other end is the one farther away */
    ASSERT_EQ(one.status, SPHM_OK) << one.context.message;
    EXPECT_NEAR(one.body.insertion_m[0], -0.1316, 1e-9);
    EXPECT_LT(one.body.axis[0], -0.99);
    std::memcpy(p.insertion, insertion, sizeof insertion);
    Body both(p);
    ASSERT_EQ(both.status, SPHM_OK) << both.context.message;
    EXPECT_EQ(both.body.axis[0], -1);
    EXPECT_NEAR(both.body.length_m, 0.4, 1e-12);
    /* Attached at the origin is now the tissue at large x. */
    for (size_t i = 0; i < both.body.count; i++)
        if (both.body.attachment[i] == SPHM_ATTACHED_ORIGIN) {
            ASSERT_GT(both.body.positions[3 * i], 0);
        }
}

TEST(LineOfAction, RefusesEqualPoints) {
    sphm_parameters p = sphm_parameters_default();
    for (int k = 0; k < 3; k++)
        p.origin[k] = p.insertion[k] = 0.01;
    Body made(p);
    EXPECT_NE(made.status, SPHM_OK);
    std::string message = made.context.message;
    EXPECT_NE(message.find("same point"), std::string::npos) << message;
}

TEST(LineOfAction, SharesAreByVolume) {
    sphm_parameters p = sphm_parameters_default();
    p.particles = 4944;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    size_t attached[3] = {0, 0, 0}, region[3] = {0, 0, 0};
    double n = (double)made.body.count;
    for (size_t i = 0; i < made.body.count; i++) {
        attached[made.body.attachment[i]]++;
        region[made.body.region[i]]++;
        EXPECT_GT(made.body.axial_fraction[i], 0);
        EXPECT_LT(made.body.axial_fraction[i], 1);
    }
    /* Whole layers: a layer of this belly holds less than 2 % of it. */
    EXPECT_NEAR((double)attached[SPHM_ATTACHED_ORIGIN] / n, 0.1, 0.02);
    EXPECT_NEAR((double)attached[SPHM_ATTACHED_INSERTION] / n, 0.1, 0.02);
    EXPECT_NEAR((double)region[SPHM_REGION_ORIGIN] / n, 0.2, 0.02);
    EXPECT_NEAR((double)region[SPHM_REGION_CENTRE] / n, 0.6, 0.03);
    p.attachment_fraction = 0;
    Body loose(p);
    for (size_t i = 0; i < loose.body.count; i++)
        ASSERT_EQ(loose.body.attachment[i], SPHM_FREE);
}

} // namespace
