#include "exchange/mpcdi_exporter.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <ctime>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "core/photometric_response.h"
#include "exchange/mpcdi_writer.h"

namespace limn::exchange {
namespace {

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

// The display values that give the lift, BGR: at least these must be shown so that black is even.
MpcdiBlendMap beta_map(const cv::Mat& blend, const ProjectorResponse* response, int bits) {
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
        value[c] = static_cast<float>(inverse_lookup(table, light));
      }
    }
  }
  return {as_levels(values, bits), 1};
}

// CV_32FC3: the position (x right, y down, 0 … 1) of each point in the viewer's image; NaN outside.
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

const ProjectorResponse* find_response(const Rig& rig, const std::string& projector) {
  for (const ProjectorResponse& response : rig.responses)
    if (response.projector == projector) return &response;
  return nullptr;
}

Mpcdi mpcdi_of(const ExportJob& job, const ExportOptions& options) {
  const Pose& world_from_prototype = *job.posed.world_from_prototype;
  Mpcdi out;
  out.profile = options.profile;
  out.date = fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(std::time(nullptr)));
  out.made_by = "limn";
  bool has_lift = false;
  for (const ProjectorMaps& map : job.maps) has_lift |= map.most_lift > 0;
  out.colour_level = has_lift ? 2 : 1;
  for (std::size_t i = 0; i < job.maps.size(); ++i) {
    Imager projector = job.rig.projectors[i];
    projector.imager_from_world =
        projector.imager_from_world * world_from_prototype;  // the file's world is the prototype
    MpcdiRegion region;
    region.id = projector.name;
    region.buffer = "prototype";
    region.width = projector.width;
    region.height = projector.height;
    region.warp = job.maps[i].points;
    region.alpha = alpha_map(job.maps[i].blend, options.gamma, options.bits);
    if (has_lift) {
      cv::cvtColor(region.alpha->image, region.alpha->image,
                   cv::COLOR_GRAY2BGR);  // required by colour level 2
      region.beta = beta_map(job.maps[i].blend, find_response(job.rig, projector.name), options.bits);
    }
    if (options.profile == MpcdiProfile::shader_lamps) {
      place_frustum(projector, MpcdiFrame(), &region);
      region.distortion = places_in_frustum(*region.frustum, projector);
      region.lens = projector.lens;
    } else if (options.profile == MpcdiProfile::from_viewer) {
      const Pose viewer_from_prototype = job.viewer->imager_from_world * world_from_prototype;
      region.warp = places_for(*job.viewer, viewer_from_prototype, job.maps[i].points);
      Imager viewer = *job.viewer;
      viewer.imager_from_world = Pose();  // the viewpoint is the origin, its optical axis is forward
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

Status check(const ExportOptions& options) {
  if (options.profile == MpcdiProfile::flat)
    return usage_error("--profile: expected sl, a3 or 3d, found 2d.");
  if (options.bits != 8 && options.bits != 16)
    return usage_error("--bits: expected 8 or 16, found {}.", options.bits);
  if (!(options.gamma >= 1 && options.gamma <= 4))
    return usage_error("--gamma: expected 1 (linear) … 4, found {}.", options.gamma);
  return {};
}

}  // namespace

Exporter mpcdi_exporter() {
  return {.name = "mpcdi",
          .argument = "FILE",
          .path = &ExportOptions::mpcdi,
          .check = check,
          .needs_viewer =
              [](const ExportOptions& options) { return options.profile == MpcdiProfile::from_viewer; },
          .write =
              [](const ExportJob& job, const ExportOptions& options) {
                return write_mpcdi(options.mpcdi, mpcdi_of(job, options));
              }};
}

}  // namespace limn::exchange
