#include "wizard/measure/scan_files.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/stopwatch.h"
#include "scene/meshes/scan_preview.h"

namespace limn::wizard {
namespace {

constexpr int k_preview_width = 1200, k_preview_height = 800;
constexpr double k_deviation_limit_mm = 0.5;  // end of the deviation map's colour scale

double percentile(std::vector<float> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Share of each camera's pixels that have a point.
double coverage(const calib::RangeView& view) {
  return static_cast<double>(view.counts.kept) / static_cast<double>(view.range.total());
}

nlohmann::ordered_json view_json(const calib::ScanView& seen) {
  const calib::RangeCounts& c = seen.view.counts;
  return {{"pose", seen.pose},
          {"camera", seen.camera},
          {"decoded", c.decoded},
          {"rejected",
           {{"epipolar", c.epipolar},
            {"angle", c.angle},
            {"unsure", c.unsure},
            {"conflicts", c.conflicts},
            {"edges", c.edges}}},
          {"points", c.kept},
          {"coverage", coverage(seen.view)},
          {"epipolar_rms_px", c.epipolar_rms_px},
          {"first_from_pose", to_json(seen.first_from_pose)}};
}

nlohmann::ordered_json scan_json(const calib::Scan& scan, double seconds) {
  const scene::ConnectedComponents pieces = scene::connected_components(scan.mesh);
  double area = 0;
  for (const double piece : pieces.areas) area += piece;
  nlohmann::ordered_json json;
  json["schema"] = "limn.scan/1";
  json["units"] = "m";
  json["points"] = scan.points.positions.size();
  json["mesh"] = {{"vertices", scan.mesh.positions.size()},
                  {"triangles", scan.mesh.triangles.size()},
                  {"voxel_mm", scan.voxel_m * 1e3},
                  {"area_m2", area},
                  {"pieces", pieces.areas.size()}};
  json["stddev_mm"] = {{"median", stddev_mm(scan, 0.5)}, {"p95", stddev_mm(scan, 0.95)}};
  if (scan.agreement.count > 0)
    json["views_agree"] = {{"points", scan.agreement.count},
                           {"rms_mm", scan.agreement.rms_m * 1e3},
                           {"median_mm", scan.agreement.median_m * 1e3},
                           {"median_sigmas", scan.agreement.median_sigmas}};
  json["views"] = nlohmann::ordered_json::array();
  for (const calib::ScanView& view : scan.views) json["views"].push_back(view_json(view));
  json["warnings"] = scan.warnings;
  json["seconds"] = {{"decode", scan.seconds_decode},
                     {"range", scan.seconds_range},
                     {"merge", scan.seconds_merge},
                     {"total", seconds}};
  return json;
}

// The measured surface in its camera's image, shaded by a light beside the camera; dark without a point.
cv::Mat shaded(const calib::RangeView& view) {
  const Eigen::Vector3d d_light =
      view.camera.imager_from_world.rotation.conjugate() * Eigen::Vector3d(-0.45, -0.6, -1).normalized();
  cv::Mat image(view.range.size(), CV_8UC3, cv::Scalar(46, 42, 40));
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      if (!view.has(x, y)) continue;
      const auto& n = view.d_normal.at<cv::Vec3f>(y, x);
      const double light = 40 + 190 * std::max(0.0, d_light.dot(Eigen::Vector3d(n[0], n[1], n[2])));
      image.at<cv::Vec3b>(y, x) = cv::Vec3b::all(static_cast<uchar>(light));
    }
  return image;
}

// The camera's image with the standard deviation of each point as a colour.
cv::Mat deviation(const calib::RangeView& view) {
  cv::Mat image(view.range.size(), CV_8UC3, cv::Scalar(46, 42, 40));
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      if (!view.has(x, y)) continue;
      const auto rgb = scene::signed_colour_rgb(1e3 * static_cast<double>(view.stddev.at<float>(y, x)) /
                                                k_deviation_limit_mm);
      image.at<cv::Vec3b>(y, x) = {rgb[2], rgb[1], rgb[0]};
    }
  return scene::with_scale(image, 0, k_deviation_limit_mm, "standard deviation of the range");
}

Status write_images(const calib::Scan& scan, const std::filesystem::path& out) {
  for (const calib::ScanView& seen : scan.views) {
    const std::string name = seen.pose + "-" + seen.camera + ".png";
    LIMN_TRY_STATUS(write_png(out / ("shaded-" + name), shaded(seen.view)));
    LIMN_TRY_STATUS(write_png(out / ("deviation-" + name), deviation(seen.view)));
  }
  const Pose& camera_from_world = scan.views.front().view.camera.imager_from_world;
  const Eigen::Quaterniond world_from_camera = camera_from_world.rotation.conjugate();
  const Eigen::Vector3d d_from =
      world_from_camera * Eigen::Vector3d(0.5, -0.35, -1);  // from beside and above the camera
  const scene::ConnectedComponents pieces = scene::connected_components(scan.mesh);
  std::vector<bool> largest;
  for (const int piece : pieces.of_vertex) largest.push_back(piece == 0);
  const Imager viewer =
      scene::preview_viewer(scene::with_vertices_kept(scan.mesh, largest), d_from,
                            world_from_camera * Eigen::Vector3d(0, -1, 0), k_preview_width, k_preview_height);
  return write_png(out / "mesh.png", scene::draw_scan_preview(scan.mesh, viewer));
}

Status write_scan(const calib::Scan& scan, double seconds, const std::filesystem::path& out) {
  return write_together(out, [&](const std::filesystem::path& into) -> Status {
    LIMN_TRY_STATUS(scene::save_ply(scan.points, into / "points.ply"));
    LIMN_TRY_STATUS(scene::save_ply(scan.mesh, into / "mesh.ply"));
    LIMN_TRY_STATUS(write_images(scan, into));
    return write_file(into / "scan.json", json_text(scan_json(scan, seconds), 2) + "\n");
  });
}

}  // namespace

double stddev_mm(const calib::Scan& scan, double share) {
  return 1e3 * percentile(scan.points.stddevs, share);
}

Result<calib::Scan> make_scan(const calib::CaptureSet& captures,
                              const Rig& rig,
                              const calib::ScanOptions& options,
                              const std::filesystem::path& out) {
  const auto begun = std::chrono::steady_clock::now();
  LIMN_TRY(calib::Scan scan, calib::scan_captures(captures, rig, options));
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "write"}));
  LIMN_TRY_STATUS(write_scan(scan, 1e-3 * milliseconds_since(begun), out));
  return scan;
}

}  // namespace limn::wizard
