// web_glasses_room FOLDER [camera]: a session of the studio, served to a page with emulated glasses
// (glasses_test.py). A person wears them; the room's cameras measure their marker, and FOLDER/path.json says
// where their drifting odometry believes them to be. With `camera` the glasses have no marker, but a camera
// of their own. The session's clock moves only when it is told to, so that results do not depend on how busy
// the machine is. Commands come by the standard input, a line each:
//   step NOW AT               the session's clock is NOW (s), and the person is at AT (s) of the walk
//   eye AT X                  the true pose of an eye at AT of the walk, X (m) beside the middle of both eyes
//   mask SIZE… EYE… POSE…     which pixels of an eye parts and light cover (see mask_of)
//   projected                 a number that changes with the projectors' images
//   photograph AT X SIZE F    writes what the glasses' camera sees at AT, X (m) beside the middle of both
//   eyes located N                 waits until N photographs have been looked at
// Answers are lines of JSON on the standard output.
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <deque>
#include <filesystem>
#include <future>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
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
#include "tests/remote/virtual_tablet.h"
#include "tests/web/glasses_walk.h"
#include "tracker/marker_image.h"

namespace {

namespace fs = std::filesystem;
using namespace limn;
using Eigen::Vector3d;
using nlohmann::json;
using test::noise;
using test::turned;
using test::Walk;

constexpr const char* k_marker = "apriltag_36h11:40";
constexpr double k_marker_rad = 2e-3, k_marker_m = 0.5e-3;

// The glasses' camera: how far the truth is from what the browser states of it, and what its lens does that
// WebXR cannot state.
constexpr double k_stated_rad = 0.5e-3, k_stated_m = 0.3e-3, k_stated_share = 1e-3;
constexpr double k_radial[] = {0.004, -0.003};
constexpr double k_exposure_s = 0.008;  // in a room; the head turns meanwhile
constexpr double k_camera_look = 0.65;  // a person whose glasses' camera must see markers turns the head less

// The image as the exposure blurs it while the camera turns from one pose to the other.
cv::Mat blurred(const cv::Mat& image, const Lens& lens, const Pose& from, const Pose& to) {
  constexpr int k_parts = 5;
  Eigen::Matrix3d k;
  k << lens.fx(), 0, lens.values[2], 0, lens.fy(), lens.values[3], 0, 0, 1;
  cv::Mat sum(image.size(), CV_32FC3, cv::Scalar::all(0)), turned_image, out;
  for (int i = 0; i < k_parts; ++i) {
    const Pose then = interpolated(from, to, (i + 0.5) / k_parts), middle = interpolated(from, to, 0.5);
    const Eigen::Matrix3d h =
        k * (then.rotation * middle.rotation.inverse()).toRotationMatrix() * k.inverse();
    const cv::Matx33d map(h(0, 0), h(0, 1), h(0, 2), h(1, 0), h(1, 1), h(1, 2), h(2, 0), h(2, 1), h(2, 2));
    cv::warpPerspective(image, turned_image, map, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    cv::accumulate(turned_image, sum);
  }
  sum.convertTo(out, CV_8UC3, 1.0 / k_parts);
  return out;
}

class Room {
 public:
  Room(const fs::path& folder, bool by_camera)
      : folder_(folder), by_camera_(by_camera), context_(device::GlContext::create().value()) {
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
    if (!by_camera_) setup_.scene.viewers.push_back(wearer);
    telemetry_.emplace(session::Telemetry::create({}).value());
    session_.emplace(session::Session::create(setup_, &*telemetry_, nullptr, false).value());
    const int camera = 0;
    for (int i = 0; i < 8; ++i) percepts_ = perception.watch(rig.expose(std::span(&camera, 1)));
    const Stamp seen_at = percepts_.captured_at;
    session_->update_percepts(percepts_, ++moments_);
    // From its second frame on a scene that stands still is drawn more smoothly.
    for (int i = 0; i < 2; ++i) session_->compose_and_record(seen_at, seen_at);
    renderer_.emplace(projector::Renderer::create(setup_.scene, setup_.rig).value());
    walk_ = test::walk_through(p_middle_, by_camera_ ? k_camera_look : 1, rng_);
    LIMN_CHECK(write_file(folder / "path.json", test::path_of(walk_).dump()).ok());
    if (by_camera_) make_camera(rig.world());
    remote::ServeOptions serve;
    serve.at = std::string("0");
    serve.keys = folder / "keys";
    server_ = remote::Server::open(serve, by_camera_ ? image_providers() : remote::ImageProviders{}).value();
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
      measure(std::midpoint(before_now_s, now_s_), std::midpoint(before_at_s, at_s_));
    measure(now_s_, at_s_);
  }

  void measure(double now_s, double at_s) {
    now_ = begun_at_ + std::chrono::nanoseconds(std::llround(1e9 * now_s));
    session::Percepts percepts = percepts_;
    percepts.captured_at = now_;
    if (!by_camera_) percepts.tracks.push_back(measured_marker(at_s));
    session_->update_percepts(std::move(percepts), ++moments_);
    turn();
  }

  Track measured_marker(double at_s) {
    Track track;
    track.body = scene::viewer_body(setup_.scene.viewers.size() - 1);
    track.world_from_body =
        boxplus(walk_.eye(at_s) * marker_from_eye_.inverse(), noise(rng_, k_marker_rad, k_marker_m));
    track.covariance.diagonal() << Vector3d::Constant(k_marker_rad * k_marker_rad),
        Vector3d::Constant(k_marker_m * k_marker_m);
    track.captured_at = track.at = now_;
    return track;
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
    Imager eye = viewer_imager(Pose(), width, height, 60);
    const double fx = 0.5 * width * p0, fy = 0.5 * height * p5;
    eye.lens = Lens::create("LENSMODEL_PINHOLE",
                            {fx, fy, 0.5 * width * (1 - p8) - 0.5, 0.5 * height * (1 + p9) - 0.5})
                   .value();
    eye.imager_from_world = (Pose(Eigen::Quaterniond(qw, qx, qy, qz), t) * turned()).inverse();
    cv::Mat shown(height, width, CV_8UC1, cv::Scalar(0));
    for (const projector::PartCoverage& part : renderer_->coverage(session_->composed().posed, eye))
      shown = cv::max(shown, part.mask);
    return {{"rest", bits_of(shown == 128)}, {"full", bits_of(shown > 0)}};
  }

  // AT X SIZE F: a square image, and its focal length (px) as the browser states it. The session goes on
  // meanwhile.
  json photograph(std::istringstream& words) {
    double at_s = 0, x = 0, focal = 0;
    int size = 0;
    words >> at_s >> x >> size >> focal;
    Imager& camera = camera_->world().rig.cameras[0];
    const double centre = 0.5 * (size - 1);
    camera.width = camera.height = size;
    camera.lens =
        Lens::create("LENSMODEL_OPENCV4",
                     {focal * (1 + lens_off_[0]), focal * (1 + lens_off_[0]), centre + focal * lens_off_[1],
                      centre + focal * lens_off_[2], k_radial[0], k_radial[1], 0, 0})
            .value();
    const auto camera_from_world = [&](double then_s) {
      const Pose world_from_stated = walk_.eye(then_s) * Pose(Eigen::Quaterniond::Identity(), {x, 0, 0});
      return (world_from_stated * stated_from_camera_ * turned()).inverse();
    };
    auto photograph = std::async(std::launch::async, [&] {
      return blurred(camera_->shoot_from(camera_from_world(at_s)).image, camera.lens,
                     camera_from_world(at_s - 0.5 * k_exposure_s),
                     camera_from_world(at_s + 0.5 * k_exposure_s));
    });
    while (photograph.wait_for(k_pause) != std::future_status::ready) turn();
    const fs::path path = folder_ / "photograph.png";
    LIMN_CHECK(cv::imwrite(path.string(), photograph.get()));
    return {{"photograph", path.string()}};
  }

  // N
  json wait_until_located(std::istringstream& words) {
    int count = 0;
    words >> count;
    const Stamp end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (looked_at_ < count && std::chrono::steady_clock::now() < end) {
      turn();
      std::this_thread::sleep_for(k_pause);
    }
    return {{"looked_at", looked_at_.load()}, {"located", located_.load()}};
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
  static constexpr std::chrono::milliseconds k_pause{5};

  // The glasses' camera in the world as the session lights it.
  void make_camera(const sim::World& world) {
    camera_.emplace(world, session_->composed().projectors, 960, 960, 7);
    stated_from_camera_ = boxplus(Pose(), noise(rng_, k_stated_rad, k_stated_m));
    std::normal_distribution<double> normal(0, k_stated_share);
    for (double& off : lens_off_) off = normal(rng_);
  }

  // As `limn live` has them; the photographs are counted.
  remote::ImageProviders image_providers() {
    remote::ImageProviders out =
        remote::image_providers(remote::TabletView::create(setup_, folder_ / "lenses").value(),
                                remote::CameraLocator::create(setup_).value());
    out.locate_camera = [this, locate = out.locate_camera](
                            std::uint64_t camera, const remote::StatedLens& lens,
                            std::vector<std::uint8_t> jpeg, remote::LocatedCallback answer) {
      locate(camera, lens, std::move(jpeg),
             [this, answer = std::move(answer)](const remote::LocatedCamera& found) {
               located_ += found.is_located;
               answer(found);
               ++looked_at_;
             });
    };
    return out;
  }

  static std::string bits_of(const cv::Mat& mask) {
    std::string out;
    for (int at = 0; at < static_cast<int>(mask.total()); at += 4) {
      int digit = 0;
      for (int k = 0; k < 4; ++k) digit = 2 * digit + (mask.data[at + k] > 0);
      out += "0123456789abcdef"[digit];
    }
    return out;
  }

  fs::path folder_;
  bool by_camera_;
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
  std::optional<test::VirtualTablet> camera_;
  Pose stated_from_camera_;
  double lens_off_[3] = {};  // the focal length's share, and the centre in focal lengths
  std::atomic<int> looked_at_ = 0, located_ = 0;
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
  if (command == "photograph") return room->photograph(words);
  if (command == "located") return room->wait_until_located(words);
  if (command != "step")
    return {{"error", "expected step, eye, mask, projected, photograph or located, found " + command}};
  room->step(words);
  return {{"done", command}};
}

}  // namespace

int main(int argc, char** argv) {
  const bool by_camera = argc == 3 && argv[2] == std::string_view("camera");
  if (argc != 2 && !by_camera) {
    fmt::print(stderr, "web_glasses_room: expected a folder to write to, and then nothing or: camera.\n");
    return 2;
  }
  Room room(argv[1], by_camera);
  static Commands commands;
  std::cout << room.invitation().dump() << std::endl;
  while (!commands.is_over()) {
    room.turn();
    if (const auto line = commands.next()) std::cout << done_by(&room, *line).dump() << std::endl;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return 0;
}
