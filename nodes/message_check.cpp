#include "nodes/message_check.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>

#include "nodes/packed_image.h"
#include "scene/volume_part.h"

namespace limn::nodes {
namespace {

// The largest room that is foreseen has 32 machines and 64 projectors; the limits are far beyond it.
constexpr std::size_t k_most_items = 4096;
constexpr std::size_t k_longest_name = 1024, k_longest_text = 64 << 10, k_longest_options = 4 << 20;
constexpr std::size_t k_most_image_bytes = 64 << 20;
constexpr std::size_t k_node_name = 64;
constexpr std::size_t k_most_found = 1024;  // markers, balls or controls of one camera
constexpr double k_most_px = 2 * k_max_side;

// Keeps the first problem, so that callers need no check after each value.
class MessageCheck {
 public:
  void require(bool is_true, const char* field, const char* expected) {
    if (!is_true && status_) status_ = error("{}: expected {}, found something else.", field, expected);
  }
  void finite(const char* field, std::initializer_list<double> values) {
    for (const double value : values) require(std::isfinite(value), field, "finite numbers");
  }
  template <class Matrix>
  void finite_matrix(const char* field, const Matrix& values) {
    require(values.allFinite(), field, "finite numbers");
  }
  void pose(const char* field, const Pose& pose) {
    constexpr double k_tolerance = 1e-3;  // for a quaternion's norm; rounding leaves 1e-15
    require(pose.is_finite() && std::abs(pose.rotation.norm() - 1) < k_tolerance, field,
            "a finite pose with a unit quaternion");
  }
  void text(const char* field, const std::string& text, std::size_t longest = k_longest_name) {
    require(text.size() <= longest && text.find('\0') == std::string::npos, field,
            "a text of reasonable length without zero bytes");
  }
  void bytes(const char* field, const std::string& bytes) {
    require(bytes.size() <= k_most_image_bytes, field, "an image of at most 64 MB");
  }
  template <class Items>
  void count(const char* field, const Items& items, std::size_t most = k_most_items) {
    require(items.size() <= most, field, "a shorter list");
  }
  void size(const char* field, const cv::Size& size) {
    require(size.width >= 0 && size.height >= 0 && size.width <= k_max_side && size.height <= k_max_side,
            field, "a width and height of at most 16384");
  }
  void image(const char* field, const cv::Mat& image, int channels) {
    if (image.empty()) return;
    pixels_ += static_cast<long>(image.total());
    require(image.dims == 2 && image.depth() == CV_8U && (image.channels() == channels || channels == 0) &&
                pixels_ <= k_most_packed_pixels,
            field, "8-bit images of at most 4 million pixels in all");
  }
  void pixel(const char* field, const Eigen::Vector2d& px) {
    require(px.allFinite() && px.cwiseAbs().maxCoeff() <= k_most_px, field, "pixels near an image");
  }
  void covariance(const char* field, const Eigen::Matrix2d& values) {
    constexpr double k_tolerance = 1e-9;  // for symmetry; rounding leaves 1e-15
    const bool is_symmetric =
        values.allFinite() && std::abs(values(0, 1) - values(1, 0)) <= k_tolerance * values.trace();
    require(
        is_symmetric && values(0, 0) > 0 && values.determinant() > 0 && std::isfinite(values.determinant()),
        field, "a symmetric positive definite covariance");
  }
  void count_of_uses(const char* field, int uses) {
    require(uses >= 0 && uses <= (1 << 30) - 1, field, "a number of uses from 0 to 2^30 - 1");
  }
  Status status() const { return status_; }

 private:
  Status status_;
  long pixels_ = 0;  // in all images
};

void check(const scene::RoomLight& light, MessageCheck* to) {
  to->count("light.lamps", light.lamps, scene::RoomLight::k_most_lamps);
  to->finite_matrix("light", light.d_up_world);
  to->finite_matrix("light", light.below_rgb);
  to->finite_matrix("light", light.above_rgb);
  for (const auto& lamp : light.lamps) {
    to->finite_matrix("light.lamps", lamp.d_world);
    to->finite_matrix("light.lamps", lamp.strength_rgb);
  }
  to->finite("light.image_strength", {light.image_strength});
}

void check(const scene::PosedPart& part, MessageCheck* to) {
  to->text("part.slot", part.slot);
  to->text("part.variant", part.variant);
  to->pose("part", part.world_from_part);
  if (part.material.base_colour) to->finite_matrix("part.material", *part.material.base_colour);
  if (part.window)
    to->require(scene::is_window(*part.window), "part.window", "a finite level and a width above 0");
  to->finite("part.material", {part.material.metallic.value_or(0), part.material.roughness.value_or(0)});
}

void check(const scene::DrawnLine& line, std::size_t* points, MessageCheck* to) {
  to->text("line.name", line.name);
  to->finite_matrix("line.colour", line.style.colour);
  to->finite("line.width", {line.style.width_m});
  *points += line.curve.points.size();
  to->require(*points <= scene::k_most_points_shown, "line.points", "fewer points");
  for (const scene::SurfacePoint& point : line.curve.points) {
    to->finite_matrix("line.points", point.p);
    to->finite_matrix("line.points", point.d_normal);
  }
}

void check(const scene::PosedScene& posed, MessageCheck* to) {
  if (posed.world_from_prototype) to->pose("posed.world_from_prototype", *posed.world_from_prototype);
  to->count("posed.parts", posed.parts);
  to->count("posed.viewpoints", posed.viewpoints);
  for (const auto& part : posed.parts) check(part, to);
  for (const auto& viewpoint : posed.viewpoints) {
    to->text("posed.viewpoints", viewpoint.viewer);
    to->finite_matrix("posed.viewpoints", viewpoint.p_world);
    to->finite("posed.viewpoints", {viewpoint.weight});
  }
  if (posed.light) check(*posed.light, to);
  to->text("posed.finish", posed.finish);
  if (posed.cut) to->require(scene::is_plane(*posed.cut), "posed.cut", "a plane with a normal of length 1");
  to->count("posed.lines", posed.lines, scene::k_most_lines);
  for (const std::string& line : posed.lines) to->text("posed.lines", line);
  to->count("posed.drawn", posed.drawn);
  std::size_t points = 0;
  for (const scene::DrawnLine& line : posed.drawn) check(line, &points, to);
  to->finite("posed.deviation", {posed.deviation.tolerance_m});
}

void check(const Track& track, MessageCheck* to) {
  to->text("track.body", track.body);
  to->pose("track", track.world_from_body);
  // Its lower triangle travels (to_wire.cpp), so what arrives is symmetric.
  to->finite_matrix("track.covariance", track.covariance);
  to->finite("track.rms_px", {track.rms_px});
}

void check(const Imager& imager, MessageCheck* to) {
  to->text("viewer.name", imager.name);
  to->size("viewer.size", {imager.width, imager.height});
  to->pose("viewer", imager.imager_from_world);
  to->count("viewer.lens", imager.lens.values, 1 << 16);
  for (const double value : imager.lens.values) to->finite("viewer.lens", {value});
}

void check(const projector::SplitOverlay& split, MessageCheck* to) {
  check(split.left, to);
  to->finite("split.x_m", {split.x_m});
}

void check(const projector::GridOverlay& /*grid*/, MessageCheck* /*to*/) {}

void check(const projector::RingOverlay& ring, MessageCheck* to) {
  to->pose("ring", ring.world_from_marker);
  to->finite("ring", {ring.size_m, ring.strength});
  for (int i = 0; i < 4; ++i) to->finite("ring.colour", {ring.colour[i]});
}

void check(const projector::WordOverlay& word, MessageCheck* to) {
  to->pose("word", word.world_from_marker);
  to->finite("word", {word.size_m, word.strength});
  to->text("word.text", word.text);
}

void check(const projector::SignOverlay& sign, MessageCheck* to) {
  to->image("sign.image", sign.image, 3);
  if (!sign.place) return;
  to->finite_matrix("sign.place", sign.place->p_corner);
  to->finite_matrix("sign.place", sign.place->d_right);
  to->finite_matrix("sign.place", sign.place->d_down);
}

void check_overlays(const std::vector<projector::Overlay>& overlays, MessageCheck* to) {
  to->count("overlays", overlays);
  for (const projector::Overlay& overlay : overlays)
    std::visit([to](const auto& one) { check(one, to); }, overlay);
}

void check(const Moment& moment, MessageCheck* to) {
  const session::FrameDescription& frame = moment.frame;
  to->count("frame.tracks", frame.tracks);
  for (const Track& track : frame.tracks) check(track, to);
  check(frame.posed, to);
  check(frame.viewer, to);
  to->count("frame.fading", frame.fading);
  for (const auto& fading : frame.fading) {
    check(fading.part, to);
    to->finite("frame.fading", {fading.share});
  }
  to->count("frame.gone", frame.gone);
  for (const auto& gone : frame.gone) {
    check(gone.posed, to);
    to->finite("frame.gone", {gone.share});
  }
  check_overlays(frame.on_surface, to);
  check_overlays(frame.signs, to);
  to->count("frame.loose", frame.loose);
  for (const MarkerName& marker : frame.loose) to->text("frame.loose", marker.family + marker.id);
  to->count("frame.arriving", frame.arriving);
  for (const cv::Mat& map : frame.arriving) to->image("frame.arriving", map, 1);
}

void check_devices(const std::vector<OfferedDevice>& devices, MessageCheck* to) {
  to->count("devices", devices);
  for (const OfferedDevice& device : devices) {
    to->text("device.name", device.name);
    to->size("device.size", device.size);
  }
}

void check(const Offer& offer, MessageCheck* to) {
  to->text("version", offer.version);
  to->text("renderer", offer.renderer);
  check_devices(offer.monitors, to);
  check_devices(offer.cameras, to);
  to->count("servers", offer.servers);
  for (const std::string& server : offer.servers) to->text("servers", server);
  to->text("fingerprint", offer.fingerprint);
  to->text("token", offer.token);
}

bool is_sha256(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
}

// Whether a path stays in the folder that it is relative to.
bool is_inside(const std::string& path) {
  const std::filesystem::path way(path);
  if (path.empty() || way.is_absolute()) return false;
  return std::none_of(way.begin(), way.end(), [](const auto& part) { return part == ".."; });
}

void check(const Setup& setup, MessageCheck* to) {
  to->text("devices", setup.devices, k_longest_options);
  to->count("files", setup.files, 1 << 16);
  for (const SharedFile& file : setup.files) {
    to->text("file.path", file.path);
    to->require(is_inside(file.path), "file.path", "a path inside the session's folder");
    to->require(is_sha256(file.sha256), "file.sha256", "64 hexadecimal digits");
  }
}

void check_receiver(const std::string& machine, MessageCheck* to) {
  to->require(is_node_name(machine), "to", "a machine's name");
}

void check(const ScreenImage& image, MessageCheck* to) {
  check_receiver(image.to, to);
  to->text("screen", image.screen);
  to->bytes("left", image.left);
  to->bytes("right", image.right);
}

void check(const ClockRequest& request, MessageCheck* to) { check_receiver(request.to, to); }

void check(const ClockAnswer& answer, MessageCheck* to) { check_receiver(answer.to, to); }

void check(const Order& order, MessageCheck* to) {
  check_receiver(order.to, to);
  to->text("device", order.device, k_longest_options);
  to->bytes("image", order.image);
}

void check(const Answer& answer, MessageCheck* to) {
  check_receiver(answer.to, to);
  to->text("error", answer.error, k_longest_text);
  to->size("size", answer.size);
  to->bytes("image", answer.image);
}

void check(const Health& health, MessageCheck* to) {
  to->finite("health", {health.latency_s, health.draw_ms, health.late_ms, health.clock_offset_s,
                        health.clock_stddev_s});
  to->count("problems", health.problems);
  for (const std::string& problem : health.problems) to->text("problems", problem, k_longest_text);
  to->count("refreshes", health.refreshes);
  for (const Refresh& refresh : health.refreshes) to->finite("refreshes", {refresh.period_s});
  to->count("screen_problems", health.screen_problems);
  for (const std::string& problem : health.screen_problems)
    to->text("screen_problems", problem, k_longest_text);
}

void check(const tracker::Detection& marker, MessageCheck* to) {
  to->text("marker.name", marker.marker.family);
  to->text("marker.name", marker.marker.id);
  to->require(marker.score >= 0 && marker.score <= 1, "marker.score", "a probability");
  for (std::size_t i = 0; i < 4; ++i) {
    to->pixel("marker.corners", marker.corners_px[i]);
    to->covariance("marker.covariance", marker.corner_covariance[i]);
  }
}

void check(const tracker::Ball& ball, MessageCheck* to) {
  constexpr double k_tolerance = 1e-6;  // for a unit vector's norm
  to->require(std::abs(ball.d_centre.norm() - 1) < k_tolerance, "ball.d_centre", "a unit vector");
  to->require(ball.half_angle > 0 && ball.half_angle < std::numbers::pi / 2, "ball.half_angle",
              "an angle between 0 and 90 degrees");
  to->pixel("ball.centre_px", ball.centre_px);
  to->covariance("ball.covariance", ball.centre_covariance);
  to->finite("ball", {ball.contrast, ball.blur_px});
  to->require(ball.radius_px > 0 && ball.radius_px <= k_most_px, "ball.radius_px", "a radius in an image");
  to->require(ball.half_angle_stddev > 0 && std::isfinite(ball.half_angle_stddev), "ball.half_angle_stddev",
              "a standard deviation");
}

void check(const Detections& message, MessageCheck* to) {
  to->text("camera", message.found.camera);
  to->count("markers", message.found.detections, k_most_found);
  to->count("balls", message.found.balls, k_most_found);
  to->count("controls", message.found.controls, k_most_found);
  for (const tracker::Detection& marker : message.found.detections) check(marker, to);
  for (const tracker::Ball& ball : message.found.balls) check(ball, to);
  for (const tracker::GestureReading& control : message.found.controls) {
    to->count_of_uses("controls.forward", control.forward);
    to->count_of_uses("controls.backward", control.backward);
  }
}

void check(const Departure& /*departure*/, MessageCheck* to) {
  to->require(false, "message", "one that can be sent");
}

}  // namespace

Status check_message(const Message& message) {
  MessageCheck to;
  std::visit([&to](const auto& one) { check(one, &to); }, message);
  return to.status();
}

bool is_node_name(const std::string& name) {
  return !name.empty() && name.size() <= k_node_name &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return c < 0x80 && (std::isalnum(c) || c == '-' || c == '_' || c == '.');
         });
}

}  // namespace limn::nodes
