#include <gtest/gtest.h>

#include <cstdio>
#include <future>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/coarser.h"
#include "apps/live/session.h"
#include "apps/live/watcher.h"
#include "apps/tablet/guest_eye.h"
#include "apps/tablet/guest_picture.h"
#include "apps/tablet/lens_book.h"
#include "apps/tablet/onlooker.h"
#include "apps/world_markers.h"
#include "core/picture.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "sim/truth.h"
#include "sim/virtual_rig.h"
#include "tests/apps/virtual_tablet.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int k_width = 640, k_height = 400;

Pose pose_of(const json& node) {
  const auto& q = node["rotation_wxyz"];
  const auto& t = node["translation_m"];
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
}

// A session in the studio that has seen and lit the door, and somebody who looks on.
class Room {
 public:
  explicit Room(const fs::path& lens_folder) : context_(device::GlContext::create().value()) {
    sim::World world =
        sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", marker_picture).value();
    EXPECT_TRUE(make_coarser(0.5, &world.rig).ok());
    setup_.rig = world.rig;
    setup_.scene = *world.scene;
    rig_.emplace(std::move(world), sim::VirtualRigOptions{.grab_waits_for_light = false});
    watcher_ = Watcher::create(setup_.scene, setup_.rig).value();
    session_ = Session::create(setup_, nullptr, nullptr, false).value();
    onlooker_ = Onlooker::create(setup_, lens_folder).value();
    for (int i = 0; i < 8; ++i) step();
  }

  // One more of the room's frames.
  void step() {
    const int camera = 0;
    session_->take(watcher_->watch(rig_->expose(std::span(&camera, 1))), ++moments_);
    const Painted& painted = session_->paint(rig_->now(), shifted(rig_->now(), 0.04));
    for (std::size_t k = 0; k < painted.projectors.size(); ++k)
      (void)rig_->projector(static_cast<int>(k)).show(painted.projectors[k]).value();
    onlooker_->know(*session_);
  }

  struct Window {
    json said;
    cv::Mat picture;
    std::vector<std::uint8_t> jpeg;
  };
  Window look(const std::string& device, std::vector<std::uint8_t> jpeg) {
    std::promise<Onlooker::Seen> answered;
    onlooker_->look(device, std::move(jpeg),
                    [&](Onlooker::Seen seen) { answered.set_value(std::move(seen)); });
    Onlooker::Seen seen = answered.get_future().get();
    Window window{json::parse(seen.json), {}, seen.jpeg};
    if (!seen.jpeg.empty()) window.picture = device::decode_jpeg(seen.jpeg).value();
    return window;
  }

  test::VirtualTablet tablet(std::uint64_t seed, int width = k_width, int height = k_height) {
    return {rig_->world(), session_->painted().projectors, width, height, seed};
  }

  Onlooker& onlooker() { return *onlooker_; }
  void end_onlooker() { onlooker_.reset(); }
  Session& session() { return *session_; }
  sim::VirtualRig& rig() { return *rig_; }

 private:
  device::GlContext context_;
  SessionSetup setup_;
  std::optional<sim::VirtualRig> rig_;
  std::optional<Watcher> watcher_;
  std::optional<Session> session_;
  std::unique_ptr<Onlooker> onlooker_;
  std::size_t moments_ = 0;
};

// Points of the parts' meshes in the world, at their true places.
std::vector<Eigen::Vector3d> part_points(const sim::World& world, const scene::PosedScene& posed) {
  std::vector<Eigen::Vector3d> points;
  for (const scene::PosedPart& part : posed.parts) {
    const scene::Slot* slot = world.scene->find_slot(part.slot);
    for (const scene::Variant& variant : slot->variants)
      if (variant.name == part.variant)
        for (const sim::SurfacePoint& point : sim::surface_points(variant.mesh, 60, 1))
          points.push_back(part.world_from_part * point.p);
  }
  return points;
}

Imager view_of(const json& said, const Imager& truth) {
  Imager view = truth;
  view.lens = Lens::create(said["lens"]["model"], said["lens"]["values"]).value();
  view.imager_from_world = pose_of(said["view_from_world"]);
  return view;
}

// Somebody looks round for 10 s: what is drawn lies where it belongs in exactly the picture that was sent.
TEST(Tablet, PartAndPictureLieOnEachOtherAfterTenSecondsOfLookingRound) {
  const fs::path folder = test::test_folder();
  Room room(folder / "lenses");
  ASSERT_TRUE(room.look("tablet-of-ann", {}).said["why"].is_string());
  test::VirtualTablet tablet = room.tablet(8);
  const scene::PosedScene truth = sim::true_poses(room.rig().world());
  const std::vector<Eigen::Vector3d> points = part_points(room.rig().world(), truth);
  double squares = 0, late_squares = 0;
  int count = 0, late_count = 0;
  for (int i = 0; i < 100; ++i) {
    const test::TabletShot shot = tablet.shoot(0.1 * i);
    const Room::Window window = room.look("tablet-of-ann", shot.jpeg);
    ASSERT_EQ(window.said["sees"], "prototype") << i << ": " << window.said.dump();
    const Imager view = view_of(window.said, shot.camera);
    double here = 0;
    int seen = 0;
    for (const Eigen::Vector3d& p : points) {
      const auto px = shot.camera.project(p);
      if (!px || !shot.camera.contains(*px)) continue;
      here += (*view.project(p) - *px).squaredNorm();
      ++seen;
    }
    squares += here;
    count += seen;
    if (i >= 80) late_squares += here, late_count += seen;
    if (i % 10 == 0 || i == 99)
      std::printf("%5.1f s: %4.2f px, %d markers, rms %.2f px, focal %.1f +- %.1f (true %.1f), %s ms\n",
                  0.1 * i, std::sqrt(here / seen), window.said["markers"].get<int>(),
                  window.said["rms_px"].get<double>(), view.lens.fx(),
                  window.said["lens"]["focal_stddev_px"].get<double>(), shot.camera.lens.fx(),
                  window.said["ms"].dump().c_str());
    if (i % 33 == 0) {
      ASSERT_TRUE(write_png(folder / fmt::format("sent-{}.png", i), shot.picture));
      ASSERT_TRUE(write_png(folder / fmt::format("seen-{}.png", i), window.picture));
    }
  }
  std::printf("composite: %.2f px RMS of all, %.2f of the last two seconds; %s\n", std::sqrt(squares / count),
              std::sqrt(late_squares / late_count), folder.c_str());
  EXPECT_LE(std::sqrt(late_squares / late_count), 1.5);
}

}  // namespace
}  // namespace limn::apps
