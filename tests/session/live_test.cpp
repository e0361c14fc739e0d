#include "apps/live.h"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "apps/replay.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "device/udp_socket.h"
#include "session/perception.h"
#include "session/requests/osc.h"
#include "session/requests/script.h"
#include "session/scene_watch.h"
#include "session/session.h"
#include "session/telemetry.h"
#include "session/virtual_room.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"
#include "tracker/marker_image.h"
#include "tracker/predict.h"
#include "tracker/swapped_cameras.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using namespace test::literals;
using nlohmann::json;

constexpr double k_mended_s = 5.4;  // time of a repair on the virtual clock, plus half a second
TEST(Live, ASessionIsReplayedToTheLastDigit) {
  const fs::path folder = test::test_folder();
  apps::LiveOptions options;
  options.resolution = 0.5;
  options.script = write_json(
      folder / "script.json",
      script_of(0.7,
                {{{"at_s", 0.2},
                  {"move", k_mirror},
                  {"home_from_marker", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0.012, 0, 0}}}}},
                 {{"at_s", 0.4}, {"edit", {{"action", "next_variant"}, {"slot", "mirror"}}}},
                 {{"at_s", 0.45},
                  {"edit", {{"action", "material"}, {"slot", "mirror"}, {"value", "#20c040 0.5 0.3"}}}},
                 {{"at_s", 0.5}, {"edit", {{"action", "light"}, {"value", "60 30 0.8 0.2 0.1"}}}},
                 {{"at_s", 0.5}, {"edit", {{"action", "marker_states"}}}},
                 {{"at_s", 0.6}, {"edit", {{"action", "next_variant"}, {"slot", "no"}}}}}));
  options.stereo = {"projector1"};
  options.record = folder / "recording";
  options.out = folder / "out";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const json summary = read_json(folder / "out/session.json");
  EXPECT_EQ(summary.at("pictures"), 21);
  EXPECT_LT(summary.at("placement_mm").at("median").get<double>(), 0.3);
  EXPECT_NEAR(summary.at("latency_ms").at("median").get<double>(), 60, 1.5);  // the bins are 2 % wide
  EXPECT_NE(read_file(folder / "out/session.html").value().find("next_variant mirror (script)"),
            std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "out/projector-projector0.png"));
  EXPECT_FALSE(fs::exists(folder / "out/projector-projector0-right.png"));
  EXPECT_TRUE(fs::exists(folder / "out/projector-projector1-right.png"));
  const auto poses = lines_of(folder / "out/poses.csv");
  EXPECT_EQ(poses.size(), 1 + 21u * 2);
  EXPECT_NE(poses.back().find(",trim,"), std::string::npos);

  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  replay.out = folder / "replayed";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
  EXPECT_EQ(poses, lines_of(folder / "replayed/poses.csv"));

  // A replay must name each damage: a changed digit of a pose, a changed bit of a frame, a cut line.
  auto events = lines_of(folder / "recording/events.jsonl");
  const auto with = [&](const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + "\n";
    EXPECT_TRUE(write_file(folder / "recording/events.jsonl", text));
    return apps::run_replay(replay);
  };
  auto other = events;
  other.resize(4);
  const auto digit = other[1].find("translation_m\":[") + 19;
  other[1][digit] = other[1][digit] == '1' ? '2' : '1';
  const Status one_off = with(other);
  ASSERT_FALSE(one_off.ok());
  EXPECT_NE(one_off.message().find("1 of 2 "), std::string::npos) << one_off.message();
  auto cut = events;
  cut.resize(5);
  cut.back().resize(20);
  const Status damaged = with(cut);
  ASSERT_FALSE(damaged.ok());
  EXPECT_NE(damaged.message().find("events.jsonl:5"), std::string::npos) << damaged.message();
}

// A projector is nudged. On request the session measures it on the prototype and continues with a corrected
// rig.
TEST(Live, GoesOnWithAMendedRig) {
  const fs::path folder = test::test_folder();
  apps::LiveOptions options;
  options.resolution = 0.5;
  options.frame_period_s = 0.1;
  const auto edit = [](double at_s, const std::string& action, const std::string& value) {
    return json{{"at_s", at_s}, {"edit", {{"action", action}, {"value", value}}}};
  };
  options.script = write_json(
      folder / "script.json",
      script_of(k_mended_s, {{{"at_s", 0.05}, {"nudge", "projector1"}, {"degrees", {0, 0.25, 0}}},
                             edit(0.3, "blackout", "on"),
                             edit(0.3, "repair", ""),
                             edit(0.35, "blackout", "off"),
                             {{"at_s", 0.35}, {"edit", {{"action", "next_variant"}, {"slot", "mirror"}}}},
                             edit(0.45, "repair", "")}));
  options.record = folder / "recording";
  options.out = folder / "out";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const Imager before = studio_world(0.5).rig.projectors[1];
  const Pose nudge(exp_rotation(Eigen::Vector3d(0, 0.25, 0) * M_PI / 180), Eigen::Vector3d::Zero());
  const Pose truth = nudge.inverse() * before.imager_from_world;
  const auto mended = load_rig(folder / "out/repaired-1");
  ASSERT_TRUE(mended) << mended.message();
  EXPECT_TRUE(test::pose_near(mended->projectors[1].imager_from_world, truth, 0.02_deg, 1.5_mm));
  EXPECT_EQ(mended->projectors[0].imager_from_world.matrix(),
            load_rig(folder / "recording/rig")->projectors[0].imager_from_world.matrix());
  const std::string page = read_file(folder / "out/session.html").value();
  EXPECT_NE(page.find("projector1 was turned by 0.2"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "out/repaired-2")) << "the repair during the blackout is refused";
  // The variant that was chosen before the repair is still shown.
  const auto poses = lines_of(folder / "out/poses.csv");
  EXPECT_NE(poses[poses.size() - 2].find(",mirror,sport,"), std::string::npos) << poses[poses.size() - 2];

  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
  // The session really continued with the corrected rig: with the old one the replay differs.
  fs::copy(folder / "recording/rig", folder / "recording/rig-2",
           fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  const Status other = apps::run_replay(replay);
  ASSERT_FALSE(other.ok());
  EXPECT_NE(other.message().find("expected the recorded projector"), std::string::npos) << other.message();
}

// Edits of another program come at any moment; they are recorded and replayed at the same moment.
TEST(Live, HearsAndTellsByOscAndIsReplayed) {
  const fs::path folder = test::test_folder();
  auto answers = device::UdpSocket::receiving({"127.0.0.1", "0"});
  ASSERT_TRUE(answers) << answers.message();
  copy_studio_to(folder);
  apps::LiveOptions options;
  options.resolution = 0.5;
  options.world = folder / "world.json";
  options.seconds = 1e5;  // ended below
  options.osc = "127.0.0.1:47312";
  options.osc_to = fmt::format("127.0.0.1:{}", answers->port());
  options.record = folder / "recording";
  options.out = folder / "out";
  bool was_answered = false;
  std::thread other([&] {
    auto sender = device::UdpSocket::sending({"127.0.0.1", "47312"});
    const auto has_answered = [&](const std::string& wanted) {
      std::array<std::uint8_t, 2048> bytes{};
      while (const auto datagram = answers->next(bytes))
        if (std::string(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(datagram->length))
                .find(wanted) != std::string::npos)
          return true;
      return false;
    };
    // Repeats a message until its effect is reported; messages sent before it were then received, too.
    const auto say = [&](const std::string& path, const std::vector<OscValue>& values,
                         const std::string& answer) {
      for (int i = 0; i < 600; ++i) {
        sender->send(osc_message(path, values));
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        if (has_answered(answer)) return true;
      }
      return false;
    };
    was_answered = say("/limn/choose_variant", {"mirror", "sport"}, "sport") &&
                   say("/limn/save_look", {"heard"}, "heard");
    sender->send(osc_message("/limn/restore_look", {"heard"}));
    sender->send(osc_message("/limn/restore_look", {"never"}));
    was_answered = was_answered && say("/limn/save_look", {"last"}, "last");
    std::raise(SIGTERM);
  });
  const Status lived = apps::run_live(options);
  other.join();
  ASSERT_TRUE(lived.ok()) << lived.message();
  EXPECT_TRUE(was_answered);
  const std::string page = read_file(folder / "out/session.html").value();
  EXPECT_NE(page.find("choose_variant mirror sport (osc)"), std::string::npos);
  EXPECT_NE(page.find("restore_look heard (osc)"), std::string::npos);
  EXPECT_NE(page.find("OSC refused: restore_look: expected one of heard"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "door/looks/heard.json"));
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

// The driver takes the GL context away: the shown images stay, and they are drawn again in a new context.
TEST(Live, DrawsAnewWhenTheGraphicsCardLostIt) {
  const sim::World world = studio_world(0.34);
  SessionSetup setup{world.rig, *world.scene, {}, {}};
  setup.paint.refill = false;
  sim::VirtualRig rig(world, {.grab_waits_for_light = false});
  std::optional<device::GlContext> context = device::GlContext::create().value();
  Telemetry telemetry = Telemetry::create({}).value();
  auto perception = Perception::create(setup.scene, setup.rig);
  auto session = Session::create(setup, &telemetry, nullptr, false);
  ASSERT_TRUE(perception && session);
  bool is_lost = false, can_renew = false;
  session->survive_losses({[&] { return is_lost; },
                           [&]() -> Status {
                             if (!can_renew) return error("there is no card.");
                             context.reset();
                             context = device::GlContext::create().value();
                             is_lost = false;
                             return {};
                           }});
  const int camera = 0;
  session->update_percepts(perception->watch(rig.expose(std::span(&camera, 1))), 1);
  const Stamp now = rig.now(), shown_at = shifted(now, 0.03);
  const cv::Mat good = session->compose_and_record(now, shown_at).projectors[0].clone();
  ASSERT_GT(cv::countNonZero(good.reshape(1)), 100);
  const auto is_good = [&](const ComposedFrame& painted) {
    return cv::norm(painted.projectors[0], good, cv::NORM_INF) == 0;
  };
  is_lost = true;
  for (const double later_s : {0.03, 0.06, 0.5, 1.2})
    EXPECT_TRUE(is_good(session->compose_and_record(shifted(now, later_s), shifted(shown_at, later_s))));
  EXPECT_TRUE(session->screen().empty());
  can_renew = true;
  rig.advance(3);
  session->update_percepts(perception->watch(rig.expose(std::span(&camera, 1))), 2);
  const cv::Mat anew = session->compose_and_record(rig.now(), shifted(rig.now(), 0.03)).projectors[0].clone();
  Telemetry unused = Telemetry::create({}).value();
  auto fresh = Session::create(setup, &unused, nullptr, false);  // this one has never lost its context
  ASSERT_TRUE(fresh);
  fresh->update_percepts(perception->percepts(), 1);
  const cv::Mat expected = fresh->compose_and_record(rig.now(), shifted(rig.now(), 0.03)).projectors[0];
  EXPECT_EQ(cv::norm(anew, expected, cv::NORM_INF), 0);
  EXPECT_FALSE(is_lost);
  EXPECT_FALSE(session->screen().empty());
  const json notes = telemetry.summary().at("notes");
  ASSERT_EQ(notes.size(), 2u) << notes.dump();
  EXPECT_NE(notes[0].at("what").get<std::string>().find("there is no card"), std::string::npos);
  EXPECT_NE(notes[1].at("what").get<std::string>().find("drawn again"), std::string::npos);
}

// A camera fails and works again: parts are extrapolated, fade out, and are shown again.
TEST(Live, GoesOnWithoutItsCamera) {
  const fs::path folder = test::test_folder();
  apps::LiveOptions options;
  options.resolution = 0.5;
  options.script = write_json(folder / "script.json",
                              script_of(1.6, {{{"at_s", 0.3}, {"until_s", 1.3}, {"unplug", "camera0"}}}));
  options.out = folder / "out";
  options.record = folder / "recording";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const json summary = read_json(folder / "out/session.json");
  EXPECT_EQ(summary.at("missed_frames"), 30);
  EXPECT_GT(summary.at("pictures_with_lost_bodies").get<int>(), 15);
  int dark = 0;
  for (const std::string& line : lines_of(folder / "recording/events.jsonl"))
    if (const json event = json::parse(line); event.contains("paint"))
      dark += event["paint"]["parts"].empty();
  EXPECT_GT(dark, 15);
  // Without tracks nothing is shown; at the end everything is shown again.
  EXPECT_GT(cv::countNonZero(read_grey_image(folder / "out/projector-projector0.png").value()), 1000);
  EXPECT_NE(read_file(folder / "out/session.html").value().find("camera0 is back"), std::string::npos);
}

// Images of another size than the rig was calibrated with are refused, with a message. A camera whose clock
// steps is used as before.
TEST(Live, GoesOnWhenItsCamerasImagesAndClockChange) {
  const fs::path folder = test::test_folder();
  const auto lived = [&](const std::string& name, double duration_s, const json& events) {
    apps::LiveOptions options;
    options.resolution = 0.5;
    options.script = write_json(folder / (name + ".json"), script_of(duration_s, events));
    options.out = folder / name;
    const Status status = apps::run_live(options);
    EXPECT_TRUE(status.ok()) << status.message();
    return read_json(options.out / "session.json");
  };
  const auto last_light = [&](const std::string& name) {
    return read_image(folder / name / "projector-projector0.png").value();
  };
  const json sway = {{"at_s", 0.2}, {"until_s", 5}, {"sway", k_mirror}, {"amplitude_m", {0.03, 0, 0}}};
  lived("calm", 0.9, json::array({sway}));
  const json stepped = lived("stepped", 0.9,
                             {sway,
                              {{"at_s", 0.4}, {"clock_step", "camera0"}, {"seconds", 3600}},
                              {{"at_s", 0.6}, {"clock_step", "camera0"}, {"seconds", -9000}}});
  EXPECT_TRUE(test::image_near(last_light("stepped"), last_light("calm"), 0, 0, "light"));
  EXPECT_EQ(stepped.at("missed_frames"), 0);
  int steps = 0;
  for (const json& note : stepped.at("notes"))
    steps += note.at("what").get<std::string>().find("camera0's clock has stepped") == 0;
  EXPECT_EQ(steps, 2);

  const json resized =
      lived("resized", 1.6, {{{"at_s", 0.3}, {"until_s", 1.3}, {"resize", "camera0"}, {"size", {640, 480}}}});
  EXPECT_EQ(resized.at("missed_frames"), 30);
  EXPECT_GT(resized.at("pictures_with_lost_bodies").get<int>(), 15);
  std::vector<std::string> notes;
  for (const json& note : resized.at("notes")) notes.push_back(note.at("what"));
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_NE(notes[0].find("960x540 pixels, found one of 640x480"), std::string::npos) << notes[0];
  EXPECT_EQ(notes[1], "camera0 is back");
  EXPECT_GT(cv::countNonZero(last_light("resized").reshape(1)), 1000);
}

// A hand is in one projector's light: the other projector fills in. Without a hand nothing changes.
TEST(Live, RefillsASomebodysShadow) {
  const fs::path folder = test::test_folder();
  const auto light = [&](const std::string& name, bool refill, const json& events) {
    apps::LiveOptions options;
    options.resolution = 0.5;
    options.refill = refill;
    options.script = write_json(folder / (name + ".json"), script_of(0.6, events));
    options.out = folder / name;
    EXPECT_TRUE(apps::run_live(options).ok());
    return read_image(options.out / "projector-projector1.png").value();
  };
  const json hand = {{{"at_s", 0.3}, {"until_s", 2}, {"block", "projector0"}}};
  const cv::Mat calm = light("calm", true, json::array()), calm_off = light("calm-off", false, json::array());
  EXPECT_EQ(cv::norm(calm, calm_off, cv::NORM_INF), 0);
  const cv::Mat with = light("with", true, hand), without = light("without", false, hand);
  const double more = cv::sum(cv::sum(with))[0] / cv::sum(cv::sum(without))[0];
  std::printf("a hand before projector0: projector1's display values are %.2f times what they were\n", more);
  EXPECT_GT(more, 1.02);
}

// Looks are saved as files beside the scene, with an overview page for a review.
TEST(Live, KeepsLooks) {
  const fs::path folder = test::test_folder();
  copy_studio_to(folder);
  apps::LiveOptions options;
  options.resolution = 0.5;
  options.world = folder / "world.json";
  const auto edit = [](double at_s, const std::string& action, const std::string& value) {
    return json{{"at_s", at_s}, {"edit", {{"action", action}, {"value", value}}}};
  };
  options.script = write_json(
      folder / "script.json",
      script_of(0.35, {edit(0.1, "save_look", "calm"),
                       {{"at_s", 0.13}, {"edit", {{"action", "next_variant"}, {"slot", "mirror"}}}},
                       {{"at_s", 0.13},
                        {"edit", {{"action", "material"}, {"slot", "mirror"}, {"value", "#20c040"}}}},
                       edit(0.16, "light", "-60 20 0.9 0.2 0.05"),
                       edit(0.2, "save_look", "bold"),
                       edit(0.24, "save_look", "third"),
                       edit(0.27, "delete_look", "third"),
                       edit(0.29, "delete_look", "calm"),
                       edit(0.31, "undelete_look", "")}));
  ASSERT_TRUE(apps::run_live(options).ok());
  const fs::path looks = folder / "door/looks";
  const json calm = read_json(looks / "calm.json"), bold = read_json(looks / "bold.json");
  EXPECT_NE(calm.at("slots").at("mirror").at("variant"), bold.at("slots").at("mirror").at("variant"));
  const cv::Mat calm_image = read_image(looks / "calm.png").value(),
                bold_image = read_image(looks / "bold.png").value();
  EXPECT_GT(cv::norm(calm_image, bold_image, cv::NORM_INF), 50);
  EXPECT_FALSE(fs::exists(looks / "third.json"));
  const std::string page = read_file(looks / "looks.html").value();
  EXPECT_NE(page.find("<b>calm</b>"), std::string::npos);
  EXPECT_EQ(page.find("<b>third</b>"), std::string::npos);

  EXPECT_FALSE(calm.at("slots").at("mirror").contains("material"));
  EXPECT_EQ(bold.at("slots").at("mirror").at("material").at("base_colour").size(), 3u);
  EXPECT_EQ(bold.at("light").at("lamps").at(0).at("strength"), json({0.9, 0.9, 0.9}));
  const auto green = [](const cv::Mat& bgr) {  // number of green pixels
    int count = 0;
    for (const cv::Vec3b& c : cv::Mat_<cv::Vec3b>(bgr)) count += c[1] > 1.5 * std::max(c[0], c[2]) + 20;
    return count;
  };
  EXPECT_GT(green(bold_image), green(calm_image) + 500);

  // The next session loads the saved looks.
  options.script =
      write_json(folder / "next.json", script_of(0.2, json::array({edit(0.1, "restore_look", "bold")})));
  options.out = folder / "out";
  ASSERT_TRUE(apps::run_live(options).ok());
  const auto poses = lines_of(folder / "out/poses.csv");
  const auto& translation = bold.at("slots").at("mirror").at("prototype_from_part").at("translation_m");
  EXPECT_NE(
      poses[poses.size() - 2].find(fmt::format(
          ",mirror,{},{:.4f},{:.4f},{:.4f},", bold.at("slots").at("mirror").at("variant").get<std::string>(),
          1e3 * translation[0].get<double>(), 1e3 * translation[1].get<double>(),
          1e3 * translation[2].get<double>())),
      std::string::npos)
      << poses[poses.size() - 2];
  EXPECT_GT(green(read_image(options.out / "projector-projector0.png").value()), 100);
}

// A part is added to its slot's folder, then damaged, while the session runs.
TEST(Live, TakesOverPartsThatAreSavedAndKeepsThemWhenTheyBreak) {
  const fs::path folder = test::test_folder();
  copy_studio_to(folder);
  fs::create_directories(folder / "door/slots/mirror");
  const fs::path dropped = folder / "door/slots/mirror/new.glb";

  SceneWatch watch(folder / "door");
  const auto changed_scene = [&] {
    const auto begun = std::chrono::steady_clock::now();
    for (;;) {
      auto scene = watch.take_changed_scene();
      const double waited_s = seconds_between(begun, std::chrono::steady_clock::now());
      if (!scene && waited_s < 20) continue;
      std::printf("after %.0f ms\n", 1e3 * waited_s);
      return scene;
    }
  };
  fs::copy_file(folder / "door/mirror-sport.glb", dropped);
  const auto there = changed_scene();
  ASSERT_TRUE(there.has_value() && *there);
  EXPECT_EQ((*there)->scene.find_slot("mirror")->variants.back().name, "new");
  fs::resize_file(dropped, 1000);
  const auto broken = changed_scene();
  ASSERT_TRUE(broken.has_value());
  ASSERT_TRUE(*broken);
  ASSERT_EQ((*broken)->skipped_variants.size(), 1u);
  EXPECT_NE((*broken)->skipped_variants[0].why.find("new.glb"), std::string::npos)
      << (*broken)->skipped_variants[0].why;
  fs::remove(dropped);

  apps::LiveOptions options;
  options.resolution = 0.5;
  options.world = folder / "world.json";
  options.seconds = 1e5;  // ended below
  options.out = folder / "out";
  options.record = folder / "recording";
  std::thread person([&] {
    const auto wait_for_images = [&](std::size_t more) {
      const fs::path events = options.record / "events.jsonl";
      const std::size_t before = lines_of(events).size();
      for (int i = 0; i < 400 && lines_of(events).size() < before + more; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    };
    // The recording keeps a copy of each scene that is taken over.
    const auto wait_for_copy = [&](const std::string& scene, std::uintmax_t bytes) {
      const fs::path copy = options.record / scene / "slots/mirror/new.glb";
      std::error_code absent;
      for (int i = 0; i < 400 && fs::file_size(copy, absent) != bytes; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    };
    wait_for_images(4);
    fs::copy_file(folder / "door/mirror-sport.glb", dropped);
    wait_for_copy("scene-2", fs::file_size(folder / "door/mirror-sport.glb"));
    wait_for_images(4);
    fs::resize_file(dropped, 1000);
    wait_for_copy("scene-3", 1000);
    wait_for_images(4);
    std::raise(SIGHUP);
  });
  const Status lived = apps::run_live(options);
  person.join();
  ASSERT_TRUE(lived.ok()) << lived.message();
  const std::string page = read_file(folder / "out/session.html").value();
  EXPECT_NE(page.find("loaded again"), std::string::npos);
  EXPECT_NE(page.find("new of slot mirror stays as it was"), std::string::npos);
  std::string last;
  for (const std::string& line : lines_of(folder / "out/poses.csv"))
    if (line.find(",mirror,") != std::string::npos) last = line;
  EXPECT_NE(last.find(",mirror,new,"), std::string::npos) << last;
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

// There is a second camera beside the first, and their cables are exchanged.
TEST(Live, KnowsCamerasThatWereExchanged) {
  sim::World world = studio_world(0.5);
  Imager second = world.rig.cameras[0];
  second.name = "camera1";
  second.imager_from_world = looking_at({0.6, -1.5, 0.6}, {0, 0, 0.42}, Eigen::Vector3d::UnitZ());
  world.rig.cameras.push_back(second);
  world.camera_effects.push_back(world.camera_effects[0]);
  const std::vector<Body> bodies = scene::bodies(*world.scene);
  sim::VirtualRig rig(world, {.grab_waits_for_light = false});
  const int cameras[] = {0, 1};
  std::vector<Frame> frames = rig.expose(cameras);
  const auto found = [&] {
    auto perception = Perception::create(*world.scene, world.rig);
    EXPECT_TRUE(perception) << perception.message();
    const Percepts& percepts = perception->watch(frames);
    EXPECT_GT(percepts.detections[0].size(), 3u);
    EXPECT_GT(percepts.detections[1].size(), 3u);
    return tracker::swapped_cameras(world.rig, bodies, percepts.detections, percepts.captured_at);
  };
  EXPECT_FALSE(found());
  std::swap(frames[0].image, frames[1].image);
  const auto swapped = found();
  ASSERT_TRUE(swapped);
  EXPECT_EQ(swapped->first, "camera0");
  EXPECT_EQ(swapped->second, "camera1");

  const auto context = device::GlContext::create();
  Telemetry telemetry = Telemetry::create({}).value();
  auto session = Session::create({world.rig, *world.scene, {}, {}}, &telemetry, nullptr, false);
  auto perception = Perception::create(*world.scene, world.rig);
  ASSERT_TRUE(context && session && perception);
  for (const int moment : {1, 2}) {  // it is reported once only
    for (Frame& frame : frames) frame.captured_at = shifted(frame.captured_at, 5);
    session->update_percepts(perception->watch(frames), static_cast<std::size_t>(moment));
  }
  const json notes = telemetry.summary().at("notes");
  ASSERT_EQ(notes.size(), 1u) << notes.dump();
  EXPECT_EQ(notes[0].at("what").get<std::string>().find("camera0 and camera1 seem to be exchanged"), 0u);
}

// A fixed viewer, a cap with a marker and guests' tablets share a viewpoint; it moves slowly when a viewer
// comes, goes or is no longer seen.
TEST(Live, ViewersOfAllKindsShareAnEyeThatNeverJumps) {
  constexpr double k_period_s = 0.1, k_fade_s = 0.8;
  constexpr const char* k_cap = "aruco_4x4_50:9";
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  sim::World world = studio_world(0.25);
  scene::Viewer cap, tablets;
  cap.marker = MarkerName::parse(k_cap).value();
  cap.marker_size_m = 0.12;
  cap.p_eye_marker = {0, 0.1, 0};
  tablets.tablet = "";
  tablets.weight = 2;
  world.scene->viewers.push_back(cap);
  world.scene->viewers.push_back(tablets);
  const Eigen::Vector3d p_cap(0.2, -0.75, 0.62);
  const Eigen::Vector3d p_camera = world.rig.cameras[0].imager_from_world.inverse().translation;
  const Pose world_from_cap = looking_at(p_cap, 2 * p_cap - p_camera, Eigen::Vector3d::UnitZ()).inverse();
  ASSERT_TRUE(
      sim::add_marker(world, {*cap.marker, cap.marker_size_m, world_from_cap}, false, tracker::marker_image));
  const fs::path folder = test::test_folder();
  const auto script = load_script(write_json(
      folder / "script.json", script_of(6, {{{"at_s", 2.4}, {"until_s", 4.8}, {"cover", k_cap}}})));
  ASSERT_TRUE(script) << script.message();
  const SessionSetup setup{world.rig, *world.scene, {}, {}};
  const Eigen::Vector3d p_fixed = world.scene->viewers[0].fixed->imager_from_world.inverse().translation,
                        p_worn = world_from_cap * cap.p_eye_marker, p_ann(-0.3, -1.1, 0.7),
                        p_ben(0.5, -1.2, 0.5), p_middle = world.world_from_prototype.translation;
  sim::VirtualRig rig(std::move(world), {.frame_period_s = k_period_s, .grab_waits_for_light = false});
  auto room = ScriptedRoom::create(*script, &rig);
  ASSERT_TRUE(room) << room.message();
  auto perception = Perception::create(setup.scene, setup.rig);
  auto session = Session::create(setup, nullptr, nullptr, false);
  ASSERT_TRUE(perception && session);
  std::size_t moments = 0;
  std::optional<Eigen::Vector3d> p_before;
  double farthest_m = 0;
  // The viewpoint at `end_s`, while these tablets see markers.
  const auto eye_at = [&](double end_s, const std::map<std::string, Eigen::Vector3d>& guests) {
    while (seconds_between(Stamp{}, rig.next_exposure()) < end_s) {
      room->set(seconds_between(Stamp{}, rig.next_exposure()));
      const int camera = 0;
      session->update_percepts(perception->watch(rig.expose(std::span(&camera, 1))), ++moments);
      for (const auto& [guest, p_eye] : guests) session->note_tablet(guest, p_eye, rig.now());
      const ComposedFrame& painted = session->compose_and_record(rig.now(), shifted(rig.now(), 0.04));
      const Eigen::Vector3d p_eye = painted.viewer.imager_from_world.inverse().translation;
      if (p_before) farthest_m = std::max(farthest_m, (p_eye - *p_before).norm());
      p_before = p_eye;
      EXPECT_EQ(painted.follows, "");
      EXPECT_EQ(painted.p_guest_eye_world.has_value(), !guests.empty()) << end_s;
    }
    return *p_before;
  };
  // All viewers stand on one side of the door: each counts by weight divided by distance.
  using Weighted = std::vector<std::pair<Eigen::Vector3d, double>>;
  const auto off_mm = [&](const Eigen::Vector3d& p_eye, const Weighted& eyes) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const auto& [p, weight] : eyes) {
      sum += weight / (p - p_middle).norm() * p;
      weights += weight / (p - p_middle).norm();
    }
    return 1e3 * (p_eye - sum / weights).norm();
  };
  const std::pair own{p_fixed, 1.0}, worn{p_worn, 1.0}, ann{p_ann, 2.0}, ben{p_ben, 2.0};
  const double two_mm = off_mm(eye_at(1.4, {}), {own, worn}),
               four_mm = off_mm(eye_at(2.4, {{"Ann", p_ann}, {"Ben", p_ben}}), {own, worn, ann, ben}),
               lost_mm = off_mm(eye_at(4.6, {{"Ben", p_ben}}), {own, ben}),
               back_mm = off_mm(eye_at(6, {{"Ben", p_ben}}), {own, worn, ben});
  double apart_m = 0;
  for (const Eigen::Vector3d& p : {p_fixed, p_worn, p_ann, p_ben})
    for (const Eigen::Vector3d& q : {p_fixed, p_worn, p_ann, p_ben})
      apart_m = std::max(apart_m, (p - q).norm());
  std::printf("off: %.1f, %.1f, %.1f, %.1f mm; at most %.1f mm a picture, of %.1f\n", two_mm, four_mm,
              lost_mm, back_mm, 1e3 * farthest_m, 1e3 * apart_m);
  for (const double mm : {two_mm, four_mm, lost_mm, back_mm}) EXPECT_LT(mm, 10);
  EXPECT_LT(farthest_m, 1.05 * apart_m * k_period_s / k_fade_s);
  EXPECT_GT(farthest_m, 0.01);
}

TEST(Live, MakesARoomForARigAndAScene) {
  const sim::World world = studio_world(0.5);
  const auto room = room_for(world.rig, *world.scene);
  ASSERT_TRUE(room) << room.message();
  sim::VirtualRig rig(*room, {.grab_waits_for_light = false});
  auto perception = Perception::create(*room->scene, room->rig);
  ASSERT_TRUE(perception);
  const int camera = 0;
  const Percepts& percepts = perception->watch(rig.expose(std::span(&camera, 1)));
  EXPECT_EQ(percepts.motions.size(), 3u);  // the door and both slots
}

TEST(Live, SaysWhatIsWrong) {
  const fs::path folder = test::test_folder();
  const auto message = [](const apps::LiveOptions& options) {
    const Status status = apps::run_live(options);
    return status.ok() ? std::string("no error") : status.message();
  };
  apps::LiveOptions one;
  one.rig = folder;
  EXPECT_NE(message(one).find("--rig and --scene together"), std::string::npos);
  apps::LiveOptions script;
  script.script = write_json(folder / "a.json", script_of(1, {{{"at_s", 0.2}, {"dance", "x"}}}));
  EXPECT_NE(
      message(script).find(
          "events[0]: expected one of sway, move, cover, block, unplug, nudge, resize, clock_step, edit"),
      std::string::npos)
      << message(script);
  script.script =
      write_json(folder / "b.json", script_of(1, {{{"at_s", 2}, {"until_s", 1}, {"cover", k_mirror}}}));
  EXPECT_NE(message(script).find("until_s"), std::string::npos);
  script.script = write_json(folder / "c.json",
                             script_of(1, {{{"at_s", 0}, {"until_s", 1}, {"cover", "aruco_4x4_50:44"}}}));
  EXPECT_NE(message(script).find("a marker that stands in the room"), std::string::npos);
  const std::vector<std::pair<json, std::string>> refused = {
      {{{"at_s", 0}, {"until_s", 1}, {"unplug", "camera7"}}, "a device that stands in the room (camera0, "},
      {{{"at_s", 0}, {"until_s", 1}, {"block", "camera0"}},
       "a projector that stands in the room (projector0, "},
      {{{"at_s", 0}, {"until_s", 1}, {"resize", "camera7"}, {"size", {64, 48}}},
       "a camera that stands in the room (camera0), found 'camera7'"},
      {{{"at_s", 0}, {"until_s", 1}, {"resize", "camera0"}, {"size", {64, 0.5}}},
       "expected [width, height] in whole pixels"},
      {{{"at_s", 0}, {"clock_step", "projector0"}, {"seconds", 1}},
       "a camera that stands in the room (camera0), found 'projector0'"},
      {{{"at_s", 0}, {"clock_step", "camera0"}, {"seconds", 1e300}}, "events[0].seconds: expected a number"}};
  for (const auto& [event, why] : refused) {
    script.script = write_json(folder / "d.json", script_of(1, json::array({event})));
    EXPECT_NE(message(script).find(why), std::string::npos) << event << message(script);
  }
  apps::LiveOptions other_rig;  // it has another projector size
  sim::World world = studio_world();
  world.rig.projectors[1].width = 1024;
  ASSERT_TRUE(save_rig(world.rig, folder / "rig"));
  other_rig.rig = folder / "rig";
  other_rig.scene = world.scene->folder;
  other_rig.world = fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json";
  EXPECT_NE(message(other_rig).find("projector1: expected the device's size 1280x800, found 1024x800"),
            std::string::npos)
      << message(other_rig);
  apps::LiveOptions twice;
  twice.seconds = 0.04;
  twice.resolution = 0.5;
  twice.record = folder / "recording";
  ASSERT_TRUE(make_folder(folder / "recording").ok());
  ASSERT_TRUE(write_file(folder / "recording/session.json", "{}"));
  EXPECT_NE(message(twice).find("expected a folder without a session"), std::string::npos) << message(twice);
  apps::ReplayOptions replay;
  replay.session = folder / "none";
  EXPECT_FALSE(apps::run_replay(replay).ok());
}

}  // namespace
}  // namespace limn::session
