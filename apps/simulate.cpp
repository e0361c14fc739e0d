#include "apps/simulate.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/names.h"
#include "core/print.h"
#include "core/rig.h"
#include "sim/sensor_model.h"
#include "sim/truth.h"
#include "sim/world.h"
#include "tracker/marker_image.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// The images to project, one for each projector; projectors that are not named stay black.
Result<std::vector<cv::Mat>> shown_images(const std::vector<std::string>& show, const Rig& rig) {
  std::vector<cv::Mat> shown(rig.projectors.size());
  for (const std::string& text : show) {
    const std::size_t equals = text.find('=');
    const std::string name = text.substr(0, equals);
    const Imager* projector = find_named(rig.projectors, name);
    if (equals == std::string::npos || !projector)
      return usage_error(
          "--show: expected PROJECTOR=IMAGE with a projector of the world, found '{}'. Try --show "
          "projector0=image.png.",
          text);
    LIMN_TRY(const cv::Mat image, read_image(text.substr(equals + 1)));
    if (image.cols != projector->width || image.rows != projector->height)
      return error("{}: expected {}x{}, the size of {}, found {}x{}. Draw it at the projector's size.",
                   text.substr(equals + 1), projector->width, projector->height, name, image.cols,
                   image.rows);
    shown[static_cast<std::size_t>(projector - rig.projectors.data())] = image;
  }
  return shown;
}

Result<std::vector<std::string>> chosen_variants(const std::string& text, const sim::World& world) {
  if (!world.scene) return std::vector<std::string>{};
  std::vector<std::string> variants(world.scene->slots.size());
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string item = text.substr(begin, end - begin);
    const std::size_t equals = item.find('=');
    const scene::Slot* slot = world.scene->find_slot(item.substr(0, equals));
    const bool known =
        slot != nullptr && equals != std::string::npos && find_named(slot->variants, item.substr(equals + 1));
    if (!known)
      return usage_error(
          "--variants: expected SLOT=VARIANT of the world's scene, found '{}'. scene.json lists them.", item);
    variants[static_cast<std::size_t>(slot - world.scene->slots.data())] = item.substr(equals + 1);
    begin = end + 1;
  }
  return variants;
}

ordered_json pose_json(const Pose& pose) { return ordered_json(to_json(pose)); }

// The outer corners of the black square in pixels of each camera, and whether the camera sees them all.
ordered_json marker_json(const sim::World& world, const sim::Truth& truth, const sim::PlacedMarker& marker) {
  const Pose world_from_marker = *sim::world_from_marker(world, marker.marker);
  ordered_json json = {{"name", marker.marker.text()},
                       {"size_mm", marker.size_m * 1e3},
                       {"world_from_marker", pose_json(world_from_marker)}};
  if (is_constellation(marker.marker)) return json;
  const double h = marker.size_m / 2;
  for (const Imager& camera : world.rig.cameras) {
    ordered_json corners = ordered_json::array();
    bool visible = true;
    for (const auto& [x, y] : {std::pair{-h, -h}, {h, -h}, {h, h}, {-h, h}}) {
      const Eigen::Vector3d p_world = world_from_marker * Eigen::Vector3d(x, y, 0);
      const auto px = camera.project(p_world);
      const Eigen::Vector3d d_in = world_from_marker.rotation * Eigen::Vector3d::UnitZ();
      const bool faces = d_in.dot(p_world - camera.imager_from_world.inverse().translation) > 0;
      visible = visible && faces && truth.visible(camera, p_world);
      corners.push_back(px ? ordered_json{px->x(), px->y()} : ordered_json());
    }
    json["cameras"][camera.name] = {{"corners_px", corners}, {"visible", visible}};
  }
  return json;
}

Status write_truth(const sim::World& world, const scene::PosedScene& parts, const fs::path& out) {
  const sim::Truth truth(world, parts);
  ordered_json json = {{"schema", "limn.truth/1"}, {"rig", "rig"}};
  if (world.scene && world.scene->prototype)
    json["world_from_prototype"] = pose_json(world.world_from_prototype);
  json["slots"] = ordered_json::object();
  for (const scene::PosedPart& part : parts.parts)
    json["slots"][part.slot] = {{"world_from_part", pose_json(part.world_from_part)},
                                {"variant", part.variant}};
  json["markers"] = ordered_json::array();
  for (const sim::PlacedMarker& marker : world.markers)
    json["markers"].push_back(marker_json(world, truth, marker));
  LIMN_TRY_STATUS(save_rig(world.rig, out / "rig"));
  return write_file(out / "truth.json", json_text(json, 2) + "\n");
}

// What one camera sees. It numbers the photographs so that each has its own noise.
struct Shooting {
  std::string camera;
  sim::Samples samples;
  std::uint64_t shots = 0;
};

Shooting traced(const sim::World& world, int camera) {
  const auto begin = std::chrono::steady_clock::now();
  Shooting shooting{world.rig.cameras[static_cast<std::size_t>(camera)].name, sim::trace(world, camera)};
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  log_info("{}: {} samples traced in {:.2f} s", shooting.camera, shooting.samples.size(), seconds);
  return shooting;
}

Status shoot(Shooting& shooting,
             const sim::World& world,
             const std::vector<cv::Mat>& shown,
             const fs::path& out,
             const std::string& what) {
  const fs::path file = out / (shooting.camera + "-" + what + ".png");
  const auto begin = std::chrono::steady_clock::now();
  const cv::Mat image = sim::photograph(world, shooting.samples, shown, world.seed + ++shooting.shots);
  const double shot_ms =
      1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  LIMN_TRY_STATUS(write_png(file, image));
  print_out("{}  {}x{}, photographed in {:.0f} ms\n", file.string(), image.cols, image.rows, shot_ms);
  return {};
}

Status shoot_camera(const sim::World& world,
                    const scene::PosedScene& parts,
                    int camera,
                    const SimulateOptions& options,
                    const std::vector<cv::Mat>& shown) {
  std::vector<cv::Mat> white;
  for (const Imager& projector : world.rig.projectors)
    white.emplace_back(projector.height, projector.width, CV_8U, cv::Scalar(255));
  sim::World dark = world;  // all projectors off, without their black light
  for (sim::ProjectorEffects& effects : dark.projector_effects) effects.black_level = 0;
  Shooting shooting = traced(world, camera);
  LIMN_TRY_STATUS(shoot(shooting, dark, {}, options.out, "ambient"));
  LIMN_TRY_STATUS(shoot(shooting, world, white, options.out, "white"));
  if (!options.show.empty()) LIMN_TRY_STATUS(shoot(shooting, world, shown, options.out, "shown"));
  if (parts.parts.empty()) return {};
  const sim::World still_life = sim::with_parts(world, parts);
  Shooting with_parts = traced(still_life, camera);
  return shoot(with_parts, still_life, white, options.out, "still-life");
}

}  // namespace

Status run_simulate(const SimulateOptions& options) {
  LIMN_TRY(sim::World world, sim::load_world(options.world, tracker::marker_image));
  LIMN_TRY(const std::vector<cv::Mat> shown, shown_images(options.show, world.rig));
  LIMN_TRY(const std::vector<std::string> variants, chosen_variants(options.variants, world));
  LIMN_TRY_STATUS(make_folder(options.out));
  const scene::PosedScene parts = sim::true_poses(world, variants);
  LIMN_TRY_STATUS(write_truth(world, parts, options.out));
  if (options.srgb) {
    for (sim::CameraEffects& effects : world.camera_effects) effects.srgb = true;
  }
  for (std::size_t i = 0; i < world.rig.cameras.size(); ++i)
    LIMN_TRY_STATUS(shoot_camera(world, parts, static_cast<int>(i), options, shown));
  return {};
}

}  // namespace limn::apps
