#include "limn/calibration.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "library/convert.h"
#include "tests/library/example_inputs.h"
#include "tests/support/matchers.h"
#include "wizard/measure/solve_captures.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;
namespace fs = std::filesystem;

api::SolveOptions photographs_of_the_board() {
  api::SolveOptions options;
  options.cameras_only = true;
  options.board = test::k_example_board;
  options.camera_model = "LENSMODEL_OPENCV4";
  return options;
}

TEST(LibrarySolve, GivesWhatTheProgramGives) {
  const fs::path folder = test::test_folder();
  test::write_example_photographs(folder / "photographs", 6);
  api::SolveOptions options = photographs_of_the_board();
  std::vector<std::string> stages;
  options.progress = [&](const api::Progress& progress) { return stages.push_back(progress.stage), true; };
  const api::Calibration found = api::solve(folder / "photographs", folder / "rig", options);

  wizard::SolveCommandOptions command{.captures = folder / "photographs", .out = folder / "program"};
  command.cameras_only = true;
  command.foreign.board = test::k_example_board;
  command.camera_model = "LENSMODEL_OPENCV4";
  const auto expected = wizard::solve_captures(command);
  ASSERT_TRUE(expected) << expected.message();
  EXPECT_EQ(found.held_out_rms_px, expected->assessment.held_out.rms_px);
  EXPECT_EQ(found.explanation, expected->explanation.verdict);
  ASSERT_EQ(found.devices.size(), 1U);
  EXPECT_EQ(found.devices[0].rms_px, expected->assessment.devices[0].rms_px);
  EXPECT_EQ(found.rig.cameras()[0].parts().lens_values,
            api::Rig::load(folder / "program").cameras()[0].parts().lens_values);
  EXPECT_EQ(stages, (std::vector<std::string>{"decode", "solve", "assess", "write"}));
  EXPECT_TRUE(fs::exists(found.report_html));
}

TEST(LibrarySolve, IsStoppedAndWritesNothing) {
  const fs::path folder = test::test_folder();
  test::write_example_photographs(folder / "photographs", 3);
  api::SolveOptions options = photographs_of_the_board();
  options.progress = [](const api::Progress& progress) { return progress.stage != "solve"; };
  EXPECT_THROW(api::solve(folder / "photographs", folder / "rig", options), api::Stopped);
  EXPECT_FALSE(fs::exists(folder / "rig"));
}

TEST(LibrarySolve, AFailureIsNotAStop) {
  api::SolveOptions options = photographs_of_the_board();
  options.progress = [](const api::Progress&) { return true; };
  try {
    api::solve(test::test_folder() / "none", test::test_folder() / "rig", options);
    FAIL() << "expected an error";
  } catch (const api::Stopped&) {
    FAIL() << "expected another error";
  } catch (const api::Error& error) {
    EXPECT_NE(std::string(error.what()).find("none"), std::string::npos) << error.what();
  }
}

TEST(LibraryScan, SaysWhatItRefuses) {
  const api::Rig rig({}, {});
  api::ScanOptions options;
  options.near_m = 2;
  options.far_m = 1;
  EXPECT_THROW(api::scan(test::test_folder(), rig, test::test_folder() / "scan", options), api::Error);
  EXPECT_THROW(api::scan(test::test_folder() / "none", rig, test::test_folder() / "scan"), api::Error);
  EXPECT_THROW(api::align({}, "mesh.stl", test::test_folder()), api::Error);
}

}  // namespace
}  // namespace limn
