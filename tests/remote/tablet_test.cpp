#include <gtest/gtest.h>

#include <cstdio>
#include <future>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>
#include <thread>

#include "core/file.h"
#include "core/image_io.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "remote/tablet/intrinsics_store.h"
#include "remote/tablet/tablet_image.h"
#include "remote/tablet/tablet_localizer.h"
#include "remote/tablet/tablet_view.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/truth.h"
#include "sim/virtual_rig.h"
#include "tests/remote/virtual_tablet.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"
#include "tracker/family.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int k_width = 640, k_height = 400;
constexpr const char* k_tablet = "tablet-of-ann";

// A session in the studio that has seen and lit the door, and somebody who looks on.
class Room {
 public:
  explicit Room(const fs::path& lens_folder, double resolution = 0.5, double frame_period_s = 1 / 30.0)
      : context_(device::GlContext::create().value()) {
    sim::World world = test::studio_world(resolution);
    setup_.rig = world.rig;
    setup_.scene = *world.scene;
    rig_.emplace(std::move(world),
                 sim::VirtualRigOptions{.frame_period_s = frame_period_s, .grab_waits_for_light = false});
    perception_ = session::Perception::create(setup_.scene, setup_.rig).value();
    session_ = session::Session::create(setup_, nullptr, nullptr, false).value();
    tablet_view_ = TabletView::create(setup_, lens_folder).value();
    for (int i = 0; i < 8; ++i) step();
  }

  // One more of the room's frames.
  void step() {
    const int camera = 0;
    session_->update_percepts(perception_->watch(rig_->expose(std::span(&camera, 1))), ++moments_);
    const session::ComposedFrame& painted =
        session_->compose_and_record(rig_->now(), shifted(rig_->now(), 0.04));
    for (std::size_t k = 0; k < painted.projectors.size(); ++k)
      (void)rig_->projector(static_cast<int>(k)).show(painted.projectors[k]).value();
    tablet_view_->update_session(*session_);
  }

  struct Window {
    json reply;
    cv::Mat image;
    std::vector<std::uint8_t> jpeg;
    std::optional<Eigen::Vector3d> p_viewpoint_world;
  };
  Window draw_window(const std::string& device,
                     std::vector<std::uint8_t> jpeg,
                     TabletViewMode parts = TabletViewMode::as_screen) {
    std::promise<CompositeImage> answered;
    tablet_view_->draw_window({device, "", parts}, std::move(jpeg),
                              [&](CompositeImage seen) { answered.set_value(std::move(seen)); });
    CompositeImage seen = answered.get_future().get();
    Window window{json::parse(seen.json), {}, seen.jpeg, seen.p_viewpoint_world};
    if (!seen.jpeg.empty()) window.image = device::decode_jpeg(seen.jpeg).value();
    return window;
  }

  test::VirtualTablet tablet(std::uint64_t seed, int width = k_width, int height = k_height) {
    return {rig_->world(), session_->composed().projectors, width, height, seed};
  }

  TabletView& tablet_view() { return *tablet_view_; }
  void destroy_tablet_view() { tablet_view_.reset(); }
  session::Session& session() { return *session_; }
  sim::VirtualRig& rig() { return *rig_; }

 private:
  device::GlContext context_;
  session::SessionSetup setup_;
  std::optional<sim::VirtualRig> rig_;
  std::optional<session::Perception> perception_;
  std::optional<session::Session> session_;
  std::unique_ptr<TabletView> tablet_view_;
  std::size_t moments_ = 0;
};

// Points of the parts' meshes in the world, at their true places.
std::vector<Eigen::Vector3d> part_points(const sim::World& world, const scene::PosedScene& posed) {
  std::vector<Eigen::Vector3d> points;
  for (const scene::PosedPart& part : posed.parts) {
    const scene::Slot* slot = world.scene->find_slot(part.slot);
    for (const scene::Variant& variant : slot->variants)
      if (variant.name == part.variant)
        for (const sim::SampledPoint& point : sim::surface_points(variant.mesh, 60, 1))
          points.push_back(part.world_from_part * point.p);
  }
  return points;
}

Imager view_of(const json& reply, const Imager& truth) {
  Imager view = truth;
  view.lens = Lens::create(reply["lens"]["model"], reply["lens"]["values"]).value();
  view.imager_from_world = test::pose_of(reply["view_from_world"]);
  return view;
}

// Where the image that came back differs from the one that was sent.
cv::Mat drawn_mask(const cv::Mat& sent, const cv::Mat& back) {
  constexpr int k_drawn = 40;  // levels, more than JPEG makes of edges
  cv::Mat difference, channels[3], most;
  cv::absdiff(sent, back, difference);
  cv::split(difference, channels);
  cv::max(channels[0], channels[1], most);
  cv::max(most, channels[2], most);
  return most > k_drawn;
}

// Somebody looks round for 10 s: what is drawn lies where it belongs, in exactly the image that was sent.
TEST(Tablet, PartAndImageLieOnEachOtherAfterTenSecondsOfLookingRound) {
  const fs::path folder = test::test_folder();
  Room room(folder / "lenses");
  test::VirtualTablet tablet = room.tablet(8);
  const scene::PosedScene truth = sim::true_poses(room.rig().world());
  const std::vector<Eigen::Vector3d> points = part_points(room.rig().world(), truth);
  const sim::Truth judge(room.rig().world(), truth);
  double squares = 0;
  int count = 0, judged = 0;
  for (int i = 0; i < 100; ++i) {
    const test::TabletShot shot = tablet.shoot(0.1 * i);
    const Room::Window window = room.draw_window(k_tablet, shot.jpeg);
    ASSERT_EQ(window.reply["sees"], "prototype") << i << ": " << window.reply.dump();
    const Imager view = view_of(window.reply, shot.camera);
    double here = 0;
    int seen = 0;
    for (const Eigen::Vector3d& p : points) {
      const auto px = shot.camera.project(p);
      if (!px || !shot.camera.contains(*px)) continue;
      here += (*view.project(p) - *px).squaredNorm();
      ++seen;
    }
    if (i >= 80) squares += here, count += seen;
    // The focal length is as sure as it says it is.
    const double focal_off = view.lens.fx() - shot.camera.lens.fx();
    EXPECT_LT(std::abs(focal_off), 4 * window.reply["lens"]["focal_stddev_px"].get<double>() + 0.15) << i;
    if (i % 33 != 0) continue;
    const double part_px = std::sqrt(here / seen);
    std::printf("%5.1f s: %4.2f px, %d markers, rms %.2f px, focal length %.1f +- %.1f (true %.1f)\n",
                0.1 * i, part_px, window.reply["markers"].get<int>(), window.reply["rms_px"].get<double>(),
                view.lens.fx(), window.reply["lens"]["focal_stddev_px"].get<double>(), shot.camera.lens.fx());
    ASSERT_TRUE(write_png(folder / fmt::format("sent-{}.png", i), shot.image));
    ASSERT_TRUE(write_png(folder / fmt::format("seen-{}.png", i), window.image));
    // The mirror that was drawn, and the one that belongs there.
    const sim::ObjectImage objects = judge.object_image(shot.camera);
    const auto name = std::find(objects.names.begin(), objects.names.end(), "part-mirror");
    ASSERT_NE(name, objects.names.end());
    cv::Mat expected = objects.image == static_cast<int>(name - objects.names.begin());
    if (cv::countNonZero(expected) < 300) continue;
    const cv::Mat found = drawn_mask(device::decode_jpeg(shot.jpeg).value(), window.image);
    ASSERT_TRUE(write_png(folder / fmt::format("drawn-{}.png", i), found));
    cv::Mat around;
    cv::dilate(expected, around, cv::Mat::ones(9, 9, CV_8U));
    EXPECT_LT(cv::countNonZero(found & ~around), 10) << "something else was drawn over";
    if (i == 0) continue;  // the lens is a guess there
    // Its rim is white, its foot may stand before white.
    const cv::Rect is = cv::boundingRect(found), should = cv::boundingRect(expected);
    EXPECT_NEAR(is.x, should.x, 2) << i;
    EXPECT_NEAR(is.y, should.y, 2) << i;
    ++judged;
  }
  std::printf("in the last two seconds: %.2f px RMS; %s\n", std::sqrt(squares / count), folder.c_str());
  EXPECT_LE(std::sqrt(squares / count), 1.5);
  EXPECT_GT(judged, 0);
}

// Where light of the mirror falls in a tablet's image, and where it should for that tablet's eye.
struct LitMirror {
  double off_mm = 0;   // between the middles, at the prototype's distance
  double overlap = 0;  // what is in both, of what is in either
};

// With all between its ends: the glass is hardly lighter than what is behind it.
cv::Mat filled(const cv::Mat& mask) {
  std::vector<cv::Point> points, hull;
  cv::findNonZero(mask, points);
  cv::Mat out = cv::Mat::zeros(mask.size(), CV_8U);
  if (points.empty()) return out;
  cv::convexHull(points, hull);
  cv::fillConvexPoly(out, hull, 255);
  return out;
}

LitMirror lit_mirror(const sim::World& world,
                     std::vector<cv::Mat> shown,
                     const Pose& camera_from_world,
                     const fs::path& kept) {
  constexpr int k_lit = 6;  // levels
  const scene::PosedScene parts = sim::true_poses(world);
  std::vector<cv::Mat> dark;
  for (const cv::Mat& image : shown) dark.push_back(cv::Mat::zeros(image.size(), image.type()));
  test::VirtualTablet with(world, std::move(shown), k_width, k_height, 21),
      without(world, std::move(dark), k_width, k_height, 21);
  const test::TabletShot lit = with.shoot_from(camera_from_world);
  const sim::Truth judge(world, parts);
  const cv::Mat wanted = filled(judge.part_mask(lit.camera, "mirror") == 255);
  cv::Mat lights, either;
  cv::absdiff(lit.image, without.shoot_from(camera_from_world).image, lights);
  cv::blur(lights, lights, {3, 3});  // the noise
  cv::cvtColor(lights, lights, cv::COLOR_BGR2GRAY);
  lights = lights > k_lit;
  lights.setTo(0, judge.part_mask(lit.camera, "trim"));
  cv::morphologyEx(lights, lights, cv::MORPH_OPEN, cv::Mat::ones(5, 5, CV_8U));
  lights = filled(lights);
  EXPECT_TRUE(write_png(kept.string() + ".png", lit.image));
  EXPECT_TRUE(write_png(kept.string() + "-light.png", lights));
  cv::bitwise_or(lights, wanted, either);
  const cv::Moments a = cv::moments(lights, true), b = cv::moments(wanted, true);
  if (a.m00 < 1 || b.m00 < 1) return {1e3, 0};
  const double off_px = std::hypot(a.m10 / a.m00 - b.m10 / b.m00, a.m01 / a.m00 - b.m01 / b.m00);
  const double away_m = (camera_from_world * world.world_from_prototype.translation).z();
  return {1e3 * off_px * away_m / lit.camera.lens.fx(),
          1.0 * cv::countNonZero(lights & wanted) / cv::countNonZero(either)};
}

// Light shows view parts to a tablet's eye while that is wanted and known, and comes and goes calmly.
TEST(Tablet, ViewPartsAreDrawnForATabletThatIsFollowed) {
  const fs::path folder = test::test_folder();
  constexpr double k_period_s = 0.1;
  Room room(folder / "lenses", 0.25, k_period_s);
  session::Session& session = room.session();
  const sim::World& world = room.rig().world();
  test::VirtualTablet tablet = room.tablet(6);
  for (int i = 0; i < 4; ++i) room.draw_window(k_tablet, tablet.shoot(1.2 * i).jpeg);  // the lens
  const Eigen::Vector3d p_middle = world.world_from_prototype.translation;
  const Pose aside = looking_at(p_middle + Eigen::Vector3d(-0.5, -0.55, 0.1), p_middle, {0, 0, 1});
  const Room::Window seen = room.draw_window(k_tablet, tablet.shoot_from(aside).jpeg);
  ASSERT_TRUE(seen.p_viewpoint_world.has_value()) << seen.reply.dump();
  const Eigen::Vector3d p_tablet = aside.inverse().translation,
                        p_own =
                            session.setup().scene.viewers[0].fixed->imager_from_world.inverse().translation;
  EXPECT_LT((*seen.p_viewpoint_world - p_tablet).norm(), 0.01);

  // Nobody has asked for it.
  for (int i = 0; i < 3; ++i) {
    session.note_tablet("Ann", seen.p_viewpoint_world, room.rig().now());
    room.step();
  }
  EXPECT_FALSE(session.composed().p_guest_eye_world.has_value());
  EXPECT_EQ(session.windows(), std::set<std::string>{"Ann"});
  const LitMirror before =
      lit_mirror(world, session.composed().projectors, aside, folder / "lit-for-its-own-viewer");

  // Followed: what else is seen of other guests does not matter.
  ASSERT_TRUE(session.edit({"viewer", "", "Ann"}, "Ben", room.rig().now()).ok());
  Eigen::Vector3d p_before = p_own;
  double farthest_m = 0;
  const auto steps = [&](int count, bool is_seen) {
    for (int i = 0; i < count; ++i) {
      if (is_seen) session.note_tablet("Ann", seen.p_viewpoint_world, room.rig().now());
      session.note_tablet("Ben", p_middle + Eigen::Vector3d(1, -1, 0), room.rig().now());
      room.step();
      const Eigen::Vector3d p_now = session.composed().p_guest_eye_world.value_or(p_own);
      farthest_m = std::max(farthest_m, (p_now - p_before).norm());
      p_before = p_now;
    }
  };
  steps(11, true);
  EXPECT_EQ(session.composed().follows, "Ann");
  EXPECT_LT((p_before - *seen.p_viewpoint_world).norm(), 1e-6);
  const LitMirror followed =
      lit_mirror(world, session.composed().projectors, aside, folder / "lit-for-the-tablet");
  std::printf("light of the mirror: %.1f mm off, overlap %.2f; followed %.1f mm, %.2f; eye %.1f mm off; %s\n",
              before.off_mm, before.overlap, followed.off_mm, followed.overlap,
              1e3 * (*seen.p_viewpoint_world - p_tablet).norm(), folder.c_str());
  EXPECT_GT(before.off_mm, 15);
  EXPECT_LT(before.overlap, 0.6);
  EXPECT_LT(followed.off_mm, 2);
  EXPECT_GT(followed.overlap, 0.85);

  // The tablet is silent: after a second the eye goes back, never at once.
  steps(8, false);
  EXPECT_EQ(session.composed().follows, "Ann");
  steps(2, false);
  EXPECT_EQ(session.composed().follows, "");
  EXPECT_TRUE(session.composed().p_guest_eye_world.has_value());
  steps(9, false);
  EXPECT_FALSE(session.composed().p_guest_eye_world.has_value());
  EXPECT_LT(farthest_m, 1.05 * (p_own - p_tablet).norm() / 0.8 * k_period_s) << "of 0.8 s for the whole way";
  // It comes again and its window is closed.
  steps(3, true);
  EXPECT_EQ(session.composed().follows, "Ann");
  session.note_tablet("Ann", std::nullopt, room.rig().now());
  steps(1, false);
  EXPECT_EQ(session.composed().follows, "");
  EXPECT_EQ(session.windows(), std::set<std::string>{"Ben"});
}

// What a window draws is its guest's choice; left of the session's split it shows the other look, as screens
// do.
TEST(Tablet, AWindowShowsWhatItsGuestChoseAndTheSessionsSplit) {
  const fs::path folder = test::test_folder();
  Room room(folder / "lenses", 0.25);
  session::Session& session = room.session();
  const auto edit = [&](const char* action, const char* slot, const char* value) {
    const Status done = session.edit({action, slot, value}, "Ben", room.rig().now());
    EXPECT_TRUE(done.ok()) << done.message();
    room.tablet_view().update_session(session);
  };
  test::VirtualTablet tablet = room.tablet(7);
  for (int i = 0; i < 4; ++i) room.draw_window(k_tablet, tablet.shoot(1.2 * i).jpeg);  // the lens
  const Eigen::Vector3d p_middle = room.rig().world().world_from_prototype.translation;
  const test::TabletShot shot = tablet.shoot_from(
      looking_at(p_middle + Eigen::Vector3d(-0.1, -0.7, 0.1), p_middle, Eigen::Vector3d::UnitZ()));
  const cv::Mat sent = device::decode_jpeg(shot.jpeg).value();
  const auto shown = [&](const char* name, TabletViewMode parts) {
    cv::Mat image = room.draw_window(k_tablet, shot.jpeg, parts).image;
    EXPECT_TRUE(write_png(folder / (std::string(name) + ".png"), image));
    return image;
  };
  const cv::Rect mirror = cv::boundingRect(
      sim::Truth(room.rig().world(), sim::true_poses(room.rig().world())).part_mask(shot.camera, "mirror"));
  const auto pixels = [&](const cv::Mat& image) {
    return cv::countNonZero(drawn_mask(sent(mirror), image(mirror)));
  };

  // The mirror's light is for another eye: as the screen, whole.
  const cv::Mat classic = shown("full", TabletViewMode::full);
  EXPECT_NEAR(pixels(shown("as-screen", TabletViewMode::as_screen)), pixels(classic), 0.05 * pixels(classic));
  const int rest = pixels(shown("rest", TabletViewMode::rest));
  EXPECT_LT(rest, 0.7 * pixels(classic));
  EXPECT_GT(rest, 100);

  edit("save_look", "", "classic");
  edit("choose_variant", "mirror", "sport");
  edit("save_look", "", "sport");
  const cv::Mat sport = shown("sport", TabletViewMode::full);
  EXPECT_GT(cv::countNonZero(drawn_mask(classic, sport)), 300);
  edit("split", "", "on");
  const cv::Mat left = shown("left-of-the-split", TabletViewMode::full);  // as the mirror is
  edit("split_at", "", "-440");
  const cv::Mat right = shown("right-of-the-split", TabletViewMode::full);
  // But for the line and what JPEG makes of it.
  const auto apart = [](const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(drawn_mask(a, b)); };
  EXPECT_LT(10 * apart(left, classic), apart(left, sport));
  EXPECT_LT(10 * apart(right, sport), apart(right, classic));
}

// What is no image, or too much of one, is refused, and everybody gets an answer.
// After a repair the room's image is drawn by the camera's new place.
TEST(Tablet, AMendedRigIsDrawnWith) {
  const fs::path folder = test::test_folder();
  Room room(folder / "lenses", 0.25);
  const auto image = [&](TabletView* tablet_view) {
    tablet_view->update_session(room.session());
    std::promise<CompositeImage> answered;
    tablet_view->draw_room([&](CompositeImage seen) { answered.set_value(std::move(seen)); });
    return device::decode_jpeg(answered.get_future().get().jpeg).value();
  };
  const cv::Mat before = image(&room.tablet_view());
  Rig mended = room.session().setup().rig;
  mended.cameras[0].imager_from_world.translation.x() += 0.05;
  ASSERT_TRUE(room.session().replace_rig(mended, room.rig().now()));
  const cv::Mat after = image(&room.tablet_view());
  EXPECT_GT(cv::countNonZero(drawn_mask(before, after)), 50);
  const auto fresh = TabletView::create(room.session().setup(), folder / "lenses").value();
  EXPECT_EQ(cv::countNonZero(drawn_mask(image(fresh.get()), after)), 0);
}

TEST(Tablet, WhatCannotBeLookedAtIsAnsweredWithWhy) {
  Room room(test::test_folder() / "lenses");
  test::VirtualTablet tablet = room.tablet(3);
  const test::TabletShot shot = tablet.shoot(0);
  const auto reply = [&](const std::string& device, std::vector<std::uint8_t> jpeg) {
    const Room::Window window = room.draw_window(device, std::move(jpeg));
    EXPECT_TRUE(window.jpeg.empty());
    EXPECT_EQ(window.reply["sees"], "nothing");
    EXPECT_FALSE(window.reply.contains("view_from_world"));
    return window.reply["why"].get<std::string>();
  };
  const std::string text = "<html>not a picture</html>";
  EXPECT_NE(reply(k_tablet, {}).find("something else"), std::string::npos);
  EXPECT_NE(reply(k_tablet, {text.begin(), text.end()}).find("something else"), std::string::npos);
  EXPECT_NE(reply(k_tablet, std::vector<std::uint8_t>(20 << 20, 0xff)).find("at most 4 MB"),
            std::string::npos);
  std::vector<std::uint8_t> half = shot.jpeg;
  half.resize(half.size() / 2);
  EXPECT_NE(reply(k_tablet, half).find("truncated or damaged"), std::string::npos);
  EXPECT_NE(reply(k_tablet, device::encode_jpeg(cv::Mat(16, 5000, CV_8U, cv::Scalar(9)), 50)).find("5000x16"),
            std::string::npos);
  std::vector<std::uint8_t> scans = shot.jpeg;
  for (int i = 0; i < 500; ++i) scans.insert(scans.end(), {0xff, 0xda});
  EXPECT_NE(reply(k_tablet, scans).find("scans"), std::string::npos);
  EXPECT_NE(reply("../../etc", shot.jpeg).find("device"), std::string::npos);
  EXPECT_NE(reply(k_tablet, device::encode_jpeg(cv::Mat(1, 1, CV_8U, cv::Scalar(9)), 50)).find("No markers"),
            std::string::npos);
  // A wall: no markers. The room's image stands in.
  const Pose aside = looking_at({0, -1, 0.5}, {0, -3, 0.5}, Eigen::Vector3d::UnitZ());
  EXPECT_NE(reply(k_tablet, tablet.shoot_from(aside).jpeg).find("No markers"), std::string::npos);
  std::promise<CompositeImage> answered;
  room.tablet_view().draw_room([&](CompositeImage seen) { answered.set_value(std::move(seen)); });
  const CompositeImage seen = answered.get_future().get();
  EXPECT_EQ(json::parse(seen.json)["why"], "");
  const auto image = device::decode_jpeg(seen.jpeg);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->size(), cv::Size(960, 540));
  ASSERT_TRUE(write_png(test::test_folder() / "room.png", *image));
  // After all that an image is an image; a large one comes back smaller.
  EXPECT_EQ(room.draw_window(k_tablet, shot.jpeg).image.size(), cv::Size(k_width, k_height));
  test::VirtualTablet large = room.tablet(3, 2560, 1600);
  const Room::Window window = room.draw_window(k_tablet, large.shoot(0).jpeg);
  EXPECT_EQ(window.reply["sees"], "prototype") << window.reply.dump();
  EXPECT_EQ(window.image.size(), cv::Size(1280, 800));
}

// Images that come faster than they can be drawn: the newest wins, and everybody is answered once.
TEST(Tablet, TheNewestImageOfADeviceWinsAndAllAreAnswered) {
  const fs::path lenses = test::test_folder() / "lenses";
  Room room(lenses);
  test::VirtualTablet tablet = room.tablet(5);
  const test::TabletShot one = tablet.shoot(0), other = tablet.shoot(1.7);
  constexpr int k_images = 12;
  struct Answers {
    std::mutex mutex;
    std::vector<std::vector<json>> reply = std::vector<std::vector<json>>(2 * k_images);
    int count = 0;
  } answers;
  for (int i = 0; i < 2 * k_images; ++i) {
    const bool is_one = i % 2 == 0;
    room.tablet_view().draw_window(
        {is_one ? "tablet-one" : "tablet-other"}, is_one ? one.jpeg : other.jpeg,
        [&answers, i](const CompositeImage& seen) {
          const std::lock_guard lock(answers.mutex);
          answers.reply[static_cast<std::size_t>(i)].push_back(json::parse(seen.json));
          ++answers.count;
        });
  }
  for (int i = 0; i < 600; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const std::lock_guard lock(answers.mutex);
    if (answers.count == 2 * k_images) break;
  }
  int drawn = 0;
  for (int i = 0; i < 2 * k_images; ++i) {
    const auto& reply = answers.reply[static_cast<std::size_t>(i)];
    ASSERT_EQ(reply.size(), 1u) << i;
    if (reply[0]["sees"] == "nothing") {
      EXPECT_LT(i, 2 * k_images - 2) << "the newest";
      continue;
    }
    ++drawn;
    const Imager& truth = (i % 2 == 0 ? one : other).camera;
    EXPECT_TRUE(
        test::pose_near(test::pose_of(reply[0]["view_from_world"]), truth.imager_from_world, 0.05, 0.1));
  }
  EXPECT_LT(drawn, 2 * k_images);
  // What still waits at the end is told so.
  std::promise<CompositeImage> late;
  room.tablet_view().draw_window({k_tablet}, one.jpeg, [](const CompositeImage&) {});
  room.tablet_view().draw_window({"tablet-late"}, one.jpeg,
                                 [&](CompositeImage seen) { late.set_value(std::move(seen)); });
  room.destroy_tablet_view();
  EXPECT_EQ(late.get_future().wait_for(std::chrono::seconds(0)), std::future_status::ready);
  // What was found of the lenses is kept.
  EXPECT_EQ(load_lenses(lenses, "tablet-one").size(), 1u);
  EXPECT_EQ(load_lenses(lenses, "tablet-nobody").size(), 0u);
}

TEST(Tablet, AMarkerThatIsBeingMovedIsPlacedByTheGuestsOwnImage) {
  sim::World world = test::studio_world();
  const scene::Scene scene = *world.scene;
  const std::vector<Body> bodies = scene::bodies(scene);
  // What the session takes to be true.
  std::vector<Track> tracks;
  for (const Body& body : bodies) {
    Track track;
    track.body = body.name;
    track.world_from_body = body.name == "prototype" ? world.world_from_prototype
                                                     : *sim::world_from_marker(world, body.markers[0].marker);
    tracks.push_back(track);
  }
  // A hand has moved the mirror's marker since: 40 mm along the door, and off it.
  const MarkerName moved = MarkerName::parse("aruco_4x4_50:0").value();
  const Eigen::Vector3d way(0.04, -0.03, 0);
  for (const sim::PlacedMarker& placed : world.markers)
    if (placed.marker == moved) world.find(placed.object)->world_from_object.translation += way;
  std::vector<cv::Mat> white;
  for (const Imager& p : world.rig.projectors)
    white.emplace_back(p.height, p.width, CV_8UC3, cv::Scalar::all(150));
  test::VirtualTablet tablet(world, white, k_width, k_height, 4);
  TabletLocalizer localizer(tracker::Families::load(tracker::families_of(bodies), scene.folder).value());
  int found = 0;
  for (int i = 0; i < 12; ++i) {
    const test::TabletShot shot = tablet.shoot(0.4 * i);
    const TabletPose pose = localizer.localize(shot.image, bodies, tracks);
    localizer.update_intrinsics();
    ASSERT_TRUE(pose.view.has_value()) << pose.why;
    if (i < 4) continue;  // the lens is new
    EXPECT_TRUE(test::pose_near(pose.view->imager_from_world, shot.camera.imager_from_world, 0.005, 0.004));
    for (const Track& track : pose.moved) {
      EXPECT_EQ(track.body, "mirror");
      EXPECT_LT((track.world_from_body.translation - tracks[1].world_from_body.translation - way).norm(),
                0.01);
      ++found;
    }
  }
  EXPECT_GE(found, 3);
  EXPECT_EQ(tracks[1].body, "mirror");
}

TEST(Tablet, LensesThatAreKeptAreThereAgainAndDamagedOnesAreNot) {
  const fs::path folder = test::test_folder();
  calib::IntrinsicsEstimate lens = calib::prior_intrinsics(1280, 800);
  lens.views = 17;
  lens.covariance(0, 3) = lens.covariance(3, 0) = 0.1;
  ASSERT_TRUE(save_lenses(folder, "tablet-one", {lens}));
  const auto again = load_lenses(folder, "tablet-one");
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].values, lens.values);
  EXPECT_EQ(again[0].covariance, lens.covariance);
  EXPECT_EQ(again[0].views, 17);
  const std::string whole = read_file(folder / "tablet-one.json").value();
  for (const std::string& damaged : {std::string("{"), whole.substr(0, whole.size() / 2),
                                     std::string(R"({"schema": "limn.guest_lens/1", "lenses": [{}]})"),
                                     std::regex_replace(whole, std::regex("1280"), "-1280")}) {
    ASSERT_TRUE(write_file(folder / "tablet-one.json", damaged));
    EXPECT_TRUE(load_lenses(folder, "tablet-one").empty()) << damaged;
  }
  EXPECT_FALSE(is_device_name("short"));
  EXPECT_FALSE(is_device_name("../tablet-one"));
  EXPECT_FALSE(is_device_name(std::string(65, 'a')));
  EXPECT_TRUE(is_device_name("tablet-1-Ann"));
}

}  // namespace
}  // namespace limn::remote
