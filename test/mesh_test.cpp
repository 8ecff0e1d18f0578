/* Reading meshes with assimp, and filling two real ones where they are at hand. */
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "shapes.h"
#include "sph_muscle/io.h"

namespace {

using shapes::Body;

class Mesh : public testing::Test {
  protected:
    std::string path;
    sphm_surface surface = {};
    sphm_context context = {};
    void SetUp() override {
        if (!sphm_io_has_mesh())
            GTEST_SKIP() << "built without assimp";
    }
    void TearDown() override {
        sphm_surface_free(&surface);
        if (!path.empty())
            std::remove(path.c_str());
    }
    sphm_status load(const std::string &name, const std::string &text, double scale = 0.001) {
        path = testing::TempDir() + name;
        FILE *file = std::fopen(path.c_str(), "w");
        EXPECT_NE(file, nullptr);
        std::fputs(text.c_str(), file);
        std::fclose(file);
        return sphm_io_load_surface(path.c_str(), scale, &surface, &context);
    }
};

const char cube_obj[] = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n"
                        "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

TEST_F(Mesh, ReadsAndScalesACube) {
    ASSERT_EQ(load("sphm_mesh_test.obj", cube_obj, 0.01), SPHM_OK) << context.message;
    EXPECT_EQ(surface.triangle_count, 12u); /* quadrangles are divided */
    sphm_surface_report report;
    ASSERT_EQ(sphm_surface_repair(&surface, &report, &context), SPHM_OK) << context.message;
    EXPECT_NEAR(report.volume_m3, 8e-6, 1e-12);
    EXPECT_EQ(report.open_edges, 0u);
}

TEST_F(Mesh, RefusesAMissingFile) {
    EXPECT_EQ(sphm_io_load_surface("/nowhere/muscle.stl", 1, &surface, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::string(context.message).find("/nowhere/muscle.stl"), std::string::npos) << context.message;
    EXPECT_EQ(surface.vertices, nullptr);
}

TEST_F(Mesh, RefusesAFileWithoutTriangles) {
    EXPECT_GT(load("sphm_mesh_test.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"), 0);
    EXPECT_NE(std::string(context.message).find(path), std::string::npos) << context.message;
}

TEST_F(Mesh, RefusesNoise) {
    EXPECT_GT(load("sphm_mesh_test.stl", "this is no mesh"), 0);
    EXPECT_NE(std::string(context.message).find(path), std::string::npos) << context.message;
    EXPECT_EQ(surface.vertices, nullptr);
}

TEST_F(Mesh, RefusesBadScale) {
    EXPECT_EQ(load("sphm_mesh_test.obj", cube_obj, 0), SPHM_REFUSED_ARGUMENT);
}

/* Real muscles ------------------------------------------------------------------------------------------- */

std::string real_mesh(const char *name) {
    const char *folder = std::getenv("SPH_MUSCLE_DATA");
    std::string path =
        std::string(folder ? folder : SPHM_SOURCE_DIR "/../shared/data/bodyparts3d") + "/" + name;
    FILE *file = std::fopen(path.c_str(), "rb");
    if (!file)
        return "";
    std::fclose(file);
    return path;
}

struct Published {
    const char *file;
    size_t triangles, open_edges, components;
    double volume_m3;
};

class RealMesh : public testing::TestWithParam<Published> {};

TEST_P(RealMesh, FillsAsPublished) {
    const Published &known = GetParam();
    std::string path = real_mesh(known.file);
    if (!sphm_io_has_mesh() || path.empty())
        GTEST_SKIP() << known.file << " or assimp is not there (set SPH_MUSCLE_DATA to the folder)";
    sphm_surface surface;
    ASSERT_EQ(sphm_io_load_surface(path.c_str(), 0.001, &surface, nullptr), SPHM_OK);
    EXPECT_EQ(surface.triangle_count, known.triangles);
    for (int64_t count : {2231, 18475}) {
        sphm_parameters p = sphm_parameters_default();
        p.particles = count;
        p.fibres = SPHM_FIBRES_LAPLACE;
        Body made(p, &surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_NEAR((double)made.body.count, (double)count, 0.01 * (double)count);
        EXPECT_EQ(made.body.report.components, known.components);
        EXPECT_EQ(made.body.report.dropped_fragments, known.components - 1);
        /* The published open edges are counted before the loose fragments are dropped. */
        EXPECT_LE(made.body.report.open_edges, known.open_edges);
        EXPECT_GT(made.body.report.open_edges, known.open_edges / 2);
        EXPECT_NEAR(made.body.volume_m3, known.volume_m3, 0.01 * known.volume_m3);
        EXPECT_NEAR((double)made.body.count * std::pow(made.body.spacing_m, 3), known.volume_m3,
                    0.015 * known.volume_m3);
        EXPECT_LT(made.body.axis[2], -0.95); /* from the shoulder or hip downwards */
        EXPECT_EQ(made.body.isolated, 0u);
    }
    sphm_surface_free(&surface);
}

INSTANTIATE_TEST_SUITE_P(
    BodyParts3D, RealMesh,
    testing::Values(Published{"triceps_long_head_right_FMA37699.stl", 7902, 514, 1, 139.9e-6},
                    Published{"vastus_lateralis_right_FMA38930.stl", 19112, 1696, 21, 432.9e-6}));

} // namespace
