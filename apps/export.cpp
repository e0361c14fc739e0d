#include "apps/export.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "apps/exchange/exr.h"
#include "apps/exchange/mpcdi_writer.h"
#include "apps/exchange/pfm.h"
#include "core/file.h"
#include "core/log.h"
#include "core/picture.h"
#include "core/rig.h"
#include "device/gl_context.h"
#include "projector/renderer.h"
#include "scene/posed.h"
#include "scene/scene.h"

namespace limn::apps {
namespace {

using nlohmann::ordered_json;

// What one projector lights and how it is to be blended.
struct Maps {
  cv::Mat points;  // Renderer::surface_points
  cv::Mat blend;   // Renderer::blend
  int lit = 0, shared = 0;
  double most_lift = 0;
};

Maps maps_of(projector::Renderer* renderer, std::size_t index, const scene::PosedScene& posed) {
  Maps maps{renderer->surface_points(index, posed), renderer->blend(index, posed)};
  for (int row = 0; row < maps.points.rows; ++row) {
    for (int column = 0; column < maps.points.cols; ++column) {
      const auto& [share, lift] = maps.blend.at<cv::Vec2f>(row, column).val;
      maps.lit += std::isfinite(maps.points.at<cv::Vec3f>(row, column)[0]);
      maps.shared += share > 0 && share < 1;
      maps.most_lift = std::max<double>(maps.most_lift, lift);
    }
  }
  return maps;
}

cv::Mat as_levels(const cv::Mat& values, int bits) {
  cv::Mat levels;
  values.convertTo(levels, bits == 16 ? CV_16U : CV_8U, bits == 16 ? 65535 : 255);
  return levels;
}

MpcdiBlendMap alpha_map(const cv::Mat& blend, double gamma, int bits) {
  cv::Mat share;
  cv::extractChannel(blend, share, 0);
  cv::pow(share, 1 / gamma, share);
  return {as_levels(share, bits), gamma};
}

// The display values that give the lift, BGR: what must at least be shown so that black is even.
MpcdiBlendMap beta_map(const cv::Mat& blend, const Response* response, int bits) {
  const double black = response && response->black_level ? response->black_level->value : 0;
  cv::Mat values(blend.size(), CV_32FC3, cv::Scalar::all(0));
  for (int row = 0; row < blend.rows; ++row) {
    for (int column = 0; column < blend.cols; ++column) {
      const double lift = static_cast<double>(blend.at<cv::Vec2f>(row, column)[1]);
      if (!(lift > 0)) continue;
      auto& value = values.at<cv::Vec3f>(row, column);
      const double light = black + (1 - black) * lift;
      for (int c = 0; c < 3; ++c) {
        const auto& table = c == 0 ? response->blue : c == 1 ? response->green : response->red;
        value[c] = static_cast<float>(inverse_looked_up(table, light));
      }
    }
  }
  return {as_levels(values, bits), 1};
}

// CV_32FC3: the place (x right, y down, 0 … 1) of each point in the viewer's picture; NaN outside.
cv::Mat places_for(const Imager& viewer, const Pose& viewer_from_prototype, const cv::Mat& points) {
  cv::Mat places(points.size(), CV_32FC3, cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  for (int row = 0; row < points.rows; ++row) {
    for (int column = 0; column < points.cols; ++column) {
      const auto& p = points.at<cv::Vec3f>(row, column);
      if (!std::isfinite(p[0])) continue;
      const auto px = viewer.lens.project(viewer_from_prototype * Eigen::Vector3d(p[0], p[1], p[2]));
      if (!px || !viewer.contains(*px)) continue;
      places.at<cv::Vec3f>(row, column) = {static_cast<float>((px->x() + 0.5) / viewer.width),
                                           static_cast<float>((px->y() + 0.5) / viewer.height), 0.0f};
    }
  }
  return places;
}

const Response* find_response(const Rig& rig, const std::string& projector) {
  for (const Response& response : rig.responses)
    if (response.projector == projector) return &response;
  return nullptr;
}

// All that is exported, and how it stands to each other.
struct Session {
  Rig rig;
  scene::Scene scene;
  scene::PosedScene posed;
  std::optional<Imager> viewer;
};

Mpcdi mpcdi_of(const Session& session, const std::vector<Maps>& maps, const ExportOptions& options) {
  const Pose& world_from_prototype = *session.posed.world_from_prototype;
  Mpcdi out;
  out.profile = options.profile;
  out.date = fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(std::time(nullptr)));
  out.made_by = "limn";
  bool has_lift = false;
  for (const Maps& map : maps) has_lift |= map.most_lift > 0;
  out.colour_level = has_lift ? 2 : 1;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    Imager projector = session.rig.projectors[i];
    projector.imager_from_world =
        projector.imager_from_world * world_from_prototype;  // the world of the file
    MpcdiRegion region;
    region.id = projector.name;
    region.buffer = "prototype";
    region.width = projector.width;
    region.height = projector.height;
    region.warp = maps[i].points;
    region.alpha = alpha_map(maps[i].blend, options.gamma, options.bits);
    if (has_lift) {
      cv::cvtColor(region.alpha->picture, region.alpha->picture,
                   cv::COLOR_GRAY2BGR);  // as colour level 2 asks
      region.beta = beta_map(maps[i].blend, find_response(session.rig, projector.name), options.bits);
    }
    if (options.profile == "sl") {
      place_frustum(projector, MpcdiFrame(), &region);
      region.distortion = places_in_frustum(*region.frustum, projector);
      region.lens = projector.lens;
    } else if (options.profile == "3d") {
      const Pose viewer_from_prototype = session.viewer->imager_from_world * world_from_prototype;
      region.warp = places_for(*session.viewer, viewer_from_prototype, maps[i].points);
      Imager viewer = *session.viewer;
      viewer.imager_from_world = Pose();  // the eye is the origin, its line of sight is forward
      MpcdiFrame own;
      own.d_down = Eigen::Vector3d::UnitY();
      own.d_forward = Eigen::Vector3d::UnitZ();
      place_frustum(viewer, own, &region);
      region.frame.reset();
    }
    out.regions.push_back(std::move(region));
  }
  return out;
}

Status write_warps(const Session& session, const std::vector<Maps>& maps, const ExportOptions& options) {
  LIMN_TRY_STATUS(make_folder(options.warp));
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const std::string name = fmt::format("warp-{}.{}", session.rig.projectors[i].name, options.format);
    const std::string bytes =
        options.format == "pfm"
            ? pfm_bytes(maps[i].points)
            : exr_bytes(maps[i].points,
                        "R, G, B: x, y, z (m) of the prototype's point that the pixel lights; NaN: none");
    LIMN_TRY_STATUS(write_file(options.warp / name, bytes));
  }
  return {};
}

// Every placed slot's variants, one at a time, as the viewer sees them over black.
Status write_looks(const Session& session, const ExportOptions& options) {
  LIMN_TRY_STATUS(make_folder(options.looks));
  Rig rig;
  rig.cameras = {*session.viewer};
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(session.scene, rig));
  const cv::Mat black = cv::Mat::zeros(session.viewer->height, session.viewer->width, CV_8UC3);
  for (const scene::PosedPart& part : session.posed.parts) {
    const scene::Slot* slot = session.scene.find_slot(part.slot);
    for (const scene::Variant& variant : slot->variants) {
      scene::PosedScene alone{session.posed.world_from_prototype, {part}};
      alone.parts[0].variant = variant.name;
      const auto file = options.looks / fmt::format("look-{}-{}.png", part.slot, variant.name);
      LIMN_TRY_STATUS(write_png(file, renderer.composite(0, black, alone, projector::Composite::full)));
    }
  }
  return {};
}

Status check(const ExportOptions& options) {
  if (options.mpcdi.empty() && options.warp.empty() && options.looks.empty())
    return usage_error("expected --mpcdi FILE, --warp DIR or --looks DIR, found none of them.");
  if (options.profile != "sl" && options.profile != "a3" && options.profile != "3d")
    return usage_error("--profile: expected sl, a3 or 3d, found '{}'.", options.profile);
  if (options.format != "pfm" && options.format != "exr")
    return usage_error("--format: expected pfm or exr, found '{}'.", options.format);
  if (options.bits != 8 && options.bits != 16)
    return usage_error("--bits: expected 8 or 16, found {}.", options.bits);
  if (!(options.gamma >= 1 && options.gamma <= 4))
    return usage_error("--gamma: expected 1 (linear) … 4, found {}.", options.gamma);
  return {};
}

Result<Session> load(const ExportOptions& options) {
  Session session;
  LIMN_TRY(session.rig, load_rig(options.rig));
  LIMN_TRY(session.scene, scene::load_scene(options.scene));
  LIMN_TRY(session.posed, scene::load_poses(options.poses, session.scene));
  if (session.rig.projectors.empty())
    return error("{}: expected a rig with projectors, found none.", options.rig.string());
  if (!session.scene.prototype)
    return error("{}: expected a scene with a prototype, found none.", options.scene.string());
  if (!session.posed.world_from_prototype)
    return error("{}: world_from_prototype: expected where the prototype stands, found nothing.",
                 options.poses.string());
  if (!options.viewer.empty()) {
    LIMN_TRY(session.viewer, scene::load_viewer(options.viewer));
  } else if (session.scene.viewers.size() == 1) {
    session.viewer = session.scene.viewers[0].fixed;
  }
  if (!session.viewer && (options.profile == "3d" || !options.looks.empty()))
    return usage_error(
        "--viewer: expected a viewer file for --profile 3d and --looks, since the scene has none.");
  if (session.posed.parts.empty() && !options.looks.empty())
    return error("{}: slots: expected the place of a part for --looks, found none.", options.poses.string());
  return session;
}

ordered_json report_of(const Session& session, const std::vector<Maps>& maps) {
  ordered_json json;
  json["schema"] = "limn.export/1";
  json["projectors"] = ordered_json::array();
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const auto pixels = static_cast<double>(maps[i].points.total());
    json["projectors"].push_back({{"name", session.rig.projectors[i].name},
                                  {"size", {maps[i].points.cols, maps[i].points.rows}},
                                  {"lit_share", maps[i].lit / pixels},
                                  {"shared_share", maps[i].shared / pixels},
                                  {"most_black_lift", maps[i].most_lift}});
  }
  return json;
}

void print(const ordered_json& report) {
  for (const auto& projector : report["projectors"]) {
    fmt::print("{}: {}x{}, {:.1f} % of the pixels light the prototype, {:.1f} % share their light{}\n",
               projector["name"].get<std::string>(), projector["size"][0].get<int>(),
               projector["size"][1].get<int>(), 100 * projector["lit_share"].get<double>(),
               100 * projector["shared_share"].get<double>(),
               projector["most_black_lift"] > 0 ? fmt::format(", black is lifted by up to {:.4f} of white",
                                                              projector["most_black_lift"].get<double>())
                                                : std::string());
  }
}

}  // namespace

Status run_export(const ExportOptions& options) {
  LIMN_TRY_STATUS(check(options));
  LIMN_TRY(const Session session, load(options));
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  log_info("export: {}", context.description());
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(session.scene, session.rig));
  const scene::PosedScene bare{session.posed.world_from_prototype, {}};
  std::vector<Maps> maps;
  int lit = 0;
  for (std::size_t i = 0; i < session.rig.projectors.size(); ++i) {
    maps.push_back(maps_of(&renderer, i, bare));
    lit += maps.back().lit;
    if (maps.back().lit == 0)
      log_warning("export: {} does not reach the prototype; its maps are empty",
                  session.rig.projectors[i].name);
  }
  if (lit == 0) {
    return error("{}: expected a prototype that a projector reaches, found none. Check rig and poses.",
                 options.poses.string());
  }
  if (!options.mpcdi.empty()) LIMN_TRY_STATUS(write_mpcdi(options.mpcdi, mpcdi_of(session, maps, options)));
  if (!options.warp.empty()) LIMN_TRY_STATUS(write_warps(session, maps, options));
  if (!options.looks.empty()) LIMN_TRY_STATUS(write_looks(session, options));
  const ordered_json report = report_of(session, maps);
  if (options.json) {
    fmt::print("{}\n", report.dump(2));
  } else {
    print(report);
  }
  return {};
}

}  // namespace limn::apps
