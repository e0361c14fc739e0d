// What a guest's tablet view costs the server: decode, track, composite and encode of one client's 640x400
// images, compared with a JPEG decode, a detection and a JPEG encode alone in the same run. Also its
// accuracy, and how much it slows the projector loop. Usage: limn bench tablet [--frames N (60)] [--seed S
// (2026)]
#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <future>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "core/median.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "remote/tablet/tablet_view.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/truth.h"
#include "sim/virtual_rig.h"
#include "tests/remote/virtual_tablet.h"
#include "tracker/detector.h"
#include "tracker/family.h"
#include "tracker/marker_image.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int k_width = 640, k_height = 400, k_quality = 80;
constexpr const char* k_device = "bench-tablet";

double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

double processor_ms() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// A session in the studio, with light on its door.
struct Room {
  device::GlContext context = device::GlContext::create().value();
  session::SessionSetup setup;
  sim::VirtualRig rig;
  session::Perception perception;
  session::Session session;
  std::size_t moments = 0;

  explicit Room(const sim::World& world)
      : setup{.rig = world.rig, .scene = *world.scene, .watch = {}, .paint = {}},
        rig(world, {.grab_waits_for_light = false}),
        perception(session::Perception::create(setup.scene, setup.rig).value()),
        session(session::Session::create(setup, nullptr, nullptr, false).value()) {
    for (int i = 0; i < 6; ++i) step();
  }

  const session::Percepts& see() {
    const int camera = 0;
    ++moments;
    return perception.watch(rig.expose(std::span(&camera, 1)));
  }

  void step() {
    session.update_percepts(see(), moments);
    const session::ComposedFrame& painted = session.compose_and_record(rig.now(), shifted(rig.now(), 0.04));
    for (std::size_t k = 0; k < painted.projectors.size(); ++k)
      (void)rig.projector(static_cast<int>(k)).show(painted.projectors[k]).value();
  }
};

remote::CompositeImage look(remote::TabletView* tablet_view, const std::vector<std::uint8_t>& jpeg) {
  std::promise<remote::CompositeImage> answered;
  tablet_view->draw_window({k_device}, jpeg,
                           [&](remote::CompositeImage seen) { answered.set_value(std::move(seen)); });
  return answered.get_future().get();
}

Pose pose_of(const json& node) {
  const auto& q = node["rotation_wxyz"];
  const auto& t = node["translation_m"];
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
}

// Sum of squared distances of part points from their true places, px^2, and the number of points.
struct Off {
  double squares = 0;
  int count = 0;
  void add(const json& said, const Imager& truth, const std::vector<Eigen::Vector3d>& points) {
    Imager view = truth;
    view.lens = Lens::create(said["lens"]["model"], said["lens"]["values"]).value();
    view.imager_from_world = pose_of(said["view_from_world"]);
    for (const Eigen::Vector3d& p : points) {
      const auto px = truth.project(p), there = view.project(p);
      if (!px || !truth.contains(*px)) continue;
      squares += there ? (*there - *px).squaredNorm() : 1e6;
      ++count;
    }
  }
  double rms() const { return std::sqrt(squares / std::max(1, count)); }
};

std::vector<Eigen::Vector3d> part_points(const sim::World& world) {
  std::vector<Eigen::Vector3d> points;
  const scene::PosedScene posed = sim::true_poses(world);
  for (const scene::PosedPart& part : posed.parts)
    for (const scene::Variant& variant : world.scene->find_slot(part.slot)->variants)
      if (variant.name == part.variant)
        for (const sim::SampledPoint& point : sim::surface_points(variant.mesh, 100, 1))
          points.push_back(part.world_from_part * point.p);
  return points;
}

void print_window(const std::vector<TabletShot>& shots, Room* room, remote::TabletView* tablet_view) {
  const std::vector<Eigen::Vector3d> points = part_points(room->rig.world());
  tracker::Detector detector(tracker::Families::load(tracker::families_of(scene::bodies(room->setup.scene)),
                                                     room->setup.scene.folder)
                                 .value(),
                             {.encoding = tracker::Encoding::srgb});
  // Everything runs with the tablet view's priority, so that a busy machine slows both alike.
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), 19);
  std::vector<double> alone[3], parts[4], server, answer, yardstick_processor, processor;
  Off off;
  json last;
  constexpr const char* k_parts[] = {"decode", "track", "composite", "encode"};
  // As in a session, each image has different tracks.
  std::vector<session::Percepts> moments;
  for (std::size_t i = 0; i < shots.size(); ++i) moments.push_back(room->see());
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < shots.size(); ++i) {
      const TabletShot& shot = shots[i];
      room->session.update_percepts(moments[i], room->moments);
      tablet_view->update_session(room->session);
      const double begun_processor = processor_ms(), begun = now_ms();
      const cv::Mat image = device::decode_jpeg(shot.jpeg).value();
      const double decoded = now_ms();
      cv::Mat grey;
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      const double turned_grey = now_ms();
      (void)detector.detect(grey);
      const double detected = now_ms();
      (void)device::encode_jpeg(image, k_quality);
      const double encoded = now_ms();
      const double asked_processor = processor_ms(), asked = now_ms();
      const remote::CompositeImage seen = look(tablet_view, shot.jpeg);
      const double answered_processor = processor_ms(), answered = now_ms();
      const json said = json::parse(seen.json);
      LIMN_CHECK(said["sees"] != "nothing");
      if (round == 0) continue;  // the first round warms up and estimates the lens
      const double own[3] = {decoded - begun, detected - turned_grey, encoded - detected};
      for (int k = 0; k < 3; ++k) alone[k].push_back(own[k]);
      double sum = 0;
      for (int k = 0; k < 4; ++k) {
        parts[k].push_back(said["ms"][k_parts[k]]);
        sum += parts[k].back();
      }
      server.push_back(sum);
      answer.push_back(answered - asked);
      yardstick_processor.push_back(asked_processor - begun_processor);
      processor.push_back(answered_processor - asked_processor);
      off.add(said, shot.camera, points);
      last = said;
    }
  }
  const double yardstick = median(alone[0]) + median(alone[1]) + median(alone[2]);
  fmt::print("alone: JPEG decode {:.2f}, detection {:.2f}, JPEG encode {:.2f}; sum {:.2f} ms\n",
             median(alone[0]), median(alone[1]), median(alone[2]), yardstick);
  fmt::print(
      "tablet view: decode {:.2f}, track {:.2f}, composite {:.2f}, encode {:.2f}; a frame {:.2f} ms, {:.2f} "
      "times the sum (at most 3); from request to answer {:.2f} ms\n",
      median(parts[0]), median(parts[1]), median(parts[2]), median(parts[3]), median(server),
      median(server) / yardstick, median(answer));
  fmt::print("processor time of all threads: alone {:.2f} ms, tablet view {:.2f} ms, {:.2f} times\n",
             median(yardstick_processor), median(processor), median(processor) / median(yardstick_processor));
  fmt::print(
      "parts lie {:.2f} px RMS from their true places (at most 1.5); focal length {:.1f} +- {:.1f} px, "
      "true value {:.1f}\n",
      off.rms(), last["lens"]["values"][0].get<double>(), last["lens"]["focal_stddev_px"].get<double>(),
      shots[0].camera.lens.fx());
}

// Renders images one after the other, with a part nudged in each, with and without a tablet view ten times a
// second. The two take turns, so that a busy machine slows both.
void print_projector_loop(const std::vector<TabletShot>& shots, Room* room, remote::TabletView* tablet_view) {
  constexpr int k_turns = 6, k_images = 14;
  std::vector<double> with, without, know;
  for (int turn = 0; turn < 2 * k_turns; ++turn) {
    std::atomic<bool> is_over = false;
    std::thread guest([&, is_looking = turn % 2 == 1] {
      for (std::size_t i = 0; is_looking && !is_over; ++i) {
        const auto next = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
        (void)look(tablet_view, shots[i % shots.size()].jpeg);
        std::this_thread::sleep_until(next);
      }
    });
    for (int i = 0; i < k_images; ++i) {
      const char* way = i % 2 == 0 ? "0.2 0 0" : "-0.2 0 0";
      LIMN_CHECK(room->session.edit({"nudge", "mirror", way}, "bench", room->rig.now()).ok());
      const double begun = now_ms();
      room->session.compose_and_record(room->rig.now(), shifted(room->rig.now(), 0.04));
      const double painted = now_ms();
      tablet_view->update_session(room->session);
      know.push_back(now_ms() - painted);
      if (i > 1) (turn % 2 == 1 ? with : without).push_back(now_ms() - begun);
    }
    is_over = true;
    guest.join();
  }
  fmt::print(
      "projector loop: {:.1f} ms for an image, {:.1f} with a tablet view open ({:+.1f} %, at most 10); "
      "publishing the session to it {:.4f} ms\n",
      median(without), median(with), 100 * (median(with) / median(without) - 1), median(know));
}

bool read_option(const char* name, const char* text, int argc, char** argv, int* i, unsigned long* value) {
  if (std::strcmp(text, name) != 0 || *i + 1 >= argc) return false;
  const char* digits = argv[++*i];
  return std::from_chars(digits, digits + std::strlen(digits), *value).ec == std::errc();
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  using namespace limn;
  using namespace limn::test;
  unsigned long frames = 60, seed = 2026;
  for (int i = 1; i < argc; ++i)
    if (!read_option("--frames", argv[i], argc, argv, &i, &frames) &&
        !read_option("--seed", argv[i], argc, argv, &i, &seed)) {
      fmt::print(stderr, "limn bench tablet: expected --frames N or --seed S, found {}\n", argv[i]);
      return 2;
    }
  const sim::World world =
      sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", tracker::marker_image).value();
  Room room(world);
  VirtualTablet tablet(world, room.session.composed().projectors, k_width, k_height, seed);
  std::vector<TabletShot> shots;
  for (unsigned long i = 0; i < std::max(1UL, frames); ++i)
    shots.push_back(tablet.shoot(10.0 * static_cast<double>(i) / static_cast<double>(frames)));
  const fs::path folder = fs::temp_directory_path() / fmt::format("limn-bench-lenses-{}", getpid());
  {
    const auto tablet_view = remote::TabletView::create(room.setup, folder).value();
    fmt::print("{} images of {}x{}, seed {}; {}\n", shots.size(), k_width, k_height, seed,
               room.context.description());
    tablet_view->update_session(room.session);
    std::thread([&] { print_window(shots, &room, tablet_view.get()); }).join();
    print_projector_loop(shots, &room, tablet_view.get());
  }
  fs::remove_all(folder);
}
