#include "calib/judge/rig_check.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdio>
#include <random>

#include "calib/board_print.h"
#include "calib/measurement_model.h"
#include "calib/solve.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_corner_noise_px = 0.05, k_match_noise_px = 0.08;

Imager imager(const std::string& name, int width, int height, std::vector<double> values, const Pose& pose) {
  return {name, width, height, Lens::create("LENSMODEL_OPENCV4", std::move(values)).value(), pose};
}

// Up to two cameras and two projectors that face boards 1.1 m away.
Rig true_rig(size_t cameras, size_t projectors) {
  Rig rig;
  rig.cameras = {imager("camera0", 1280, 1024, {1400, 1403, 652, 498, -0.12, 0.08, 0.0006, -0.0004}, Pose()),
                 imager("camera1", 1280, 1024, {1500, 1499, 630, 520, -0.05, 0.02, -0.0003, 0.0005},
                        looking_at({0.5, 0.05, 0.05}, {0, 0, 1.1}, {0, -1, 0}))};
  rig.projectors = {imager("projector0", 1280, 800, {1600, 1602, 655, 410, -0.06, 0.03, 0.0004, 0.0003},
                           looking_at({-0.35, 0.1, 0}, {0, 0, 1.1}, {0, -1, 0})),
                    imager("projector1", 1280, 800, {1550, 1552, 630, 720, -0.02, 0.01, 0, 0.0002},
                           Pose(exp_rotation({0.2, 0, 0}), Vector3d::Zero()) *
                               looking_at({0.3, 0.1, 0.0}, {0, 0, 1.1}, {0, -1, 0}))};
  rig.cameras.resize(cameras);
  rig.projectors.resize(projectors);
  return rig;
}

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

using Rng = std::mt19937_64;

Pose board_place(const Board& board, int pose, Rng* rng) {
  std::uniform_real_distribution<double> share(-1, 1);
  const double around = 2.4 * pose, tilt = 0.4 + 0.15 * share(*rng);
  return Pose(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.3 * share(*rng)}),
              Vector3d(0.12 * share(*rng), 0.1 * share(*rng), 1.1 + 0.15 * share(*rng))) *
         Pose(Eigen::Quaterniond::Identity(), {-board.width_m() / 2, -board.height_m() / 2, 0});
}

// The observations of a board at these poses, with noise.
Observations seen_by(const Rig& rig, const std::vector<Pose>& world_from_board, Rng* rng) {
  Observations seen;
  seen.board = Board::parse("charuco:7x5:50mm").value();
  const BoardShape shape{seen.board.width_m(), seen.board.height_m()};
  const Vector2d flat = Vector2d::Zero();
  std::normal_distribution<double> scatter(0, 1);
  const auto noise = [&](double px) { return Vector2d(px * scatter(*rng), px * scatter(*rng)); };
  for (const Imager& i : rig.cameras) seen.cameras.push_back({i.name, i.width, i.height});
  for (const Imager& i : rig.projectors) seen.projectors.push_back({i.name, i.width, i.height});
  for (int pose = 0; pose < static_cast<int>(world_from_board.size()); ++pose) {
    const Pose& place = world_from_board[static_cast<size_t>(pose)];
    seen.poses.push_back("pose" + std::to_string(pose));
    for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
      const Imager& camera = rig.cameras[static_cast<size_t>(c)];
      for (int id = 0; id < seen.board.corner_count(); ++id) {
        const auto px = camera.project(place * seen.board.p_corner(id));
        if (px && camera.contains(*px))
          seen.corners.push_back({c, pose, id, *px + noise(k_corner_noise_px), k_corner_noise_px});
      }
      for (int i = 0; i < 4 * seen.board.columns * seen.board.rows; ++i) {
        const double half = seen.board.square_m / 2;
        const Vector3d p((i % (2 * seen.board.columns) + 0.5) * half,
                         (i / (2 * seen.board.columns) + 0.5) * half, 0);
        const auto px = camera.project(place * p);
        if (!px || !camera.contains(*px)) continue;
        for (int k = 0; k < static_cast<int>(rig.projectors.size()); ++k) {
          const Imager& projector = rig.projectors[static_cast<size_t>(k)];
          Vector2d lit;
          if (predict_match(view(camera), view(projector), place, shape, flat, *px, &lit) &&
              projector.contains(lit))
            seen.matches.push_back({c, k, pose, *px, lit + noise(k_match_noise_px), k_match_noise_px, 100});
        }
      }
    }
  }
  return seen;
}

// The observations of a panel with a bump where boards stood, with noise: no board, tie points only.
Observations scene_seen_by(const Rig& rig, Rng* rng) {
  Observations seen = seen_by(rig, {}, rng);
  seen.poses = {"scene"};
  std::normal_distribution<double> scatter(0, k_match_noise_px);
  const Pose panel(exp_rotation({0.3, 0.2, 0}), {-0.25, -0.15, 1.05});
  for (int i = 0; i < 300; ++i) {
    const double x = (i % 20 + 0.5) / 20, y = (i / 20 + 0.5) / 15;
    const Vector3d p = panel * Vector3d(0.5 * x, 0.35 * y, -0.08 * std::sin(3 * x) * std::sin(3 * y));
    for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
      const auto px = rig.cameras[static_cast<size_t>(c)].project(p);
      if (!px || !rig.cameras[static_cast<size_t>(c)].contains(*px)) continue;
      const int point = static_cast<int>(seen.points.size());
      seen.points.push_back({0, c, *px});
      const auto look = [&](const Imager& imager, bool by_projector, int number) {
        const auto at = imager.project(p);
        if (at && imager.contains(*at))
          seen.tie_observations.push_back(
              {point, by_projector, number, *at + Vector2d(scatter(*rng), scatter(*rng)), k_match_noise_px});
      };
      for (int k = 0; k < static_cast<int>(rig.projectors.size()); ++k)
        look(rig.projectors[static_cast<size_t>(k)], true, k);
      for (int k = 0; k < static_cast<int>(rig.cameras.size()); ++k)
        if (k != c) look(rig.cameras[static_cast<size_t>(k)], false, k);
    }
  }
  return seen;
}

std::vector<Pose> places(int count, Rng* rng) {
  const Board board = Board::parse("charuco:7x5:50mm").value();
  std::vector<Pose> all;
  for (int pose = 0; pose < count; ++pose) all.push_back(board_place(board, pose, rng));
  return all;
}

// The rig as solved from six noisy poses.
Rig calibrated(const Rig& truth, Rng* rng) { return solve(seen_by(truth, places(6, rng), rng)).value().rig; }

// Rotates the device in place about a random axis by `degrees`, and moves it by `mm`.
void nudge(Imager* device, double degrees, double mm, Rng* rng) {
  std::normal_distribution<double> scatter(0, 1);
  const auto direction = [&] { return Vector3d(scatter(*rng), scatter(*rng), scatter(*rng)).normalized(); };
  const Pose moved(exp_rotation(degrees * std::numbers::pi / 180 * direction()), 1e-3 * mm * direction());
  device->imager_from_world = moved * device->imager_from_world;
}

Imager& device_of(Rig* rig, size_t device) {
  return device < rig->cameras.size() ? rig->cameras[device] : rig->projectors[device - rig->cameras.size()];
}

// RMS distance on a panel of 0.6 x 0.4 m between where light of `rig` is meant to land and where the true
// projectors send it. The panel's pose is the one that camera 0 of `rig` measures.
double registration_mm(const Rig& rig, const Rig& truth) {
  Rng rng(3);
  const Pose panel(exp_rotation({0.3, 0.2, 0}), {-0.3, -0.15, 1.05});
  const Imager &camera = rig.cameras[0], &true_camera = truth.cameras[0];
  std::vector<Vector3d> points;
  for (int i = 0; i < 12; ++i)
    for (int k = 0; k < 8; ++k) points.emplace_back(0.6 * (i + 0.5) / 12, 0.4 * (k + 0.5) / 8, 0);
  // Gauss-Newton from the true pose in the camera's world: small angles.
  Pose found = camera.imager_from_world.inverse() * true_camera.imager_from_world * panel;
  for (int round = 0; round < 8; ++round) {
    Matrix6d normal = Matrix6d::Zero();
    Vector6d right = Vector6d::Zero();
    for (const Vector3d& p : points) {
      Derivatives by;
      Vector2d px;
      EXPECT_TRUE(predict_corner(view(camera), found, {1, 1}, Vector2d::Zero(), p.head<2>(), &px, &by));
      normal += by.board_pose.transpose() * by.board_pose;
      right += by.board_pose.transpose() * (px - *true_camera.project(panel * p));
    }
    found = boxplus(found, -normal.ldlt().solve(right));
  }
  double squares = 0;
  int count = 0;
  for (size_t k = 0; k < rig.projectors.size(); ++k) {
    const Imager& light = truth.projectors[k];
    for (const Vector3d& p : points) {
      const auto ray = light.ray(*rig.projectors[k].project(found * p));
      const Vector3d n = panel.rotation * Vector3d::UnitZ();
      const double distance = n.dot(panel.translation - ray->p_origin) / n.dot(ray->d);
      squares += (ray->p_origin + distance * ray->d - panel * p).squaredNorm();
      ++count;
    }
  }
  return 1e3 * std::sqrt(squares / count);
}

constexpr int k_seeds = 50;

TEST(Recheck, NeverFlagsASoundRigInFiftySeeds) {
  Rng rng = test_rng();
  const Rig truth = true_rig(1, 2);
  for (int seed = 0; seed < k_seeds; ++seed) {
    const Rig rig = calibrated(truth, &rng);
    const auto checked = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
    ASSERT_TRUE(checked) << checked.message();
    EXPECT_EQ(checked->verdict, RigVerdict::sound) << seed;
    EXPECT_TRUE(checked->candidates.empty()) << seed;
  }
}

// A sheet that is 0.6 % wider than its text says, and twisted.
TEST(Recheck, AnUnevenPrintThatTheRigKnowsIsNoMove) {
  Rng rng = test_rng();
  const Rig rig = true_rig(1, 1);
  Observations seen = seen_by(rig, {}, &rng);
  const Board& board = seen.board;
  Eigen::VectorXd print = Eigen::VectorXd::Zero(k_print_modes);
  print[0] = 0.003 * board.width_m();
  const BoardShape shape{board.width_m(), board.height_m(), 0.002};
  const Vector2d flat = Vector2d::Zero();
  std::normal_distribution<double> scatter(0, k_corner_noise_px);
  for (int pose = 0; pose < 3; ++pose) {
    const Pose place = board_place(board, pose, &rng);
    seen.poses.push_back("pose" + std::to_string(pose));
    const ImagerView camera = view(rig.cameras[0]), projector = view(rig.projectors[0]);
    for (int id = 0; id < board.corner_count(); ++id) {
      Vector2d px, lit;
      ASSERT_TRUE(predict_corner(camera, place, shape, flat, printed_corner(board, print, id), &px));
      ASSERT_TRUE(predict_match(camera, projector, place, shape, flat, px, &lit));
      seen.corners.push_back({0, pose, id, px + Vector2d(scatter(rng), scatter(rng)), k_corner_noise_px});
      seen.matches.push_back(
          {0, 0, pose, px, lit + Vector2d(scatter(rng), scatter(rng)), k_corner_noise_px, 100});
    }
  }
  const auto known = check_rig(rig, seen, {.twist_m = 0.002, .print = print});
  ASSERT_TRUE(known.ok()) << known.message();
  EXPECT_EQ(known->verdict, RigVerdict::sound);
  EXPECT_LT(known->devices[1].before_px, 0.15);
  const auto unknown = check_rig(rig, seen);
  ASSERT_TRUE(unknown.ok()) << unknown.message();
  EXPECT_GT(unknown->devices[1].before_px, 2 * known->devices[1].before_px);
}

TEST(Recheck, NamesTheDeviceThatWasTurnedByAFifthOfADegreeAndPutsItBack) {
  Rng rng = test_rng();
  Rig rig;
  double worst_mm = 0, error_deg = 0;
  for (int seed = 0; seed < k_seeds; ++seed) {
    Rig truth = true_rig(1, 2);
    if (seed % 5 == 0) rig = calibrated(truth, &rng);
    const size_t device = static_cast<size_t>(seed) % 3;
    nudge(&device_of(&truth, device), 0.2, 0.5, &rng);
    const auto checked = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
    ASSERT_TRUE(checked) << checked.message();
    ASSERT_EQ(checked->verdict, RigVerdict::moved) << seed;
    const Move& move = checked->candidates.front();
    EXPECT_EQ(move.device, device_of(&truth, device).name);
    EXPECT_NEAR(move.degrees, 0.2, 4 * move.degrees_stddev) << seed;
    error_deg = std::max(error_deg, std::abs(move.degrees - 0.2));
    EXPECT_EQ(device_of(&rig, device).lens.values, checked->rig.find(move.device)->lens.values);
    worst_mm = std::max(worst_mm, registration_mm(checked->rig, truth));
  }
  EXPECT_LT(worst_mm, 1);
  EXPECT_LT(error_deg, 0.05);
  RecordProperty("worst_mm_after_repair", std::to_string(worst_mm));
  RecordProperty("worst_error_of_turn_deg", std::to_string(error_deg));
}

TEST(Recheck, ASceneWithoutABoardTellsWhichDeviceMovedAndPutsItBack) {
  Rng rng = test_rng();
  double worst_mm = 0;
  for (const auto& [cameras, projectors] : {std::pair<size_t, size_t>{1, 2}, {2, 1}, {2, 2}}) {
    const Rig rig = calibrated(true_rig(cameras, projectors), &rng);
    const auto still = check_rig(rig, scene_seen_by(true_rig(cameras, projectors), &rng), {.rig_px = 0.08});
    ASSERT_TRUE(still) << still.message();
    EXPECT_EQ(still->verdict, RigVerdict::sound);
    for (size_t device = 0; device < cameras + projectors; ++device)
      for (const double degrees : {0.2, 2.0}) {
        Rig truth = true_rig(cameras, projectors);
        nudge(&device_of(&truth, device), degrees, 5 * degrees, &rng);
        const auto checked = check_rig(rig, scene_seen_by(truth, &rng), {.rig_px = 0.08});
        ASSERT_TRUE(checked) << checked.message();
        ASSERT_EQ(checked->verdict, RigVerdict::moved) << cameras << " cameras, device " << device;
        EXPECT_EQ(checked->candidates[0].device, device_of(&truth, device).name);
        EXPECT_NEAR(checked->candidates[0].degrees, degrees, 4 * checked->candidates[0].degrees_stddev);
        worst_mm = std::max(worst_mm, registration_mm(checked->rig, truth));
      }
  }
  std::printf("after repair by a scene: %.2f mm at worst\n", worst_mm);
  EXPECT_LT(worst_mm, 1);
}

TEST(Recheck, ASceneThatTwoDevicesShareTellsNoScale) {
  Rng rng = test_rng();
  const auto checked = check_rig(true_rig(1, 1), scene_seen_by(true_rig(1, 1), &rng));
  ASSERT_FALSE(checked);
  EXPECT_NE(checked.message().find("three of the rig's devices share"), std::string::npos);
}

TEST(Recheck, TellsWhichOfTwoCamerasWasPushed) {
  Rng rng = test_rng();
  const Rig rig = calibrated(true_rig(2, 1), &rng);
  for (const size_t device : {0u, 1u, 2u}) {
    Rig truth = true_rig(2, 1);
    nudge(&device_of(&truth, device), 3, 30, &rng);  // a large move
    const auto checked = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
    ASSERT_TRUE(checked) << checked.message();
    ASSERT_EQ(checked->verdict, RigVerdict::moved) << device;
    EXPECT_EQ(checked->candidates[0].device, device_of(&truth, device).name);
    EXPECT_NEAR(checked->candidates[0].degrees, 3, 0.05);
    EXPECT_LT(registration_mm(checked->rig, truth), 1);
  }
}

TEST(Recheck, CannotTellOneCameraFromOneProjectorAndSaysSo) {
  Rng rng = test_rng();
  const Rig rig = calibrated(true_rig(1, 1), &rng);
  for (const size_t device : {0u, 1u}) {
    Rig truth = true_rig(1, 1);
    nudge(&device_of(&truth, device), 0.2, 0.5, &rng);
    const auto checked = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
    ASSERT_TRUE(checked) << checked.message();
    ASSERT_EQ(checked->verdict, RigVerdict::undecided);
    ASSERT_EQ(checked->candidates.size(), 2u);
    EXPECT_EQ(checked->candidates[0].device, "projector0");  // the device that is corrected
    EXPECT_EQ(checked->candidates[1].device, "camera0");
    EXPECT_LT(registration_mm(checked->rig, truth), 1);
  }
}

TEST(Recheck, ABoardThatStoodStillTellsOneCameraFromOneProjector) {
  Rng rng = test_rng();
  const Rig rig = calibrated(true_rig(1, 1), &rng);
  const std::vector<Pose> board = places(1, &rng);
  const auto before = check_rig(rig, seen_by(true_rig(1, 1), board, &rng), {.rig_px = 0.08});
  ASSERT_TRUE(before) << before.message();
  ASSERT_EQ(before->verdict, RigVerdict::sound);
  RigCheckOptions options{.rig_px = 0.08};
  options.still_boards = before->world_from_board;
  for (const size_t device : {0u, 1u}) {
    Rig truth = true_rig(1, 1);
    nudge(&device_of(&truth, device), 0.2, 0.5, &rng);
    const auto checked = check_rig(rig, seen_by(truth, board, &rng), options);
    ASSERT_TRUE(checked) << checked.message();
    ASSERT_EQ(checked->verdict, RigVerdict::moved) << device;
    EXPECT_EQ(checked->candidates[0].device, device_of(&truth, device).name);
    EXPECT_FALSE(checked->board_moved);
  }
  const auto touched = check_rig(rig, seen_by(true_rig(1, 1), places(1, &rng), &rng), options);
  ASSERT_TRUE(touched) << touched.message();
  EXPECT_EQ(touched->verdict, RigVerdict::sound);
  EXPECT_TRUE(touched->board_moved);
}

TEST(Recheck, SaysWhenNoSingleMoveExplainsWhatIsSeen) {
  Rng rng = test_rng();
  const Rig rig = calibrated(true_rig(1, 2), &rng);
  Rig truth = true_rig(1, 2);
  nudge(&truth.projectors[0], 0.4, 2, &rng);
  nudge(&truth.projectors[1], 0.4, 2, &rng);
  const auto two = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
  ASSERT_TRUE(two) << two.message();
  EXPECT_EQ(two->verdict, RigVerdict::unexplained);
  EXPECT_TRUE(two->candidates.empty());

  truth = true_rig(1, 2);
  truth.projectors[1].lens.values[0] *= 1.03;  // its zoom was changed
  truth.projectors[1].lens.values[1] *= 1.03;
  const auto zoomed = check_rig(rig, seen_by(truth, places(1, &rng), &rng), {.rig_px = 0.08});
  ASSERT_TRUE(zoomed) << zoomed.message();
  EXPECT_NE(zoomed->verdict, RigVerdict::sound);
}

TEST(Recheck, NamesDevicesThatTheRigDoesNotHave) {
  Rng rng = test_rng();
  const Rig rig = true_rig(1, 1);
  Observations seen = seen_by(rig, places(1, &rng), &rng);
  seen.projectors[0].width = 1024;
  EXPECT_NE(check_rig(rig, seen).message().find("projector0 at 1280x800"), std::string::npos);
  seen.projectors[0].name = "projector7";
  EXPECT_NE(check_rig(rig, seen).message().find("'projector7'"), std::string::npos);
  Observations empty = seen_by(rig, places(1, &rng), &rng);
  empty.corners.clear();
  EXPECT_NE(check_rig(rig, empty).message().find("expected the board"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
