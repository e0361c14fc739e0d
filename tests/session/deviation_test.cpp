// The action `deviation` in a session on the virtual rig: the prototype has clay that its CAD lacks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <vector>

#include "calib/surface/deviation_scale.h"
#include "core/file.h"
#include "core/image_io.h"
#include "device/gl_context.h"
#include "scene/meshes/mesh_bvh.h"
#include "session/deviation/prototype_comparison.h"
#include "session/virtual_room.h"
#include "session/virtual_session.h"
#include "sim/truth.h"
#include "tests/session/studio.h"
#include "tests/support/bumped_door.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"
#include "tests/support/text.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double k_frame_s = 0.1;
constexpr double k_patterns_s = 10;  // at least as long as the patterns take

// The studio with clay on the door, and without parts.
sim::World door_world(double resolution) {
  sim::World world = studio_world(resolution);
  std::set<MarkerName> on_door;
  for (const BodyMarker& marker : world.scene->prototype->markers) on_door.insert(marker.marker);
  for (const sim::PlacedMarker& placed : world.markers)
    if (!on_door.contains(placed.marker))
      std::erase_if(world.objects, [&](const sim::Object& object) { return object.name == placed.object; });
  std::erase_if(world.markers,
                [&](const sim::PlacedMarker& placed) { return !on_door.contains(placed.marker); });
  world.scene->slots.clear();
  world.scene->controls.clear();
  world.find("prototype")->mesh =
      std::make_shared<const scene::Mesh>(test::bumped(world.scene->prototype->mesh));
  return world;
}

// A session and what is left of it.
struct Played {
  fs::path folder;
  sim::World world;
  std::optional<device::GlContext> context;
  std::optional<SessionOutput> output;
  std::optional<Session> session;
  std::atomic<bool> is_ended = false;  // when set, the session ends
};

using Turn = std::function<void(const Session&, sim::VirtualRig*)>;

// Something that happens while the session runs.
class Meanwhile final : public SessionClient {
 public:
  Meanwhile(Turn what, sim::VirtualRig* rig) : what_(std::move(what)), rig_(rig) {}
  void apply_edits(const SessionMoment& moment) override {
    if (what_) what_(moment.session, rig_);
  }
  void publish_state(const SessionMoment&) override {}

 private:
  Turn what_;
  sim::VirtualRig* rig_;
};

using Edits = std::vector<std::pair<double, std::string>>;  // seconds, value of `deviation`

// `meanwhile` is called in each turn of the loop. `real_time`: as of play_virtually().
void play(sim::World world,
          const Edits& edits,
          double end_s,
          Played* played,
          const Turn& meanwhile = {},
          const std::vector<Script::Move>& moves = {},
          const RealTime* real_time = nullptr) {
  played->folder = test::test_folder();
  played->world = world;
  SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  played->context.emplace(std::move(*context));
  sim::VirtualRig rig(std::move(world), virtual_rig_options(k_frame_s));
  Script script;
  script.moves = moves;
  for (const auto& [at_s, value] : edits)
    script.edits.push_back({at_s, scene::make_edit(scene::ActionId::deviation, "", value)});
  auto room = ScriptedRoom::create(script, &rig);
  ASSERT_TRUE(room) << room.message();
  auto output = SessionOutput::open(played->folder / "out", {}, &setup);
  ASSERT_TRUE(output) << output.message();
  played->output.emplace(std::move(*output));
  auto perception = Perception::create(setup.scene, setup.rig, setup.watch);
  auto session = Session::create(setup, &played->output->telemetry(), nullptr, false);
  ASSERT_TRUE(perception && session);
  played->session.emplace(std::move(*session));
  Meanwhile client(meanwhile, &rig);
  const Status done = play_virtually(end_s, real_time, played->is_ended, &rig, &*room,
                                     {*perception, *played->session, *played->output, {&client}});
  ASSERT_TRUE(done) << done.message();
}

std::string notes_of(Played& played) {
  std::string all;
  for (const auto& [at_s, note] : played.output->telemetry().notes()) all += note + "\n";
  return all;
}

struct Errors {
  int count = 0, large = 0, on_markers = 0;
  double rms_mm = 0, mean_mm = 0, pull = 0, right_sign = 0;
};

// Whether a marker's plate, which is no clay, hides the clay around a place of the door.
bool is_near_plate(const scene::Scene& scene, const Vector3d& p) {
  constexpr double k_reach_m = 0.042;  // half the diagonal of a plate, and the edge of the scan around it
  return std::ranges::any_of(scene.prototype->markers, [&](const BodyMarker& marker) {
    return (marker.body_from_marker.translation - p).norm() < k_reach_m;
  });
}

bool is_on_marker(const scene::Scene& scene, const Vector3d& p) {
  constexpr double k_near_m = 0.01;
  return std::ranges::any_of(scene.prototype->markers, [&](const BodyMarker& marker) {
    const Vector3d at = marker.body_from_marker.inverse() * p;
    return at.head<2>().cwiseAbs().maxCoeff() < marker.size_m / 2 && std::abs(at.z()) < k_near_m;
  });
}

// Against the clay that was really added or taken away, on the door's outer side.
Errors errors_of(const calib::Deviation& found, const scene::Scene& scene) {
  Errors e;
  int right = 0;
  for (std::size_t i = 0; i < found.states.size(); ++i) {
    if (!found.has(i) || found.cad.surface.normals[i].z() < 0.3f) continue;
    const Vector3d p = found.cad.surface.positions[i].cast<double>();
    e.on_markers += is_on_marker(scene, p);
    const double height = test::door_height(p);
    const double off = static_cast<double>(found.distances_m[i]) - height;
    ++e.count;
    e.mean_mm += 1e3 * off;
    e.rms_mm += 1e6 * off * off;
    e.pull += std::pow(off / static_cast<double>(found.stddevs_m[i]), 2);
    if (std::abs(height) < 0.3e-3) continue;
    ++e.large;
    right += static_cast<double>(found.distances_m[i]) * height > 0;
  }
  e.rms_mm = std::sqrt(e.rms_mm / e.count);
  e.mean_mm /= e.count;
  e.pull = std::sqrt(e.pull / e.count);
  e.right_sign = 1.0 * right / std::max(1, e.large);
  return e;
}

class LiveDeviation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    play(door_world(1), {{0.5, ""}, {k_patterns_s + 2, "report"}}, k_patterns_s + 3, &played_.emplace());
  }
  static void TearDownTestSuite() { played_.reset(); }
  static inline std::optional<Played> played_;
};

TEST_F(LiveDeviation, IsTheClayThatWasAddedOrTakenAway) {
  const auto& result = played_->session->deviation().result;
  ASSERT_TRUE(result) << notes_of(*played_);
  const Errors e = errors_of(result->report.deviation, *played_->world.scene);
  std::printf("[ deviation ] %.3f mm RMS (mean %.3f), pulls %.2f, right sign %.2f %% of %d; %zu points\n",
              e.rms_mm, e.mean_mm, e.pull, 100 * e.right_sign, e.large,
              result->report.deviation.states.size());
  EXPECT_GT(e.count, 10000);
  EXPECT_GT(e.large, 500);
  EXPECT_LT(e.rms_mm, 0.15);
  EXPECT_NEAR(e.pull, 1, 0.2);
  EXPECT_GE(e.right_sign, 0.99);
  EXPECT_EQ(e.on_markers, 0);
  EXPECT_TRUE(played_->session->show_state().deviation.is_shown);
  EXPECT_EQ(played_->session->deviation().progress, "");
}

TEST_F(LiveDeviation, LeavesAReport) {
  const fs::path report = played_->folder / "out/deviation-1";
  for (const char* file : {"deviation.html", "deviation.json", "deviation.csv", "deviation.ply"})
    EXPECT_TRUE(fs::exists(report / file)) << file;
  const auto json = test::read_json(report / "deviation.json");
  EXPECT_EQ(json["alignment"]["start"], "tracked pose");
  EXPECT_NEAR(json["highest_mm"].get<double>(), 3, 0.2);
  EXPECT_NEAR(json["lowest_mm"].get<double>(), -3, 0.2);
  test::expect_contains(notes_of(*played_), "deviation: the report is");
}

// A camera close to the door, 0.1 mm per pixel.
Imager close_up(const sim::World& world, double x, double y) {
  Imager camera = world.rig.cameras[0];
  camera.name = "close-up";
  camera.width = camera.height = 800;
  camera.lens = Lens::pinhole(4000, 4000, 399.5, 399.5);
  const Pose& door = world.world_from_prototype;
  const auto p = scene::nearest_on(world.scene->prototype->mesh, {x, y, 0.2});
  const Vector3d p_eye = door * Vector3d(p.p + 0.4 * p.d_normal), d_forward = door.rotation * -p.d_normal;
  Eigen::Matrix3d axes;
  const Vector3d d_right = d_forward.cross(door.rotation * Vector3d::UnitY()).normalized();
  axes << d_right, d_forward.cross(d_right), d_forward;
  camera.imager_from_world = Pose(Eigen::Quaterniond(axes), p_eye).inverse();
  return camera;
}

// What a camera near the door sees, and how high the clay really is there.
struct CloseUp {
  cv::Mat image, heights_mm;  // heights: CV_64F, NaN where it sees something else
};

CloseUp close_up_of(const Played& played, const test::DoorBump& bump) {
  sim::World world = played.world;
  const Imager camera = close_up(world, bump.x, bump.y);
  world.rig.cameras = {camera};
  world.camera_effects = {{.colour = true, .exposure = 2}};
  world.room = {};
  const Pose from_world = world.world_from_prototype.inverse();
  const sim::Truth truth(played.world);
  const scene::MeshBvh cad(played.world.scene->prototype->mesh);
  sim::VirtualRig rig(std::move(world), {.display_delay_s = 0});
  const std::vector<cv::Mat>& light = played.session->composed().projectors;
  for (std::size_t i = 0; i < light.size(); ++i)
    EXPECT_TRUE(rig.projector(static_cast<int>(i)).show(light[i]));
  const int first = 0;
  CloseUp out{rig.expose({&first, 1})[0].image, {}};
  out.heights_mm = cv::Mat(out.image.size(), CV_64F, cv::Scalar(std::nan("")));
  for (int y = 0; y < out.image.rows; ++y)
    for (int x = 0; x < out.image.cols; ++x) {
      const auto landing = truth.landing(camera, Eigen::Vector2d(x, y));
      if (!landing || landing->object != "prototype") continue;
      const auto foot = cad.nearest(from_world * landing->p_world, 0.01);  // clay grew along the CAD's normal
      if (foot) out.heights_mm.at<double>(y, x) = 1e3 * test::door_height(foot->p);
    }
  return out;
}

cv::Vec3d colour_at(const cv::Mat& image, int x, int y) {
  const auto& bgr = image.at<cv::Vec3b>(y, x);
  return {1.0 * bgr[0], 1.0 * bgr[1], 1.0 * bgr[2]};
}

constexpr double k_tolerance_mm = 0.5;

// The colour in the middle of a proud band: the median, because a ring and a number are there, too.
cv::Vec3d colour_of_band(const CloseUp& seen, int band) {
  const double low = band == 0 ? 0 : k_tolerance_mm / 2 * std::exp2(band),
               high = k_tolerance_mm * std::exp2(band);
  std::array<std::vector<double>, 3> levels;
  for (int y = 0; y < seen.image.rows; ++y)
    for (int x = 0; x < seen.image.cols; ++x) {
      const double mm = seen.heights_mm.at<double>(y, x);
      if (!(mm > low + 0.3 * (high - low) && mm < high - 0.3 * (high - low))) continue;
      const cv::Vec3d colour = colour_at(seen.image, x, y);
      for (int k = 0; k < 3; ++k) levels[static_cast<std::size_t>(k)].push_back(colour[k]);
    }
  cv::Vec3d middle;
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_GT(levels[k].size(), 500U) << "band " << band;
    std::ranges::sort(levels[k]);
    if (!levels[k].empty()) middle[static_cast<int>(k)] = levels[k][levels[k].size() / 2];
  }
  return middle;
}

// The share of b in a mix of the colours a and b, by least squares; nullopt: it is another colour.
std::optional<double> share_of_second(const cv::Vec3d& c, const cv::Vec3d& a, const cv::Vec3d& b) {
  const double aa = a.dot(a), ab = a.dot(b), bb = b.dot(b), ac = a.dot(c), bc = b.dot(c);
  const double of_a = (ac * bb - bc * ab) / (aa * bb - ab * ab),
               of_b = (bc * aa - ac * ab) / (aa * bb - ab * ab), both = of_a + of_b;
  if (both < 0.6 || both > 1.4 || cv::norm(c - of_a * a - of_b * b) > 0.1 * cv::norm(c)) return std::nullopt;
  return of_b / both;
}

// The light as a camera near the door sees it: where does it change from one band's colour to the next? Rows
// are searched; 10 pixels are 1 mm.
TEST_F(LiveDeviation, ColoursChangeWhereTheClayCrossesTheTolerance) {
  const CloseUp seen = close_up_of(*played_, test::k_door_bumps[2]);  // 3 mm
  ASSERT_TRUE(write_png(played_->folder / "close-up.png", seen.image));
  std::vector<double> offs_mm;  // of the clay's height there from the limit
  double squares = 0;           // of the distances along the surface from the true lines
  for (int band = 0; band < 3; ++band) {
    const double limit = k_tolerance_mm * std::exp2(band);
    const cv::Vec3d below = colour_of_band(seen, band), above = colour_of_band(seen, band + 1);
    for (int y = 1; y < seen.image.rows - 1; ++y)
      for (int x = 1; x < seen.image.cols - 1; ++x) {
        const auto height = [&](int dx, int dy) { return seen.heights_mm.at<double>(y + dy, x + dx); };
        const double slope = (height(1, 0) - height(-1, 0)) / 2, up = (height(0, 1) - height(0, -1)) / 2;
        if (!(std::abs(slope) > 0.004) || !(std::abs(height(0, 0) - limit) < 0.3 * limit)) continue;
        const auto here = share_of_second(colour_at(seen.image, x, y), below, above),
                   beside = share_of_second(colour_at(seen.image, x + 1, y), below, above);
        if (!here || !beside || (*here > 0.5) == (*beside > 0.5) || (*beside > *here) != (slope > 0))
          continue;
        const double at = height(0, 0) + slope * (0.5 - *here) / (*beside - *here);
        offs_mm.push_back(std::abs(at - limit));
        const double along_mm = 0.1 * offs_mm.back() / std::hypot(slope, up);
        squares += along_mm * along_mm;
      }
  }
  ASSERT_GT(offs_mm.size(), 300U);
  std::ranges::sort(offs_mm);
  const double p95 = offs_mm[offs_mm.size() * 95 / 100],
               along_rms = std::sqrt(squares / static_cast<double>(offs_mm.size()));
  std::printf(
      "[ deviation ] colours change at heights %.3f mm from the limits (95 %%), worst %.3f; %.3f mm RMS "
      "along the surface (%zu)\n",
      p95, offs_mm.back(), along_rms, offs_mm.size());
  EXPECT_LT(p95, 0.1);
  EXPECT_LT(along_rms, 0.3);
}

// A palm before the door, and a finger that touches it.
TEST(LiveDeviations, InventNothingWhereAHandWas) {
  sim::World world = door_world(0.4);
  const Pose& door = world.world_from_prototype;
  const auto add = [&](const char* name, const Vector3d& p, const Vector3d& half) {
    world.objects.push_back(test::box_object(name, door * Pose(Eigen::Quaterniond::Identity(), p), half));
  };
  add("palm", {0.0, 0.09, 0.14}, {0.04, 0.03, 0.01});
  add("finger", {-0.15, -0.05, 0.09}, {0.008, 0.045, 0.03});
  Played played;
  play(std::move(world), {{0.5, ""}}, k_patterns_s + 2.5, &played);
  const auto& result = played.session->deviation().result;
  ASSERT_TRUE(result) << notes_of(played);
  const calib::Deviation& found = result->report.deviation;
  const sim::Truth truth(played.world);
  int hidden = 0, invented = 0, measured = 0;
  for (std::size_t i = 0; i < found.states.size(); ++i) {
    if (found.cad.surface.normals[i].z() < 0.3f) continue;
    const Vector3d p = found.cad.surface.positions[i].cast<double>(),
                   n = found.cad.surface.normals[i].cast<double>();
    if (is_near_plate(*played.world.scene, p)) continue;
    const Vector3d p_clay = door * Vector3d(p + (test::door_height(p) + 5e-5) * n);
    const Rig& rig = played.world.rig;
    const bool is_seen = truth.visible(rig.cameras[0], p_clay) && (truth.visible(rig.projectors[0], p_clay) ||
                                                                   truth.visible(rig.projectors[1], p_clay));
    hidden += !is_seen;
    measured += found.has(i);
    invented += !is_seen && found.has(i);
  }
  std::printf("[ deviation ] %d of %d hidden points invented, %d measured\n", invented, hidden, measured);
  EXPECT_GT(hidden, 500);
  EXPECT_GT(measured, 5000);
  EXPECT_LT(invented, 0.01 * hidden);
}

TEST(LiveDeviations, AreFittedInABoxAndKeepTheirAlignment) {
  Played played;
  std::vector<calib::DeviationReport> reports;
  play(door_world(0.35),
       {{0.5, ""},
        {k_patterns_s + 2, "fit 20 -150 -50 200 150 100"},
        {k_patterns_s + 2.5, "hold on"},
        {k_patterns_s + 3, "scan"}},
       2 * k_patterns_s + 5, &played, [&](const Session& session, sim::VirtualRig*) {
         const auto& result = session.deviation().result;
         if (result && (reports.empty() || reports.back().made_at != result->report.made_at ||
                        reports.back().start != result->report.start ||
                        reports.back().fit_box.has_value() != result->report.fit_box.has_value()))
           reports.push_back(result->report);
       });
  ASSERT_EQ(reports.size(), 3U) << notes_of(played);
  EXPECT_FALSE(reports[0].fit_box);
  ASSERT_TRUE(reports[1].fit_box);
  EXPECT_NEAR(reports[1].fit_box->min().x(), 0.02, 1e-12);
  EXPECT_EQ(reports[2].start, "held");
  EXPECT_EQ(reports[2].registration.world_from_prototype.matrix(),
            reports[1].registration.world_from_prototype.matrix());
  EXPECT_EQ(played.session->show_state().deviation.layer->number, 3);
}

bool is_image_folder_there(const Played& played) {
  return std::ranges::any_of(fs::directory_iterator(played.folder / "out"), [](const auto& entry) {
    return entry.path().filename().string().starts_with("scanning");
  });
}

// Plays a session in which the prototype, with its markers, is moved by `moved_m` (world) at one moment of
// the scan and, if `back_s` is positive, put back at another.
void play_moved(const Vector3d& moved_m, double at_s, double back_s, Played* played) {
  sim::World world = door_world(0.35);
  const Pose before = world.world_from_prototype, shift(Eigen::Quaterniond::Identity(), moved_m);
  std::vector<Script::Move> moves;
  for (const sim::PlacedMarker& placed : world.markers) {
    const Pose home = world.find(placed.object)->world_from_object;
    moves.push_back({placed.marker.text(), at_s, home.inverse() * shift * home});
    if (back_s > 0) moves.push_back({placed.marker.text(), back_s, Pose()});
  }
  int turn = 0;
  const auto move = [&](const Session&, sim::VirtualRig* rig) {
    const double now_s = seconds_of(rig->now());
    if (turn == 0 && now_s >= at_s) ++turn, rig->move("prototype", shift * before);
    if (turn == 1 && back_s > 0 && now_s >= back_s) ++turn, rig->move("prototype", before);
  };
  play(std::move(world), {{0.5, ""}}, k_patterns_s + 2.5, played, move, moves);
  EXPECT_EQ(turn, back_s > 0 ? 2 : 1);
}

TEST(LiveDeviations, RefuseAPrototypeThatWasMovedDuringTheScan) {
  Played played;
  play_moved({0.006, 0, 0}, 8, 0, &played);
  EXPECT_FALSE(played.session->deviation().result);
  EXPECT_FALSE(played.session->show_state().deviation.is_shown);
  test::expect_contains(notes_of(played), "stand still while it was scanned, found it moved by 6.");
  EXPECT_FALSE(is_image_folder_there(played));
}

// A person sees how the session goes on, and moves the prototype after the scan, before the result is there.
TEST(LiveDeviations, GoOnInRealTimeWhileTheResultIsComputed) {
  sim::World world = door_world(0.5);
  const Pose before = world.world_from_prototype;
  const RealTime real_time{.whole = world.rig, .frame_period_s = k_frame_s, .efforts = {Effort{}}};
  Played played;
  std::set<Stamp> computing;  // the rig's clock, in turns of the loop in which the result is computed
  bool is_moved = false;
  const Turn turn = [&](const Session& session, sim::VirtualRig* rig) {
    if (session.deviation().progress == "computing") computing.insert(rig->now());
    if (!is_moved && !computing.empty() && seconds_between(*computing.begin(), rig->now()) > 1) {
      is_moved = true;
      rig->move("prototype", Pose(Eigen::Quaterniond::Identity(), {0.006, 0, 0}) * before);
    }
    if (session.deviation().result) played.is_ended = true;
  };
  play(std::move(world), {{0.5, ""}}, 300, &played, turn, {}, &real_time);
  EXPECT_TRUE(is_moved) << "the result came within a second: a larger world is needed";
  EXPECT_GT(computing.size(), 3U);
  EXPECT_TRUE(played.session->deviation().result) << notes_of(played);
}

// It stands again where it stood, so that its pose says nothing.
TEST(LiveDeviations, PaintNothingWrongWhereAPrototypeWasMovedAndPutBack) {
  Played played;
  play_moved({0.006, 0, 0.002}, 4, 7, &played);
  const auto& result = played.session->deviation().result;
  if (!result) return test::expect_contains(notes_of(played), "The former result stays");
  const calib::Deviation& found = result->report.deviation;
  int certain = 0, wrong = 0;
  for (std::size_t i = 0; i < found.states.size(); ++i) {
    const Vector3d p = found.cad.surface.positions[i].cast<double>();
    if (found.states[i] != calib::DeviationState::measured || found.cad.surface.normals[i].z() < 0.3f ||
        is_near_plate(*played.world.scene, p))
      continue;
    ++certain;
    wrong += std::abs(static_cast<double>(found.distances_m[i]) - test::door_height(p)) > 0.5e-3;
  }
  std::printf("[ deviation ] %d of %d points wrong by more than 0.5 mm: %s\n", wrong, certain,
              played.session->deviation().text.c_str());
  EXPECT_LT(wrong, 0.01 * certain + 1);
}

TEST(LiveDeviations, NeedAPrototypeThatIsTracked) {
  sim::World world = door_world(0.3);
  for (const sim::PlacedMarker& placed : world.markers)
    std::erase_if(world.objects, [&](const sim::Object& object) { return object.name == placed.object; });
  world.markers.clear();
  Played played;
  int turns_after = 0;
  play(std::move(world), {{0.5, ""}}, 2, &played, [&](const Session& session, sim::VirtualRig* rig) {
    turns_after += seconds_of(rig->now()) > 1 && session.deviation().progress.empty();
  });
  EXPECT_FALSE(played.session->deviation().result);
  EXPECT_FALSE(played.session->show_state().deviation.is_shown);
  test::expect_contains(notes_of(played), "expected the cameras to see the prototype's markers");
  EXPECT_GT(turns_after, 5) << "the session goes on";
  EXPECT_FALSE(is_image_folder_there(played));
}

TEST(LiveDeviations, LeaveNoImagesWhenTheSessionEndsDuringAScan) {
  Played played;
  bool was_there = false;
  play(door_world(0.3), {{0.5, ""}}, 2, &played,
       [&](const Session&, sim::VirtualRig*) { was_there |= is_image_folder_there(played); });
  EXPECT_TRUE(was_there);
  EXPECT_FALSE(is_image_folder_there(played));
}

// A flat panel: the scan slides on it.
TEST(LiveDeviations, SayWhichDirectionsAFlatPanelLeavesOpen) {
  scene::Scene scene = *test::studio_world().scene;
  scene.slots.clear();
  scene.controls.clear();
  scene::Prototype& panel = *scene.prototype;
  panel.mesh = test::grid(30, 20, [](double u, double v) { return Vector3d(0.4 * u, 0.3 * v, 0); });
  panel.albedo_image.release();
  int i = 0;
  for (BodyMarker& marker : panel.markers) {
    marker.body_from_marker =
        Pose(Eigen::Quaterniond::Identity(), {i % 2 ? 0.35 : 0.05, i / 2 % 2 ? 0.25 : 0.05, 0});
    ++i;
  }
  panel.markers.resize(std::min<std::size_t>(4, panel.markers.size()));
  const auto world = room_for(test::studio_world(0.5).rig, scene);
  ASSERT_TRUE(world) << world.message();
  Played played;
  play(*world, {{0.5, ""}}, k_patterns_s + 2.5, &played);
  const auto& result = played.session->deviation().result;
  ASSERT_TRUE(result) << notes_of(played);
  EXPECT_EQ(result->report.registration.free_directions.size(), 3U);
  EXPECT_EQ(result->layer->unsure.size(), 3U);
  test::expect_contains(played.session->deviation().text, "hatched");
  EXPECT_GT(result->report.summary.areas_m2[0], 0.05) << "along the normal the flat part is sure";
}

}  // namespace
}  // namespace limn::session
