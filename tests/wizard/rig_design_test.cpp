#include "wizard/design/rig_design.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/plan_rig.h"
#include "core/file.h"
#include "tests/support/matchers.h"
#include "wizard/design/design_report.h"

namespace limn::design {
namespace {

namespace fs = std::filesystem;

const fs::path k_described = fs::path(LIMN_SOURCE_DIR) / "config/described";

PredictedAccuracy predicted_accuracy(const DescribedRig& described) {
  const auto found = predict_accuracy(described);
  EXPECT_TRUE(found) << found.message();
  return found ? *found : PredictedAccuracy{};
}

// rig_design_truth_test compares predictions with the same rig's true errors; here are only values that can
// be computed by hand.
TEST(Foresee, TellsSizesOfTheBench) {
  const auto described = load_described(k_described / "bench.json");
  ASSERT_TRUE(described) << described.message();
  const PredictedAccuracy found = predicted_accuracy(*described);
  ASSERT_EQ(found.cameras.size(), 1u);
  ASSERT_EQ(found.projectors.size(), 1u);
  // 1.273 m along the projector's level axis, divided by 1523 px; 1.376 m from the camera to the centre,
  // divided by 1620 px.
  EXPECT_NEAR(found.projectors[0].pixel_mm, 0.836, 0.003);
  EXPECT_NEAR(found.cameras[0].pixel_mm, 0.849, 0.003);
  EXPECT_NEAR(found.cameras[0].distance_m, std::hypot(0.32, 1.32, 0.22), 1e-9);
  // The lit side faces -y.
  const double cosine = 1.32 / std::hypot(0.32, 1.32, 0.22);
  EXPECT_NEAR(found.cameras[0].steep_deg, std::acos(cosine) * 180 / M_PI, 1e-6);
  EXPECT_NEAR(found.cameras[0].surface_mm, found.cameras[0].pixel_mm / cosine, 1e-9);
  ASSERT_EQ(found.markers.size(), 1u);
  EXPECT_NEAR(found.markers[0].side_px, 40 * cosine / found.cameras[0].pixel_mm, 1.5);
  EXPECT_LT(found.markers[0].farthest_px, found.markers[0].side_px);
}

TEST(Foresee, TheExamplesLoadAndTheNumbersRepeat) {
  for (const char* name : {"bench.json", "studio.json"}) {
    const auto described = load_described(k_described / name);
    ASSERT_TRUE(described) << described.message();
    EXPECT_TRUE(described->rig.cameras[0].project(described->p_centre).has_value());
  }
  const auto described = load_described(k_described / "bench.json");
  EXPECT_EQ(predicted_accuracy(*described).error_mm, predicted_accuracy(*described).error_mm);
}

// Everything that was described is on the page, which needs no other file.
TEST(Foresee, APageShowsTheRig) {
  const fs::path out = test::test_folder() / "plan";
  testing::internal::CaptureStdout();
  const Status done = apps::run_plan_rig({.described = k_described / "bench.json", .out = out});
  const std::string table = testing::internal::GetCapturedStdout();
  ASSERT_TRUE(done.ok()) << done.message();
  const std::string page = read_file(out / "plan.html").value();
  const DescribedRig described = load_described(k_described / "bench.json").value();
  for (const auto* imagers : {&described.rig.cameras, &described.rig.projectors})
    for (const Imager& imager : *imagers)
      EXPECT_NE(page.find(">" + imager.name + "</text>"), std::string::npos) << imager.name;
  EXPECT_NE(page.find(table), std::string::npos) << "the table";
  EXPECT_EQ(page.find("nan"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos);
  EXPECT_TRUE(nlohmann::json::accept(read_file(out / "plan.json").value()));
}

TEST(Foresee, NoiseAndNarrowAnglesCostWhatTheyMust) {
  auto described = load_described(k_described / "bench.json");
  ASSERT_TRUE(described) << described.message();
  const PredictedAccuracy before = predicted_accuracy(*described);
  EXPECT_TRUE(before.advice.empty()) << before.advice.front();
  DescribedRig noisy = *described;
  for (double* px : {&noisy.corner_px, &noisy.match_px, &noisy.marker_px}) *px *= 10;
  const PredictedAccuracy rough = predicted_accuracy(noisy);
  EXPECT_NEAR(rough.calibration_mm[0] / before.calibration_mm[0], 10, 3);
  // The measurement of the prototype is never assumed to be better than 0.02 px; here it is 0.06 px.
  EXPECT_NEAR(rough.measuring_mm[0] / before.measuring_mm[0], 3, 0.3);
  EXPECT_NEAR(rough.markers[0].across_mm / before.markers[0].across_mm, 10, 0.2);
  EXPECT_GT(before.markers[0].along_mm, 3 * before.markers[0].across_mm);
  DescribedRig small = *described;
  small.rig.projectors[0].width = 400;  // a narrow image: most of the volume stays dark
  small.rig.projectors[0].lens.values[2] = 199.5;
  const PredictedAccuracy dark = predicted_accuracy(small);
  EXPECT_LT(dark.coverage, 0.8 * before.coverage);
  ASSERT_FALSE(dark.advice.empty());
  EXPECT_NE(dark.advice[0].find("the projectors reach"), std::string::npos) << dark.advice[0];
}

// Each problem alone is named, and the corrected rig gets no such advice.
TEST(Foresee, NamesWhatIsTooSmallFarSteepOrDim) {
  const auto described = load_described(k_described / "bench.json");
  ASSERT_TRUE(described) << described.message();
  const auto advice_of = [](const DescribedRig& rig) {
    std::string all;
    for (const std::string& sentence : predicted_accuracy(rig).advice) all += sentence + "\n";
    return all;
  };
  const auto has = [](const std::string& text, const std::string& word) {
    return text.find(word) != std::string::npos;
  };
  DescribedRig small = *described;
  small.marker_m = 0.02;
  EXPECT_TRUE(has(advice_of(small), "camera0: too small, a marker of 20 mm")) << advice_of(small);
  small.marker_m = 0.045;
  EXPECT_FALSE(has(advice_of(small), "too small"));

  DescribedRig steep = *described;
  steep.d_front = Eigen::Vector3d(-1, 0, 0);  // camera and projector see this side at a grazing angle
  EXPECT_TRUE(has(advice_of(steep), "camera0: too steep")) << advice_of(steep);
  EXPECT_TRUE(has(advice_of(steep), "projector0: too steep")) << advice_of(steep);

  DescribedRig far = *described;
  Imager& projector = far.rig.projectors[0];
  const double away = (projector.imager_from_world * far.p_centre).z();
  projector.imager_from_world.translation.z() += away;  // twice as far
  EXPECT_TRUE(has(advice_of(far), "projector0: too far, a pixel is 1.7 mm")) << advice_of(far);

  DescribedRig dim = *described;
  dim.room_lux = 100;
  dim.lumens = {400};
  const PredictedAccuracy lit = predicted_accuracy(dim);
  // 400 lm on 1.070 m x 0.669 m, 18.6 degrees off the normal.
  EXPECT_NEAR(lit.projectors[0].lux, 400 / (1.070 * 0.669) * 0.948, 3);
  EXPECT_FALSE(has(advice_of(dim), "too dim")) << advice_of(dim);
  dim.room_lux = 150;
  EXPECT_TRUE(has(advice_of(dim), "projector0: too dim")) << advice_of(dim);
}

TEST(Foresee, WrongFilesAreNamedByKey) {
  const std::string good = read_file(k_described / "bench.json").value();
  const fs::path file = test::test_folder() / "rig.json";
  const auto message_with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    EXPECT_TRUE(write_file(file, text));
    const auto described = load_described(file);
    return described ? std::string() : described.message();
  };
  EXPECT_EQ(message_with("\"poses\": 9", "\"poses\": 10"), "");
  EXPECT_NE(message_with("\"poses\": 9", "\"poses\": 2").find("poses"), std::string::npos);
  EXPECT_NE(message_with("\"throw\": 1.19", "\"thrown\": 1.19").find("thrown"), std::string::npos);
  EXPECT_NE(message_with("\"throw\": 1.19, ", "").find("projectors[0]"), std::string::npos);
  EXPECT_NE(message_with("\"eye_m\": [0.24, -1.25, 0.06]", "\"eye_m\": [0, 0, 0.06]").find("in one place"),
            std::string::npos);
  EXPECT_NE(message_with("charuco:11x8:35mm", "paper").find("board"), std::string::npos);
  // Relative to the centre of the volume: 2 m away, 30 degrees to the right for a person in front.
  ASSERT_EQ(message_with("\"eye_m\": [-0.32, -1.32, 0.62]",
                         "\"from\": {\"distance_m\": 2, \"right_deg\": 30, \"up_deg\": 0}"),
            "");
  const Pose world_from_camera = load_described(file)->rig.cameras[0].imager_from_world.inverse();
  EXPECT_TRUE(test::near(world_from_camera.translation, Eigen::Vector3d(1, -std::sqrt(3.0), 0.4), 1e-9));
  // On the ceiling, straight above.
  ASSERT_EQ(message_with("\"eye_m\": [-0.32, -1.32, 0.62]", "\"eye_m\": [0, 0, 2]"), "");
  const auto px = load_described(file)->rig.cameras[0].project({0, 0.1, 0.4});
  ASSERT_TRUE(px.has_value());
  EXPECT_LT(px->y(), 500);  // the direction away from the front is up
}

}  // namespace
}  // namespace limn::design
