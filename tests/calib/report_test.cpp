#include "calib/report/report.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/rig.h"
#include "tests/calib/observed_world.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;
using namespace test;
using namespace worlds;
using Eigen::Vector2d;
using Eigen::Vector3d;
using nlohmann::json;

// A calibration of a noisy world, with its report in `folder` as `limn solve` writes it.
Report reported(const World& world, const fs::path& folder, const std::string& made_at) {
  Report report;
  report.observed.observations = world.observations;
  report.observed.decoded = {{0, 0, 0, 1000, 950, 3, 1900}};
  report.solution = solve(world.observations).value();
  report.assessment = assess(report.observed, {}, report.solution).value();
  report.explanation = explain(report.observed, report.solution, report.assessment);
  report.seconds = {{"solve", 0.5}, {"total", 1.25}};
  report.made_at = made_at;
  report.history = read_history(folder);
  return report;
}

World noisy_world() {
  World world = make_world(1, 1, 5, 0.2);
  add_noise(&world, 0.02, 0.05, test_rng());
  return world;
}

TEST(Report, ThePageIsSelfContainedAndSaysTheVerdictInWords) {
  Report report = reported(noisy_world(), test_folder(), "2026-11-21T10:00:00Z");
  report.assessment.faults = {{FaultName::odd_pose, "odd <fault>, a & b", "look \"here\""}};
  report.lens_trials = {
      {"camera0", "LENSMODEL_OPENCV8", std::numeric_limits<double>::quiet_NaN(), 0, 0, false}};
  const std::string html = report_html(report);
  EXPECT_NE(html.find("LENSMODEL_OPENCV8"), std::string::npos);
  for (const char* outside : {"http", "<script", "src=", "@import", "url(", "<link"})
    EXPECT_EQ(html.find(outside), std::string::npos) << outside;
  EXPECT_NE(html.find("Predicted error"), std::string::npos)
      << "the verdict's sentence starts without the verdict itself";
  for (const std::string& sentence : report.explanation.advice)
    EXPECT_NE(html.find(sentence), std::string::npos);
  EXPECT_NE(html.find("odd &lt;fault&gt;"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_EQ(html.find("inf"), std::string::npos);
}

TEST(Report, TheScaleRestsOnTheCadWhereAScanHasItsSize) {
  const Report before = reported(noisy_world(), test_folder(), "2026-11-21T10:00:00Z");
  Report report = before;
  ASSERT_NE(before.observed.observations.board.text(), "");
  report.explanation = explain(report.observed, report.solution, report.assessment, false);
  EXPECT_NE(report.explanation.verdict.find("nothing has checked"), std::string::npos);
  EXPECT_FALSE(note_cad_size({0.99, 0}, &report));      // not compared
  EXPECT_FALSE(note_cad_size({1.001, 0.02}, &report));  // a flat plate
  EXPECT_EQ(report.scale_rests_on, "board");

  EXPECT_TRUE(note_cad_size({1.001, 0.0005}, &report));
  EXPECT_EQ(report.scale_rests_on, "cad");
  EXPECT_EQ(report.explanation.verdict.find("nothing has checked"), std::string::npos);
  EXPECT_FALSE(note_cad_size({0.96, 0.0005}, &report));  // it was checked

  Report wrong = before;
  EXPECT_TRUE(note_cad_size({0.96, 0.0005}, &wrong));
  EXPECT_EQ(wrong.scale_rests_on, "board");
  EXPECT_EQ(wrong.assessment.faults.back().name, FaultName::wrong_scale);
  EXPECT_GE(wrong.assessment.verdict, Verdict::usable);
  EXPECT_NE(wrong.explanation.verdict.find("nothing has checked"), std::string::npos);
  const fs::path folder = test_folder();
  ASSERT_TRUE(write_report(wrong, folder).ok());
  EXPECT_EQ(test::read_json(folder / "report.json")["scale_rests_on"], "board");
  EXPECT_TRUE(fs::exists(folder / "report.html"));
}

TEST(Report, DiffersByDateAndSecondsAlone) {
  const World world = noisy_world();
  const auto stripped = [](std::string html) {
    const auto at = html.find("<p class='soft'>"), end = html.find('\n', at);
    EXPECT_NE(at, std::string::npos);
    return html.erase(at, end - at);
  };
  Report a = reported(world, test_folder(), "2026-11-21T10:00:00Z");
  Report b = reported(world, test_folder(), "2026-11-22T11:11:11Z");
  b.seconds = {{"solve", 9.5}, {"total", 11.25}};
  EXPECT_EQ(stripped(report_html(a)), stripped(report_html(b)));
  json first = json::parse(report_json(a)), second = json::parse(report_json(b));
  for (json* report : {&first, &second}) {
    report->erase("made_at");
    report->erase("seconds");
  }
  EXPECT_EQ(first, second);
  EXPECT_EQ(first["history"], json::array());
}

TEST(Report, RemembersEarlierCalibrationsAndHowFarTheProjectorHasMoved) {
  const fs::path folder = test_folder();
  World world = noisy_world();
  ASSERT_TRUE(write_rig_folder(reported(world, folder, "2026-11-20T10:00:00Z"), {}, folder).ok());

  // The projector is moved by half a degree and 5 mm; all matches follow it.
  Imager& projector = world.rig.projectors[0];
  Pose world_from_projector = projector.imager_from_world.inverse();
  world_from_projector.rotation = world_from_projector.rotation * exp_rotation(Vector3d(0, 0.5_deg, 0));
  world_from_projector.translation.x() += 0.005;
  projector.imager_from_world = world_from_projector.inverse();
  world.observations.corners.clear();
  world.observations.matches.clear();
  for (int pose = 0; pose < 5; ++pose) {
    observe_corners(&world, 0, pose);
    observe_matches(&world, 0, 0, pose);
  }
  const Report second = reported(world, folder, "2026-11-21T10:00:00Z");
  ASSERT_TRUE(write_rig_folder(second, {}, folder).ok());
  const json report = test::read_json(folder / "report.json");
  ASSERT_EQ(report["history"].size(), 1U);
  EXPECT_EQ(report["history"][0]["made_at"], "2026-11-20T10:00:00Z");
  EXPECT_GT(report["history"][0]["held_out_px"], 0.01);
  ASSERT_EQ(report["moved"].size(), 1U);
  EXPECT_EQ(report["moved"][0]["name"], "projector0");
  EXPECT_NEAR(report["moved"][0]["degrees"], 0.5, 0.15);
  EXPECT_NEAR(report["moved"][0]["mm"], 5, 3);
  EXPECT_GT(report["moved"][0]["px"], 5) << "half a degree is some 14 px";
  EXPECT_NE(report_html(second).find("2026-11-20T10:00:00Z"), std::string::npos);

  const Report third = reported(world, folder, "2026-11-22T10:00:00Z");
  ASSERT_EQ(third.history.past.size(), 2U);
  ASSERT_EQ(third.history.past[1].moved.size(), 1U);
  EXPECT_NEAR(third.history.past[1].moved[0].degrees, 0.5, 0.15);
  const json same = json::parse(report_json(third));
  EXPECT_LT(same["moved"][0]["px"], 1e-3) << "the same observations, the same rig";
}

TEST(Report, HistoryIsLimitedAndSurvivesDamage) {
  const fs::path folder = test_folder();
  json report = json::parse(report_json(reported(noisy_world(), folder, "2026-11-20T10:00:00Z")));
  for (int i = 0; i < 2 * k_history; ++i)
    report["history"].push_back({{"made_at", fmt::format("{}", i)},
                                 {"verdict", "good"},
                                 {"held_out_px", 0.2},
                                 {"worst_px", nullptr},
                                 {"predicted_mm", 1.0}});
  ASSERT_TRUE(write_file(folder / "report.json", report.dump()).ok());
  const History history = read_history(folder);
  EXPECT_EQ(static_cast<int>(history.past.size()), k_history);
  EXPECT_EQ(history.past.back().made_at, "2026-11-20T10:00:00Z");
  EXPECT_FALSE(history.rig);
  ASSERT_TRUE(write_file(folder / "report.json", R"({"verdict": "reject", "failure": "no board"})").ok());
  EXPECT_TRUE(read_history(folder).past.empty());
  for (const char* damaged : {"{", "[]", "{\"verdict\": 3}", "{\"verdict\": \"good\", \"held_out\": 1}"}) {
    ASSERT_TRUE(write_file(folder / "report.json", damaged).ok());
    EXPECT_TRUE(read_history(folder).past.empty()) << damaged;
  }
}

}  // namespace
}  // namespace limn::calib
