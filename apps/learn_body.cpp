#include "apps/learn_body.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "apps/camera_image.h"
#include "core/camera_files/imager_file.h"
#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "tracker/detector.h"
#include "tracker/marker_mapping.h"

namespace limn::apps {
namespace {

constexpr double k_degrees = 180 / std::numbers::pi;

// Three consecutive standard deviations, one for each axis of the body.
nlohmann::ordered_json deviations(const Matrix6d& covariance, int first, double scale) {
  nlohmann::ordered_json values;
  for (int i = first; i < first + 3; ++i) values.push_back(scale * std::sqrt(covariance(i, i)));
  return values;
}

nlohmann::ordered_json json_of(const tracker::MarkerMap& learned, const std::string& name) {
  nlohmann::ordered_json json = {
      {"schema", "limn.body/1"},       {"name", name},
      {"frame", learned.frame.text()}, {"pictures", learned.images},
      {"rms_px", learned.rms_px},      {"markers", nlohmann::ordered_json::array()}};
  for (const tracker::MappedMarker& marker : learned.markers)
    json["markers"].push_back({{"name", marker.marker.marker.text()},
                               {"size_mm", 1e3 * marker.marker.size_m},
                               {"body_from_marker", to_json(marker.marker.body_from_marker)},
                               {"stddev_deg", deviations(marker.covariance, 0, k_degrees)},
                               {"stddev_mm", deviations(marker.covariance, 3, 1e3)},
                               {"pictures", marker.images}});
  return json;
}

void print(const tracker::MarkerMap& learned) {
  for (const tracker::MappedMarker& marker : learned.markers) {
    const Eigen::Vector3d p_mm = 1e3 * marker.marker.body_from_marker.translation;
    print_out("{:<24} at ({:.2f}, {:.2f}, {:.2f}) mm, +- {:.2f} mm, {:.2f} degrees, {} images\n",
              marker.marker.marker.text(), p_mm.x(), p_mm.y(), p_mm.z(),
              1e3 * std::sqrt(marker.covariance.bottomRightCorner<3, 3>().trace()),
              k_degrees * std::sqrt(marker.covariance.topLeftCorner<3, 3>().trace()), marker.images);
  }
  print_out("{} markers from {} images, {:.3f} px; the body's frame is that of {}\n", learned.markers.size(),
            learned.images, learned.rms_px, learned.frame.text());
  for (const MarkerName& marker : learned.unplaced)
    log_warning(
        "{}: no image shows it together with the others; it is left out. Add an image that shows it beside "
        "one of them.",
        marker.text());
}

}  // namespace

Status run_learn_body(const LearnBodyOptions& options) {
  if (options.camera.empty())
    return usage_error("--learn-body: poses need a camera; add --camera X.cameramodel.");
  if (!(options.size_mm > 0 && options.size_mm <= k_largest_marker_mm))
    return usage_error("--size-mm: expected millimetres, over 0 and at most {}, found {}.",
                       k_largest_marker_mm, options.size_mm);
  if (options.out.extension() != ".json")
    return usage_error("--out: expected a file that ends in .json, found '{}'.", options.out.string());
  LIMN_TRY(const Imager camera, load_imager(options.camera));
  const auto families = tracker::Families::load(std::vector<std::string>{options.family});
  if (!families) return usage_error("--family: {}", families.message());
  tracker::Detector detector(*families);
  std::vector<std::vector<tracker::Detection>> detections;
  Imager at_origin = camera;  // a body's frame has no world frame
  at_origin.imager_from_world = Pose{};
  Progress progress("detect", static_cast<int>(options.images.size()));
  for (const auto& path : options.images) {
    LIMN_TRY(const cv::Mat grey, read_image_of(camera, path));
    detections.push_back(detector.detect(grey, &camera.lens));
    progress.step(static_cast<int>(detections.size()));
  }
  std::vector<tracker::View> views;
  for (const auto& found : detections) views.push_back({&at_origin, found});
  const auto learned = tracker::map_markers(views, 1e-3 * options.size_mm);
  if (!learned) return error("--learn-body: {}", learned.message());
  print(*learned);
  return write_file(options.out, json_text(json_of(*learned, options.out.stem().string()), 1) + "\n");
}

}  // namespace limn::apps
