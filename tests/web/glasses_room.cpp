// web_glasses_room FOLDER: a session of the studio, served to a page with emulated glasses (glasses_test.py).
// A person wears them; the room's cameras measure their marker, and FOLDER/path.json says where their
// drifting odometry believes them to be. The session's clock moves only when it is told to, so that results
// do not depend on how busy the machine is. Commands come by the standard input, a line each:
//   step NOW AT               the session's clock is NOW (s), and the person is at AT (s) of the walk
//   eye AT X                  the true pose of an eye at AT of the walk, X (m) beside the middle of both eyes
//   mask SIZE… EYE… POSE…     which pixels of an eye parts and light cover (see mask_of)
//   projected                 a number that changes with the projectors' images
// Answers are lines of JSON on the standard output.
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <deque>
#include <filesystem>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <random>
#include <sstream>
#include <thread>

#include "core/config.h"
#include "core/file.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "projector/renderer.h"
#include "remote/server.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "sim/world.h"
#include "tracker/marker_image.h"

namespace {

namespace fs = std::filesystem;
using namespace limn;
using Eigen::Vector3d;
using nlohmann::json;

constexpr const char* k_marker = "apriltag_36h11:40";
constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_step_s = 0.01, k_look_round_s = 12, k_station_s = 3, k_move_s = 1;
constexpr int k_stations = 3;
constexpr double k_marker_rad = 2e-3, k_marker_m = 0.5e-3;
constexpr double k_drift_rad = 0.02 * k_degree, k_drift_m = 0.3e-3;  // in a second

// The eye looks along -z with y up, as in WebXR.
Pose eye_at(const Vector3d& p_eye, const Vector3d& p_target) {
  const Pose turned(Eigen::Quaterniond(0, 1, 0, 0), Vector3d::Zero());
  return looking_at(p_eye, p_target, {0, 0, 1}).inverse() * turned;
}

Vector6d noise(std::mt19937_64& rng, double rotation, double translation) {
  std::normal_distribution<double> normal;
  Vector6d delta;
  for (int k = 0; k < 6; ++k) delta[k] = (k < 3 ? rotation : translation) * normal(rng);
  return delta;
}

// Where the person's eye is in truth, and by the odometry, at steps of time.
struct Walk {
  std::vector<Pose> world_from_eye, feed_from_eye;

  Pose eye(double at_s) const {
    const double step = std::clamp(at_s / k_step_s, 0.0, static_cast<double>(world_from_eye.size()) - 1.001);
    const auto i = static_cast<std::size_t>(step);
    return interpolated(world_from_eye[i], world_from_eye[i + 1], step - static_cast<double>(i));
  }
};

Pose looking_round(const Vector3d& p_middle, double at_s) {
  const auto wave = [&](double period_s, double phase) {
    return std::sin(2 * std::numbers::pi * at_s / period_s + phase);
  };
  const double side = 0.35 * wave(6.1, 0.3);
  const Vector3d p_eye =
      p_middle + 0.95 * Vector3d(std::sin(side), -std::cos(side), 0.25 + 0.15 * wave(4.7, 1));
  const Eigen::Quaterniond turned =
      exp_rotation({0.4 * wave(3.1, 0), 0.55 * wave(3.7, 2), 0.15 * wave(4.1, 1)});
  const Pose straight = eye_at(p_eye, p_middle);
  return {straight.rotation * turned, p_eye};
}

Pose station(const Vector3d& p_middle, int index) {
  const double side = std::array{-0.55, 0.15, 0.7}[static_cast<std::size_t>(index)];
  const double height = std::array{0.1, 0.5, 0.25}[static_cast<std::size_t>(index)];
  return eye_at(p_middle + 0.8 * Vector3d(std::sin(side), -std::cos(side), height), p_middle);
}

// Looks round, then stands at each station in turn.
Walk walk_through(const Vector3d& p_middle, std::mt19937_64& rng) {
  Walk walk;
  Pose world_from_feed(exp_rotation({0.3, -0.8, 1.9}), {0.7, -1.4, 0.2});
  Pose before = looking_round(p_middle, 0);
  const int steps = static_cast<int>((k_look_round_s + k_stations * k_station_s) / k_step_s);
  for (int i = 0; i < steps; ++i) {
    const double at_s = i * k_step_s, since_s = at_s - k_look_round_s;
    Pose eye = looking_round(p_middle, at_s);
    if (since_s >= 0) {
      const int index = static_cast<int>(since_s / k_station_s);
      const double share = std::min(1.0, (since_s - index * k_station_s) / k_move_s);
      if (share == 0 || i == 0) before = walk.world_from_eye.back();
      if (share < k_step_s) before = walk.world_from_eye.back();
      eye = interpolated(before, station(p_middle, index), share * share * (3 - 2 * share));
    }
    const double root = std::sqrt(k_step_s);
    const Vector6d drift = noise(rng, root * k_drift_rad, root * k_drift_m);
    const Eigen::Quaterniond turned = exp_rotation(drift.head<3>());
    world_from_feed =
        Pose(turned * world_from_feed.rotation,
             eye.translation + turned * (world_from_feed.translation - eye.translation) + drift.tail<3>());
    walk.world_from_eye.push_back(eye);
    walk.feed_from_eye.push_back(world_from_feed.inverse() * eye);
  }
  return walk;
}

json path_of(const Walk& walk) {
  json out = {{"step_s", k_step_s},
              {"look_round_s", k_look_round_s},
              {"station_s", k_station_s},
              {"stations", k_stations},
              {"poses", json::array()}};
  for (const Pose& pose : walk.feed_from_eye) {
    const Eigen::Quaterniond& q = pose.rotation;
    const Vector3d& t = pose.translation;
    out["poses"].push_back({q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()});
  }
  return out;
}

class Room {
 public:
  explicit Room(const fs::path& folder) : context_(device::GlContext::create().value()) {
    sim::World world =
        sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", tracker::marker_image)
            .value();
    LIMN_CHECK(scale_resolution(0.5, &world.rig).ok());
    setup_.rig = world.rig;
    setup_.scene = *world.scene;
    setup_.scene.folder = folder / "project";
    fs::create_directories(setup_.scene.folder);
    p_middle_ = world.world_from_prototype.translation;
    sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
    auto perception = session::Perception::create(setup_.scene, setup_.rig).value();
    scene::Viewer wearer;
    wearer.marker = MarkerName::parse(k_marker).value();
    wearer.marker_size_m = 0.06;
    setup_.scene.viewers.push_back(wearer);
    telemetry_.emplace(session::Telemetry::create({}).value());
    session_.emplace(session::Session::create(setup_, &*telemetry_, nullptr, false).value());
    const int camera = 0;
    for (int i = 0; i < 8; ++i) percepts_ = perception.watch(rig.expose(std::span(&camera, 1)));
    const Stamp seen_at = percepts_.captured_at;
    session_->update_percepts(percepts_, ++moments_);
    // From its second frame on a scene that stands still is drawn more smoothly.
    for (int i = 0; i < 2; ++i) session_->compose_and_record(seen_at, seen_at);
    renderer_.emplace(projector::Renderer::create(setup_.scene, setup_.rig).value());
    walk_ = walk_through(p_middle_, rng_);
    LIMN_CHECK(write_file(folder / "path.json", path_of(walk_).dump()).ok());
    remote::ServeOptions serve;
    serve.at = std::string("0");
    serve.keys = folder / "keys";
    server_ = remote::Server::open(serve, {}).value();
  }

  json invitation() const {
    const session::Invitation& invited = server_->invitation();
    return {{"url", invited.url}, {"pins", invited.pins}, {"projected", projected()}};
  }

  // NOW AT: the cameras measure the marker then and there, and half-way to it unless another walk begins.
  void step(std::istringstream& words) {
    const double before_now_s = now_s_, before_at_s = at_s_;
    words >> now_s_ >> at_s_;
    if (at_s_ >= before_at_s && at_s_ - before_at_s <= now_s_ - before_now_s + 1e-3)
      measure_marker(std::midpoint(before_now_s, now_s_), std::midpoint(before_at_s, at_s_));
    measure_marker(now_s_, at_s_);
  }

  void measure_marker(double now_s, double at_s) {
    now_ = begun_at_ + std::chrono::nanoseconds(std::llround(1e9 * now_s));
    Track track;
    track.body = scene::viewer_body(setup_.scene.viewers.size() - 1);
    track.world_from_body =
        boxplus(walk_.eye(at_s) * marker_from_eye_.inverse(), noise(rng_, k_marker_rad, k_marker_m));
    track.covariance.diagonal() << Vector3d::Constant(k_marker_rad * k_marker_rad),
        Vector3d::Constant(k_marker_m * k_marker_m);
    track.captured_at = track.at = now_;
    session::Percepts percepts = percepts_;
    percepts.captured_at = now_;
    percepts.tracks.push_back(track);
    session_->update_percepts(std::move(percepts), ++moments_);
    turn();
  }

  // Exchanges everything with the server.
  void turn() {
    server_->apply_edits(&*session_, now_);
    server_->publish_state(*session_, *telemetry_, health_, now_);
  }

  // AT X
  json eye_of(std::istringstream& words) const {
    double at_s = 0, x = 0;
    words >> at_s >> x;
    const Pose eye = walk_.eye(at_s) * Pose(Eigen::Quaterniond::Identity(), {x, 0, 0});
    const Eigen::Quaterniond& q = eye.rotation;
    const Vector3d& t = eye.translation;
    return {{"world_from_view", {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}}};
  }

  // WIDTH HEIGHT P0 P5 P8 P9 QW QX QY QZ TX TY TZ: an eye's image, the entries of its projection matrix, and
  // its pose world_from_view. The answer has two masks in hexadecimal, a bit for each pixel, first row first:
  // what light cannot show of the parts (rest), and the whole parts (full).
  json mask_of(std::istringstream& words) {
    int width = 0, height = 0;
    double p0 = 0, p5 = 0, p8 = 0, p9 = 0, qw = 1, qx = 0, qy = 0, qz = 0;
    Vector3d t = Vector3d::Zero();
    words >> width >> height >> p0 >> p5 >> p8 >> p9 >> qw >> qx >> qy >> qz >> t.x() >> t.y() >> t.z();
    const Pose turned(Eigen::Quaterniond(0, 1, 0, 0), Vector3d::Zero());
    Imager eye = viewer_imager(Pose(), width, height, 60);
    const double fx = 0.5 * width * p0, fy = 0.5 * height * p5;
    eye.lens = Lens::create("LENSMODEL_PINHOLE",
                            {fx, fy, 0.5 * width * (1 - p8) - 0.5, 0.5 * height * (1 + p9) - 0.5})
                   .value();
    eye.imager_from_world = (Pose(Eigen::Quaterniond(qw, qx, qy, qz), t) * turned).inverse();
    cv::Mat shown(height, width, CV_8UC1, cv::Scalar(0));
    for (const projector::PartCoverage& part : renderer_->coverage(session_->composed().posed, eye))
      shown = cv::max(shown, part.mask);
    return {{"rest", bits_of(shown == 128)}, {"full", bits_of(shown > 0)}};
  }

  // A number that changes when a projector's image does.
  std::size_t projected() const {
    std::size_t sum = 0;
    for (const cv::Mat& image : session_->composed().projectors)
      sum = 31 * sum + std::hash<std::string_view>()(std::string_view(
                           reinterpret_cast<const char*>(image.data), image.total() * image.elemSize()));
    return sum;
  }
  json projected_again() {
    const Stamp at = percepts_.captured_at;
    session_->update_percepts(percepts_, ++moments_);
    session_->compose_and_record(at, at);
    return {{"projected", projected()}};
  }

 private:
  static std::string bits_of(const cv::Mat& mask) {
    std::string out;
    for (int at = 0; at < static_cast<int>(mask.total()); at += 4) {
      int digit = 0;
      for (int k = 0; k < 4; ++k) digit = 2 * digit + (mask.data[at + k] > 0);
      out += "0123456789abcdef"[digit];
    }
    return out;
  }

  std::mt19937_64 rng_{37};
  device::GlContext context_;
  session::SessionSetup setup_;
  Vector3d p_middle_;
  std::optional<session::Telemetry> telemetry_;
  std::optional<session::Session> session_;
  session::Percepts percepts_;
  session::DeviceHealth health_;
  std::optional<projector::Renderer> renderer_;
  std::size_t moments_ = 0;
  Walk walk_;
  Pose marker_from_eye_{exp_rotation({0.4, 1.2, -0.3}), {0.03, -0.07, 0.05}};
  double now_s_ = 0, at_s_ = 0;
  Stamp begun_at_ = std::chrono::steady_clock::now(), now_ = begun_at_;
  std::unique_ptr<remote::Server> server_;
};

// Lines of the standard input, read on a thread of their own.
class Commands {
 public:
  Commands() {
    std::thread([this] {
      for (std::string line; std::getline(std::cin, line);) {
        const std::lock_guard lock(mutex_);
        lines_.push_back(line);
      }
      is_over_ = true;
    }).detach();
  }
  std::optional<std::string> next() {
    const std::lock_guard lock(mutex_);
    if (lines_.empty()) return std::nullopt;
    std::string line = std::move(lines_.front());
    lines_.pop_front();
    return line;
  }
  bool is_over() const { return is_over_; }

 private:
  std::mutex mutex_;
  std::deque<std::string> lines_;
  std::atomic<bool> is_over_ = false;
};

json done_by(Room* room, const std::string& line) {
  std::istringstream words(line);
  std::string command;
  words >> command;
  if (command == "mask") return room->mask_of(words);
  if (command == "eye") return room->eye_of(words);
  if (command == "projected") return room->projected_again();
  if (command != "step") return {{"error", "expected step, eye, mask or projected, found " + command}};
  room->step(words);
  return {{"done", command}};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "web_glasses_room: expected a folder to write to.\n");
    return 2;
  }
  Room room(argv[1]);
  static Commands commands;
  std::cout << room.invitation().dump() << std::endl;
  while (!commands.is_over()) {
    room.turn();
    if (const auto line = commands.next()) std::cout << done_by(&room, *line).dump() << std::endl;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return 0;
}
