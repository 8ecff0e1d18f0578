// The triceps preset of config/triceps_solid.yaml with a free insertion: shortening at full activation, and
// the way back. Murray et al. (J. Biomech. 33 (2000) 943): up to 28 % of the optimal length.
#include "solid_muscles.h"

namespace {

using namespace solid;

TEST(Preset, TricepsShortensAndReturns) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.preset = SPHM_PRESET_TRICEPS_LONG_HEAD;
    p.particles = 300;
    p.threads = 1;
    p.passive_compressive_stiffness = 4.5e5;
    p.force_velocity = SPHM_FORCE_VELOCITY_HILL;
    p.rate_filter = 0.02;
    const Muscle muscle = make(p);
    ASSERT_EQ(sphm_muscle_slide_end(muscle.get(), SPHM_END_INSERTION, 0, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 1, 0.3, nullptr), SPHM_OK);
    proceed(muscle, 0.3);
    const sphm_observation active = observe(muscle);
    EXPECT_GT(active.shortening, 0.20);
    EXPECT_LT(active.shortening, 0.28);
    EXPECT_NEAR(active.volume_ratio, 1, 0.05);
    proceed(muscle, 0.4);
    EXPECT_NEAR(observe(muscle).shortening, 0, 0.01);
}

} // namespace
