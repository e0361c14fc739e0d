#include "session/requests/osc.h"

#include <gtest/gtest.h>
#include <lo/lo.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <sstream>
#include <thread>

#include "core/file.h"
#include "device/gl_context.h"
#include "session/osc_port.h"
#include "sim/virtual_rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

// Encodes a message by hand, so that wrong ones can be made, too.
std::vector<std::uint8_t> raw(const std::string& path,
                              const std::string& types,
                              const std::string& arguments) {
  const auto padded = [](std::string text) {
    text.resize(text.size() + 4 - text.size() % 4);
    return text;
  };
  return bytes_of(padded(path) + padded("," + types) + arguments);
}

std::string refusal(std::span<const std::uint8_t> datagram) {
  const auto edit = edit_of_osc(datagram);
  return edit ? "taken: " + edit->action : edit.message();
}

TEST(Osc, TheTableTheDocumentationAndTheActionsAgree) {
  const auto text = read_file(fs::path(LIMN_SOURCE_DIR) / "docs/osc.md");
  ASSERT_TRUE(text) << text.message();
  std::map<std::string, std::string> rows;  // by address
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);)
    if (line.rfind("| `/limn/", 0) == 0) {
      const std::string path = line.substr(3, line.find('`', 3) - 3);
      EXPECT_TRUE(rows.emplace(path, line).second) << path << " is in the table twice";
    }
  std::size_t wanted = 0;
  const auto check = [&](const std::vector<OscAddress>& addresses) {
    for (const OscAddress& address : addresses) {
      const std::string row =
          fmt::format("| `{}` | {} | {} |{}", address.path, address.arguments, address.what,
                      address.role.empty() ? "" : " " + address.role + " |");
      EXPECT_EQ(rows[address.path], row) << "docs/osc.md must contain this row:\n" << row;
      ++wanted;
    }
  };
  check(osc_received());
  check(osc_sent());
  EXPECT_EQ(rows.size(), wanted) << "docs/osc.md has an address that does not exist";
  ASSERT_EQ(osc_received().size(), scene::actions().size());
  for (std::size_t i = 0; i < osc_received().size(); ++i)
    EXPECT_EQ(osc_received()[i].path, fmt::format("/limn/{}", scene::actions()[i].name));
}

// A minimal message for each action, with the arguments that the action takes, gives an edit of that action.
TEST(Osc, EveryActionHasAMessage) {
  for (const scene::Action& action : scene::actions()) {
    std::vector<OscValue> arguments;
    std::string value;
    if (action.of_slot) arguments.emplace_back("mirror");
    if (action.argument_kind == scene::ArgumentKind::text) arguments.emplace_back(value = "some name");
    if (action.argument_kind == scene::ArgumentKind::number) {
      arguments.emplace_back(12.5F);
      value = "12.5";
    }
    if (action.argument_kind == scene::ArgumentKind::millimetres) {
      for (const float mm : {1.5F, -2.0F, 0.25F}) arguments.emplace_back(mm);
      value = "1.5 -2 0.25";
    }
    if (action.argument_kind == scene::ArgumentKind::pose) {
      for (const float number : {120.5F, -2.0F, 0.25F, 0.5F, -0.5F, 0.5F, 0.5F})
        arguments.emplace_back(number);
      value = "120.5 -2 0.25 0.5 -0.5 0.5 0.5";
    }
    const std::string path = fmt::format("/limn/{}", action.name);
    const auto edit = edit_of_osc(osc_message(path, arguments));
    ASSERT_TRUE(edit) << edit.message();
    EXPECT_EQ(edit->action, action.name);
    EXPECT_EQ(edit->slot, action.of_slot ? "mirror" : "");
    EXPECT_EQ(edit->value, value);
    arguments.emplace_back("one more");
    arguments.emplace_back("and another");
    if (!action.of.empty()) arguments.emplace_back("and a third");
    EXPECT_NE(refusal(osc_message(path, arguments)).find(path), std::string::npos);
  }
}

TEST(Osc, NumbersOfEveryKindAreNumbers) {
  const auto value = [](const std::string& path, const std::string& types, const std::string& arguments) {
    const auto edit = edit_of_osc(raw(path, types, arguments));
    return edit ? edit->value : edit.message();
  };
  using namespace std::string_literals;
  EXPECT_EQ(value("/limn/blackout", "", ""), "");
  EXPECT_EQ(value("/limn/blackout", "T", ""), "on");
  EXPECT_EQ(value("/limn/blackout", "F", ""), "off");
  EXPECT_EQ(value("/limn/blackout", "i", "\0\0\0\1"s), "on");
  EXPECT_EQ(value("/limn/blackout", "i", "\0\0\0\0"s), "off");
  EXPECT_EQ(value("/limn/blackout", "f", "\x3f\x80\0\0"s), "on");
  EXPECT_EQ(value("/limn/blackout", "s", "toggle\0\0"s), "toggle");
  // The values 1, -2 (64 bits) and 0.5 (double).
  EXPECT_EQ(
      value("/limn/nudge", "sihd",
            "mirror\0\0"s + "\0\0\0\1"s + "\xff\xff\xff\xff\xff\xff\xff\xfe"s + "\x3f\xe0\0\0\0\0\0\0"s),
      "1 -2 0.5");
}

TEST(Osc, RefusesWithAReason) {
  using namespace std::string_literals;
  const auto has = [](const std::string& text, const std::string& word) {
    EXPECT_NE(text.find(word), std::string::npos) << text;
  };
  has(refusal({}), "expected a message of Open Sound Control");
  has(refusal(bytes_of("hello, is anybody there?")), "expected a message of Open Sound Control");
  has(refusal(raw("/limn/dance", "", "")), "found '/limn/dance'");
  has(refusal(raw("limn/freeze", "", "")), "expected a message of Open Sound Control");
  has(refusal(raw("/limn/state/look", "s", "x\0\0\0"s)), "found '/limn/state/look'");
  has(refusal(raw("/limn/next_variant", "", "")),
      "/limn/next_variant: expected a slot as text, found no more");
  has(refusal(raw("/limn/next_variant", "i", "\0\0\0\1"s)), "found an argument of type 'i'");
  has(refusal(raw("/limn/next_variant", "ss", "a\0\0\0b\0\0\0"s)), "expected 1 arguments at most, found 2");
  has(refusal(raw("/limn/freeze", "b", "\0\0\0\4abcd"s)), "found an argument of type 'b'");
  // A blob that is cut off must not reach liblo.
  has(refusal(raw("/limn/freeze", "b", "")), "found an argument of type 'b'");
  has(refusal(bytes_of("/limn/freeze\0\0\0\0"s)), "expected a message of Open Sound Control");
  has(refusal(osc_message("/limn/nudge", {"mirror", 1, 2})), "found no more arguments");
  has(refusal(osc_message("/limn/place", {"mirror", 1, 2, 3, 1, 0, 0})), "expected a number, found no more");
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    has(refusal(osc_message("/limn/nudge", {"mirror", 1, 2, bad})), "expected finite numbers");
    has(refusal(osc_message("/limn/blackout", {bad})), "/limn/blackout: expected on, off");
    has(refusal(osc_message("/limn/place", {"mirror", 1, 2, 3, 1, bad, 0, 0})), "expected finite numbers");
  }
  has(refusal(osc_message("/limn/choose_variant", {"mirror", std::string(300, 'x')})), "found 300 bytes");
  has(refusal(osc_message("/limn/save_look", {"a\nb"})), "printable");
  has(refusal(osc_message("/limn/viewer", {"\xff"})), "UTF-8");
  has(refusal(std::vector<std::uint8_t>(k_longest_osc + 1, '/')), "found 1025");
  has(refusal(bytes_of("#bundle\0\0\0\0\0\0\0\0\1\0\0\0\x10/limn/freeze\0\0\0\0"s)), "found a bundle");
  const auto good = osc_message("/limn/nudge", {"mirror", 1, 2, 3.5F});
  for (std::size_t cut = 0; cut < good.size(); ++cut)
    EXPECT_FALSE(edit_of_osc(std::span(good).first(cut))) << cut;
}

// Randomly changed bytes give an edit or a reason, nothing else.
TEST(Osc, SurvivesSpoiltBytes) {
  auto rng = test::test_rng();
  std::size_t taken = 0, refused = 0;
  const std::vector<std::vector<std::uint8_t>> good = {
      osc_message("/limn/nudge", {"mirror", 1, 2, 3.5F}),
      osc_message("/limn/choose_variant", {"mirror", "sport"}), osc_message("/limn/blackout", {1}),
      raw("/limn/freeze", "TFNI[s]mcrhtd", std::string(64, 'a')),
      raw("/limn/screen", "b", std::string("\0\0\0\4abcd", 8))};
  for (int i = 0; i < 200000; ++i) {
    std::vector<std::uint8_t> bytes = good[rng() % good.size()];
    for (std::size_t n = 1 + rng() % 4; n > 0; --n) {
      const std::size_t at = rng() % bytes.size();
      switch (rng() % 4) {
        case 0:
          bytes[at] = static_cast<std::uint8_t>(rng());
          break;
        case 1:
          bytes[at] = 0;
          break;
        case 2:
          bytes.resize(1 + at);
          break;
        default:
          bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::uint8_t>(rng()));
      }
    }
    const auto edit = edit_of_osc(bytes);
    ++(edit ? taken : refused);
    ASSERT_TRUE(edit || !edit.message().empty());
  }
  EXPECT_GT(taken, 1000u);
  EXPECT_GT(refused, 100000u);
}

class AnOscSession : public testing::Test {
 protected:
  void SetUp() override {
    const sim::World world = test::studio_world(0.25);
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    SessionSetup setup;
    setup.rig = world.rig;
    setup.scene = *world.scene;
    setup.screens = {"wall", "desk"};
    auto telemetry = Telemetry::create({});
    ASSERT_TRUE(telemetry);
    telemetry_.emplace(std::move(*telemetry));
    auto session = Session::create(setup, &*telemetry_, nullptr, false);
    ASSERT_TRUE(session) << session.message();
    session_.emplace(std::move(*session));
  }

  // The notes of the session.
  std::string page() {
    const fs::path file = test::test_folder() / "page.html";
    EXPECT_TRUE(telemetry_->write_page(file, "x").ok());
    return read_file(file).value();
  }

  std::optional<device::GlContext> context_;
  std::optional<Telemetry> telemetry_;
  std::optional<Session> session_;
};

TEST_F(AnOscSession, HearsAnotherPrograms) {
  auto port = OscPort::open("0", "");
  ASSERT_TRUE(port) << port.message();
  const auto receive = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    port->apply_edits(&*session_, &*telemetry_, Stamp{});
  };
  const lo_address to = lo_address_new("127.0.0.1", std::to_string(port->port()).c_str());
  const auto& variants = session_->setup().scene.slots[0].variants;
  ASSERT_GE(variants.size(), 2u);
  EXPECT_EQ(session_->show_state().slots[0].variant, variants[0].name);
  ASSERT_GT(lo_send(to, "/limn/choose_variant", "ss", "mirror", variants[1].name.c_str()), 0);
  ASSERT_GT(lo_send(to, "/limn/blackout", "T"), 0);
  ASSERT_GT(lo_send(to, "/limn/nudge", "sfid", "mirror", 1.0, 2, -3.5), 0);
  receive();
  EXPECT_EQ(session_->show_state().slots[0].variant, variants[1].name);
  EXPECT_TRUE(session_->show_state().blackout);
  EXPECT_TRUE(
      test::near(session_->show_state().slots[0].nudge, Eigen::Vector3d(0.001, 0.002, -0.0035), 1e-9));

  // A pose, in the form in which the session sends poses; the part is then there.
  ASSERT_GT(lo_send(to, "/limn/place", "sfffffff", "mirror", 20.0, -30.0, 12.5, 1.2, 0.0, 1.2, 0.0), 0);
  receive();
  const auto& pin = session_->show_state().slots[0].pin;
  ASSERT_TRUE(pin.has_value());
  EXPECT_TRUE(test::pose_near(
      pin->prototype_from_part,
      Pose(Eigen::Quaterniond(std::sqrt(0.5), 0, std::sqrt(0.5), 0), Eigen::Vector3d(0.02, -0.03, 0.0125)),
      1e-6, 1e-6));
  EXPECT_TRUE(session_->show_state().slots[0].nudge.isZero());

  // The content of one screen, and of all.
  ASSERT_GT(lo_send(to, "/limn/screen", "s", "camera"), 0);
  ASSERT_GT(lo_send(to, "/limn/screen", "ss", "full", "wall"), 0);
  receive();
  EXPECT_EQ(session_->show_state().screen, scene::Screen::camera);
  EXPECT_EQ(scene::screen_content(session_->show_state(), "wall"), scene::Screen::full);
  EXPECT_EQ(scene::screen_content(session_->show_state(), "desk"), scene::Screen::camera);

  // A variant that the scene does not have changes nothing and is reported.
  ASSERT_GT(lo_send(to, "/limn/choose_variant", "ss", "mirror", "no such"), 0);
  receive();
  EXPECT_EQ(session_->show_state().slots[0].variant, variants[1].name);
  EXPECT_NE(page().find("OSC refused: choose_variant: expected a variant"), std::string::npos) << page();
  lo_address_free(to);
}

TEST_F(AnOscSession, AFloodIsTakenInPortionsAndToldOnce) {
  auto port = OscPort::open("0", "");
  ASSERT_TRUE(port) << port.message();
  const lo_address to = lo_address_new("127.0.0.1", std::to_string(port->port()).c_str());
  for (int i = 0; i < 3000; ++i) lo_send(to, "/limn/nudge", "siii", "mirror", 1, 0, 0);
  int calls = 0;
  double moved_mm = -1;
  for (; calls < 1000; ++calls) {
    const double before_mm = std::exchange(moved_mm, 1e3 * session_->show_state().slots[0].nudge.x());
    port->apply_edits(&*session_, &*telemetry_, Stamp{});
    const double now_mm = 1e3 * session_->show_state().slots[0].nudge.x();
    EXPECT_LE(now_mm - moved_mm, OscPort::k_most_at_once + 1e-6);
    if (calls > 0 && now_mm == moved_mm && moved_mm == before_mm) break;
  }
  EXPECT_GT(moved_mm, OscPort::k_most_at_once);  // the others waited and were applied later
  EXPECT_LT(moved_mm, 2999);                     // messages beyond the buffer's size are lost
  for (int i = 0; i < 200; ++i) lo_send(to, "/limn/dance", "");
  for (int i = 0; i < 10; ++i) port->apply_edits(&*session_, &*telemetry_, Stamp{});
  const std::string text = page();
  const auto first = text.find("OSC refused");
  ASSERT_NE(first, std::string::npos);
  EXPECT_EQ(text.find("OSC refused", first + 1), std::string::npos);
  port->apply_edits(&*session_, &*telemetry_, shifted(Stamp{}, 1));
  EXPECT_NE(page().find("more refused meanwhile"), std::string::npos);
  lo_address_free(to);
}

struct ReceivedMessages {
  std::vector<std::string> lines;
};

int note_received(const char* path, const char* types, lo_arg** values, int count, lo_message, void* into) {
  std::string line = path;
  for (int i = 0; i < count; ++i)
    line += types[i] == 's'   ? fmt::format(" {}", &values[i]->s)
            : types[i] == 'i' ? fmt::format(" {}", values[i]->i)
                              : fmt::format(" {:.2f}", values[i]->f);
  static_cast<ReceivedMessages*>(into)->lines.push_back(line);
  return 0;
}

TEST_F(AnOscSession, TellsWhatChanges) {
  const lo_server server = lo_server_new(nullptr, nullptr);
  ASSERT_NE(server, nullptr);
  ReceivedMessages received;
  lo_server_add_method(server, nullptr, nullptr, note_received, &received);
  auto port = OscPort::open("", fmt::format("127.0.0.1:{}", lo_server_get_port(server)));
  ASSERT_TRUE(port) << port.message();
  const auto received_lines = [&](Stamp at = Stamp{}) {
    received.lines.clear();
    port->publish_state(*session_, at);
    while (lo_server_recv_noblock(server, 20) > 0) {
    }
    return received.lines;
  };
  const auto has = [](const std::vector<std::string>& lines, const std::string& line) {
    return std::find(lines.begin(), lines.end(), line) != lines.end();
  };
  const std::string variant = session_->setup().scene.slots[0].variants[0].name;
  const auto all = received_lines();
  for (const OscAddress& address : osc_sent()) {
    if (address.path == "/limn/state/pose" || address.path == "/limn/state/prototype")
      continue;  // no marker is seen
    EXPECT_TRUE(std::any_of(all.begin(), all.end(), [&](const std::string& line) {
      return line.rfind(address.path + " ", 0) == 0;
    })) << address.path;
  }
  EXPECT_TRUE(has(all, "/limn/state/variant mirror " + variant));
  EXPECT_TRUE(has(all, "/limn/state/lost mirror"));
  EXPECT_TRUE(has(all, "/limn/state/looks 0 0 "));
  EXPECT_TRUE(received_lines().empty());
  ASSERT_TRUE(session_->edit({"freeze", "", "on"}, "test", Stamp{}).ok());
  ASSERT_TRUE(session_->edit({"save_look", "", "calm"}, "test", Stamp{}).ok());
  const auto changed = received_lines();
  EXPECT_EQ(changed.size(), 3u);
  EXPECT_TRUE(has(changed, "/limn/state/freeze 1"));
  EXPECT_TRUE(has(changed, "/limn/state/look calm"));
  EXPECT_TRUE(has(changed, "/limn/state/looks 0 1 calm"));
  ASSERT_TRUE(session_->edit({"freeze", "", "off"}, "test", Stamp{}).ok());
  received_lines();

  // After a frame in which everything is seen, the poses are sent.
  sim::World world = test::studio_world(0.5);
  Rig rig = world.rig;
  sim::VirtualRig virtual_rig(std::move(world), {.grab_waits_for_light = false});
  auto perception = Perception::create(session_->setup().scene, rig);
  ASSERT_TRUE(perception);
  const int camera = 0;
  session_->update_percepts(perception->watch(virtual_rig.expose(std::span(&camera, 1))), 1);
  session_->compose_and_record(virtual_rig.now(), virtual_rig.now());
  const auto poses = received_lines();
  const scene::PosedScene& posed = session_->composed().posed;
  ASSERT_TRUE(posed.world_from_prototype.has_value());
  ASSERT_FALSE(posed.parts.empty());
  const Pose part = posed.world_from_prototype->inverse() * posed.parts[0].world_from_part;
  const std::string begin =
      fmt::format("/limn/state/pose mirror {:.2f} {:.2f} {:.2f} ", 1e3 * part.translation.x(),
                  1e3 * part.translation.y(), 1e3 * part.translation.z());
  EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), [&](const std::string& line) {
    return line.rfind(begin, 0) == 0;
  })) << begin;
  EXPECT_TRUE(received_lines().empty());
  EXPECT_TRUE(received_lines(shifted(Stamp{}, 0.9)).empty());
  // Everything is sent again, for programs that started later.
  EXPECT_GT(received_lines(shifted(Stamp{}, 1)).size(), all.size());
  lo_server_free(server);
}

TEST_F(AnOscSession, ReceivesFromOneMachineOnly) {
  for (const auto& [from, accepted] : {std::pair{"127.0.0.1", true}, {"192.168.7.20", false}}) {
    auto port = OscPort::open("0", "", from);
    ASSERT_TRUE(port) << port.message();
    const lo_address to = lo_address_new("127.0.0.1", std::to_string(port->port()).c_str());
    ASSERT_GT(lo_send(to, "/limn/blackout", "T"), 0);
    lo_address_free(to);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    port->apply_edits(&*session_, &*telemetry_, Stamp{});
    EXPECT_EQ(session_->show_state().blackout, accepted) << from;
    scene::Edit light = scene::make_edit(scene::ActionId::blackout);
    light.value = "off";
    ASSERT_TRUE(session_->edit(light, "test", Stamp{}));
  }
}

TEST(OscPort, SaysWhatIsWrongWithAPlace) {
  const auto message = [](const std::string& receive_at, const std::string& send_to) {
    const auto port = OscPort::open(receive_at, send_to);
    return port ? std::string("no error") : port.message();
  };
  EXPECT_EQ(message("", ""), "no error");
  EXPECT_EQ(message("127.0.0.1:0", "localhost:9"), "no error");
  EXPECT_NE(message("99999", "").find("--osc: expected a port from 1 to 65535, found '99999'"),
            std::string::npos);
  EXPECT_NE(message("", "9000x").find("--osc-to: expected a port"), std::string::npos);
  EXPECT_NE(message("", "0").find("--osc-to: expected a port"), std::string::npos);
  EXPECT_NE(message(":9000", "").find("expected an address before the port"), std::string::npos);
  EXPECT_NE(message("somewhere:9000", "").find("expected a numeric address"), std::string::npos);
  EXPECT_NE(OscPort::open("0", "", "desk").message().find("--osc-from: expected a numeric address"),
            std::string::npos);
  EXPECT_NE(OscPort::open("", "", "::1").message().find("--osc-from: expected --osc with it"),
            std::string::npos);
  EXPECT_NE(message("203.0.113.7:9000", "").find("an address of this machine"), std::string::npos);
  const auto first = OscPort::open("0", "");
  ASSERT_TRUE(first);
  EXPECT_NE(message(std::to_string(first->port()), "").find("expected a free port"), std::string::npos);
}

}  // namespace
}  // namespace limn::session
