// What the remote lets in, without a network: messages, PINs and sessions, roles, what is kept for slow
// readers.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "core/file.h"
#include "device/gui/qr_code.h"
#include "device/udp_socket.h"
#include "remote/api/auth_sessions.h"
#include "remote/api/guest_name.h"
#include "remote/api/messages.h"
#include "remote/api/ws_client.h"
#include "remote/http/http.h"
#include "remote/http/own_addresses.h"
#include "remote/http/static_files.h"
#include "tests/support/matchers.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;

const fs::path k_source = LIMN_SOURCE_DIR;

std::set<std::string> names_of_the_table() {
  std::set<std::string> names;
  for (const scene::Action& action : scene::actions()) names.emplace(action.name);
  return names;
}

TEST(RemoteActions, AreToldRowByRow) {
  const json table = json::parse(actions_json());
  ASSERT_EQ(table.size(), scene::actions().size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    const scene::Action& action = scene::actions()[i];
    EXPECT_EQ(table[i]["name"].get<std::string>(), action.name);
    EXPECT_EQ(table[i]["of_slot"].get<bool>(), action.of_slot);
    EXPECT_EQ(table[i]["role"].get<std::string>(), name_of(action.role));
    EXPECT_EQ(table[i]["value"].get<std::string>(), action.value);
    EXPECT_EQ(table[i]["value"].get<std::string>().empty(), table[i]["takes"] == "nothing");
    EXPECT_FALSE(table[i]["what"].get<std::string>().empty());
  }
}

// What the page has a word of its own for, and what something on it does: buttons, sliders and switches.
TEST(RemoteActions, ThePageHasEachAndNoOther) {
  const std::set<std::string> table = names_of_the_table();
  const std::string words = read_file(k_source / "remote/web/actions.js").value();
  const std::size_t begin = words.find("k_words = {") + 10, end = words.find("};", begin);
  const json own = json::parse(words.substr(begin, end + 1 - begin));
  for (const auto& [name, label] : own.items())
    EXPECT_TRUE(table.contains(name)) << "remote/web/actions.js has a word for '" << name << "'";

  static const std::regex done(
      R"re((?:\b(?:button|act|role_of)\(|make_switch\(\s*session,|"data-action":)\s*"(\w+)")re");
  std::set<std::string> on_the_page;
  for (const auto& entry : fs::directory_iterator(k_source / "remote/web")) {
    if (entry.path().extension() != ".js") continue;
    const std::string text = read_file(entry.path()).value();
    for (std::sregex_iterator at(text.begin(), text.end(), done), none; at != none; ++at)
      on_the_page.insert((*at)[1]);
  }
  EXPECT_EQ(on_the_page, table);
}

TEST(RemoteActions, DesignersDoAllButWhatBelongsToTheOperator) {
  std::set<std::string> operate;
  for (const scene::Action& action : scene::actions())
    if (role_for(std::string(action.name)) == Role::operate) operate.emplace(action.name);
  EXPECT_EQ(operate, (std::set<std::string>{"pair", "unpair", "units", "marker_states", "screen", "repair"}));
  EXPECT_EQ(role_for("an action of tomorrow"), Role::operate);
}

// The rows of docs/remote.md that show a message are understood.
TEST(RemoteMessages, AreThoseOfTheDocumentation) {
  const std::string page = read_file(k_source / "docs/remote.md").value();
  const std::size_t begin = page.find("| from the page | what |"), end = page.find("| to the page | what |");
  ASSERT_NE(begin, std::string::npos);
  const std::string rows = page.substr(begin, end - begin);
  static const std::regex row(R"(\| `(\{.*\})` \|)");
  std::set<std::string> types;
  for (std::sregex_iterator at(rows.begin(), rows.end(), row), none; at != none; ++at) {
    std::string text = (*at)[1];
    if (const auto dots = text.find("\"device\": \"…\""); dots != std::string::npos)
      text.replace(dots, std::string("\"device\": \"…\"").size(), "\"device\": \"tablet-0001\"");
    const auto message = parse_message(text);
    EXPECT_TRUE(message) << text << ": " << (message ? "" : message.message());
    types.insert(json::parse(text)["type"].get<std::string>());
  }
  EXPECT_EQ(types, (std::set<std::string>{"edit", "comment", "stroke", "pictures", "seen", "window",
                                          "glasses", "glasses_pose", "glasses_view", "glasses_state"}));
}

TEST(RemoteMessages, EveryActionIsAMessage) {
  for (const scene::Action& action : scene::actions()) {
    const auto message = parse_message(
        json({{"type", "edit"}, {"id", 7}, {"action", action.name}, {"slot", "mirror"}, {"value", "x"}})
            .dump());
    ASSERT_TRUE(message) << message.message();
    const auto& edit = std::get<EditMessage>(*message);
    EXPECT_EQ(edit.id, 7u);
    EXPECT_EQ(edit.edit.action, action.name);
    EXPECT_EQ(edit.edit.slot, "mirror");
    EXPECT_EQ(edit.edit.value, "x");
  }
}

std::string refusal_of(const std::string& text) {
  const auto message = parse_message(text);
  return message ? "taken" : message.message();
}

TEST(RemoteMessages, RefuseWithAReason) {
  const auto has = [](const std::string& text, const std::string& words) {
    EXPECT_NE(refusal_of(text).find(words), std::string::npos) << text << ": " << refusal_of(text);
  };
  has("", "expected a JSON object");
  has("[1, 2]", "expected a JSON object, found array");
  has("{\"type\": \"edit\"", "expected a JSON object");
  has("{}", "type: expected it, found no such key");
  has(R"({"type": 3})", "type: expected text, found '3'");
  has(R"({"type": "dance"})",
      "type: expected edit, comment, stroke, pictures, seen, window, glasses, glasses_pose, glasses_view "
      "or "
      "glasses_state, "
      "found "
      "'dance'");
  has(R"({"type": "edit", "id": 1, "action": "dance"})", "action: expected one of GET /api/actions");
  has(R"({"type": "edit", "id": -1, "action": "flip"})", "id: expected a whole number");
  has(R"({"type": "edit", "id": 1.5, "action": "flip"})", "id: expected a whole number");
  has(R"({"type": "edit", "id": 9007199254740993, "action": "flip"})", "id: expected a whole number");
  has(R"({"type": "edit", "id": 1, "action": "flip", "slot": ["a"]})", "slot: expected text, found array");
  has(R"({"type": "edit", "id": 1, "action": "flip", "more": 1})", "expected no other keys, found 'more'");
  has("{\"type\": \"edit\", \"id\": 1, \"action\": \"flip\", \"value\": \"\\u0000\"}", "without control");
  has(json({{"type", "edit"}, {"id", 1}, {"action", "flip"}, {"value", std::string(201, 'x')}}).dump(),
      "value: expected at most 200 bytes, found 201");
  has(R"({"type": "pictures", "room": 1})", "room: expected true or false");
  has(R"({"type": "seen", "picture": 4294967296})", "picture: expected a whole number");
  has(R"({"type": "window", "device": "tablet-0001", "on": true, "parts": "half"})",
      "parts: expected screen, rest or full, found 'half'");
  has(R"({"type": "window", "device": "short", "on": true})", "device: expected 8 to 64");
  has(R"({"type": "window", "device": "../../etc/passwd", "on": true})", "device: expected 8 to 64");
  has(R"({"type": "comment", "id": 1, "text": " \n"})", "text: expected a remark");
  has(std::string(k_longest_message + 1, ' '), "expected a message of at most 16384 bytes");
  std::string deep(k_longest_message, '[');
  has(deep, "expected a JSON object");
  has("{\"type\": \"\xff\xfe\"}", "expected a JSON object");
}

TEST(RemoteMessages, AWrongOneIsAnsweredByItsId) {
  EXPECT_EQ(parse_message_id(R"({"type": "edit", "id": 12, "action": "dance"})"), 12u);
  EXPECT_EQ(parse_message_id(R"({"id": "12"})"), std::nullopt);
  EXPECT_EQ(parse_message_id("not JSON"), std::nullopt);
}

TEST(RemoteMessages, FramesHaveANumberAndAJpeg) {
  std::vector<std::uint8_t> bytes = {1, 2, 0, 0, 0xff, 0xd8, 0xff, 0xe0};
  const auto frame = parse_frame(bytes);
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->number, 513u);
  EXPECT_EQ(frame->jpeg.size(), 4u);
  EXPECT_EQ(frame->jpeg.data(), bytes.data() + 4);
  bytes[5] = 0;
  EXPECT_FALSE(parse_frame(bytes));
  EXPECT_FALSE(parse_frame({}));
  std::vector<std::uint8_t> huge(k_longest_frame + 1, 0xd8);
  huge[4] = 0xff;
  EXPECT_FALSE(parse_frame(huge));
}

TEST(RemoteMessages, ImagesAreWrittenAsTheDocumentationSays) {
  const std::vector<std::uint8_t> jpeg = {0xff, 0xd8};
  const std::string bytes = image_message(ImageKind::window, 258, "{}", jpeg);
  using namespace std::string_literals;
  EXPECT_EQ(bytes, "\2\0\0\0\2\1\0\0\2\0\0\0{}\xff\xd8"s);
}

TEST(RemoteMessages, APairingNeedsSixDigits) {
  EXPECT_EQ(parse_pairing(R"({"pin": "012345", "name": "Ann"})").value().name, "Ann");
  EXPECT_EQ(parse_pairing(R"({"pin": "012345"})").value().name, "guest");
  for (const char* wrong : {R"({"pin": "12345"})", R"({"pin": "1234567"})", R"({"pin": "12345a"})",
                            R"({"pin": 123456})", R"({"name": "Ann"})"})
    EXPECT_FALSE(parse_pairing(wrong)) << wrong;
  EXPECT_FALSE(parse_pairing(json({{"pin", "012345"}, {"name", std::string(65, 'A')}}).dump()));
}

// The log says whose an edit was: a guest is not to pass for Limn itself.
TEST(RemoteMessages, AGuestHasNoNameOfLimnsOwn) {
  const auto named = [](const std::string& name) {
    return parse_pairing(json({{"pin", "012345"}, {"name", name}}).dump());
  };
  for (const char* own : {"operator", " Operator ", "KEY", "script", "osc", "Limn", "aruco_4x4_50:0"}) {
    const auto pairing = named(own);
    ASSERT_FALSE(pairing) << own;
    EXPECT_NE(pairing.message().find("name: expected a name"), std::string::npos) << pairing.message();
  }
  EXPECT_EQ(named("  Ann B. ")->name, "Ann B.");
  EXPECT_EQ(named("my operator")->name, "my operator");
}

std::string wrong_pin(const AuthSessions& guests) {
  for (int i = 0;; ++i) {
    std::string pin = fmt::format("{:06}", i);
    if (std::find(guests.pins().begin(), guests.pins().end(), pin) == guests.pins().end()) return pin;
  }
}

TEST(AuthSessions, OfOneNameAreToldApart) {
  AuthSessions guests;
  const AuthSessions::Time now{};
  const auto paired = [&](const std::string& name, const std::optional<AuthSessions::Guest>& replaced = {}) {
    return std::get<AuthSessions::Paired>(
        guests.pair(guests.pin(Role::look), name, "10.0.0.1", now, replaced));
  };
  const AuthSessions::Paired first = paired("Ann"), second = paired("ann");
  EXPECT_EQ(first.guest.name, "Ann");
  EXPECT_EQ(second.guest.name, "ann (2)");
  EXPECT_EQ(paired("Ann").guest.name, "Ann (3)");
  EXPECT_EQ(paired("Ben").guest.name, "Ben");
  // Who pairs again is the same, and one session ends.
  EXPECT_EQ(paired("Ann", first.guest).guest.name, "Ann");
  EXPECT_FALSE(guests.find(first.token, now));
  EXPECT_TRUE(std::holds_alternative<AuthSessions::WrongPin>(
      guests.pair(wrong_pin(guests), "Ann", "10.0.0.1", now, second.guest)));
  EXPECT_TRUE(guests.find(second.token, now));
}

TEST(AuthSessions, APinGivesItsRoleAndATokenThatEnds) {
  AuthSessions guests;
  const AuthSessions::Time now{};
  std::set<std::string> tokens;
  for (const Role role : {Role::look, Role::work, Role::operate}) {
    EXPECT_TRUE(std::regex_match(guests.pin(role), std::regex("[0-9]{6}")));
    const auto paired = guests.pair(guests.pin(role), "Ann", "10.0.0.1", now);
    ASSERT_TRUE(std::holds_alternative<AuthSessions::Paired>(paired));
    const std::string token = std::get<AuthSessions::Paired>(paired).token;
    EXPECT_EQ(token.size(), 64u);
    tokens.insert(token);
    const auto found = guests.find(token, now + k_session_life - 1s);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->role, role);
    EXPECT_EQ(found->name, "Ann");
    EXPECT_FALSE(guests.find(token, now + k_session_life));
    std::string other = token;
    other.back() = other.back() == '0' ? '1' : '0';
    EXPECT_FALSE(guests.find(other, now));
    EXPECT_FALSE(guests.find(token.substr(1), now));
    guests.end_session(found->number);
    EXPECT_FALSE(guests.find(token, now)) << "a session that was left is replayed";
  }
  EXPECT_EQ(tokens.size(), 3u);
  EXPECT_FALSE(guests.find("", now));
  EXPECT_NE(AuthSessions().pins(), guests.pins());
}

TEST(AuthSessions, AfterTenWrongPinsAnAddressWaits) {
  AuthSessions guests;
  AuthSessions::Time now{};
  const std::string wrong = wrong_pin(guests), right = guests.pin(Role::look);
  auto wait = k_first_wait;
  for (int round = 0; round < 6; ++round) {
    for (int i = 0; i < k_max_wrong_pins; ++i)
      EXPECT_TRUE(std::holds_alternative<AuthSessions::WrongPin>(guests.pair(wrong, "", "10.0.0.1", now)));
    const auto held = guests.pair(right, "", "10.0.0.1", now + 1s);
    ASSERT_TRUE(std::holds_alternative<AuthSessions::Wait>(held));
    EXPECT_EQ(std::get<AuthSessions::Wait>(held).left, wait - 1s);
    EXPECT_TRUE(std::holds_alternative<AuthSessions::Paired>(guests.pair(right, "", "10.0.0.2", now)))
        << "somebody else";
    now += wait;
    EXPECT_TRUE(std::holds_alternative<AuthSessions::Paired>(guests.pair(right, "", "10.0.0.1", now)));
    wait = std::min(2 * wait, k_longest_wait);
  }
}

TEST(AuthSessions, AfterAHundredWrongPinsEverybodyWaits) {
  AuthSessions guests;
  const AuthSessions::Time now{};
  const std::string wrong = wrong_pin(guests);
  for (int i = 0; i < k_max_wrong_pins_of_all; ++i)
    EXPECT_TRUE(std::holds_alternative<AuthSessions::WrongPin>(
        guests.pair(wrong, "", fmt::format("10.0.{}.1", i), now)));
  EXPECT_TRUE(
      std::holds_alternative<AuthSessions::Wait>(guests.pair(guests.pin(Role::look), "", "10.1.0.1", now)));
}

TEST(AuthSessions, ANetworkOfIPv6IsOnePlace) {
  AuthSessions guests;
  const AuthSessions::Time now{};
  const std::string wrong = wrong_pin(guests);
  for (int i = 0; i < k_max_wrong_pins; ++i) guests.pair(wrong, "", fmt::format("2001:db8::{}", i + 1), now);
  EXPECT_TRUE(std::holds_alternative<AuthSessions::Wait>(guests.pair(wrong, "", "2001:db8::ffff", now)));
  EXPECT_TRUE(std::holds_alternative<AuthSessions::WrongPin>(guests.pair(wrong, "", "2001:db8:0:1::1", now)));
}

TEST(AuthSessions, SessionsOfEachRoleAreBounded) {
  AuthSessions guests;
  const AuthSessions::Time now{};
  std::string first;
  const auto operates = guests.pair(guests.pin(Role::operate), "", "10.0.0.2", now);
  for (std::size_t i = 0; i < k_max_sessions + 10; ++i) {
    const auto paired = guests.pair(guests.pin(Role::look), "", "10.0.0.1", now);
    if (i == 0) first = std::get<AuthSessions::Paired>(paired).token;
  }
  EXPECT_EQ(guests.count(), k_max_sessions + 1);
  EXPECT_FALSE(guests.find(first, now));
  EXPECT_TRUE(guests.find(std::get<AuthSessions::Paired>(operates).token, now));
}

TEST(GuestName, IsVisible) {
  for (const char* name : {"Ann", "Ann Lee", "J\xc3\xbcrgen", "\xe6\x9d\x8e", "O'Neil-3", "\xd8\xa3\xd9\x86"})
    EXPECT_TRUE(is_visible_name(name)) << name;
  for (const char* name : {"", " Ann", "Ann ", "Ann  Lee", "An\xe2\x80\x8bn", "\xe2\x80\xaennA",
                           "Ann\xc2\xa0Lee", "An\xc2\xadn", "\xe3\x85\xa4", "An\nn", "An\xffn"})
    EXPECT_FALSE(is_visible_name(name)) << name;
}

TEST(GuestName, LooksLikeAnother) {
  EXPECT_TRUE(look_alike("operator", "Operator"));
  EXPECT_TRUE(look_alike("operator", "\xd0\xbeper\xd0\xb0tor")) << "with Cyrillic o and a";
  EXPECT_FALSE(look_alike("operator", "operators"));
  EXPECT_FALSE(look_alike("Ann", "Ben"));
}

TEST(GuestName, OfLimnOrInvisibleIsRefused) {
  const auto refusal = [](const std::string& name) {
    const auto read = parse_pairing(json{{"pin", "123456"}, {"name", name}}.dump());
    return read ? std::string() : read.message();
  };
  EXPECT_EQ(refusal("  Ann "), "");
  EXPECT_NE(refusal("\xd0\xbeperator").find("none of Limn's own"), std::string::npos);
  EXPECT_NE(refusal("op\xe2\x80\x8b"
                    "erator")
                .find("visible characters"),
            std::string::npos);
}

TEST(Outbox, KeepsTheNewestAlone) {
  Outbox outbox;
  const auto text = [](const char* words) { return std::make_shared<const std::string>(words); };
  outbox.set_state(text("old"));
  outbox.set_state(text("new"));
  outbox.set_image(ImageKind::room, text("old room"));
  outbox.set_image(ImageKind::room, text("new room"));
  outbox.add_answer("done");
  std::vector<std::string> all;
  while (const auto next = outbox.next_message()) all.push_back(*next->bytes);
  EXPECT_EQ(all, (std::vector<std::string>{"done", "new", "new room"}));
  EXPECT_FALSE(outbox.is_over());
}

TEST(Outbox, EndsWhenAnswersAreNotRead) {
  Outbox outbox;
  for (std::size_t i = 0; i < k_max_answers; ++i) outbox.add_answer("done");
  EXPECT_FALSE(outbox.is_over());
  outbox.add_answer("one more");
  const auto bye = outbox.next_message();
  ASSERT_TRUE(bye);
  EXPECT_NE(bye->bytes->find("\"bye\""), std::string::npos);
  EXPECT_FALSE(outbox.next_message());
  EXPECT_TRUE(outbox.is_over());
}

TEST(Pace, LetsABurstThroughAndThenSoManyASecond) {
  RateLimit pace(10, 5);
  RateLimit::Time now{};
  const auto taken = [&](int count) {
    int out = 0;
    for (int i = 0; i < count; ++i) out += pace.allows(now);
    return out;
  };
  EXPECT_EQ(taken(20), 5);
  now += 300ms;
  EXPECT_EQ(taken(20), 3);
  now += 1h;
  EXPECT_EQ(taken(20), 5);
}

TEST(Http, PartsOfPathsAreDecodedOnce) {
  EXPECT_EQ(decoded("look%2001"), "look 01");
  EXPECT_EQ(decoded("%252e"), "%2e");
  for (const char* wrong : {"%2", "%", "%zz", "a%00", "a%2fb", "a/b", "%0a"})
    EXPECT_EQ(decoded(wrong), std::nullopt) << wrong;
  EXPECT_EQ(path_of("/a?b=c"), "/a");
  EXPECT_EQ(path_of("http://a/b"), std::nullopt);
  EXPECT_EQ(cookie_in("a=b; limn=token; c=d", "limn"), "token");
  EXPECT_EQ(cookie_in("xlimn=token", "limn"), "");
  EXPECT_EQ(host_in("[::1]:8080"), "::1");
  EXPECT_EQ(host_in("localhost:8080"), "localhost");
}

TEST(OwnAddresses, KnowWhoCanReachThem) {
  for (const char* own : {"127.0.0.1", "127.3.2.1", "::1"}) EXPECT_TRUE(device::is_loopback(own)) << own;
  for (const char* other : {"0.0.0.0", "192.168.7.2", "::", "128.0.0.1", "localhost", "127.0.0.1.example"})
    EXPECT_FALSE(device::is_loopback(other)) << other;
  EXPECT_TRUE(is_unspecified("0.0.0.0"));
  EXPECT_TRUE(is_unspecified("::"));
}

TEST(StaticFiles, AreTheFolderAsItWasAndNothingElse) {
  const fs::path folder = test::test_folder() / "page";
  ASSERT_TRUE(write_file(folder.parent_path() / "secret.txt", "secret"));
  EXPECT_FALSE(StaticFiles::read(folder));
  fs::create_directories(folder / "inside");
  ASSERT_TRUE(write_file(folder / "index.html", "page"));
  ASSERT_TRUE(write_file(folder / "review.html", "review"));
  ASSERT_TRUE(write_file(folder / "inside/a.js", "code"));
  ASSERT_TRUE(write_file(folder / ".hidden.txt", "hidden"));
  ASSERT_TRUE(write_file(folder / "notes.unknown", "unknown"));
  fs::create_symlink("../secret.txt", folder / "link.txt");
  const auto files = StaticFiles::read(folder);
  ASSERT_TRUE(files) << files.message();
  ASSERT_TRUE(files->find("/"));
  EXPECT_EQ(files->find("/")->content, "page");
  EXPECT_EQ(files->find("/review")->content, "review");
  EXPECT_EQ(files->find("/inside/a.js")->type, "text/javascript; charset=utf-8");
  for (const char* other : {"/../secret.txt", "/link.txt", "/.hidden.txt", "/notes.unknown", "/inside", "",
                            "//index.html", "/inside/../index.html"})
    EXPECT_FALSE(files->find(other)) << other;
}

TEST(QrCode, HasAMarginAndThreeEyes) {
  const cv::Mat code = gui::qr_code("https://192.168.7.2:8443/#pin=123456");
  ASSERT_FALSE(code.empty());
  EXPECT_EQ(code.rows, code.cols);
  const int last = code.cols - 1 - 4;
  const auto is_black = [&](int x, int y) { return code.at<std::uint8_t>(y, x) == 0; };
  for (int i = 0; i < code.cols; ++i) EXPECT_FALSE(is_black(i, 3));
  for (int i = 0; i < 7; ++i)
    EXPECT_TRUE(is_black(4 + i, 4) && is_black(last - i, 4) && is_black(4 + i, last)) << i;
  EXPECT_TRUE(gui::qr_code(std::string(3000, 'x')).empty());
}

}  // namespace
}  // namespace limn::remote
