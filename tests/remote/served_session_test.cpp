// The remote of a session: guests' edits, what they are told, images, their tablets, the code in the light.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <csignal>
#include <ctime>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "apps/live.h"
#include "apps/replay.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "remote/pairing_overlay.h"
#include "scene/comments.h"
#include "session/perception.h"
#include "sim/virtual_rig.h"
#include "tests/remote/a_server.h"
#include "tests/remote/virtual_tablet.h"
#include "tests/support/soak.h"
#include "tests/support/worlds.h"
#include "tracker/marker_image.h"

namespace limn::remote {
namespace {

// A session with a virtual rig's scene, served, and played by hand: one turn is what the loop does between
// two images.
class AServedSession : public AServer {
 protected:
  void SetUp() override {
    AServer::SetUp();
    const sim::World world = test::studio_world(0.25);
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    session::SessionSetup setup;
    setup.rig = world.rig;
    setup.scene = *world.scene;
    setup.scene.folder = folder_ / "project";
    setup.screens = {"wall", "desk"};
    fs::create_directories(setup.scene.folder);
    prepare(&setup);
    auto telemetry = session::Telemetry::create({});
    ASSERT_TRUE(telemetry);
    telemetry_.emplace(std::move(*telemetry));
    auto session = session::Session::create(setup, &*telemetry_, nullptr);
    ASSERT_TRUE(session) << session.message();
    session_.emplace(std::move(*session));
    health_.add({.name = "camera0", .kind = "camera"});
    open({}, echoing_providers());
  }
  void TearDown() override { server_.reset(); }
  virtual void prepare(session::SessionSetup*) {}

  // What a projector shows, as the frame loop hands it over.
  cv::Mat lit_by(std::size_t projector) {
    return session::with_overlays(session_->composed(), session_->setup().rig,
                                  server_->overlays(&*session_))[projector]
        .left;
  }

  void turn() {
    at_ = shifted(at_, 0.01);
    server_->apply_edits(&*session_, at_);
    server_->publish_state(*session_, *telemetry_, health_, at_);
  }
  // Plays the session while guests do something on another thread.
  void play_while(const std::function<void()>& guests) {
    std::atomic<bool> is_over = false;
    std::thread other([&] {
      guests();
      is_over = true;
    });
    while (!is_over) {
      turn();
      std::this_thread::sleep_for(5ms);
    }
    other.join();
  }

  Stamp at_;
  std::optional<device::GlContext> context_;
  std::optional<session::Telemetry> telemetry_;
  std::optional<session::Session> session_;
  session::DeviceHealth health_;
};

TEST_F(AServedSession, AnEditReachesItAndEverybodySeesIt) {
  const auto& variants = session_->setup().scene.slots[0].variants;
  ASSERT_GE(variants.size(), 2u);
  play_while([&] {
    const auto ann = guest(Role::work, "Ann"), ben = guest(Role::look, "Ben");
    const auto first = ben->message_of("state");
    ASSERT_TRUE(first);
    ann->send_text(json({{"type", "edit"},
                         {"id", 7},
                         {"action", "choose_variant"},
                         {"slot", "mirror"},
                         {"value", variants[1].name}})
                       .dump());
    const auto done = ann->message_of("done");
    ASSERT_TRUE(done);
    EXPECT_EQ(json::parse(*done)["id"], 7);
    const std::uint64_t number = json::parse(*done)["number"];
    json state;
    while (state.is_null() || state["number"] < number) {
      const auto next = ben->message_of("state");
      ASSERT_TRUE(next);
      state = json::parse(*next);
    }
    EXPECT_EQ(state["number"], number);
    EXPECT_EQ(state["slots"][0]["variant"], variants[1].name);
    EXPECT_EQ(state["last_edit"], json({{"who", "Ann"},
                                        {"action", "choose_variant"},
                                        {"slot", "mirror"},
                                        {"value", variants[1].name},
                                        {"number", number}}));
    EXPECT_EQ(state["guests"],
              json::parse(R"([{"name": "Ann", "role": "work"}, {"name": "Ben", "role": "look"}])"));
    EXPECT_EQ(state["devices"][0]["name"], "camera0");

    ann->send_text(
        R"({"type": "edit", "id": 8, "action": "choose_variant", "slot": "mirror", "value": "none"})");
    const auto refused = ann->message_of("refused");
    ASSERT_TRUE(refused);
    EXPECT_EQ(json::parse(*refused)["id"], 8);
    EXPECT_NE(refused->find("choose_variant: expected a variant"), std::string::npos) << *refused;
  });
  EXPECT_EQ(session_->show_state().slots[0].variant, variants[1].name);
}

TEST_F(AServedSession, ProgramsEditOverHttp) {
  play_while([&] {
    const std::string token = token_of(Role::work, "a program");
    const auto done = client()->post("/api/edit", R"({"action": "blackout", "value": "on"})", token);
    ASSERT_EQ(done.status, 200) << done.body;
    const json state = json::parse(client()->get("/api/state", token).body);
    EXPECT_EQ(state["number"], json::parse(done.body)["number"]);
    EXPECT_EQ(state["blackout"], true);
    EXPECT_EQ(state["last_edit"]["who"], "a program");
    const auto wrong = client()->post("/api/edit", R"({"action": "blackout", "value": "maybe"})", token);
    EXPECT_EQ(wrong.status, 400);
    EXPECT_NE(wrong.body.find("expected on, off or toggle"), std::string::npos);
  });
  EXPECT_TRUE(session_->show_state().blackout);
}

// In the words of the actions, so that everybody's sliders stand there; also those of a look.
TEST_F(AServedSession, TellsMaterialsAndLight) {
  using MaterialAndLight = std::pair<std::string, std::string>;  // the mirror's material, the light
  std::string token;
  const auto done = [&](const char* action, const char* slot, const std::string& value) {
    const auto answer = client()->post(
        "/api/edit", json({{"action", action}, {"slot", slot}, {"value", value}}).dump(), token);
    EXPECT_EQ(answer.status, 200) << answer.body;
    const json state = json::parse(client()->get("/api/state", token).body);
    return MaterialAndLight(state["slots"][0]["material"], state["light"]);
  };
  play_while([&] {
    token = token_of(Role::work, "Ann");
    EXPECT_EQ(done("grid", "", "on"), MaterialAndLight("", ""));
    EXPECT_EQ(done("material", "mirror", "#c02818 - 0.45"), MaterialAndLight("#c02818 - 0.45", ""));
    EXPECT_EQ(done("material", "mirror", ""), MaterialAndLight("", ""));
    for (const char* light : {"-135 -20.5 0.65 0.35 0.15", "30 45 0.6 0.3 0.1", "170 5 2 0 0"})
      EXPECT_EQ(done("light", "", light), MaterialAndLight("", light));
  });
  session_->compose_and_record(at_, at_);  // which looks are saved of
  ASSERT_TRUE(session_->edit({"save_look", "", "dark"}, "test", at_));
  play_while([&] {
    EXPECT_EQ(done("light", "", ""), MaterialAndLight("", ""));
    EXPECT_EQ(done("restore_look", "", "dark"), MaterialAndLight("", "170 5 2 0 0"));
  });
}

TEST_F(AServedSession, TellsWhatEachScreenShows) {
  play_while([&] {
    const std::string token = token_of(Role::operate, "Ann");
    ASSERT_EQ(client()->post("/api/edit", R"({"action": "screen", "value": "camera"})", token).status, 200);
    ASSERT_EQ(
        client()->post("/api/edit", R"({"action": "screen", "slot": "wall", "value": "full"})", token).status,
        200);
    const json state = json::parse(client()->get("/api/state", token).body);
    EXPECT_EQ(state["screen"], "camera");
    EXPECT_EQ(state["outputs"],
              json::parse(R"([{"name": "wall", "shows": "full"}, {"name": "desk", "shows": "camera"}])"));
    const auto wrong = client()->post("/api/edit", R"({"action": "screen", "slot": "roof"})", token);
    EXPECT_EQ(wrong.status, 400);
    EXPECT_NE(wrong.body.find("a screen of the devices file (wall, desk)"), std::string::npos) << wrong.body;
  });
}

// The session gives guests no more of its time than it can between two images.
TEST_F(AServedSession, AFloodOfEditsIsTakenInPortions) {
  const auto ann = guest(Role::work);
  for (int i = 0; i < 100; ++i)
    ann->send_text(fmt::format(
        R"({{"type": "edit", "id": {}, "action": "nudge", "slot": "mirror", "value": "1 0 0"}})", i));
  std::this_thread::sleep_for(200ms);
  turn();
  const double first_mm = 1e3 * session_->show_state().slots[0].nudge.x();
  EXPECT_GT(first_mm, 0);
  EXPECT_LE(first_mm, Server::k_max_edits_at_once + 1e-6);
  for (int i = 0; i < 100; ++i) turn();
  EXPECT_NEAR(1e3 * session_->show_state().slots[0].nudge.x(), 100, 1e-6);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(ann->message_of("done")) << i;
}

// The state that the documentation shows has the members that are told.
TEST_F(AServedSession, TellsTheStateOfTheDocumentation) {
  const std::string page = read_file(fs::path(LIMN_SOURCE_DIR) / "docs/remote.md").value();
  const std::string shown = page.substr(page.find("\n## The state"));
  json state;
  play_while([&] {
    const auto one = guest(Role::look);
    const auto found = one->message_of("state");
    ASSERT_TRUE(found);
    state = json::parse(*found);
  });
  EXPECT_EQ(state["type"], "state");
  const auto check = [&](const json& object) {
    for (const auto& [key, value] : object.items())
      EXPECT_NE(shown.find("\"" + key + "\""), std::string::npos) << key << " is not in docs/remote.md";
  };
  check(state);
  check(state["slots"][0]);
  for (const char* key : {"number",       "slots",    "prototype",  "looks",   "look",          "other_look",
                          "deleted_look", "blackout", "frozen",     "grid",    "marker_states", "split",
                          "outputs",      "light",    "split_mm",   "screen",  "viewer",        "follows",
                          "windows",      "screens",  "projectors", "devices", "waiting",       "guests",
                          "comments",     "notes",    "repair",     "pace",    "deviation"})
    EXPECT_TRUE(state.contains(key)) << key;
}

// With a viewer whose marker is on glasses.
class GlassesInASession : public AServedSession {
 protected:
  void prepare(session::SessionSetup* setup) override {
    scene::Viewer wearer;
    wearer.marker = MarkerName{"apriltag_36h11", "40"};
    wearer.marker_size_m = 0.06;
    setup->scene.viewers.push_back(wearer);
  }
};

TEST_F(GlassesInASession, ChangeNoProjectorImageWhetherOnOrOff) {
  sim::VirtualRig rig(test::studio_world(0.25), {.grab_waits_for_light = false});
  session::Perception perception =
      session::Perception::create(session_->setup().scene, session_->setup().rig).value();
  const int camera = 0;
  for (std::size_t i = 1; i <= 4; ++i)
    session_->update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), i);
  const Stamp seen_at = session_->percepts().captured_at;
  // What fades in is there after some frames.
  for (int i = 0; i < 5; ++i)
    session_->compose_and_record(shifted(seen_at, 0.1 * i), shifted(seen_at, 0.1 * i));
  const Stamp shown_at = shifted(seen_at, 0.4);
  const std::vector<cv::Mat> before = session_->compose_and_record(shown_at, shown_at).projectors;
  const auto is_as_before = [&] {
    const std::vector<cv::Mat> now = session_->compose_and_record(shown_at, shown_at).projectors;
    return std::equal(now.begin(), now.end(), before.begin(), before.end(),
                      [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0; });
  };
  EXPECT_GT(cv::countNonZero(before.at(0).reshape(1)), 0);
  ASSERT_TRUE(is_as_before()) << "the same moment gives the same images";
  const auto ann = guest(Role::look, "Ann");
  json glasses, state;
  play_while([&] {
    ann->message_of("state");
    ann->send_text(R"({"type": "glasses", "on": true})");
    for (int i = 0; i < 20; ++i) {
      const json pose = {{"type", "glasses_pose"},
                         {"at_s", 7 + 0.033 * i},
                         {"rotation_wxyz", {1, 0, 0, 0}},
                         {"translation_m", {0.01 * i, 1.6, 0}}};
      ann->send_text(pose.dump());
      std::this_thread::sleep_for(30ms);
    }
    glasses = json::parse(ann->message_of("glasses").value());
    state = json::parse(client()->get("/api/state", token_of(Role::look, "Ben")).body);
  });
  EXPECT_EQ(glasses["marker"], "apriltag_36h11:40");
  EXPECT_EQ(state["guests"][0]["glasses"], "waiting") << state["guests"];
  EXPECT_EQ(server_->glasses(),
            std::vector<std::string>{"Ann's glasses (apriltag_36h11:40): no camera sees the marker"});
  EXPECT_TRUE(is_as_before());
  play_while([&] {
    ann->send_text(R"({"type": "glasses", "on": false})");
    std::this_thread::sleep_for(100ms);
  });
  EXPECT_TRUE(server_->glasses().empty());
  EXPECT_TRUE(is_as_before());
}

TEST_F(GlassesInASession, GetMeshesAndTheLight) {
  play_while([&] {
    // The first state says that the session has begun.
    ASSERT_TRUE(guest(Role::look, "Ben")->message_of("state"));
    const std::string token = token_of(Role::look, "Ann");
    const auto prototype = client()->get("/glasses/prototype.glb", token);
    EXPECT_EQ(prototype.status, 200);
    EXPECT_EQ(prototype.body.substr(0, 4), "glTF");
    EXPECT_EQ(client()->get("/glasses/part/mirror/sport.glb", token).body.substr(0, 4), "glTF");
    for (const char* wrong : {"/glasses/part/mirror/none.glb", "/glasses/part/mirror", "/glasses/x.glb"})
      EXPECT_EQ(client()->get(wrong, token).status, 404) << wrong;
    EXPECT_EQ(client()->get("/glasses/light.json").status, 401);
    const json light = json::parse(client()->get("/glasses/light.json", token).body);
    const Imager& projector = session_->setup().rig.projectors[1];
    ASSERT_EQ(light["projectors"].size(), 2u);
    const json& told = light["projectors"][1];
    EXPECT_EQ(told["name"], projector.name);
    const Eigen::Vector3d d(told["outline"][0][0], told["outline"][0][1], 1);
    const auto px = projector.lens.project(d);
    ASSERT_TRUE(px);
    EXPECT_LT((*px - Eigen::Vector2d(-0.5, -0.5)).norm(), 0.05);
    EXPECT_NEAR(told["world_from_projector"][6].get<double>(),
                projector.imager_from_world.inverse().translation.z(), 1e-5);
  });
}

TEST_F(AServedSession, FourGuestsSeeAnEditWithin200ms) {
  std::vector<double> late_s;
  play_while([&] {
    std::vector<std::unique_ptr<RemoteClient>> guests;
    for (int i = 0; i < 4; ++i) guests.push_back(guest(Role::work, fmt::format("guest {}", i)));
    for (int i = 0; i < 20; ++i) {
      const auto& editor = guests[static_cast<std::size_t>(i % 4)];
      const auto begun = Clock::now();
      editor->send_text(json({{"type", "edit"},
                              {"id", i},
                              {"action", "nudge"},
                              {"slot", "mirror"},
                              {"value", fmt::format("{} 0 0", 1 + i)}})
                            .dump());
      for (const auto& each : guests) {
        json state;
        while (state.is_null() || !state.contains("last_edit") ||
               state["last_edit"]["value"] != fmt::format("{} 0 0", 1 + i)) {
          const auto next = each->message_of("state", 2);
          ASSERT_TRUE(next);
          state = json::parse(*next);
        }
        late_s.push_back(seconds_since(begun));
      }
    }
  });
  ASSERT_EQ(late_s.size(), 80u);
  std::sort(late_s.begin(), late_s.end());
  RecordProperty("median_ms", fmt::format("{:.1f}", 1e3 * late_s[40]));
  fmt::print("an edit is seen after {:.1f} ms (median), {:.1f} ms (worst of 80)\n", 1e3 * late_s[40],
             1e3 * late_s.back());
  EXPECT_LT(late_s[40], 0.2);  // the worst is the machine's, which may be busy
}

TEST_F(AServedSession, KeepsCommentsWithTheProject) {
  play_while([&] {
    const auto ann = guest(Role::work, "Ann");
    ASSERT_TRUE(ann->message_of("state"));
    ann->send_text(R"({"type": "comment", "id": 3, "look": "", "slot": "mirror", "text": "2 mm up"})");
    EXPECT_TRUE(ann->message_of("done"));
    const std::string token = token_of(Role::work, "Ben");
    EXPECT_EQ(client()->post("/api/comment", R"({"text": "calm"})", token).status, 200);
    EXPECT_EQ(client()->post("/api/comment", R"({"slot": "none", "text": "calm"})", token).status, 400);
    const json state = json::parse(client()->get("/api/state", token).body);
    ASSERT_EQ(state["comments"].size(), 2u);
    EXPECT_EQ(state["comments"][0]["who"], "Ann");
    EXPECT_EQ(state["comments"][0]["slot"], "mirror");
    EXPECT_EQ(state["comments"][1]["text"], "calm");
  });
  const auto kept = scene::load_comments(folder_ / "project/comments.json");
  ASSERT_TRUE(kept) << kept.message();
  ASSERT_EQ(kept->size(), 2u);
  EXPECT_EQ((*kept)[0].text, "2 mm up");
}

TEST_F(AServedSession, GivesImagesAndAssemblies) {
  ASSERT_TRUE(session_->edit({"save_look", "", "calm one"}, "test", at_));
  session_->compose_and_record(at_, at_);
  const std::string slot = session_->setup().scene.slots[0].name,
                    variant = session_->setup().scene.slots[0].variants[0].name;
  play_while([&] {
    const std::string token = token_of(Role::look);
    std::this_thread::sleep_for(100ms);
    const auto projector = client()->get("/picture/projector/projector0.jpg", token);
    ASSERT_EQ(projector.status, 200) << projector.body;
    EXPECT_EQ(projector.headers.at("cache-control"), "no-store");
    const auto image = device::decode_jpeg(
        {reinterpret_cast<const std::uint8_t*>(projector.body.data()), projector.body.size()});
    ASSERT_TRUE(image) << image.message();
    EXPECT_EQ(image->size(), session_->composed().projectors[0].size());
    const auto part = client()->get("/picture/variant/" + slot + "/" + variant + ".png", token);
    EXPECT_EQ(part.status, 200) << part.body;
    EXPECT_EQ(part.body.substr(1, 3), "PNG");
    const auto assembly = client()->get("/look/calm%20one.glb", token);
    EXPECT_EQ(assembly.status, 200) << assembly.body;
    EXPECT_EQ(assembly.body.substr(0, 4), "glTF");
    for (const char* path : {"/picture/projector/none.jpg", "/picture/variant/mirror/none.png",
                             "/picture/look/none.png", "/look/none.glb", "/picture/look/..%2f..%2fsecret.png",
                             "/picture/variant/mirror", "/picture/nothing"})
      EXPECT_EQ(client()->get(path, token).status, 404) << path;
  });
}

// A code in a projector's light is for those who stand there.
TEST_F(AServedSession, ProjectsACodeForAWhile) {
  ServeOptions options;
  options.code_duration = 1500ms;
  open(options, echoing_providers());
  session_->compose_and_record(at_, at_);
  const cv::Mat painted = session_->composed().projectors[0].clone();
  const auto is_painted = [&](const cv::Mat& lit) { return cv::norm(lit, painted, cv::NORM_INF) == 0; };
  EXPECT_TRUE(is_painted(lit_by(0)));
  server_->show_code("projector0", Role::work);
  EXPECT_EQ(server_->code_projector(), "projector0");
  ASSERT_TRUE(session_->edit({"blackout", "", "on"}, "test", at_));
  EXPECT_TRUE(is_painted(lit_by(0))) << "under a blackout";
  ASSERT_TRUE(session_->edit({"blackout", "", "off"}, "test", at_));
  // No prototype is seen: after a while it is in the image's middle.
  cv::Mat lit = lit_by(0);
  EXPECT_TRUE(is_painted(lit));
  for (const auto asked = Clock::now(); is_painted(lit) && seconds_since(asked) < 5;) {
    std::this_thread::sleep_for(50ms);
    lit = lit_by(0);
  }
  const auto begun = Clock::now();
  cv::Mat sign;
  cv::resize(
      0.75 * pairing_code_image(server_->invitation().url_for(Role::work), pin(Role::work), "work", 12), sign,
      {}, 1.0 / 6, 1.0 / 6, cv::INTER_AREA);
  const cv::Rect middle({(lit.cols - sign.cols) / 2, (lit.rows - sign.rows) / 2}, sign.size());
  EXPECT_LE(cv::norm(lit(middle), sign, cv::NORM_INF), 1);
  EXPECT_TRUE(is_painted(session_->composed().projectors[0])) << "what is recorded and told";
  EXPECT_EQ(cv::norm(lit_by(1), session_->composed().projectors[1], cv::NORM_INF), 0);
  play_while([&] {
    const std::string looks = token_of(Role::look, "Ben"), works = token_of(Role::work, "Ann");
    std::this_thread::sleep_for(100ms);
    const auto hidden = client()->get("/picture/room.jpg", looks);
    EXPECT_EQ(hidden.status, 503);
    EXPECT_NE(hidden.body.find("A code for other guests"), std::string::npos) << hidden.body;
    EXPECT_EQ(client()->get("/picture/room.jpg", works).status, 200);
    const auto projector = client()->get("/picture/projector/projector0.jpg", looks);
    ASSERT_EQ(projector.status, 200);
    const cv::Mat sent = device::decode_jpeg({reinterpret_cast<const std::uint8_t*>(projector.body.data()),
                                              projector.body.size()})
                             .value();
    EXPECT_LT(cv::norm(sent, painted, cv::NORM_L1) / static_cast<double>(sent.total()), 3) << "of 255 levels";
    for (const auto& [token, bytes] : {std::pair{looks, 0}, {works, 3}}) {
      const auto socket = client();
      ASSERT_EQ(socket->upgrade(token).status, 101);
      socket->send_text(R"({"type": "pictures", "room": true})");
      auto message = socket->message();
      while (message && message->is_text) message = socket->message();
      ASSERT_TRUE(message.has_value());
      const std::size_t length = number_at(message->bytes, 8);
      EXPECT_EQ(message->bytes.size(), 12 + length + static_cast<std::size_t>(bytes));
    }
  });
  EXPECT_LT(seconds_since(begun), 1.4) << "too slow a machine for this test";
  std::this_thread::sleep_until(begun + options.code_duration);
  EXPECT_TRUE(is_painted(lit_by(0)));
  EXPECT_EQ(server_->code_projector(), "");
}

// What the loop pays for guests, of its time between two images.
TEST_F(AServedSession, CostsTheSessionLittle) {
  const auto cost_us = [&] {
    double spent_s = 0;
    constexpr int k_turns = 40;
    for (int i = 0; i < k_turns; ++i) {
      std::this_thread::sleep_for(10ms);
      const auto begun = Clock::now();
      turn();
      spent_s += seconds_since(begun);
    }
    return 1e6 * spent_s / k_turns;
  };
  const double alone_us = cost_us();
  std::vector<std::unique_ptr<RemoteClient>> guests;
  for (int i = 0; i < 4; ++i) guests.push_back(guest(Role::look));
  const double served_us = cost_us();
  fmt::print("a turn costs the session {:.1f} us alone, {:.1f} us with four guests\n", alone_us, served_us);
  EXPECT_LT(served_us, 1000);
}

double thread_ms() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// What a quarter stays below: other work of the machine comes and goes.
double quarter(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 4];
}

// Guests who mean no good, of every kind at once, as of another machine: with the least priority here.
class Attack {
 public:
  Attack(int port, std::string token) : port_(port), token_(std::move(token)) {
    const std::vector<std::uint8_t> flat = device::encode_jpeg(cv::Mat(4096, 4096, CV_8UC3, k_grey), 50);
    largest_.assign(flat.begin(), flat.end());
    bombs_ = {largest_, largest_, largest_};
    const auto size = bombs_[0].find("\xff\xc0") + 5;  // of the frame's header: height, width
    bombs_[0].replace(size, 4, "\xff\xdc\xff\xdc");
    for (int i = 0; i < 500; ++i) bombs_[1] += "\xff\xda";
    noise_ = "\xff\xd8" + std::string(k_too_long, 'x');
  }
  ~Attack() {
    is_over_ = true;
    for (std::thread& thread : threads_) thread.join();
  }

  void begin() {
    again([this] {                         // a thousand connections that never end what they ask
      std::this_thread::sleep_for(500ms);  // which leaves seats for the others
      std::vector<std::unique_ptr<RemoteClient>> crowd;
      for (int i = 0; i < 1000 && !is_over_; ++i) {
        crowd.push_back(std::make_unique<RemoteClient>(port_));
        crowd.back()->send("GET / HTTP/1.1\r\nHost: local");
      }
    });
    again([this] {  // nobody reads what these ask for
      std::vector<std::unique_ptr<RemoteClient>> slow;
      for (std::uint32_t i = 0; i < 6; ++i) {
        slow.push_back(window(fmt::format("slow-tablet-{}", i)));
        slow.back()->read_little();
        slow.back()->send_text(R"({"type": "pictures", "room": true})");
      }
      for (std::uint32_t i = 0; i < 100 && !is_over_; ++i) {
        for (const auto& each : slow)
          if (!is_over_)
            each->send_binary(number_bytes(i) + largest_) && each->send_text(R"({"type": "dance"})");
        std::this_thread::sleep_for(10ms);
      }
    });
    again([this] {  // too much at once, and as much as may be; they vanish in the middle
      std::vector<std::unique_ptr<RemoteClient>> large;
      for (int i = 0; i < 12 && !is_over_; ++i) {
        large.push_back(window(fmt::format("large-tablet-{}", i)));
        const std::size_t size = i % 4 == 0 ? k_longest_frame : k_too_long;
        large.back()->send_half_a_frame(size, std::string_view(noise_).substr(0, size - 1));
      }
    });
    again([this] {  // images of 65500 pixels a side, of 500 scans, and large ones
      const auto one = window("bomb-tablet");
      for (std::uint32_t i = 0; i < 30 && !is_over_; ++i) {
        one->send_binary(number_bytes(i) + bombs_[i % bombs_.size()]);
        one->message(0.2);
      }
    });
    again([this] {  // JSON without end
      RemoteClient(port_).post("/api/edit", std::string(16'000, '['), token_);
      RemoteClient(port_).post("/api/edit", std::string(100'000, '{'), token_);
      RemoteClient one(port_);
      one.upgrade(token_);
      one.send_text(std::string(k_longest_message, '['));
      one.send_text(std::string(k_longest_message + 1, '['));
    });
  }

 private:
  static constexpr std::size_t k_too_long = 20'000'000;
  static inline const cv::Scalar k_grey{90, 90, 90};

  std::unique_ptr<RemoteClient> window(const std::string& device) const {
    auto out = std::make_unique<RemoteClient>(port_);
    out->upgrade(token_);
    out->send_text(json({{"type", "window"}, {"device", device}, {"on", true}}).dump());
    return out;
  }
  void again(std::function<void()> once) {
    threads_.emplace_back([this, once = std::move(once)] {
      ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), 19);
      while (!is_over_) once();
    });
  }

  int port_;
  std::string token_, largest_, noise_;
  std::vector<std::string> bombs_;
  std::atomic<bool> is_over_ = false;
  std::vector<std::thread> threads_;
};

// Whatever guests do, the session paints on, who came before is served, and memory stays within bounds.
TEST_F(AServedSession, UnderAttackMemoryIsBoundedAndItsImagesGoOn) {
  constexpr double k_attack_s = 3;
  // Eight windows: a frame that comes, one that waits, one that is looked at.
  constexpr double k_most_mib = 128;
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = std::min<rlim_t>(files.rlim_max, 8192);
  ::setrlimit(RLIMIT_NOFILE, &files);
  sim::World world = test::studio_world(0.25);
  sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
  const session::SessionSetup& setup = session_->setup();
  session::Perception perception = session::Perception::create(setup.scene, setup.rig, setup.watch).value();
  auto tablet_view = TabletView::create(setup, folder_ / "lenses");
  ASSERT_TRUE(tablet_view) << tablet_view.message();
  open({}, image_providers(std::move(*tablet_view)));
  const auto ben = guest(Role::work, "Ben");
  Attack attack(server_->port(), token_of(Role::look, "Eve"));
  struct Frames {
    std::vector<double> all_ms, guests_ms;  // by the wall; what guests take of the session's thread
    double most_mib = 0;
  };
  std::size_t count = 0;
  const auto played = [&](double seconds) {
    Frames out;
    const auto begun = Clock::now();
    while (seconds_since(begun) < seconds) {
      const auto frame = Clock::now();
      const int camera = 0;
      session_->update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), ++count);
      at_ = rig.now();
      EXPECT_TRUE(session_->edit({"nudge", "mirror", count % 2 ? "0.2 0 0" : "-0.2 0 0"}, "test", at_));
      double guests_ms = -thread_ms();
      server_->apply_edits(&*session_, at_);
      server_->publish_state(*session_, *telemetry_, health_, at_);
      guests_ms += thread_ms();
      const session::ComposedFrame& painted = session_->compose_and_record(at_, shifted(at_, 0.04));
      EXPECT_EQ(painted.painted_at, at_);
      for (std::size_t i = 0; i < painted.projectors.size(); ++i)
        EXPECT_TRUE(rig.projector(static_cast<int>(i)).show(lit_by(i)));
      out.all_ms.push_back(1e3 * seconds_since(frame));
      out.guests_ms.push_back(guests_ms);
      out.most_mib = std::max(out.most_mib, test::resident_mib());
    }
    return out;
  };
  played(0.1);  // warms up
  const Frames alone = played(0.5);
  const double before_mib = test::resident_mib();
  attack.begin();
  const Frames attacked = played(k_attack_s);
  fmt::print(
      "{} pictures alone, {:.1f} ms each; {} under attack, {:.1f} ms each, {:.2f} ms for guests; memory grew "
      "by {:.0f} MiB\n",
      alone.all_ms.size(), quarter(alone.all_ms), attacked.all_ms.size(), quarter(attacked.all_ms),
      quarter(attacked.guests_ms), attacked.most_mib - before_mib);
#ifndef __SANITIZE_ADDRESS__  // which keeps what was freed
  EXPECT_LT(attacked.most_mib - before_mib, k_most_mib);
#endif
  EXPECT_LT(quarter(attacked.guests_ms), 2);
  EXPECT_LT(quarter(attacked.all_ms), 4 * quarter(alone.all_ms));
  EXPECT_TRUE(ben->send_text("not JSON"));
  EXPECT_TRUE(ben->message_of("refused"));
  server_.reset();  // so that attackers who wait for it give up
}

// stderr into a file, from which the PINs are read while the session runs.
class StderrFile {
 public:
  explicit StderrFile(const fs::path& file) : before_(::dup(2)), file_(file) {
    const int handle = ::open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
    ::dup2(handle, 2);
    ::close(handle);
  }
  ~StderrFile() {
    ::dup2(before_, 2);
    ::close(before_);
  }
  StderrFile(const StderrFile&) = delete;
  StderrFile& operator=(const StderrFile&) = delete;

  // What follows these words, once they are there.
  std::string after(const std::string& words, std::size_t length) const {
    for (int i = 0; i < 600; ++i) {
      const std::string text = read_file(file_).value();
      if (const auto at = text.find(words);
          at != std::string::npos && text.find('\n', at) != std::string::npos)
        return text.substr(at + words.size(), length);
      std::this_thread::sleep_for(100ms);
    }
    return "";
  }

 private:
  int before_;
  fs::path file_;
};

// Guests' edits come at any moment, are in the recording, and come again at the same one.
TEST(LiveServe, GuestsReachARunningSessionThatIsReplayed) {
  const fs::path folder = test::test_folder();
  test::copy_studio_to(folder);
  ::setenv("XDG_CONFIG_HOME", folder.c_str(), 1);
  apps::LiveOptions options;
  options.resolution = 0.25;
  options.world = folder / "world.json";
  options.seconds = 1e5;  // ended below
  options.serve = "0";
  options.record = folder / "recording";
  // What a tablet sees of the room.
  sim::World seen = sim::load_world(folder / "world.json", tracker::marker_image).value();
  std::vector<cv::Mat> dark;
  for (const Imager& p : seen.rig.projectors) dark.push_back(cv::Mat::zeros(p.height, p.width, CV_8UC3));
  const Eigen::Vector3d p_middle = seen.world_from_prototype.translation;
  const std::vector<std::uint8_t> image =
      test::VirtualTablet(seen, dark, 640, 400, 2)
          .shoot_from(looking_at(p_middle + Eigen::Vector3d(-0.4, -0.6, 0.1), p_middle, {0, 0, 1}))
          .jpeg;
  const std::string jpeg(image.begin(), image.end());
  bool is_followed = false, is_left = false;
  int status = 0, room_status = 0;
  json state;
  Status lived;
  {
    const StderrFile said(folder / "stderr.txt");
    std::thread guest([&] {
      const std::string url = said.after("the remote is at http://127.0.0.1:", 6);
      const std::string pin = said.after("operate ", 6);
      const int port = std::atoi(url.c_str());
      const auto answer = RemoteClient(port).post("/api/pair", json({{"pin", pin}, {"name", "Ann"}}).dump());
      if (answer.status == 200) {
        const std::string token = json::parse(answer.body)["token"];
        const auto edit = [&](const json& what) {
          status = RemoteClient(port).post("/api/edit", what.dump(), token).status;
        };
        edit({{"action", "choose_variant"}, {"slot", "mirror"}, {"value", "sport"}});
        edit({{"action", "save_look"}, {"value", "by Ann"}});
        // Her tablet becomes the eye, and leaves.
        edit({{"action", "viewer"}, {"value", "Ann"}});
        RemoteClient window(port);
        window.upgrade(token);
        const auto follows = [&](const std::string& guest) {
          for (int i = 0; i < 200; ++i) {
            if (guest == "Ann") window.send_binary(number_bytes(static_cast<std::uint32_t>(i)) + jpeg);
            const auto told = window.message_of("state");
            if (told && json::parse(*told)["follows"] == guest) return true;
          }
          return false;
        };
        window.send_text(R"({"type": "window", "device": "tablet-of-ann", "on": true})");
        is_followed = follows("Ann");
        std::this_thread::sleep_for(300ms);
        window.send_text(R"({"type": "window", "device": "tablet-of-ann", "on": false})");
        is_left = follows("");
        room_status = RemoteClient(port).get("/picture/room.jpg", token).status;
        state = json::parse(RemoteClient(port).get("/api/state", token).body);
      }
      std::raise(SIGTERM);
    });
    lived = run_live(options);
    guest.join();
  }
  ASSERT_TRUE(lived.ok()) << lived.message();
  EXPECT_EQ(status, 200);
  EXPECT_EQ(room_status, 200);
  EXPECT_TRUE(is_followed);
  EXPECT_TRUE(is_left);
  EXPECT_NE(read_file(folder / "recording/events.jsonl").value().find("\"guest_eye\":["), std::string::npos);
  EXPECT_EQ(state["slots"][0]["variant"], "sport");
  EXPECT_EQ(state["last_edit"]["who"], "Ann");
  EXPECT_EQ(state["looks"], json({"by Ann"}));
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << (replayed ? "" : replayed.message());
}

}  // namespace
}  // namespace limn::remote
