// Markers that carry nothing are paired with parts; two looks are compared; the grid is drawn.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "apps/live.h"
#include "apps/replay.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "scene/part_units.h"
#include "session/session.h"
#include "sim/ray_scene.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"
#include "tests/tracker/marker_images.h"
#include "tracker/marker_image.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const MarkerName k_nine{"aruco_4x4_50", "9"};
const Eigen::Vector3d k_laid(0.12, -0.03, 0.052);  // in the door's frame

// Copies the studio into a folder (world.json and door/) and adds a marker on the door that carries nothing.
fs::path studio_in(const fs::path& folder) {
  test::copy_studio_to(folder);
  json world = test::read_json(folder / "world.json");
  json place = world["slot_markers"]["trim"];
  for (std::size_t i = 0; i < 3; ++i)
    place["prototype_from_marker"]["translation_m"][i] = k_laid[static_cast<Eigen::Index>(i)];
  place["name"] = k_nine.text();
  place["size_mm"] = 40;
  world["loose_markers"] = json::array({place});
  return test::write_json(folder / "world.json", world);
}

// The last position of a part in poses.csv, mm in the prototype's frame.
Eigen::Vector3d last_place(const fs::path& csv, const std::string& slot) {
  std::ifstream file(csv);
  Eigen::Vector3d mm = Eigen::Vector3d::Constant(NAN);
  for (std::string line; std::getline(file, line);) {
    const auto at = line.find("," + slot + ",");
    if (at == std::string::npos) continue;
    const auto numbers = line.find(',', at + slot.size() + 2);
    EXPECT_EQ(std::sscanf(line.c_str() + numbers, ",%lf,%lf,%lf", &mm.x(), &mm.y(), &mm.z()), 3) << line;
  }
  return mm;
}

// The depth and tilt of a small marker vary by more than the 5 mm below which a marker counts as still.
TEST(Pairing, AMarkerThatLiesIsOfferedUntilItIsTakenAway) {
  auto rng = test::test_rng();
  const auto scene = scene::load_scene(fs::path(LIMN_SOURCE_DIR) / "config/scenes/door");
  ASSERT_TRUE(scene) << scene.message();
  Rig rig;
  rig.cameras = {{"camera0", 640, 480, Lens::pinhole(600, 600, 319.5, 239.5), Pose{}}};
  Perception perception = Perception::create(*scene, rig).value();
  const cv::Mat ground(480, 640, CV_8UC1, cv::Scalar(90));
  const Pose laid(exp_rotation({0.3, 0.1, 0}), {0, 0, 0.6});
  double now = 0;
  const auto see = [&](const Eigen::Vector3d& beside) {
    test::PlacedMarker marker{k_nine, laid};
    marker.camera_from_marker.translation += beside;
    marker.size_m = scene::first_marker_size_m(*scene);
    now += 1 / 30.0;
    const cv::Mat image = test::image_of(rig.cameras[0].lens, ground, std::span(&marker, 1), {}, rng);
    const Frame frame{"camera0", image, shifted(Stamp{}, now)};
    const Percepts& percepts = perception.watch(std::span(&frame, 1));
    return percepts.loose.empty() ? now : seconds_between(Stamp{}, percepts.loose[0].still_since);
  };
  double since = 0;
  while (now < 2) since = see({0, 0, 0});
  ASSERT_GE(now - since, k_lies_after_s);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(see({0, 0, i % 20 < 10 ? 0.007 : 0}), since) << now;
  for (int i = 0; i < 10; ++i) see({0.03, 0, 0});
  EXPECT_GT(see({0.03, 0, 0}), since);
}

TEST(Pairing, AMarkerThatLiesStillIsPairedAndStaysSo) {
  const fs::path folder = test::test_folder();
  apps::LiveOptions options;
  options.world = studio_in(folder);
  options.resolution = 0.5;
  options.out = folder / "out";
  options.record = folder / "recording";
  const json pair = {{"action", "pair"}, {"slot", "mirror"}};
  ASSERT_TRUE(write_file(folder / "script.json", json({{"schema", "limn.script/1"},
                                                       {"seconds", 1.7},
                                                       {"events",
                                                        {{{"at_s", 0.6}, {"edit", pair}},  // too early
                                                         {{"at_s", 1.5}, {"edit", pair}}}}})
                                                     .dump()));
  options.script = folder / "script.json";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const std::string page = read_file(folder / "out/session.html").value();
  EXPECT_NE(page.find("pair mirror aruco_4x4_50:9 (script)"), std::string::npos);
  const auto first = page.find("pair mirror");
  EXPECT_EQ(page.find("pair mirror", first + 1), std::string::npos);
  // The part is at the marker, displaced by its marker_from_part.
  const auto scene = scene::load_scene(folder / "door");
  ASSERT_TRUE(scene);
  const double offset_mm = 1e3 * scene->find_slot("mirror")->marker_from_part.translation.norm();
  EXPECT_NEAR((last_place(folder / "out/poses.csv", "mirror") - 1e3 * k_laid).norm(), offset_mm, 3);
  EXPECT_EQ(test::read_json(folder / "door/pairings.json")["slots"]["mirror"], k_nine.text());

  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();

  // The next session keeps the pairing until it is undone.
  apps::LiveOptions next = options;
  next.record.clear();
  next.out = folder / "next";
  ASSERT_TRUE(
      write_file(folder / "script.json", R"({"schema": "limn.script/1", "seconds": 0.5, "events": []})"));
  ASSERT_TRUE(apps::run_live(next).ok());
  EXPECT_NEAR((last_place(folder / "next/poses.csv", "mirror") - 1e3 * k_laid).norm(), offset_mm, 3);
  ASSERT_TRUE(write_file(folder / "script.json",
                         R"({"schema": "limn.script/1", "seconds": 0.3, "events": [
                             {"at_s": 0.1, "edit": {"action": "unpair", "slot": "mirror"}}]})"));
  next.out = folder / "last";
  ASSERT_TRUE(apps::run_live(next).ok());
  EXPECT_GT((last_place(folder / "last/poses.csv", "mirror") - 1e3 * k_laid).norm(), 100);
  EXPECT_FALSE(fs::exists(folder / "door/pairings.json"));
}

// A session that is stepped by the test, with the ground truth.
class ASession : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = test::test_folder();
    auto world = sim::load_world(studio_in(folder_), tracker::marker_image);
    ASSERT_TRUE(world) << world.message();
    ASSERT_TRUE(scale_resolution(0.5, &world->rig).ok());
    setup_.rig = world->rig;
    setup_.scene = *world->scene;
    setup_.paint.refill = false;
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    auto perception = Perception::create(setup_.scene, setup_.rig, setup_.watch);
    ASSERT_TRUE(perception) << perception.message();
    perception_.emplace(std::move(*perception));
    auto telemetry = Telemetry::create({});
    ASSERT_TRUE(telemetry);
    telemetry_.emplace(std::move(*telemetry));
    auto session = Session::create(setup_, &*telemetry_, nullptr);
    ASSERT_TRUE(session) << session.message();
    session_.emplace(std::move(*session));
    world_ = *world;
    rig_ = std::make_unique<sim::VirtualRig>(std::move(*world),
                                             sim::VirtualRigOptions{.grab_waits_for_light = false});
  }

  void watch(int moments) {
    for (int i = 0; i < moments; ++i) {
      const int camera = 0;
      session_->update_percepts(perception_->watch(rig_->expose(std::span(&camera, 1))), ++moments_);
    }
  }

  cv::Mat painted(std::size_t projector = 0) {
    return session_->compose_and_record(rig_->now(), rig_->now()).projectors[projector].clone();
  }

  void edit(const std::string& action, const std::string& slot, const std::string& value) {
    const Status done = session_->edit({action, slot, value}, "test", rig_->now());
    ASSERT_TRUE(done.ok()) << done.message();
  }

  // The true surface point of the prototype under a projector's pixel, in its frame; nullopt: none.
  struct Under {
    Eigen::Vector3d p, n;
  };
  std::optional<Under> point_under(std::size_t projector, int x, int y) {
    const auto ray = setup_.rig.projectors[projector].ray(Eigen::Vector2d(x, y));
    if (!ray) return std::nullopt;
    const sim::Hit hit = rays().first_hit(*ray);
    if (hit.object != 0) return std::nullopt;
    const Pose prototype_from_world = world_.world_from_prototype.inverse();
    return Under{prototype_from_world * (ray->p_origin + hit.distance * ray->d),
                 prototype_from_world.rotation * rays().face_normal(hit)};
  }

  // The pixels that are kept dark for markers.
  bool is_by_a_marker(const Eigen::Vector3d& p) {
    for (const sim::PlacedMarker& placed : world_.markers) {
      const Pose world_from_marker = world_.find(placed.object)->world_from_object;
      const Eigen::Vector3d p_marker = world_.world_from_prototype.inverse() * world_from_marker.translation;
      if ((p - p_marker).norm() < 1.2 * placed.size_m) return true;
    }
    return false;
  }

  const sim::RayScene& rays() {
    if (!rays_) {
      placed_ = {&world_.scene->prototype->mesh, world_.world_from_prototype};
      rays_ = std::make_unique<sim::RayScene>(std::span(&placed_, 1));
    }
    return *rays_;
  }

  fs::path folder_;
  SessionSetup setup_;
  sim::World world_;
  std::optional<device::GlContext> context_;
  std::optional<Perception> perception_;
  std::optional<Telemetry> telemetry_;
  std::optional<Session> session_;
  std::unique_ptr<sim::VirtualRig> rig_;
  sim::MeshInstance placed_;
  std::unique_ptr<sim::RayScene> rays_;
  std::size_t moments_ = 0;
};

TEST_F(ASession, AMarkerGlowsOnceItLiesStillForASecond) {
  watch(30);
  EXPECT_TRUE(waiting_markers(setup_.scene, session_->show_state(), session_->percepts()).empty());
  const cv::Mat before[2] = {painted(0), painted(1)};
  EXPECT_FALSE(session_->edit({"pair", "mirror", ""}, "test", rig_->now()).ok());
  watch(8);
  const auto waiting = waiting_markers(setup_.scene, session_->show_state(), session_->percepts());
  ASSERT_EQ(waiting.size(), 1u);
  EXPECT_EQ(waiting[0].marker, k_nine);
  const Eigen::Vector3d p_true = world_.world_from_prototype * k_laid;
  EXPECT_TRUE(test::near(waiting[0].world_from_marker.translation, p_true, 0.01));
  // A ring of light surrounds the marker, from one projector.
  int lit = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const cv::Mat after = painted(i);
    EXPECT_TRUE(write_png(folder_ / fmt::format("glow-{}.png", i), after).ok());
    cv::Mat more;
    cv::subtract(after, before[i], more);
    const Eigen::Vector2d middle = *setup_.rig.projectors[i].project(p_true);
    const double side_px =
        (*setup_.rig.projectors[i].project(p_true + 0.04 * Eigen::Vector3d::UnitX()) - middle).norm();
    int changed = 0, near = 0;
    for (int y = 0; y < more.rows; ++y)
      for (int x = 0; x < more.cols; ++x) {
        if (more.at<cv::Vec3b>(y, x)[0] < 100) continue;
        ++changed;
        const double away = (Eigen::Vector2d(x, y) - middle).norm() / side_px;
        near += away > 0.8 && away < 1.8;
      }
    EXPECT_EQ(near, changed);
    lit += changed > 50;
  }
  EXPECT_EQ(lit, 1);
  edit("pair", "mirror", "");
  EXPECT_TRUE(waiting_markers(setup_.scene, session_->show_state(), session_->percepts()).empty());
}

TEST_F(ASession, AGridOfMillimetresLiesOnThePrototype) {
  watch(3);
  const cv::Mat plain = painted();
  edit("grid", "", "on");
  const cv::Mat with = painted();
  EXPECT_TRUE(write_png(folder_ / "grid.png", with).ok());
  cv::Mat more;
  cv::subtract(with, plain, more);
  // Near edges the other projector takes over.
  const auto is_at_an_edge = [&](int x, int y) {
    constexpr int k_beside = 40;
    return !point_under(0, x - k_beside, y) || !point_under(0, x + k_beside, y) ||
           !point_under(0, x, y - k_beside) || !point_under(0, x, y + k_beside);
  };
  int on = 0, off = 0, lines = 0, between = 0, astray = 0, lit = 0;
  for (int y = 2; y < more.rows; y += 3)
    for (int x = 2; x < more.cols; x += 3) {
      const bool is_lit = more.at<cv::Vec3b>(y, x)[0] > 20;
      lit += is_lit;
      const auto under = point_under(0, x, y);
      astray += is_lit && !under;
      // The door's front faces along z, so there are lines of x and y. Parts and markers keep their pixels.
      if (!under || std::abs(under->n.z()) < 0.9 || cv::norm(plain.at<cv::Vec3b>(y, x)) > 0 ||
          is_by_a_marker(under->p) || is_at_an_edge(x, y))
        continue;
      const auto away_mm = [](double m) { return 1e3 * std::abs(m - 0.01 * std::round(m / 0.01)); };
      const double away = std::min(away_mm(under->p.x()), away_mm(under->p.y()));
      if (away < 0.3) ++lines, on += is_lit;
      if (away > 3) ++between, off += !is_lit;
    }
  std::printf("%d of %d pixels on lines are lit, %d of %d between them are not; %d of %d beside the door\n",
              on, lines, off, between, astray, lit);
  ASSERT_GT(lines, 150);
  ASSERT_GT(between, 200);
  EXPECT_GT(on, 0.95 * lines);
  EXPECT_GT(off, 0.95 * between);
  EXPECT_LT(astray, 0.01 * lit);
}

TEST_F(ASession, TwoLooksStandOnTheTwoSidesOfALine) {
  watch(3);
  painted();
  edit("save_look", "", "A");
  edit("next_variant", "mirror", "");
  edit("nudge", "trim", "0 30 0");
  painted();
  edit("save_look", "", "B");
  const auto calm = [&] {  // after the names of variants have faded
    painted();
    watch(45);
    return painted();
  };
  edit("restore_look", "", "A");
  const cv::Mat a = calm();
  edit("flip", "", "");
  const cv::Mat b = calm();
  const auto other_pixels = [](const cv::Mat& one, const cv::Mat& two) {
    cv::Mat off;
    cv::absdiff(one, two, off);
    return cv::countNonZero(off.reshape(1) > 60);
  };
  EXPECT_GT(other_pixels(a, b), 3000);
  edit("flip", "", "");
  EXPECT_LT(other_pixels(a, calm()), 0.02 * other_pixels(a, b));  // edges vary with tracking noise
  edit("flip", "", "");
  edit("split", "", "on");
  edit("split_at", "", "-40");
  const cv::Mat split = calm();
  for (const auto& [name, image] : {std::pair{"a", a}, {"b", b}, {"split", split}})
    EXPECT_TRUE(write_png(folder_ / fmt::format("{}.png", name), image).ok());
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : setup_.scene.prototype->mesh.positions) box.extend(p);
  const double line_m = static_cast<double>(box.center().x()) - 0.040;
  int left = 0, right = 0, wrong = 0;
  for (int y = 0; y < split.rows; ++y)
    for (int x = 0; x < split.cols; ++x) {
      if (cv::norm(a.at<cv::Vec3b>(y, x), b.at<cv::Vec3b>(y, x), cv::NORM_INF) < 60)
        continue;  // the same in both
      const auto under = point_under(0, x, y);
      if (!under || std::abs(under->p.x() - line_m) < 0.002) continue;
      const bool is_left = under->p.x() < line_m;
      ++(is_left ? left : right);
      const cv::Mat& wanted = is_left ? a : b;
      wrong += cv::norm(split.at<cv::Vec3b>(y, x), wanted.at<cv::Vec3b>(y, x), cv::NORM_INF) > 30;
    }
  std::printf("left %d, right %d, wrong %d\n", left, right, wrong);
  EXPECT_GT(left, 100);
  EXPECT_GT(right, 100);
  EXPECT_LT(wrong, 0.02 * (left + right));
}

TEST_F(ASession, SplitsTheScreenAsTheSurface) {
  const auto screen = [&](const char* name) {
    watch(3);
    painted();
    const cv::Mat image = session_->screen();
    EXPECT_TRUE(write_png(folder_ / fmt::format("screen-{}.png", name), image).ok());
    return image.clone();
  };
  watch(3);
  painted();
  edit("screen", "", "view");
  edit("choose_variant", "mirror", "classic");
  watch(3);
  painted();
  edit("save_look", "", "A");
  const cv::Mat a = screen("a");
  edit("choose_variant", "mirror", "sport");
  watch(3);
  painted();
  edit("save_look", "", "B");
  const cv::Mat b = screen("b");
  // The line goes through the middle of the area where the looks differ.
  edit("split", "", "on");
  int crossed = 0;
  for (double mm = -280; mm <= -120; mm += 40) {
    edit("split_at", "", fmt::format("{}", mm));
    const cv::Mat split = session_->screen();
    int of_a = 0, of_b = 0, of_neither = 0;
    double x_a = 0, x_b = 0;
    for (int y = 0; y < split.rows; ++y)
      for (int x = 0; x < split.cols; ++x) {
        const auto &at = split.at<cv::Vec3b>(y, x), &at_a = a.at<cv::Vec3b>(y, x),
                   &at_b = b.at<cv::Vec3b>(y, x);
        if (cv::norm(at_a, at_b, cv::NORM_INF) < 60) continue;
        const bool is_a = cv::norm(at, at_a, cv::NORM_INF) < 30, is_b = cv::norm(at, at_b, cv::NORM_INF) < 30;
        of_a += is_a;
        of_b += is_b;
        x_a += is_a * x;
        x_b += is_b * x;
        of_neither += !is_a && !is_b;
      }
    if (of_a > 100 && of_b > 100) {
      ++crossed;
      if (crossed == 2) screen("split");
      EXPECT_LT(x_a / of_a, x_b / of_b) << "look A is on the left";
      EXPECT_LT(of_neither, 0.1 * (of_a + of_b));
    }
  }
  EXPECT_GE(crossed, 3);
}

TEST_F(ASession, AsksForTheUnitOfWhatIsDroppedAndTakesTheAnswer) {
  const fs::path slot = folder_ / "door/slots/mirror";
  fs::create_directories(slot);
  ASSERT_TRUE(
      write_file(slot / "new part.obj", "v 0 0 0\nv 149 0 0\nv 0 60 0\nv 0 0 30\nf 1 2 3\nf 1 2 4\n"));
  auto scene = scene::load_scene(folder_ / "door");
  ASSERT_TRUE(scene) << scene.message();
  const auto long_side = [](const scene::Scene& loaded) {
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3f& p : loaded.find_slot("mirror")->variants.back().mesh.positions) box.extend(p);
    return box.sizes().maxCoeff();
  };
  const float guessed = long_side(*scene);
  ASSERT_TRUE(session_->replace_scene(*scene, rig_->now()).ok());
  const fs::path page = folder_ / "page.html";
  ASSERT_TRUE(telemetry_->write_page(page, "x").ok());
  EXPECT_NE(read_file(page).value().find("is assumed to be in mm, 149 mm long."), std::string::npos);
  edit("units", "mirror", "new part cm");
  session_->store().finish();
  scene = scene::load_scene(folder_ / "door");
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_NEAR(long_side(*scene) / guessed, 10, 1e-4);
  EXPECT_EQ(scene::units_question(*scene->find_slot("mirror"), scene->find_slot("mirror")->variants.back()),
            "");
  ASSERT_TRUE(
      write_file(slot / "units.json", R"({"schema": "limn.units/1", "units": {"new part": "mile"}})"));
  scene = scene::load_scene(folder_ / "door");
  ASSERT_FALSE(scene);
  EXPECT_NE(scene.message().find("units.new part"), std::string::npos) << scene.message();
}

}  // namespace
}  // namespace limn::session
