#include "apps/compensation_options.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/photometric_response.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using projector::Compensation;
using projector::MeasuredSurface;

// The surface as the first camera that measured it under every projector saw it.
Result<MeasuredSurface> load_surface(const fs::path& response_json,
                                     const Rig& rig,
                                     const Pose& world_from_prototype) {
  std::string missing;
  for (const Imager& camera : rig.cameras) {
    MeasuredSurface surface{camera, world_from_prototype, {}};
    for (const Imager& projector : rig.projectors) {
      auto mixing = load_mixing(response_json, projector.name, camera.name);
      if (!mixing) {
        missing = mixing.message();
        break;
      }
      surface.mixings.push_back(std::move(mixing).value());
    }
    if (surface.mixings.size() == rig.projectors.size()) return surface;
  }
  return error(
      "{} (No camera measured the surface under all projectors: limn patterns --response writes the images "
      "to show, limn solve reads their photographs.)",
      missing.empty() ? "--compensation measured: expected a camera in the rig, found none." : missing);
}

}  // namespace

Status set_light(const LightArguments& arguments,
                 const fs::path& rig_path,
                 const Rig& rig,
                 const scene::Scene& scene,
                 const scene::PosedScene& posed,
                 projector::Renderer* renderer) {
  if (arguments.level && !(*arguments.level > 0 && std::isfinite(*arguments.level))) {
    return usage_error("--level: expected an irradiance over 0, such as 0.5, found {}.", *arguments.level);
  }
  const projector::LightOptions options{arguments.compensation, arguments.even_black, arguments.level};
  if (arguments.compensation != Compensation::measured) return renderer->set_light(options);
  std::optional<Pose> measured_at = posed.world_from_prototype;
  if (!arguments.measured_at.empty()) {
    LIMN_TRY(const scene::PosedScene then, scene::load_poses(arguments.measured_at, scene));
    measured_at = then.world_from_prototype;
  }
  if (!scene.prototype || !measured_at) {
    return error(
        "--compensation measured: expected the prototype's pose when it was measured, found none. Give "
        "--measured-at POSES.json with world_from_prototype.");
  }
  const fs::path folder = fs::is_directory(rig_path) ? rig_path : rig_path.parent_path();
  LIMN_TRY(const MeasuredSurface surface, load_surface(folder / "response.json", rig, *measured_at));
  return renderer->set_light(options, &surface);
}

nlohmann::ordered_json light_report(const LightArguments& arguments,
                                    const Rig& rig,
                                    const projector::Renderer& renderer) {
  nlohmann::ordered_json json = {{"compensation", k_compensations.text(arguments.compensation)},
                                 {"black", k_blacks.text(arguments.even_black)},
                                 {"projectors", nlohmann::ordered_json::array()}};
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    const cv::Mat clipped = renderer.clipped(i);
    const auto share = [&](int value) {
      return static_cast<double>(cv::countNonZero(clipped == value)) / static_cast<double>(clipped.total());
    };
    json["projectors"].push_back({{"name", rig.projectors[i].name},
                                  {"too_bright_wanted", share(255)},
                                  {"too_dark_wanted", share(128)}});
  }
  double sum = 0, most = 0;
  for (const ProjectorResponse& response : rig.responses) {
    if (!response.black_level) continue;
    sum += response.black_level->value;
    most = std::max(most, response.black_level->value);
  }
  if (arguments.even_black && most > 0) {
    json["contrast"] = 1 / sum;
    json["contrast_as_is"] = 1 / most;
  }
  return json;
}

}  // namespace limn::apps
