#include "limn/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
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

// The triangles of the scan and the pose of its mesh, from captures of a surface whose height is known.
TEST(LibraryScan, MeasuresASurfaceAndFindsItsMesh) {
  const fs::path folder = test::test_folder();
  test::write_example_scan(folder);
  std::vector<std::string> stages;
  api::ScanOptions options;
  options.progress = [&](const api::Progress& progress) { return stages.push_back(progress.stage), true; };
  const api::Scan scan =
      api::scan(folder / "captures", api::Rig::load(folder / "rig"), folder / "scan", options);
  EXPECT_EQ(stages, (std::vector<std::string>{"scan", "merge", "write"}));
  const auto positions = scan.points.positions();
  ASSERT_GT(positions.size(), 3U * 10000);
  EXPECT_EQ(scan.points.normals().size(), positions.size());
  EXPECT_EQ(3 * scan.points.stddevs().size(), positions.size());
  EXPECT_FALSE(scan.mesh.triangles().empty());
  const Pose surface_from_world = test::world_from_example_surface().inverse();
  double squares = 0;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    const Eigen::Vector3f p_world(positions[i], positions[i + 1], positions[i + 2]);
    const Eigen::Vector3d p = surface_from_world * p_world.cast<double>();
    squares += std::pow(p.z() - test::example_height(p.x(), p.y()), 2);
  }
  EXPECT_LT(std::sqrt(3 * squares / static_cast<double>(positions.size())), 0.5e-3);

  api::AlignOptions aligning;
  aligning.mesh_unit = api::Unit::metre;
  aligning.start = folder / "start.json";
  const api::Alignment aligned =
      api::align(folder / "scan", folder / "surface.ply", folder / "aligned", aligning);
  const Pose error =
      test::world_from_example_surface().inverse() * api::to_room(aligned.world_from_prototype);
  EXPECT_LT(error.translation.norm(), 0.5e-3);
  EXPECT_GT(aligned.used_points, 500);
  EXPECT_GT(aligned.scan_share, 0.9);
  EXPECT_TRUE(fs::exists(folder / "aligned/poses.json"));
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
