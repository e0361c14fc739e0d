#include "wizard/capture/exposure_check.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/wizard/small_plan.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/display_latency.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::wizard {
namespace {

// The bench with its board in the plan's first pose.
struct Bench {
  Plan plan;
  calib::CaptureSet captures;
  std::unique_ptr<sim::VirtualRig> rig;

  explicit Bench(const sim::VirtualRigOptions& options = {}) {
    const std::filesystem::path folder = test::test_folder();
    plan = load_plan(test::small_plan(folder)).value();
    rig = std::make_unique<sim::VirtualRig>(sim::load_world(plan.world, tracker::marker_image).value(),
                                            options);
    captures = plan_virtual_captures(plan, *rig, folder / "captures").value();
    rig->remove_prototype();
    rig->place(board_object(plan.board, plan.world_from_board[0]));
  }

  ExposureReading seen() {
    const auto all = measure_exposure(captures, capture_backend(rig.get(), nullptr, nullptr));
    EXPECT_TRUE(all.ok()) << (all ? "" : all.message());
    return all->at(0);
  }
};

std::string advice_of(const ExposureReading& seen) {
  std::string text;
  for (const std::string& sentence : seen.advice()) text += sentence + "\n";
  return text;
}

TEST(LightCheck, FindsNothingWrongWithASoundBench) {
  Bench bench;
  const ExposureReading seen = bench.seen();
  EXPECT_EQ(seen.camera, "camera0");
  EXPECT_EQ(seen.projector, "projector0");
  EXPECT_GT(seen.lit, 0.05);
  EXPECT_EQ(advice_of(seen), "");
  EXPECT_TRUE(unseen({seen}).empty());
}

TEST(LightCheck, NamesWhatIsWrongWithExposure) {
  Bench bench;
  const double exposure = bench.rig->camera_effects(0).exposure;
  bench.rig->camera_effects(0).exposure = 4 * exposure;
  const ExposureReading bright = bench.seen();
  EXPECT_GT(bright.saturated, 0.05);
  EXPECT_NE(advice_of(bright).find("Shorten the exposure"), std::string::npos) << advice_of(bright);
  bench.rig->camera_effects(0).exposure = exposure / 4;
  const ExposureReading dark = bench.seen();
  EXPECT_EQ(dark.saturated, 0);
  EXPECT_NE(advice_of(dark).find("Lengthen the exposure"), std::string::npos) << advice_of(dark);
}

TEST(LightCheck, MeasuresHowSoftEdgesAre) {
  Bench bench;
  const double sharp_px = bench.seen().blur_px;
  bench.rig->camera_effects(0).psf_px = 4;
  const ExposureReading soft = bench.seen();
  EXPECT_LT(sharp_px, 2);
  EXPECT_NEAR(soft.blur_px, std::hypot(sharp_px, 4), 0.8);
  EXPECT_NE(advice_of(soft).find("Focus"), std::string::npos) << advice_of(soft);
}

TEST(LightCheck, NamesAProjectorThatNoCameraSees) {
  Bench bench;
  bench.rig->edit().projector_effects[0].illuminance_at_1m = 0;
  const ExposureReading nothing = bench.seen();
  EXPECT_LT(nothing.lit, 0.005);
  const auto sentences = unseen({nothing});
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_EQ(sentences[0].substr(0, 11), "projector0:");
}

// The rig's projector and camera for a latency measurement.
FlashDevices flashes(sim::VirtualRig* rig) {
  rig->darken();
  const auto show = [rig](bool white) -> Result<Stamp> {
    const Stamp at = rig->now();
    EXPECT_TRUE(
        rig->projector(0).show(cv::Mat(rig->projector(0).size(), CV_8UC1, cv::Scalar(white ? 255 : 0))).ok());
    return at;
  };
  return {.show = show,
          .next = [rig] { return rig->camera(0).next(); },
          .wait = [rig](double seconds) { rig->advance(seconds); }};
}

TEST(DisplayLatency, IsMeasuredFarBelowTheFramePeriod) {
  const sim::VirtualRigOptions all[] = {
      {.display_delay_s = 0.0171, .camera_delay_s = 0.020, .grab_waits_for_light = false},
      {.display_delay_s = 0.0613, .camera_delay_s = 0.004, .grab_waits_for_light = false},
      {.display_delay_s = 0.1304,
       .camera_delay_s = 0.020,
       .frame_period_s = 1 / 25.0,
       .grab_waits_for_light = false}};
  for (const sim::VirtualRigOptions& options : all) {
    Bench bench(options);
    const auto latency = measure_latency(flashes(bench.rig.get()));
    ASSERT_TRUE(latency) << latency.message();
    EXPECT_NEAR(latency->seconds, options.display_delay_s, 0.001);
    EXPECT_LT(latency->within_s, 0.002);
    EXPECT_LE(std::abs(latency->seconds - options.display_delay_s), latency->within_s + 1e-9);
    EXPECT_EQ(latency->flashes, FlashOptions().flashes);
  }
}

TEST(DisplayLatency, SaysWhenNothingFlashes) {
  Bench bench({.grab_waits_for_light = false});
  bench.rig->edit().projector_effects[0].illuminance_at_1m = 0;
  const auto latency = measure_latency(flashes(bench.rig.get()));
  ASSERT_FALSE(latency);
  EXPECT_NE(latency.message().find("expected to see the display flash"), std::string::npos);
}

}  // namespace
}  // namespace limn::wizard
