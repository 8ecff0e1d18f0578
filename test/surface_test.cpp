/* Copying and repairing triangle surfaces. */
#include <gtest/gtest.h>

#include "shapes.h"

namespace {

using shapes::Surface;

sphm_status repair(Surface &s, sphm_surface_report *report, std::string *message = nullptr) {
    sphm_context context;
    std::memset(&context, 0, sizeof context);
    sphm_status status = sphm_surface_repair(&s.surface, report, &context);
    if (message)
        *message = context.message;
    return status;
}

/* One surface of the triangles of two. */
Surface both(const Surface &a, const Surface &b) {
    std::vector<double> v(a.surface.vertices, a.surface.vertices + 3 * a.surface.vertex_count);
    std::vector<int32_t> t(a.surface.triangles, a.surface.triangles + 3 * a.surface.triangle_count);
    v.insert(v.end(), b.surface.vertices, b.surface.vertices + 3 * b.surface.vertex_count);
    for (size_t c = 0; c < 3 * b.surface.triangle_count; c++)
        t.push_back(b.surface.triangles[c] + (int32_t)a.surface.vertex_count);
    return Surface(v, t);
}

TEST(Surface, WeldsASoupIntoAClosedSphere) {
    Surface s = shapes::sphere(0.02, 4);
    sphm_surface_report report;
    ASSERT_EQ(repair(s, &report), SPHM_OK);
    EXPECT_EQ(s.surface.triangle_count, 2048u);
    EXPECT_EQ(s.surface.vertex_count, 1026u); /* Euler: V = 2 + T/2 */
    EXPECT_EQ(report.open_edges, 0u);
    EXPECT_EQ(report.components, 1u);
    EXPECT_NEAR(report.volume_m3, 4 * M_PI / 3 * 8e-6, 0.007 * 4 * M_PI / 3 * 8e-6);
    EXPECT_NEAR(report.area_m2, 4 * M_PI * 4e-4, 0.007 * 4 * M_PI * 4e-4);
    EXPECT_DOUBLE_EQ(report.upper_m[0], 0.02);
    EXPECT_DOUBLE_EQ(report.lower_m[2], -0.02);
}

TEST(Surface, TurnsAnInsideOutSurface) {
    Surface s = shapes::cube(0.01, 5, 5, 5);
    for (size_t t = 0; t < s.surface.triangle_count; t++)
        std::swap(s.surface.triangles[3 * t], s.surface.triangles[3 * t + 1]);
    sphm_surface_report report;
    ASSERT_EQ(repair(s, &report), SPHM_OK);
    EXPECT_NEAR(report.volume_m3, 8e-6, 1e-15);
    sphm_surface_report again;
    ASSERT_EQ(repair(s, &again), SPHM_OK);
    EXPECT_NEAR(again.volume_m3, 8e-6, 1e-15);
}

TEST(Surface, DropsFragmentsAndDegenerateTriangles) {
    Surface s = both(shapes::cube(0.02), shapes::cube(0.001, 0.1, 0, 0));
    s.surface.triangles[3 * 12] = s.surface.triangles[3 * 12 + 1]; /* of the fragment */
    sphm_surface_report report;
    ASSERT_EQ(repair(s, &report), SPHM_OK);
    EXPECT_EQ(report.components, 2u);
    EXPECT_EQ(report.dropped_fragments, 1u);
    EXPECT_EQ(report.degenerate, 1u);
    EXPECT_EQ(s.surface.triangle_count, 12u);
    EXPECT_EQ(s.surface.vertex_count, 8u);
    EXPECT_DOUBLE_EQ(report.upper_m[0], 0.02);
}

TEST(Surface, KeepsPiecesOfWeight) {
    Surface s = both(shapes::cube(0.02), shapes::cube(0.01, 0.1, 0, 0));
    sphm_surface_report report;
    ASSERT_EQ(repair(s, &report), SPHM_OK);
    EXPECT_EQ(report.components, 2u);
    EXPECT_EQ(report.dropped_fragments, 0u);
    EXPECT_NEAR(report.volume_m3, 64e-6 + 8e-6, 1e-12);
}

TEST(Surface, CountsOpenEdges) {
    Surface s = shapes::cube(0.01);
    s.surface.triangle_count = 10; /* the face at +x is missing */
    sphm_surface_report report;
    ASSERT_EQ(repair(s, &report), SPHM_OK);
    EXPECT_EQ(report.open_edges, 4u);
}

TEST(Surface, RefusesWhatHasNoVolume) {
    std::string message;
    Surface flat({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, {0, 1, 2, 0, 2, 3});
    EXPECT_EQ(repair(flat, nullptr, &message), SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(message.find("no volume"), std::string::npos) << message;
    EXPECT_EQ(flat.surface.triangle_count, 2u); /* as it was */

    Surface empty({}, {});
    EXPECT_EQ(repair(empty, nullptr, &message), SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(message.find("empty"), std::string::npos) << message;

    Surface line({0, 0, 0, 1, 0, 0, 2, 0, 0}, {0, 1, 2});
    EXPECT_EQ(repair(line, nullptr, &message), SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(message.find("without area"), std::string::npos) << message;
}

TEST(Surface, RefusesBadNumbers) {
    std::string message;
    Surface s = shapes::cube(0.01);
    s.surface.vertices[7] = NAN;
    EXPECT_EQ(repair(s, nullptr, &message), SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(message.find("vertex 2 "), std::string::npos) << message;
    Surface t = shapes::cube(0.01);
    t.surface.triangles[5] = 8;
    EXPECT_EQ(repair(t, nullptr, &message), SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(message.find("triangle 1 "), std::string::npos) << message;
}

TEST(Surface, CopiesAreEqualAndApart) {
    Surface s = shapes::cube(0.01);
    sphm_surface copy;
    ASSERT_EQ(sphm_surface_copy(&s.surface, &copy, nullptr), SPHM_OK);
    ASSERT_EQ(copy.vertex_count, 8u);
    EXPECT_EQ(std::memcmp(copy.vertices, s.surface.vertices, 24 * sizeof(double)), 0);
    EXPECT_EQ(std::memcmp(copy.triangles, s.surface.triangles, 36 * sizeof(int32_t)), 0);
    EXPECT_NE(copy.vertices, s.surface.vertices);
    sphm_surface_free(&copy);
    EXPECT_EQ(copy.vertices, nullptr);
}

} // namespace
