#include "tests/calib/fault_bench.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/capture.h"
#include "calib/code/patterns.h"
#include "core/file.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"

namespace limn::test {
namespace {

// Share of each device's pixels by side: 480 x 384 and 480 x 300 on the bench.
constexpr double k_share = 0.375;

void shrink(Imager* imager) {
  imager->width = static_cast<int>(std::lround(imager->width * k_share));
  imager->height = static_cast<int>(std::lround(imager->height * k_share));
  std::vector<double>& v = imager->lens.values;
  v[0] *= k_share;
  v[1] *= k_share;
  v[2] = (v[2] + 0.5) * k_share - 0.5;
  v[3] = (v[3] + 0.5) * k_share - 0.5;
}

Pose pose_of(const nlohmann::json& json) {
  const std::vector<double> q = json.at("rotation_wxyz"), t = json.at("translation_m");
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), Eigen::Vector3d(t[0], t[1], t[2])};
}

// The board's sheet as a mesh, bent as `place` says.
sim::Object board_sheet(const FaultBench& bench, const Pose& world_from_board) {
  const calib::BoardSheet drawn = calib::draw_board(bench.board, {.square_px = 64});
  const double metres_per_px = 1 / drawn.pixels_per_metre;
  const double width = drawn.image.cols * metres_per_px, height = drawn.image.rows * metres_per_px;
  const Eigen::Vector2d px_centre((drawn.image.cols - 1) / 2.0, (drawn.image.rows - 1) / 2.0);
  const Eigen::Vector2d p_centre = (px_centre - drawn.px_board_origin) * metres_per_px;
  const Pose board_from_sheet(Eigen::Quaterniond::Identity(), {p_centre.x(), p_centre.y(), 0});
  sim::Object object = sim::sheet("board", width, height, drawn.image, world_from_board * board_from_sheet);
  if (!bench.sheet) return object;
  constexpr int k_steps = 40;
  auto mesh = std::make_shared<scene::Mesh>();
  for (int row = 0; row <= k_steps; ++row) {
    for (int column = 0; column <= k_steps; ++column) {
      const double s = static_cast<double>(column) / k_steps, t = static_cast<double>(row) / k_steps;
      const Eigen::Vector3d p = bench.sheet({(s - 0.5) * width, (t - 0.5) * height});
      mesh->positions.push_back(p.cast<float>());
      mesh->normals.emplace_back(0.F, 0.F, -1.F);
      mesh->uvs.emplace_back(static_cast<float>(s), static_cast<float>(1 - t));
    }
  }
  for (std::uint32_t row = 0; row < k_steps; ++row) {
    for (std::uint32_t column = 0; column < k_steps; ++column) {
      const std::uint32_t a = row * (k_steps + 1) + column, b = a + 1, c = a + k_steps + 1, d = c + 1;
      mesh->triangles.push_back({a, d, b});
      mesh->triangles.push_back({a, c, d});
    }
  }
  mesh->triangle_materials.assign(mesh->triangles.size(), 0);
  object.mesh = mesh;
  return object;
}

sim::World with_board(const FaultBench& bench, const Pose& world_from_board) {
  sim::World world = bench.world;
  world.objects.push_back(board_sheet(bench, world_from_board));
  return world;
}

// One pose's light paths; a second set after a move.
struct Traced {
  std::vector<sim::Samples> before, after;  // for each camera
};

std::vector<sim::Samples> traced(const sim::World& world) {
  std::vector<sim::Samples> samples;
  for (size_t i = 0; i < world.rig.cameras.size(); ++i)
    samples.push_back(sim::trace(world, static_cast<int>(i)));
  return samples;
}

Traced trace_pose(const FaultBench& bench, int pose) {
  const Pose& at = bench.world_from_board[static_cast<size_t>(pose)];
  Traced result;
  result.before = traced(with_board(bench, at));
  if (!bench.nudge || bench.nudge->pose != pose) return result;
  FaultBench moved = bench;
  if (bench.nudge->camera) {
    Pose& camera = moved.world.rig.cameras[0].imager_from_world;
    camera = camera * bench.nudge->world_moved.inverse();
    result.after = traced(with_board(moved, at));
  } else {
    result.after = traced(with_board(moved, bench.nudge->world_moved * at));
  }
  return result;
}

// The image on every projector's panel while `projector` should show `image`.
std::vector<cv::Mat> panels(const FaultBench& bench, int projector, const cv::Mat& image) {
  std::vector<cv::Mat> shown(bench.world.rig.projectors.size());
  const int display = bench.display_of ? bench.display_of(projector) : projector;
  if (display < 0) return shown;
  cv::Mat& panel = shown[static_cast<size_t>(display)];
  panel = bench.on_panel ? bench.on_panel(image) : image;
  const Imager& imager = bench.world.rig.projectors[static_cast<size_t>(display)];
  if (panel.cols != imager.width || panel.rows != imager.height)
    cv::resize(panel, panel, {imager.width, imager.height}, 0, 0, cv::INTER_LINEAR);
  return shown;
}

}  // namespace

FaultBench FaultBench::create(const std::string& name, int poses) {
  const std::filesystem::path config = std::filesystem::path(LIMN_SOURCE_DIR) / "config";
  FaultBench bench;
  bench.world = sim::load_world(config / "worlds" / (name + ".json"), [](const MarkerName&) {
                  return Result<MarkerDrawing>(MarkerDrawing{cv::Mat(8, 8, CV_8U, cv::Scalar(0))});
                }).value();
  for (Imager& camera : bench.world.rig.cameras) shrink(&camera);
  for (Imager& projector : bench.world.rig.projectors) shrink(&projector);
  for (sim::CameraEffects& effects : bench.world.camera_effects) effects.colour = false;
  for (sim::Lamp& lamp : bench.world.room.lamps) lamp.radius_m = 0;  // soft shadows cost half of the tracing
  std::erase_if(bench.world.objects,
                [](const sim::Object& o) { return o.prototype_from_object.has_value(); });
  std::ifstream file(config / "plans" / (name + ".json"));
  const nlohmann::json plan = nlohmann::json::parse(file, nullptr, true, true);
  const calib::Board planned = calib::Board::parse(plan.at("board")).value();
  // As wide as the planned board: squares of about 20 camera pixels; every second one is only paper.
  bench.board =
      calib::Board::parse(fmt::format("chessboard:8x5:{}mm", std::lround(planned.width_m() * 1000 / 9)))
          .value();
  const Pose centred(Eigen::Quaterniond::Identity(),
                     Eigen::Vector3d(planned.width_m() - bench.board.width_m(),
                                     planned.height_m() - bench.board.height_m(), 0) /
                         2);
  for (const auto& pose : plan.at("world_from_board"))
    bench.world_from_board.push_back(pose_of(pose) * centred);
  bench.world_from_board.resize(std::min<size_t>(bench.world_from_board.size(), static_cast<size_t>(poses)));
  return bench;
}

Result<calib::CaptureSet> FaultBench::capture(const std::filesystem::path& folder) const {
  std::vector<calib::CapturedDevice> cameras, projectors;
  for (const Imager& i : world.rig.cameras) cameras.push_back({i.name, i.width, i.height});
  for (const Imager& i : world.rig.projectors)
    projectors.push_back({i.name, mode ? mode->width : i.width, mode ? mode->height : i.height});
  const calib::CaptureSet plan = calib::plan_captures(folder, cameras, projectors, board, code, code_options);
  LIMN_TRY_STATUS(calib::begin_captures(plan));
  std::uint64_t frame = seed * 1000003;
  for (int pose = 0; pose < static_cast<int>(world_from_board.size()); ++pose) {
    const Traced traced = trace_pose(*this, pose);
    std::vector<cv::Mat> shown;
    int shot = -1, of_projector = -1;
    sim::World now = world;
    const calib::CaptureBackend backend{
        .show = [&](int projector, const cv::Mat& image) -> Status {
          shot = projector == of_projector ? shot + 1 : 0;
          of_projector = projector;
          shown = panels(*this, projector, image);
          if (before_shot) before_shot(pose, shot, &now);
          return {};
        },
        .grab = [&](int camera) -> Result<cv::Mat> {
          const bool moved = !traced.after.empty() && shot >= nudge->shot;
          const sim::Samples& samples = (moved ? traced.after : traced.before)[static_cast<size_t>(camera)];
          const cv::Mat photo = sim::photograph(now, samples, shown, ++frame);
          return on_photo ? on_photo(photo) : photo;
        },
    };
    LIMN_TRY_STATUS(calib::capture_pose(plan, pose, backend));
  }
  return calib::load_captures(folder);
}

}  // namespace limn::test
