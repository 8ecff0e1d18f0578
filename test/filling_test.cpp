/* Filling shapes with particles: counts, volumes, holes, and the whole rest shape of the presets. */
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/filling.h"
#include "core/line_of_action.h"
#include "core/section.h"
#include "core/vec3.h"
#include "core/winding.h"
#include "shapes.h"

namespace {

using shapes::Body;

sphm_parameters bar_80_6_6(int64_t particles) {
    sphm_parameters p = sphm_parameters_default();
    p.preset = SPHM_PRESET_BAR;
    p.belly_length = 0.08;
    p.belly_width = p.belly_thickness = 0.006;
    p.particles = particles;
    return p;
}

TEST(Bar, IsTheCellCentredLattice) {
    const int64_t counts[2] = {2880, 360};
    const double spacings[2] = {0.001, 0.002};
    for (int c = 0; c < 2; c++) {
        Body made(bar_80_6_6(counts[c]));
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        ASSERT_EQ(b.count, (size_t)counts[c]);
        const double s = spacings[c];
        EXPECT_NEAR(b.spacing_m, s, 1e-12);
        const double corner[3] = {-0.04, -0.003, -0.003};
        for (size_t i = 0; i < b.count; i++)
            for (int k = 0; k < 3; k++) {
                double cell = (b.positions[3 * i + (size_t)k] - corner[k]) / s - 0.5;
                ASSERT_NEAR(cell, std::round(cell), 1e-9);
            }
        EXPECT_NEAR(b.positions[0], -0.04 + s / 2, 1e-12);
        EXPECT_NEAR(b.volume_m3, 0.08 * 0.006 * 0.006, 1e-15);
        EXPECT_NEAR(b.mid_radius_m, std::sqrt(0.006 * 0.006 / M_PI), 1e-9);
        EXPECT_NEAR(b.length_m, 0.08, 1e-12);
        EXPECT_EQ(b.axis[0], 1);
    }
}

/* The fluid's ends; those of the solid are in clamp_test. */
TEST(Bar, IsAttachedByWholeLayers) {
    sphm_parameters p = bar_80_6_6(2880);
    p.tissue = SPHM_TISSUE_FLUID;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    size_t attached[3] = {0, 0, 0}, region[3] = {0, 0, 0}, outer = 0;
    for (size_t i = 0; i < made.body.count; i++) {
        attached[made.body.attachment[i]]++;
        region[made.body.region[i]]++;
        outer += made.body.outer[i];
        EXPECT_EQ(made.body.fibres[3 * i], 1);
    }
    EXPECT_EQ(attached[SPHM_ATTACHED_ORIGIN], 288u);
    EXPECT_EQ(attached[SPHM_ATTACHED_INSERTION], 288u);
    EXPECT_EQ(region[SPHM_REGION_ORIGIN], 576u);
    EXPECT_EQ(region[SPHM_REGION_CENTRE], 1728u);
    EXPECT_EQ(region[SPHM_REGION_INSERTION], 576u);
    EXPECT_EQ(outer, 2880u - 78u * 4u * 4u);
}

TEST(Presets, MeetTheCountsOfThePaper) {
    const int64_t counts[4] = {2231, 4944, 9888, 18475};
    const int presets[3] = {SPHM_PRESET_TRICEPS_LONG_HEAD, SPHM_PRESET_VASTUS_LATERALIS, SPHM_PRESET_BELLY};
    for (int preset : presets)
        for (int64_t count : counts) {
            if (preset != SPHM_PRESET_TRICEPS_LONG_HEAD && count > 3000)
                break; /* one shape at all counts will do */
            sphm_parameters p = sphm_parameters_default();
            p.preset = preset;
            p.particles = count;
            Body made(p);
            ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
            EXPECT_NEAR((double)made.body.count, (double)count, 0.01 * (double)count);
            double filled = (double)made.body.count * std::pow(made.body.spacing_m, 3);
            EXPECT_NEAR(filled / made.body.volume_m3, 1, 0.03);
        }
}

TEST(Presets, HaveThePublishedSizes) {
    const int presets[2] = {SPHM_PRESET_TRICEPS_LONG_HEAD, SPHM_PRESET_VASTUS_LATERALIS};
    const double length[2] = {0.2632, 0.4427}, volume[2] = {139.9e-6, 432.9e-6};
    for (int k = 0; k < 2; k++) {
        sphm_parameters p = sphm_parameters_default();
        p.preset = presets[k];
        Body made(p);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_NEAR(made.body.upper_m[0] - made.body.lower_m[0], length[k], 1e-9);
        EXPECT_NEAR(made.body.volume_m3, volume[k], 0.002 * volume[k]);
        EXPECT_EQ(made.body.report.open_edges, 0u);
        EXPECT_GT(made.body.surface.triangle_count, 2000u);
    }
}

/* pi/4 w t integrates to pi L (re^2 + re (a + b - 2 re) 2/pi + (a - re)(b - re)/2) over a belly. */
TEST(Presets, BellyHasTheVolumeOfItsFormula) {
    for (double end : {0.0, 0.006}) {
        sphm_parameters p = sphm_parameters_default();
        p.preset = SPHM_PRESET_BELLY;
        p.belly_end_radius = end;
        p.belly_bow = 0.02;
        Body made(p);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        double a = 0.025, b = 0.018,
               exact =
                   M_PI * 0.2 * (end * end + end * (a + b - 2 * end) * 2 / M_PI + (a - end) * (b - end) / 2);
        EXPECT_NEAR(made.body.volume_m3, exact, 0.003 * exact);
        EXPECT_NEAR(made.body.mid_radius_m, std::sqrt(a * b), 0.03 * std::sqrt(a * b));
    }
}

TEST(Presets, TheSupportIsWhatSuitsTheTissue) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    EXPECT_NEAR(Body(p).body.support_radius_m / Body(p).body.spacing_m, 2.2, 1e-9);
    p.tissue = SPHM_TISSUE_FLUID;
    EXPECT_NEAR(Body(p).body.support_radius_m / Body(p).body.spacing_m, 2.6, 1e-9);
    p.smoothing_ratio = 3;
    EXPECT_NEAR(Body(p).body.support_radius_m / Body(p).body.spacing_m, 3, 1e-9);
}

TEST(Presets, PaperUnitsGiveThePapersSupport) {
    sphm_parameters p = sphm_parameters_default();
    p.particles = 18475;
    p.paper_units = 1;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    EXPECT_NEAR(made.body.support_radius_m, 0.04 * 0.2632 / 2, 1e-9);
    EXPECT_EQ(made.body.isolated, 0u);
    p.paper_h = 0.01; /* 1.3 mm at a spacing of 2 mm */
    Body alone(p);
    ASSERT_EQ(alone.status, SPHM_OK);
    EXPECT_EQ(alone.body.isolated, alone.body.count);
    EXPECT_NE(alone.log.find("no neighbour"), std::string::npos) << alone.log;
}

TEST(Filling, IsTheSameForAnyNumberOfThreads) {
    sphm_parameters p = sphm_parameters_default();
    p.jitter = 0.2;
    p.fibres = SPHM_FIBRES_LAPLACE;
    shapes::expect_threads_do_not_matter(p);
}

TEST(Filling, JitterDependsOnTheSeedAndStaysInside) {
    sphm_parameters p = sphm_parameters_default();
    Body lattice(p);
    p.jitter = 0.3;
    Body first(p), again(p);
    p.seed = 2;
    Body other(p);
    ASSERT_EQ(first.body.count, lattice.body.count);
    size_t size = 3 * first.body.count * sizeof(double);
    EXPECT_EQ(std::memcmp(first.body.positions, again.body.positions, size), 0);
    EXPECT_NE(std::memcmp(first.body.positions, other.body.positions, size), 0);
    size_t moved = 0;
    for (size_t i = 0; i < first.body.count; i++) {
        for (size_t k = 0; k < 3; k++)
            EXPECT_LE(std::fabs(first.body.positions[3 * i + k] - lattice.body.positions[3 * i + k]),
                      0.3 * lattice.body.spacing_m * 1.000001);
        moved += first.body.positions[3 * i] != lattice.body.positions[3 * i];
        EXPECT_GT(sphm_winding_number_exact(&first.body.surface, &first.body.positions[3 * i]), 0.49);
        if (i > 500)
            break;
    }
    EXPECT_GT(moved, 450u);
}

/* How many particles have no other one opposite a middle plane of the box, of a body along x, y, z. */
size_t without_mirror_image(const sphm_body &b) {
    using Place = std::array<long, 3>;
    std::set<Place> places;
    std::vector<Place> all(b.count);
    const double unit = 1e-3 * b.spacing_m;
    const auto number = [&](double x, size_t k) {
        return std::lround((x - (b.lower_m[k] + b.upper_m[k]) / 2) / unit);
    };
    for (size_t i = 0; i < b.count; i++) {
        for (size_t k = 0; k < 3; k++)
            all[i][k] = number(b.positions[3 * i + k], k);
        for (long dx : {-1, 0, 1}) /* rounding */
            for (long dy : {-1, 0, 1})
                for (long dz : {-1, 0, 1})
                    places.insert({all[i][0] + dx, all[i][1] + dy, all[i][2] + dz});
    }
    size_t missing = 0;
    for (const Place &p : all)
        missing += !places.count({-p[0], p[1], p[2]}) || !places.count({p[0], -p[1], p[2]}) ||
                   !places.count({p[0], p[1], -p[2]});
    return missing;
}

TEST(Filling, OfASymmetricShapeIsSymmetric) {
    /* Its triangles are not quite: a site that they all but touch may be tissue on one side only (500). */
    for (int64_t count : {2231, 4944, 9888, 18475}) {
        sphm_parameters p = sphm_parameters_default();
        p.tissue = SPHM_TISSUE_FLUID;
        p.preset = SPHM_PRESET_BELLY;
        p.particles = count;
        Body made(p);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_EQ(without_mirror_image(made.body), 0u) << made.body.count << " particles";
    }
}

/* Places of the layers along a direction, in spacings from `at`. */
std::set<double> layers(const sphm_body &b, const double direction[3], double at) {
    std::set<double> found;
    for (size_t i = 0; i < b.count; i++)
        found.insert(std::round(1e3 * (sphm_dot3(&b.positions[3 * i], direction) - at) / b.layer_m) / 1e3);
    return found;
}

/* Layers lie as deep inside the sections as tissue feels its clamps behind them. */
void expect_layers_inside(const sphm_body &b, const double along[3], double step, const double sections[2]) {
    const double number = (sections[1] - sections[0]) / step - 2 * SPHM_CLAMP_DEPTH;
    EXPECT_NEAR(number, std::round(number), 1e-6) << b.count;
    for (double place : layers(b, along, sections[0])) {
        const double inside = place - SPHM_CLAMP_DEPTH;
        EXPECT_NEAR(inside, std::round(inside), 2e-3) << b.count;
    }
}

/* Of the solid tissue: between sections beyond which the attached share of the volume lies; cells near to
 * cubes. */
void expect_layers_inside_sections(const sphm_parameters &p, const sphm_surface *mesh, double flatness) {
    Body made(p, mesh);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    const sphm_body &b = made.body;
    double along[3], sections[2];
    std::memcpy(along, b.step_m[0], sizeof along);
    const double step = sphm_normalise3(along);
    EXPECT_NEAR(sphm_norm3(b.step_m[1]), sphm_norm3(b.step_m[2]), 1e-12);
    EXPECT_NEAR(step * sphm_norm3(b.step_m[1]) * sphm_norm3(b.step_m[2]), std::pow(b.spacing_m, 3), 1e-15);
    EXPECT_NEAR(step, b.spacing_m, flatness * b.spacing_m);
    EXPECT_NEAR((double)b.count, (double)p.particles, 0.01 * (double)p.particles);
    const sphm_cut_body whole = {&b.surface, nullptr, 0, 0};
    sphm_end_sections(&whole, along, p.attachment_fraction, sections);
    expect_layers_inside(b, along, step, sections);
}

TEST(Filling, OfTheSolidHasItsLayersWhereClampsWantThem) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.preset = SPHM_PRESET_BELLY;
    for (int64_t count : {500, 2231, 4944, 18475}) {
        p.particles = count;
        expect_layers_inside_sections(p, nullptr, count < 1000 ? 0.03 : 0.015);
    }
    p.preset = SPHM_PRESET_TRICEPS_LONG_HEAD;
    p.attachment_fraction = 0.2;
    p.particles = 2231;
    expect_layers_inside_sections(p, nullptr, 0.02);
    shapes::Surface sphere = shapes::sphere(0.03, 3);
    for (size_t v = 0; v < sphere.surface.vertex_count; v++) /* along a direction that is no axis */
        for (size_t k = 0; k < 3; k++)
            sphere.surface.vertices[3 * v + k] += (k ? 0.8 : 0.6) * sphere.surface.vertices[3 * v];
    p.attachment_fraction = 0.1;
    expect_layers_inside_sections(p, &sphere.surface, 0.03);
}

/* The fine cubes of a surface, as its body is made. */
struct Fine {
    sphm_filling filling = {};
    sphm_status status;
    sphm_context context = {};
    explicit Fine(const sphm_surface &surface, double volume_m3) {
        sphm_winding *winding;
        status = sphm_winding_create(&surface, &winding, &context);
        sphm_filling_task task = {};
        task.surface = &surface;
        task.winding = winding;
        task.volume_m3 = volume_m3;
        sphm_surface_principal_frame(&surface, task.frame);
        if (status == SPHM_OK)
            status = sphm_filling_create_fine(&task, &filling, &context);
        sphm_winding_destroy(winding);
    }
    Fine(const Fine &) = delete;
    ~Fine() { sphm_filling_free(&filling); }
    sphm_cut_body cut() const { return {nullptr, filling.positions, filling.count, filling.spacing_m}; }
};

/* A surface without lids says no volume; fine cubes in it do, and are cut in its stead. However many
 * particles there are: their own first filling was cut up to a third of a layer elsewhere. */
TEST(Filling, OfTheSolidMeetsSectionsOfAMeshWithHoles) {
    shapes::Surface tube = shapes::sphere(0.03, 4);
    for (size_t v = 0; v < tube.surface.vertex_count; v++)
        tube.surface.vertices[3 * v] *= 3;
    tube.keep([](const double x[3]) { return x[0] < 0.07; });
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_FLUID;
    p.particles = 300000;
    Body finest(p, &tube.surface); /* cubes, as the fine ones are */
    ASSERT_EQ(finest.status, SPHM_OK) << finest.context.message;
    const sphm_cut_body whole = {nullptr, finest.body.positions, finest.body.count, finest.body.spacing_m};
    p.tissue = SPHM_TISSUE_SOLID;
    for (int64_t count : {1000, 4000, 8000}) {
        p.particles = count;
        Body made(p, &tube.surface);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        ASSERT_GT(b.report.open_edges, 0u);
        const Fine fine(b.surface, b.volume_m3);
        ASSERT_EQ(fine.status, SPHM_OK) << fine.context.message;
        double along[3];
        std::memcpy(along, b.step_m[0], sizeof along);
        const double step = sphm_normalise3(along);
        const sphm_cut_body cubes = fine.cut();
        double sections[2], clamps[2];
        sphm_end_sections(&cubes, along, p.attachment_fraction, sections);
        expect_layers_inside(b, along, step, sections);
        sphm_end_sections(&cubes, b.axis, p.attachment_fraction, clamps);
        EXPECT_EQ(b.clamp_m[0], clamps[0]) << b.count;
        EXPECT_EQ(b.clamp_m[1], clamps[1]) << b.count;
        sphm_end_sections(&whole, b.axis, p.attachment_fraction, clamps);
        /* Within a fifth of a fine cube; the particles' own cubes were 1.6 mm off (1000) and 0.5 (8000). */
        const double bar = 0.2 * fine.filling.spacing_m;
        EXPECT_NEAR(b.clamp_m[0], clamps[0], bar) << b.count;
        EXPECT_NEAR(b.clamp_m[1], clamps[1], bar) << b.count;
    }
}

/* The volume that triangles enclose says little where there are holes; the cubes are about as many. */
TEST(Filling, OfFineCubesIsAsFineWhateverTheVolumeSays) {
    const shapes::Surface sphere = shapes::sphere(0.03, 3);
    const double volume = Body(sphm_parameters_default(), &sphere.surface).body.volume_m3;
    for (double share : {0.003, 1.0, 300.0}) {
        const Fine fine(sphere.surface, share * volume);
        ASSERT_EQ(fine.status, SPHM_OK) << fine.context.message;
        EXPECT_NEAR((double)fine.filling.count, SPHM_FINE_CUBES, 0.02 * SPHM_FINE_CUBES) << share;
        EXPECT_NEAR((double)fine.filling.count * std::pow(fine.filling.spacing_m, 3), volume, 0.005 * volume);
    }
}

TEST(Filling, OfFineCubesRefusesASurfaceWithoutAnInside) {
    shapes::Surface sphere = shapes::sphere(0.03, 2);
    for (size_t t = 0; t < sphere.surface.triangle_count; t++) /* inside out */
        std::swap(sphere.surface.triangles[3 * t], sphere.surface.triangles[3 * t + 1]);
    const Fine fine(sphere.surface, 1e-4);
    EXPECT_EQ(fine.status, SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(std::string(fine.context.message).find("no cube"), std::string::npos) << fine.context.message;
    EXPECT_EQ(fine.filling.positions, nullptr);
}

/* What the fluid is filled with does not depend on where it is held. */
TEST(Filling, OfTheFluidIsCubic) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_FLUID;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < 3; k++)
            EXPECT_EQ(made.body.step_m[a][k], a == k ? made.body.spacing_m : 0);
    EXPECT_NEAR(made.body.layer_m, made.body.spacing_m, 1e-15);
}

TEST(Filling, LeavesNoHoles) {
    shapes::Surface sphere = shapes::sphere(0.03, 3);
    sphm_parameters p = sphm_parameters_default();
    p.particles = 3000;
    Body made(p, &sphere.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    double s = made.body.spacing_m;
    for (size_t i = 0; i < made.body.count; i++) {
        double r = std::sqrt(sphm_dot3(&made.body.positions[3 * i], &made.body.positions[3 * i]));
        ASSERT_LT(r, 0.03);
        /* A particle with six neighbours is inner; all of them nearer to the middle than a shell are. */
        if (r < 0.03 - 1.3 * s) {
            ASSERT_EQ(made.body.outer[i], 0) << "a neighbour is missing at radius " << r;
        }
        if (r > 0.03 - 0.5 * s) {
            ASSERT_EQ(made.body.outer[i], 1);
        }
    }
    EXPECT_NEAR((double)made.body.count * s * s * s, 4 * M_PI / 3 * 27e-6, 0.03 * 4 * M_PI / 3 * 27e-6);
}

TEST(Filling, CrossesAHoleWithAFlatLid) {
    /* An open hemisphere: the winding number is 1/2 about where a lid would be. */
    shapes::Surface bowl = shapes::sphere(0.03, 3);
    bowl.keep([](const double x[3]) { return x[2] < 0; });
    sphm_parameters p = sphm_parameters_default();
    p.particles = 3000;
    Body made(p, &bowl.surface);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    EXPECT_GT(made.body.report.open_edges, 0u);
    double filled = (double)made.body.count * std::pow(made.body.spacing_m, 3);
    EXPECT_NEAR(filled, 2 * M_PI / 3 * 27e-6, 0.12 * 2 * M_PI / 3 * 27e-6);
    for (size_t i = 0; i < made.body.count; i++)
        ASSERT_LT(made.body.positions[3 * i + 2], 0.006);
}

TEST(Filling, MeetsSmallCountsAndRefusesImpossibleOnes) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_FLUID; /* the solid has no particle free in four layers */
    p.preset = SPHM_PRESET_BELLY;
    for (int64_t count : {8, 37, 101, 500}) {
        p.particles = count;
        Body made(p);
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_NEAR((double)made.body.count, (double)count, 0.01 * (double)count);
    }
    p = bar_80_6_6(11);
    p.belly_length = 0.006;
    Body made(p);
    EXPECT_EQ(made.status, SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(std::string(made.context.message).find("particles: 11"), std::string::npos)
        << made.context.message;
    EXPECT_NE(std::string(made.context.message).find("nearest"), std::string::npos);
    EXPECT_EQ(made.body.positions, nullptr);
}

} // namespace
