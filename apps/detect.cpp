#include "apps/detect.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "apps/output_files.h"
#include "core/camera_files/imager_file.h"
#include "core/config.h"
#include "core/csv.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/median.h"
#include "core/parallel.h"
#include "core/print.h"
#include "core/rig.h"
#include "tracker/detector.h"
#include "tracker/marker_pose.h"
#include "tracker/triangle_pose.h"

namespace limn::apps {
namespace {

struct Marker {
  tracker::Detection detection;
  std::vector<tracker::MarkerPose> poses;
};

struct DetectOutcome {
  std::filesystem::path path;
  std::string name;               // in the results
  std::filesystem::path drawing;  // file to write; empty: none
  int width = 0, height = 0;
  std::vector<Marker> markers;
  std::optional<double> ms;
  std::string problem;  // empty: no problem
};

// The camera for an image of this size. ARToolKit's files are meant to be scaled to the image (its own
// programs do that); all others are valid for one size only.
Result<Imager> camera_for(const Imager& camera, const std::filesystem::path& file, int width, int height) {
  if (camera.width == 0 || (camera.width == width && camera.height == height)) return camera;
  const bool same_shape = camera.width * height == camera.height * width;
  if (file.extension() != ".dat" || !same_shape)
    return error(
        "expected {}x{} pixels, the size of {}, found an image of {}x{}. Use the camera's own images or "
        "calibrate this size.",
        camera.width, camera.height, file.string(), width, height);
  Imager scaled = camera;
  const double s = static_cast<double>(width) / camera.width;
  scaled.width = width;
  scaled.height = height;
  scaled.lens.values[0] *= s;
  scaled.lens.values[1] *= s;
  for (const std::size_t i : {2u, 3u}) scaled.lens.values[i] = (scaled.lens.values[i] + 0.5) * s - 0.5;
  return scaled;
}

double median_ms(tracker::Detector& detector, const cv::Mat& grey, const Lens* lens, int repeat) {
  std::vector<double> times;
  std::vector<tracker::Detection> found;
  for (int i = 0; i < repeat; ++i) {
    const auto started = std::chrono::steady_clock::now();
    detector.detect(grey, lens, &found);
    times.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count());
  }
  return mean_median(std::move(times));
}

double corner_rms(const Lens& lens, double size_m, const Pose& pose, const tracker::Detection& detection) {
  double squares = 0;
  const auto corners = tracker::square_corners(size_m);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto px = lens.project(pose * corners[i]);
    squares += px ? (*px - detection.corners_px[i]).squaredNorm() : 1e12;
  }
  return std::sqrt(squares / 4);
}

std::vector<tracker::MarkerPose> poses_of(const tracker::Detection& detection,
                                          const Lens& lens,
                                          const DetectOptions& options) {
  const double size_m = options.size_mm * 1e-3;
  auto poses = tracker::marker_poses(lens, size_m, detection.corners_px, detection.corner_covariance);
  if (options.pose == PoseMethod::ippe) return poses;
  const auto pose = tracker::triangle_pose(lens, size_m, detection.corners_px);
  if (!pose) return {};
  // The paper's method gives no covariance. That of the refined pose, which it approximates, is the best
  // guess.
  tracker::MarkerPose only{*pose, corner_rms(lens, size_m, *pose, detection), Matrix6d::Zero(), 1};
  if (!poses.empty()) only.covariance = poses[0].covariance;
  return {only};
}

// ---- images ----

constexpr double k_shift = 16;  // OpenCV's fractional bits: 4

cv::Point fixed(const Eigen::Vector2d& px) {
  return {static_cast<int>(std::lround(px.x() * k_shift)), static_cast<int>(std::lround(px.y() * k_shift))};
}

void draw_line(cv::Mat& image,
               const Eigen::Vector2d& a,
               const Eigen::Vector2d& b,
               const cv::Scalar& colour,
               int thickness) {
  cv::line(image, fixed(a), fixed(b), cv::Scalar(0, 0, 0), thickness + 2, cv::LINE_AA, 4);
  cv::line(image, fixed(a), fixed(b), colour, thickness, cv::LINE_AA, 4);
}

void draw_text(cv::Mat& image, const std::string& text, const Eigen::Vector2d& centre, double scale) {
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, 1, &baseline);
  const cv::Point at(static_cast<int>(centre.x()) - size.width / 2,
                     static_cast<int>(centre.y()) + size.height / 2);
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar(0, 0, 0), 3, cv::LINE_AA);
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar(80, 255, 255), 1, cv::LINE_AA);
}

// x red, y green, z blue; z points into the paper, so its line leads away from the camera.
void draw_axes(cv::Mat& image, const Lens& lens, const Pose& camera_from_marker, double size_m) {
  const auto origin = lens.project(camera_from_marker.translation);
  const std::array<cv::Scalar, 3> colours = {cv::Scalar(60, 60, 255), cv::Scalar(60, 220, 60),
                                             cv::Scalar(255, 120, 40)};
  for (int axis : {2, 0, 1}) {
    const auto tip =
        lens.project(camera_from_marker * Eigen::Vector3d(0.5 * size_m * Eigen::Vector3d::Unit(axis)));
    if (origin && tip) draw_line(image, *origin, *tip, colours[static_cast<std::size_t>(axis)], 1);
  }
}

cv::Mat drawn(const cv::Mat& grey, const DetectOutcome& outcome, const Lens* lens, double size_m) {
  cv::Mat image;
  cv::cvtColor(grey, image, cv::COLOR_GRAY2BGR);
  for (const Marker& marker : outcome.markers) {
    const auto& c = marker.detection.corners_px;
    for (std::size_t i = 0; i < 4; ++i) draw_line(image, c[i], c[(i + 1) % 4], cv::Scalar(80, 255, 80), 1);
    if (lens && !marker.poses.empty()) draw_axes(image, *lens, marker.poses[0].camera_from_marker, size_m);
    cv::circle(image, fixed(c[0]), static_cast<int>(3 * k_shift), cv::Scalar(0, 0, 0), 3, cv::LINE_AA, 4);
    cv::circle(image, fixed(c[0]), static_cast<int>(3 * k_shift), cv::Scalar(40, 40, 255), -1, cv::LINE_AA,
               4);
    const double side = std::min((c[2] - c[0]).norm(), (c[3] - c[1]).norm());
    const Eigen::Vector2d centre = 0.25 * (c[0] + c[1] + c[2] + c[3]);
    draw_text(image, marker.detection.marker.id, centre, std::clamp(side / 110, 0.35, 1.2));
  }
  return image;
}

// ---- results ----

// A number if the family numbers its markers, the file's name for templates.
nlohmann::json id_json(const std::string& id) {
  int number = 0;
  const auto [end, problem] = std::from_chars(id.data(), id.data() + id.size(), number);
  if (problem == std::errc() && end == id.data() + id.size()) return number;
  return id;
}

nlohmann::json json_of(const Marker& marker) {
  nlohmann::json node;
  node["family"] = marker.detection.marker.family;
  node["id"] = id_json(marker.detection.marker.id);
  node["score"] = marker.detection.score;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = marker.detection.corners_px[i];
    node["corners_px"].push_back({px.x(), px.y()});
    // One number for each corner: the RMS of the two directions.
    node["corner_stddev_px"].push_back(std::sqrt(0.5 * marker.detection.corner_covariance[i].trace()));
  }
  node["poses"] = nlohmann::json::array();
  for (const tracker::MarkerPose& pose : marker.poses) {
    nlohmann::json entry = {{"camera_from_marker", to_json(pose.camera_from_marker)},
                            {"rms_px", pose.rms_px},
                            {"weight", pose.weight}};
    for (int row = 0; row < 6; ++row) {
      nlohmann::json values = nlohmann::json::array();
      for (int column = 0; column < 6; ++column) values.push_back(pose.covariance(row, column));
      entry["covariance"].push_back(values);
    }
    node["poses"].push_back(entry);
  }
  return node;
}

std::string outcomes_json(const std::vector<DetectOutcome>& outcomes) {
  nlohmann::json images = nlohmann::json::array();
  for (const DetectOutcome& outcome : outcomes) {
    if (!outcome.problem.empty()) continue;
    nlohmann::json node = {{"file", outcome.name}, {"size", {outcome.width, outcome.height}}};
    if (outcome.ms) node["ms"] = *outcome.ms;
    if (!outcome.drawing.empty()) node["drawing"] = outcome.drawing.string();
    node["markers"] = nlohmann::json::array();
    for (const Marker& marker : outcome.markers) node["markers"].push_back(json_of(marker));
    images.push_back(node);
  }
  return json_text(nlohmann::json{{"images", images}}, 1) + "\n";
}

std::string csv_text(const std::vector<DetectOutcome>& outcomes, bool with_family) {
  std::string text = "file,id,x0,y0,x1,y1,x2,y2,x3,y3,score\n";
  for (const DetectOutcome& outcome : outcomes)
    for (const Marker& marker : outcome.markers) {
      const MarkerName& name = marker.detection.marker;
      text += csv_field(outcome.name) + "," + csv_field(with_family ? name.text() : name.id);
      for (const auto& px : marker.detection.corners_px)
        text += fmt::format(",{:.4f},{:.4f}", px.x(), px.y());
      text += fmt::format(",{:.4f}\n", marker.detection.score);
    }
  return text;
}

void print(const DetectOutcome& outcome) {
  const std::string time = outcome.ms ? fmt::format(", {:.3f} ms", *outcome.ms) : "";
  print_out("{}: {} markers{}\n", outcome.path.string(), outcome.markers.size(), time);
  for (const Marker& marker : outcome.markers) {
    const Eigen::Vector2d& px = marker.detection.corners_px[0];
    print_out("  {:<24} ({:8.2f}, {:8.2f})  score {:.2f}", marker.detection.marker.text(), px.x(), px.y(),
              marker.detection.score);
    if (!marker.poses.empty()) {
      const Eigen::Vector3d t = 1e3 * marker.poses[0].camera_from_marker.translation;
      print_out("  at ({:.1f}, {:.1f}, {:.1f}) mm, {:.3f} px", t.x(), t.y(), t.z(), marker.poses[0].rms_px);
      if (marker.poses.size() > 1) print_out(", weight {:.2f}", marker.poses[0].weight);
    }
    print_out("\n");
  }
}

// ---- the work ----

Status detect_in(const DetectOptions& options,
                 const std::optional<Imager>& camera,
                 tracker::Detector& detector,
                 DetectOutcome* outcome) {
  LIMN_TRY(const cv::Mat grey, read_grey_image(outcome->path));
  outcome->width = grey.cols;
  outcome->height = grey.rows;
  std::optional<Lens> lens;
  if (camera) {
    const auto fitting = camera_for(*camera, options.camera, grey.cols, grey.rows);
    if (!fitting) return error("{}: {}", outcome->path.string(), fitting.message());
    lens = fitting->lens;
  }
  const Lens* lens_or_none = lens ? &*lens : nullptr;
  for (tracker::Detection& detection : detector.detect(grey, lens_or_none)) {
    Marker marker{std::move(detection), {}};
    if (lens && options.size_mm > 0) marker.poses = poses_of(marker.detection, *lens, options);
    outcome->markers.push_back(std::move(marker));
  }
  if (options.repeat > 0) outcome->ms = median_ms(detector, grey, lens_or_none, options.repeat);
  if (outcome->drawing.empty()) return {};
  return write_png(outcome->drawing, drawn(grey, *outcome, lens_or_none, options.size_mm * 1e-3));
}

void detect_all(const DetectOptions& options,
                const std::optional<Imager>& camera,
                const tracker::Families& families,
                std::vector<DetectOutcome>* outcomes) {
  const int count = static_cast<int>(outcomes->size());
  // Timed images are processed one after the other. If there are more threads than images, each image gets
  // several.
  const int images = options.repeat > 0 ? 1 : std::max(1, count);
  const int threads = std::clamp(options.threads, 1, images);
  std::atomic<int> next = 0;
  std::atomic<int> done = 0;
  std::mutex progress_mutex;
  Progress progress("detect", count);
  tracker::DetectorOptions detector_options;
  detector_options.threads = std::clamp(options.threads / threads, 1, cv::getNumberOfCPUs());
  detector_options.encoding = options.encoding;
  const auto work = [&] {
    tracker::Detector detector(families, detector_options);
    for (int i = next++; i < count; i = next++) {
      DetectOutcome& outcome = (*outcomes)[static_cast<std::size_t>(i)];
      const Status status = detect_in(options, camera, detector, &outcome);
      if (!status) outcome.problem = status.message();
      const std::lock_guard lock(progress_mutex);
      progress.step(++done);
    }
  };
  run_on_threads(threads, work);
}

// The pattern ratio of a template is not in its file, and with a wrong one nothing is found.
void hint_at_pattern_ratio(const std::vector<std::string>& families,
                           const std::vector<DetectOutcome>& outcomes) {
  const bool without_ratio = std::ranges::any_of(families, [](const std::string& name) {
    return (name.starts_with("artoolkit:") || name.starts_with("artoolkit_inverted:")) &&
           name.find('@') == std::string::npos;
  });
  const bool is_found = std::ranges::any_of(outcomes, [](const DetectOutcome& outcome) {
    return std::ranges::any_of(outcome.markers, [](const Marker& marker) {
      const std::string& family = marker.detection.marker.family;
      return family == "artoolkit" || family == "artoolkit_inverted";
    });
  });
  if (without_ratio && !is_found)
    log_info(
        "no template was found. Patterns are assumed to be half as wide as the black square; state another "
        "share (AR.js: patternRatio) after the file's name: artoolkit:logo.patt@0.8");
}

// One for each image, without results yet.
std::vector<DetectOutcome> outcomes_of(const DetectOptions& options) {
  const std::vector<std::string> names = names_in_results(options.images);
  std::vector<std::filesystem::path> drawings(options.images.size());
  if (!options.draw.empty()) drawings = drawing_files(options.images, options.draw);
  std::vector<DetectOutcome> outcomes;
  for (std::size_t i = 0; i < names.size(); ++i)
    outcomes.push_back({options.images[i], names[i], drawings[i], 0, 0, {}, {}, {}});
  return outcomes;
}

Status check_options(const DetectOptions& options) {
  if (options.images.empty()) return usage_error("limn detect: expected images, found none.");
  if (!std::isfinite(options.size_mm) || options.size_mm < 0)
    return usage_error("--size-mm: expected millimetres (> 0), found {}.", options.size_mm);
  if (options.size_mm > 0 && options.camera.empty())
    return usage_error("--size-mm: poses also need a camera; add --camera X.cameramodel.");
  if (options.families.empty()) return usage_error("--family: expected at least one family, found none.");
  return {};
}

}  // namespace

Status run_detect(const DetectOptions& options) {
  LIMN_TRY_STATUS(check_options(options));
  const auto families = tracker::Families::load(options.families);
  if (!families) return usage_error("--family: {}", families.message());
  std::optional<Imager> camera;
  if (!options.camera.empty()) {
    LIMN_TRY(camera, load_imager(options.camera));
  }
  if (!options.draw.empty()) LIMN_TRY_STATUS(make_folder(options.draw));
  std::vector<DetectOutcome> outcomes = outcomes_of(options);
  detect_all(options, camera, *families, &outcomes);

  int failed = 0;
  for (const DetectOutcome& outcome : outcomes) {
    if (outcome.problem.empty()) {
      print(outcome);
    } else {
      ++failed;
      log_warning("{}", outcome.problem);
    }
  }
  hint_at_pattern_ratio(options.families, outcomes);
  const bool with_family = std::set(options.families.begin(), options.families.end()).size() > 1;
  if (!options.csv.empty()) LIMN_TRY_STATUS(write_file(options.csv, csv_text(outcomes, with_family)));
  if (!options.json.empty()) LIMN_TRY_STATUS(write_file(options.json, outcomes_json(outcomes)));
  if (failed > 0) return error("{} of {} images could not be processed.", failed, outcomes.size());
  return {};
}

}  // namespace limn::apps
