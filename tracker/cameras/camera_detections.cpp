#include "tracker/cameras/camera_detections.h"

#include <nlohmann/json.hpp>
#include <span>

namespace limn::tracker {
namespace {

using Json = nlohmann::ordered_json;

Json numbers(std::span<const double> values) {
  return Json(std::vector<double>(values.begin(), values.end()));
}

void read_numbers(const Json& json, std::span<double> out) {
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = json.at(i).get<double>();
}

template <class Matrix>
std::span<double> values_of(Matrix& matrix) {
  return {matrix.data(), static_cast<std::size_t>(matrix.size())};
}
template <class Matrix>
std::span<const double> values_of(const Matrix& matrix) {
  return {matrix.data(), static_cast<std::size_t>(matrix.size())};
}

std::int64_t nanoseconds(Stamp at) { return at.time_since_epoch().count(); }
Stamp stamp_of(const Json& json) { return Stamp(std::chrono::nanoseconds(json.get<std::int64_t>())); }

Json detection_json(const Detection& detection) {
  Json json = {{"family", detection.marker.family}, {"id", detection.marker.id}};
  json["corners_px"] = json["covariance_px2"] = Json::array();
  for (std::size_t i = 0; i < 4; ++i) {
    json["corners_px"].push_back(numbers(values_of(detection.corners_px[i])));
    json["covariance_px2"].push_back(numbers(values_of(detection.corner_covariance[i])));
  }
  json["visible"] = detection.corner_visible;
  json["score"] = detection.score;
  return json;
}

Detection detection_of(const Json& json) {
  Detection out;
  out.marker = {json.at("family"), json.at("id")};
  for (std::size_t i = 0; i < 4; ++i) {
    read_numbers(json.at("corners_px").at(i), values_of(out.corners_px[i]));
    read_numbers(json.at("covariance_px2").at(i), values_of(out.corner_covariance[i]));
    out.corner_visible[i] = json.at("visible").at(i).get<bool>();
  }
  out.score = json.at("score");
  return out;
}

Json ball_json(const Ball& ball) {
  return {{"d_centre", numbers(values_of(ball.d_centre))},
          {"half_angle", ball.half_angle},
          {"centre_px", numbers(values_of(ball.centre_px))},
          {"covariance_px2", numbers(values_of(ball.centre_covariance))},
          {"radius_px", ball.radius_px},
          {"half_angle_stddev", ball.half_angle_stddev},
          {"contrast", ball.contrast},
          {"blur_px", ball.blur_px}};
}

Ball ball_of(const Json& json) {
  Ball out;
  read_numbers(json.at("d_centre"), values_of(out.d_centre));
  out.half_angle = json.at("half_angle");
  read_numbers(json.at("centre_px"), values_of(out.centre_px));
  read_numbers(json.at("covariance_px2"), values_of(out.centre_covariance));
  out.radius_px = json.at("radius_px");
  out.half_angle_stddev = json.at("half_angle_stddev");
  out.contrast = json.at("contrast");
  out.blur_px = json.at("blur_px");
  return out;
}

Json control_json(const GestureReading& control) {
  Json json = {{"forward", control.forward}, {"backward", control.backward}, {"seen", control.is_seen}};
  if (control.hidden_since) json["hidden_since_ns"] = nanoseconds(*control.hidden_since);
  return json;
}

GestureReading control_of(const Json& json) {
  GestureReading out{json.at("forward"), json.at("backward"), json.at("seen")};
  if (json.contains("hidden_since_ns")) out.hidden_since = stamp_of(json.at("hidden_since_ns"));
  return out;
}

template <class Items, class Write>
Json list(const Items& items, Write write) {
  Json json = Json::array();
  for (const auto& item : items) json.push_back(write(item));
  return json;
}

}  // namespace

Json to_json(const CameraDetections& found) {
  return {{"camera", found.camera},
          {"captured_at_ns", nanoseconds(found.captured_at)},
          {"run", found.run},
          {"markers", list(found.detections, detection_json)},
          {"balls", list(found.balls, ball_json)},
          {"controls", list(found.controls, control_json)}};
}

CameraDetections camera_detections_of(const Json& json) {
  CameraDetections out{
      .camera = json.at("camera"), .captured_at = stamp_of(json.at("captured_at_ns")), .run = json.at("run")};
  for (const Json& item : json.at("markers")) out.detections.push_back(detection_of(item));
  for (const Json& item : json.at("balls")) out.balls.push_back(ball_of(item));
  for (const Json& item : json.at("controls")) out.controls.push_back(control_of(item));
  return out;
}

}  // namespace limn::tracker
