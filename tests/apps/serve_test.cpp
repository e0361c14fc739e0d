// The remote over a real network: the loopback. Guests are tests/apps/remote_client.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "apps/coarser.h"
#include "apps/live/live.h"
#include "apps/live/replay.h"
#include "apps/serve/code_sign.h"
#include "apps/serve/own_addresses.h"
#include "apps/serve/server.h"
#include "apps/world_markers.h"
#include "core/file.h"
#include "device/gl_context.h"
#include "device/jpeg.h"
#include "scene/comments.h"
#include "sim/virtual_rig.h"
#include "tests/apps/remote_client.h"
#include "tests/apps/virtual_tablet.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using test::RemoteClient;
using Clock = std::chrono::steady_clock;

const std::string k_jpeg = "\xff\xd8\xff\xd9";  // its first and last bytes

double seconds_since(Clock::time_point begun) {
  return std::chrono::duration<double>(Clock::now() - begun).count();
}

std::string number_bytes(std::uint32_t number) {
  std::string out;
  for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(number >> shift & 0xffu);
  return out;
}
std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t out = 0;
  for (std::size_t i = 4; i-- > 0;) out = out << 8 | static_cast<unsigned char>(bytes.at(at + i));
  return out;
}

// What a frame is answered with: the frame itself, after a moment, on another thread.
Eyes eyes_that_echo(std::chrono::milliseconds after = 0ms, std::size_t jpeg_bytes = 0) {
  struct Threads {
    std::vector<std::thread> all;
    std::mutex mutex;
    ~Threads() {
      for (std::thread& thread : all) thread.join();
    }
  };
  const auto threads = std::make_shared<Threads>();
  const auto later = [threads, after](std::function<void()> job) {
    const std::lock_guard lock(threads->mutex);
    threads->all.emplace_back([after, job = std::move(job)] {
      std::this_thread::sleep_for(after);
      job();
    });
  };
  Eyes eyes;
  eyes.look = [later, jpeg_bytes](const Onlooker::Window& window, std::vector<std::uint8_t> jpeg,
                                  Eyes::Answer answer) {
    if (jpeg_bytes > 0) jpeg.resize(jpeg_bytes);
    later([device = window.device, jpeg = std::move(jpeg), answer = std::move(answer)] {
      answer({json({{"sees", "nothing"}, {"why", device}}).dump(), jpeg});
    });
  };
  const auto rooms = std::make_shared<std::atomic<std::uint8_t>>(0);
  eyes.room = [later, rooms](Eyes::Answer answer) {
    later([rooms, answer = std::move(answer)] {
      answer({R"({"why":""})", {0xff, 0xd8, static_cast<std::uint8_t>(++*rooms)}});
    });
  };
  return eyes;
}

class AServer : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = test::test_folder();
    fs::create_directories(folder_ / "page");
    ASSERT_TRUE(write_file(folder_ / "page/index.html", "<!doctype html><title>Limn</title>"));
    ASSERT_TRUE(write_file(folder_ / "secret.txt", "secret"));
  }

  void open(ServeOptions options = {}, Eyes eyes = {}) {
    if (options.at.empty()) options.at = "0";
    options.page = folder_ / "page";
    options.keys = folder_ / "keys";
    is_encrypted_ = options.always_encrypted;
    auto server = Server::open(options, std::move(eyes));
    ASSERT_TRUE(server) << server.message();
    server_ = std::move(*server);
  }

  std::unique_ptr<RemoteClient> client() const {
    return std::make_unique<RemoteClient>(server_->port(), is_encrypted_);
  }
  std::string pin(Role role) const { return server_->invitation().pins[static_cast<std::size_t>(role)]; }
  std::string wrong_pin() const {
    for (int i = 0;; ++i)
      if (const std::string pin = fmt::format("{:06}", i);
          std::count(server_->invitation().pins.begin(), server_->invitation().pins.end(), pin) == 0)
        return pin;
  }
  std::string token_of(Role role, const std::string& name = "Ann") const {
    const auto answer = client()->post("/api/pair", json({{"pin", pin(role)}, {"name", name}}).dump());
    EXPECT_EQ(answer.status, 200) << answer.body;
    return answer.status == 200 ? json::parse(answer.body)["token"].get<std::string>() : "";
  }
  // A WebSocket that has said hello.
  std::unique_ptr<RemoteClient> guest(Role role, const std::string& name = "Ann") const {
    auto out = client();
    EXPECT_EQ(out->upgrade(token_of(role, name)).status, 101);
    EXPECT_TRUE(out->message_of("hello"));
    return out;
  }

  fs::path folder_;
  bool is_encrypted_ = false;
  std::unique_ptr<Server> server_;
};

TEST_F(AServer, GivesThePageAndGuardsIt) {
  open();
  const auto page = client()->get("/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.body, "<!doctype html><title>Limn</title>");
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  EXPECT_NE(page.headers.at("content-security-policy").find("default-src 'none'"), std::string::npos);
  EXPECT_NE(page.headers.at("content-security-policy").find("frame-ancestors 'none'"), std::string::npos);
  EXPECT_EQ(page.headers.at("x-content-type-options"), "nosniff");
  EXPECT_NE(page.headers.at("permissions-policy").find("camera=(self)"), std::string::npos);
  const auto again = client()->ask("GET", "/", "If-None-Match: " + page.headers.at("etag") + "\r\n");
  EXPECT_EQ(again.status, 304);
  const auto head = client();
  ASSERT_TRUE(head->send(fmt::format("HEAD / HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", server_->port())));
  EXPECT_EQ(client()->ask("GET", "/index.html?x=y").body, page.body);
  EXPECT_EQ(client()->ask("DELETE", "/", "Content-Type: application/json\r\n").status, 405);
}

TEST_F(AServer, ShowsNothingElseWithoutPairing) {
  open({}, eyes_that_echo());
  for (const char* path :
       {"/api/state", "/api/actions", "/api/live", "/api/edit", "/api/leave", "/api/nothing",
        "/picture/room.jpg", "/picture/projector/projector0.jpg", "/picture/variant/mirror/a.png",
        "/picture/look/a.png", "/look/a.glb", "/picture/../index.html"}) {
    const auto answer = client()->get(path);
    EXPECT_EQ(answer.status, 401) << path;
    EXPECT_EQ(answer.headers.at("cache-control"), "no-store") << path;
  }
  EXPECT_EQ(client()->post("/api/edit", R"({"action": "blackout"})").status, 401);
  EXPECT_EQ(client()->post("/api/comment", R"({"text": "x"})").status, 401);
  EXPECT_EQ(client()->upgrade("").status, 401);
  EXPECT_EQ(client()->upgrade(std::string(64, 'a')).status, 401);
}

TEST_F(AServer, GivesNoFileBesideThePage) {
  open();
  for (const char* path : {"/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "/..\\secret.txt",
                           "/page/../../secret.txt", "//secret.txt", "/index.html/../../secret.txt",
                           "/etc/passwd", "/.%00./secret.txt", "/index.html%00"}) {
    const auto answer = client()->get(path);
    EXPECT_TRUE(answer.status == 404 || answer.status == 400) << path << ": " << answer.status;
    EXPECT_EQ(answer.body.find("secret"), std::string::npos) << path;
  }
  EXPECT_EQ(client()->get("http://127.0.0.1/").status, 400);
}

TEST_F(AServer, PairsByPinAndForgetsWhoLeaves) {
  open();
  const auto answer = client()->post("/api/pair", json({{"pin", pin(Role::work)}, {"name", "Ann"}}).dump());
  ASSERT_EQ(answer.status, 200) << answer.body;
  const json said = json::parse(answer.body);
  EXPECT_EQ(said["role"], "work");
  EXPECT_EQ(said["name"], "Ann");
  EXPECT_EQ(said["expires_s"], 12 * 60 * 60);
  const std::string cookie = answer.headers.at("set-cookie"), token = said["token"];
  const std::string name = fmt::format("limn-{}", server_->port());  // two on a machine do not share it
  EXPECT_EQ(cookie.rfind(name + "=" + token + ";", 0), 0u) << cookie;
  for (const char* word : {"HttpOnly", "SameSite=Strict", "Path=/"})
    EXPECT_NE(cookie.find(word), std::string::npos) << cookie;
  EXPECT_EQ(client()->get("/api/actions", token).status, 200);
  EXPECT_EQ(client()->ask("GET", "/api/actions", "Cookie: " + name + "=" + token + "\r\n").status, 200);
  EXPECT_EQ(client()->ask("GET", "/api/actions", "Cookie: limn-1=" + token + "\r\n").status, 401);
  const auto posing =
      client()->post("/api/pair", json({{"pin", pin(Role::work)}, {"name", "operator"}}).dump());
  EXPECT_EQ(posing.status, 400);
  EXPECT_NE(posing.body.find("none of Limn's own"), std::string::npos) << posing.body;
  // Somebody else of that name, and the same browser again.
  const json another = {{"pin", pin(Role::look)}, {"name", "Ann"}};
  EXPECT_EQ(json::parse(client()->post("/api/pair", another.dump()).body)["name"], "Ann (2)");
  const auto again = client()->ask(
      "POST", "/api/pair",
      "Content-Type: application/json\r\nCookie: " + name + "=" + token_of(Role::look, "Ben") + "\r\n",
      json({{"pin", pin(Role::look)}, {"name", "Ben"}}).dump());
  EXPECT_EQ(json::parse(again.body)["name"], "Ben");
  const auto socket = client();
  ASSERT_EQ(socket->upgrade(token).status, 101);
  ASSERT_TRUE(socket->message_of("hello"));

  EXPECT_EQ(client()->post("/api/leave", "{}", token).status, 200);
  EXPECT_TRUE(socket->message_of("bye"));
  EXPECT_FALSE(socket->message());
  EXPECT_EQ(client()->get("/api/actions", token).status, 401) << "a session that was left is replayed";
  EXPECT_EQ(client()->upgrade(token).status, 401);
}

TEST_F(AServer, LimitsWrongPins) {
  open();
  const std::string wrong = json({{"pin", wrong_pin()}}).dump(),
                    right = json({{"pin", pin(Role::look)}}).dump();
  for (int i = 0; i < k_most_wrong; ++i) EXPECT_EQ(client()->post("/api/pair", wrong).status, 401) << i;
  const auto held = client()->post("/api/pair", right);
  EXPECT_EQ(held.status, 429) << "a right PIN after too many wrong ones";
  EXPECT_LE(std::stoi(held.headers.at("retry-after")), 60);
  EXPECT_GE(std::stoi(held.headers.at("retry-after")), 58);
}

TEST_F(AServer, RefusesOtherPagesAndOtherNames) {
  open();
  const std::string token = token_of(Role::operate);
  const std::string host = fmt::format("127.0.0.1:{}", server_->port());
  const std::string body = json({{"pin", pin(Role::look)}}).dump();
  const std::string json_type = "Content-Type: application/json\r\n";
  const auto pair = [&](const std::string& headers) {
    return client()->ask("POST", "/api/pair", headers, body).status;
  };
  EXPECT_EQ(pair(json_type + "Origin: http://" + host + "\r\n"), 200);
  EXPECT_EQ(pair(json_type + "Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(pair(json_type + "Origin: https://" + host + "\r\n"), 403);
  EXPECT_EQ(pair(json_type + "Origin: null\r\n"), 403);
  EXPECT_EQ(pair("Content-Type: text/plain\r\n"), 415);
  EXPECT_EQ(pair("Content-Type: application/x-www-form-urlencoded\r\n"), 415);
  EXPECT_EQ(pair(""), 415);
  EXPECT_EQ(pair(json_type + "Host: evil.example\r\n"), 403) << "DNS that was bound anew";
  EXPECT_EQ(pair(json_type + "Host: localhost:1\r\n"), 200);
  EXPECT_EQ(client()->upgrade(token, "Origin: http://evil.example\r\n").status, 403);
  EXPECT_EQ(client()->upgrade(token, "Origin: http://" + host + "\r\n").status, 101);
}

TEST_F(AServer, RefusesWhatIsTooLargeOrMalformed) {
  open();
  const NetworkLimits limits;
  const std::string type = "Content-Type: application/json\r\n";
  EXPECT_EQ(client()->post("/api/pair", std::string(limits.body_bytes + 1, ' ')).status, 413);
  EXPECT_EQ(client()->ask("POST", "/api/pair", type + "Content-Length: 20000000\r\n").status, 413);
  EXPECT_EQ(client()->ask("GET", "/", "X-Long: " + std::string(limits.header_bytes, 'x') + "\r\n").status,
            431);
  EXPECT_EQ(client()->ask("POST", "/api/pair", type, "{\"pin\": ").status, 400);
  EXPECT_EQ(client()->ask("POST", "/api/pair", type, std::string(limits.body_bytes, '[')).status, 400);
  const auto raw = [&](const std::string& bytes) {
    const auto out = client();
    out->send(bytes);
    return out->answer().status;
  };
  EXPECT_EQ(raw("hello, is anybody there?\r\n\r\n"), 400);
  EXPECT_EQ(raw(std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11) + "\r\n\r\n"), 400) << "TLS";
  EXPECT_EQ(raw("GET / HTTP/1.1\r\n\r\n"), 400) << "no Host";
  EXPECT_EQ(client()->get("/").status, 200);
}

TEST_F(AServer, ShedsWhoIsSlowToAsk) {
  ServeOptions options;
  options.limits.read = 300ms;
  open(options);
  const auto slow = client(), silent = client();
  const auto begun = Clock::now();
  slow->send("GET / HTTP/1.1\r\nHost: local");
  EXPECT_EQ(slow->answer().status, 408);
  EXPECT_EQ(silent->answer().status, 0) << "nothing was asked";
  EXPECT_LT(seconds_since(begun), 2);
}

TEST_F(AServer, RolesMayDoTheirs) {
  open();
  const auto edit = [&](Role role, const std::string& action) {
    return client()->post("/api/edit", json({{"action", action}}).dump(), token_of(role)).status;
  };
  EXPECT_EQ(edit(Role::look, "blackout"), 403);
  EXPECT_EQ(edit(Role::look, "pair"), 403);
  EXPECT_EQ(edit(Role::work, "pair"), 403);
  EXPECT_EQ(edit(Role::operate, "dance"), 400);
  EXPECT_EQ(client()->post("/api/comment", R"({"text": "x"})", token_of(Role::look)).status, 403);
  const auto looker = guest(Role::look);
  looker->send_text(R"({"type": "edit", "id": 5, "action": "blackout"})");
  const auto refused = looker->message_of("refused");
  ASSERT_TRUE(refused);
  EXPECT_EQ(json::parse(*refused)["id"], 5);
  EXPECT_NE(refused->find("expected the role work, found look"), std::string::npos) << *refused;
}

TEST_F(AServer, AnswersMalformedMessagesAndShedsFloods) {
  open();
  const auto one = guest(Role::work);
  one->send_text("{\"type\": ");
  EXPECT_TRUE(one->message_of("refused"));
  one->send_binary("bytes");
  EXPECT_TRUE(one->message_of("refused"));
  one->send_text(std::string(k_longest_message + 1, ' '));
  EXPECT_FALSE(one->message());

  const auto flood = guest(Role::work);
  for (int i = 0; i < 2000; ++i)
    if (!flood->send_text(R"({"type": "seen", "picture": 0})")) break;
  const auto bye = flood->message_of("bye");
  ASSERT_TRUE(bye);
  EXPECT_NE(bye->find("too many messages"), std::string::npos);
  EXPECT_EQ(client()->get("/").status, 200);
}

TEST_F(AServer, AThousandConnectionsAreShedAndOthersServed) {
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = std::min<rlim_t>(files.rlim_max, 8192);
  ::setrlimit(RLIMIT_NOFILE, &files);
  ServeOptions options;
  options.limits.read = 1500ms;
  open(options);
  const auto before = guest(Role::look);
  std::vector<std::unique_ptr<RemoteClient>> crowd;
  for (int i = 0; i < 1000; ++i) crowd.push_back(client());
  int told = 0;
  for (const auto& each : crowd) {
    each->send("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const int status = each->answer().status;
    EXPECT_TRUE(status == 200 || status == 503 || status == 0) << status;
    told += status == 503;
  }
  EXPECT_GE(told, 16) << "some are told why";
  // Who was there before was served meanwhile, and there is room again.
  EXPECT_TRUE(before->send_text("not JSON"));
  EXPECT_TRUE(before->message_of("refused"));
  crowd.clear();
  std::this_thread::sleep_for(100ms);
  EXPECT_EQ(client()->get("/").status, 200);
}

TEST_F(AServer, HoldsNoMoreThanItsConnections) {
  open();
  std::vector<std::unique_ptr<RemoteClient>> all;
  for (std::size_t i = 0; i < NetworkLimits{}.connections; ++i) {
    all.push_back(client());
    ASSERT_EQ(all.back()->get("/").status, 200) << i;
  }
  const auto answer = client()->get("/");
  EXPECT_EQ(answer.status, 503);
  EXPECT_NE(answer.body.find("too many connections"), std::string::npos);
  all.pop_back();
  int status = 0;
  for (int i = 0; i < 100 && status != 200; ++i) {
    std::this_thread::sleep_for(10ms);
    status = client()->get("/").status;
  }
  EXPECT_EQ(status, 200) << "a place was given back";
}

TEST_F(AServer, AnswersEveryFrameOfAWindowWithItsNumber) {
  open({}, eyes_that_echo(5ms));
  const auto tablet = guest(Role::look);
  tablet->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  for (std::uint32_t i = 1; i <= 20; ++i) {
    const std::string jpeg = "\xff\xd8" + std::string(1000 * i, static_cast<char>(i));
    tablet->send_binary(number_bytes(i) + jpeg);
    const auto answer = tablet->message();
    ASSERT_TRUE(answer && !answer->is_text);
    EXPECT_EQ(number_at(answer->bytes, 0), 2u);
    ASSERT_EQ(number_at(answer->bytes, 4), i);
    const std::uint32_t length = number_at(answer->bytes, 8);
    EXPECT_EQ(json::parse(answer->bytes.substr(12, length))["why"], "tablet-0001");
    EXPECT_TRUE(answer->bytes.substr(12 + length) == jpeg) << i;
  }
}

TEST_F(AServer, OpensNoMoreWindowsThanItCanLookThrough) {
  open({}, eyes_that_echo());
  std::vector<std::unique_ptr<RemoteClient>> tablets;
  for (std::ptrdiff_t i = 0; i <= k_most_windows; ++i) {
    tablets.push_back(guest(Role::look));
    tablets.back()->send_text(
        fmt::format(R"({{"type": "window", "device": "tablet-{:04}", "on": true}})", i));
  }
  EXPECT_TRUE(tablets.back()->message_of("refused"));
  tablets.front()->send_binary(number_bytes(1) + k_jpeg);
  const auto answer = tablets.front()->message();
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->is_text);
}

TEST_F(AServer, SaysWhyThereIsNoRoomPicture) {
  Eyes eyes;
  eyes.room = [](Eyes::Answer answer) { answer({R"({"why":"no camera"})", {}}); };
  open({}, eyes);
  const auto one = guest(Role::look);
  one->send_text(R"({"type": "pictures", "room": true})");
  const auto picture = one->message();
  ASSERT_TRUE(picture && !picture->is_text);
  EXPECT_EQ(picture->bytes.substr(12), R"({"why":"no camera"})");
  EXPECT_EQ(client()->get("/picture/room.jpg", token_of(Role::look)).status, 404);
}

TEST_F(AServer, LooksAtTheNewestOfFramesThatComeTogether) {
  open({}, eyes_that_echo(200ms));
  const auto tablet = guest(Role::look);
  tablet->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  for (std::uint32_t i = 1; i <= 10; ++i) tablet->send_binary(number_bytes(i) + k_jpeg);
  std::vector<std::uint32_t> answered;
  while (const auto answer = tablet->message(1)) answered.push_back(number_at(answer->bytes, 4));
  EXPECT_EQ(answered, (std::vector<std::uint32_t>{1, 10}));
}

TEST_F(AServer, RefusesLargeFramesAndForgetsHalfOnes) {
  open({}, eyes_that_echo());
  const auto large = guest(Role::look);
  large->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  large->send_binary(number_bytes(1) + "\xff\xd8" + std::string(20'000'000, 'x'));
  EXPECT_FALSE(large->message()) << "20 MB";
  const auto early = guest(Role::look);
  early->send_binary(number_bytes(1) + "\xff\xd8" + std::string(k_longest_message, 'x'));
  EXPECT_FALSE(early->message()) << "no window was begun";
  for (int i = 0; i < 20; ++i) {
    const auto half = guest(Role::look);
    half->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
    half->send_half_a_frame(k_longest_frame, number_bytes(1) + "\xff\xd8" + std::string(100'000, 'x'));
  }
  const auto next = guest(Role::look);
  next->send_text(R"({"type": "window", "device": "tablet-0002", "on": true})");
  next->send_binary(number_bytes(3) + k_jpeg);
  const auto answer = next->message();
  ASSERT_TRUE(answer);
  EXPECT_EQ(number_at(answer->bytes, 4), 3u);
}

TEST_F(AServer, SendsRoomPicturesOneInFlight) {
  open({}, eyes_that_echo());
  const auto one = guest(Role::look), other = guest(Role::look);
  for (const auto* each : {&one, &other}) (*each)->send_text(R"({"type": "pictures", "room": true})");
  std::uint32_t last = 0;
  for (int i = 0; i < 3; ++i) {
    const auto picture = one->message();
    ASSERT_TRUE(picture && !picture->is_text);
    EXPECT_EQ(number_at(picture->bytes, 0), 1u);
    EXPECT_GT(number_at(picture->bytes, 4), last);
    last = number_at(picture->bytes, 4);
    EXPECT_FALSE(one->message(0.3)) << "one was not seen yet";
    one->send_text(json({{"type", "seen"}, {"picture", last}}).dump());
  }
  EXPECT_TRUE(other->message());
  EXPECT_FALSE(other->message(0.3));
  EXPECT_EQ(client()->get("/picture/room.jpg", token_of(Role::look)).body.substr(0, 2), "\xff\xd8");
}

TEST_F(AServer, CutsWhoDoesNotRead) {
  ServeOptions options;
  options.limits.write = 500ms;
  open(options, eyes_that_echo(0ms, 3'000'000));
  const auto slow = guest(Role::look);
  slow->read_little();
  slow->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  bool is_cut = false;
  for (std::uint32_t i = 1; i < 200 && !is_cut; ++i) {
    is_cut = !slow->send_binary(number_bytes(i) + k_jpeg);
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(is_cut);
  EXPECT_EQ(client()->get("/").status, 200);
}

TEST_F(AServer, IsEncryptedFromTheFirstByteAwayFromTheLoopback) {
  const std::vector<std::string> own = own_addresses();
  if (own.empty() || own.front().find(':') != std::string::npos)
    GTEST_SKIP() << "no network: AServer.IsEncryptedFromTheFirstByteAwayFromTheLoopback";
  ServeOptions options;
  options.at = own.front() + ":0";
  open(options);
  EXPECT_EQ(server_->invitation().url.rfind("https://" + own.front(), 0), 0u);
  RemoteClient plain(server_->port(), false, own.front());
  plain.send("GET / HTTP/1.1\r\nHost: limn\r\n\r\n");
  EXPECT_EQ(plain.answer().status, 0);
  RemoteClient encrypted(server_->port(), true, own.front());
  EXPECT_EQ(encrypted.get("/").status, 200);
  EXPECT_EQ(encrypted.fingerprint(), server_->invitation().fingerprint);
}

TEST_F(AServer, SpeaksTlsAllTheWay) {
  ServeOptions options;
  options.always_encrypted = true;
  options.limits.read = 500ms;
  open(options, eyes_that_echo());
  const auto first = client();
  EXPECT_EQ(first->fingerprint(), server_->invitation().fingerprint);
  const auto paired = first->post("/api/pair", json({{"pin", pin(Role::look)}}).dump());
  ASSERT_EQ(paired.status, 200);
  EXPECT_NE(paired.headers.at("set-cookie").find("; Secure"), std::string::npos);
  EXPECT_EQ(client()->ask("GET", "/", "X-Long: " + std::string(9000, 'x') + "\r\n").status, 431);
  const auto slow = client();
  slow->send("GET / HTTP/1.1\r\nHost: local");
  EXPECT_EQ(slow->answer().status, 408);
  const auto tablet = guest(Role::look);
  tablet->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  const std::string jpeg = "\xff\xd8" + std::string(500'000, 'x');
  tablet->send_binary(number_bytes(9) + jpeg);
  const auto answer = tablet->message();
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->bytes.ends_with(jpeg));
}

TEST_F(AServer, TellsOfAPortThatIsTaken) {
  open();
  ServeOptions options;
  options.at = std::to_string(server_->port());
  options.page = folder_ / "page";
  const auto second = Server::open(options, {});
  ASSERT_FALSE(second);
  EXPECT_NE(second.message().find("--serve: 127.0.0.1"), std::string::npos) << second.message();
  EXPECT_NE(second.message().find("Take another port"), std::string::npos) << second.message();
  EXPECT_FALSE(second.error().wrong_usage);
  for (const char* wrong : {"x", "0.0.0.0:", ":80", "70000", "localhost:80"}) {
    options.at = wrong;
    const auto refused = Server::open(options, {});
    ASSERT_FALSE(refused) << wrong;
    EXPECT_TRUE(refused.error().wrong_usage) << wrong << ": " << refused.message();
  }
}

TEST_F(AServer, EndsInUnderASecondWithGuestsInTheHouse) {
  open({}, eyes_that_echo(300ms));
  std::vector<std::unique_ptr<RemoteClient>> guests;
  for (int i = 0; i < 8; ++i) guests.push_back(guest(Role::look));
  guests[0]->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  guests[0]->send_binary(number_bytes(1) + k_jpeg);
  const auto idle = client(), asking = client();
  asking->send("GET / HTTP/1.1\r\nHost");
  std::this_thread::sleep_for(50ms);
  const auto begun = Clock::now();
  server_.reset();
  EXPECT_LT(seconds_since(begun), 1);
  for (const auto& each : guests) EXPECT_TRUE(each->message_of("bye"));
}

// A session with a virtual rig's scene, served, and played by hand: one turn is what the loop does between
// two pictures.
class AServedSession : public AServer {
 protected:
  void SetUp() override {
    AServer::SetUp();
    auto world = sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/studio.json", marker_picture);
    ASSERT_TRUE(world) << world.message();
    ASSERT_TRUE(make_coarser(0.25, &world->rig).ok());
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    SessionSetup setup;
    setup.rig = world->rig;
    setup.scene = *world->scene;
    setup.scene.folder = folder_ / "project";
    fs::create_directories(setup.scene.folder);
    auto telemetry = Telemetry::create({});
    ASSERT_TRUE(telemetry);
    telemetry_.emplace(std::move(*telemetry));
    auto session = Session::create(setup, &*telemetry_, nullptr);
    ASSERT_TRUE(session) << session.message();
    session_.emplace(std::move(*session));
    health_.add({.name = "camera0", .kind = "camera"});
    open({}, eyes_that_echo());
  }
  void TearDown() override { server_.reset(); }

  void turn() {
    at_ = shifted(at_, 0.01);
    server_->hear(&*session_, at_);
    server_->tell(*session_, *telemetry_, health_, at_);
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
  std::optional<Telemetry> telemetry_;
  std::optional<Session> session_;
  DeviceHealth health_;
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
  EXPECT_EQ(session_->staging().slots[0].variant, variants[1].name);
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
  EXPECT_TRUE(session_->staging().blackout);
}

// The session gives guests no more of its time than it can between two pictures.
TEST_F(AServedSession, AFloodOfEditsIsTakenInPortions) {
  const auto ann = guest(Role::work);
  for (int i = 0; i < 100; ++i)
    ann->send_text(fmt::format(
        R"({{"type": "edit", "id": {}, "action": "nudge", "slot": "mirror", "value": "1 0 0"}})", i));
  std::this_thread::sleep_for(200ms);
  turn();
  const double first_mm = 1e3 * session_->staging().slots[0].nudge.x();
  EXPECT_GT(first_mm, 0);
  EXPECT_LE(first_mm, Server::k_most_at_once + 1e-6);
  for (int i = 0; i < 100; ++i) turn();
  EXPECT_NEAR(1e3 * session_->staging().slots[0].nudge.x(), 100, 1e-6);
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
  for (const char* key : {"number",       "slots",    "prototype", "looks",   "look",          "other_look",
                          "deleted_look", "blackout", "frozen",    "grid",    "marker_states", "split",
                          "split_mm",     "screen",   "viewer",    "follows", "windows",       "screens",
                          "projectors",   "devices",  "waiting",   "guests",  "comments",      "notes"})
    EXPECT_TRUE(state.contains(key)) << key;
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

TEST_F(AServedSession, GivesPicturesAndAssemblies) {
  ASSERT_TRUE(session_->edit({"save_look", "", "calm one"}, "test", at_));
  session_->paint(at_, at_);
  const std::string slot = session_->setup().scene.slots[0].name,
                    variant = session_->setup().scene.slots[0].variants[0].name;
  play_while([&] {
    const std::string token = token_of(Role::look);
    std::this_thread::sleep_for(100ms);
    const auto projector = client()->get("/picture/projector/projector0.jpg", token);
    ASSERT_EQ(projector.status, 200) << projector.body;
    EXPECT_EQ(projector.headers.at("cache-control"), "no-store");
    const auto picture = device::decode_jpeg(
        {reinterpret_cast<const std::uint8_t*>(projector.body.data()), projector.body.size()});
    ASSERT_TRUE(picture) << picture.message();
    EXPECT_EQ(picture->size(), session_->painted().projectors[0].size());
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

// What the loop pays for guests, of its time between two pictures.
// A code in a projector's light is for those who stand there.
TEST_F(AServedSession, ProjectsACodeForAWhile) {
  ServeOptions options;
  options.code_lasts = 1500ms;
  open(options, eyes_that_echo());
  session_->paint(at_, at_);
  const cv::Mat painted = session_->painted().projectors[0].clone();
  const auto is_painted = [&](const cv::Mat& lit) { return cv::norm(lit, painted, cv::NORM_INF) == 0; };
  EXPECT_TRUE(is_painted(server_->lit(&*session_, 0)));
  server_->show_code("projector0", Role::work);
  EXPECT_EQ(server_->code_projector(), "projector0");
  ASSERT_TRUE(session_->edit({"blackout", "", "on"}, "test", at_));
  EXPECT_TRUE(is_painted(server_->lit(&*session_, 0))) << "under a blackout";
  ASSERT_TRUE(session_->edit({"blackout", "", "off"}, "test", at_));
  // No prototype is seen: after a while it is in the picture's middle.
  cv::Mat lit = server_->lit(&*session_, 0);
  EXPECT_TRUE(is_painted(lit));
  for (const auto asked = Clock::now(); is_painted(lit) && seconds_since(asked) < 5;) {
    std::this_thread::sleep_for(50ms);
    lit = server_->lit(&*session_, 0);
  }
  const auto begun = Clock::now();
  cv::Mat sign;
  cv::resize(0.75 * code_sign(server_->invitation().url_for(Role::work), pin(Role::work), "work", 12), sign,
             {}, 1.0 / 6, 1.0 / 6, cv::INTER_AREA);
  const cv::Rect middle({(lit.cols - sign.cols) / 2, (lit.rows - sign.rows) / 2}, sign.size());
  EXPECT_LE(cv::norm(lit(middle), sign, cv::NORM_INF), 1);
  EXPECT_TRUE(is_painted(session_->painted().projectors[0])) << "what is recorded and told";
  EXPECT_EQ(cv::norm(server_->lit(&*session_, 1), session_->painted().projectors[1], cv::NORM_INF), 0);
  play_while([&] {
    const std::string looks = token_of(Role::look, "Ben"), works = token_of(Role::work, "Ann");
    std::this_thread::sleep_for(100ms);
    const auto hidden = client()->get("/picture/room.jpg", looks);
    EXPECT_EQ(hidden.status, 503);
    EXPECT_NE(hidden.body.find("A code for other guests"), std::string::npos) << hidden.body;
    EXPECT_EQ(client()->get("/picture/room.jpg", works).status, 200);
    const auto projector = client()->get("/picture/projector/projector0.jpg", looks);
    ASSERT_EQ(projector.status, 200);
    const cv::Mat told = device::decode_jpeg({reinterpret_cast<const std::uint8_t*>(projector.body.data()),
                                              projector.body.size()})
                             .value();
    EXPECT_LT(cv::norm(told, painted, cv::NORM_L1) / static_cast<double>(told.total()), 3) << "of 255 levels";
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
  std::this_thread::sleep_for(1500ms);
  EXPECT_TRUE(is_painted(server_->lit(&*session_, 0)));
  EXPECT_EQ(server_->code_projector(), "");
}

TEST_F(AServedSession, CostsTheSessionLittle) {
  const auto cost_us = [&] {
    double spent_s = 0;
    for (int i = 0; i < 100; ++i) {
      std::this_thread::sleep_for(10ms);
      const auto begun = Clock::now();
      turn();
      spent_s += seconds_since(begun);
    }
    return 1e6 * spent_s / 100;
  };
  const double alone_us = cost_us();
  std::vector<std::unique_ptr<RemoteClient>> guests;
  for (int i = 0; i < 4; ++i) guests.push_back(guest(Role::look));
  const double served_us = cost_us();
  fmt::print("a turn costs the session {:.1f} us alone, {:.1f} us with four guests\n", alone_us, served_us);
  EXPECT_LT(served_us, 1000);
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
  const fs::path folder = test::test_folder(), config = fs::path(LIMN_SOURCE_DIR) / "config";
  fs::copy(config / "scenes/door", folder / "door");
  std::string world = read_file(config / "worlds/studio.json").value();
  world.replace(world.find("../scenes/door"), 14, "door");
  ASSERT_TRUE(write_file(folder / "world.json", world));
  ::setenv("XDG_CONFIG_HOME", folder.c_str(), 1);
  LiveOptions options;
  options.resolution = 0.25;
  options.world = folder / "world.json";
  options.seconds = 1e5;  // ended below
  options.serve = "0";
  options.record = folder / "recording";
  // What a tablet sees of the room.
  sim::World seen = sim::load_world(folder / "world.json", marker_picture).value();
  std::vector<cv::Mat> dark;
  for (const Imager& p : seen.rig.projectors) dark.push_back(cv::Mat::zeros(p.height, p.width, CV_8UC3));
  const Eigen::Vector3d p_middle = seen.world_from_prototype.translation;
  const std::vector<std::uint8_t> picture =
      test::VirtualTablet(seen, dark, 640, 400, 2)
          .shoot_from(looking_at(p_middle + Eigen::Vector3d(-0.4, -0.6, 0.1), p_middle, {0, 0, 1}))
          .jpeg;
  const std::string jpeg(picture.begin(), picture.end());
  bool is_room_there = false, is_followed = false, is_left = false;
  int status = 0;
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
        is_room_there = RemoteClient(port).get("/picture/room.jpg", token).status == 200;
        state = json::parse(RemoteClient(port).get("/api/state", token).body);
      }
      std::raise(SIGTERM);
    });
    lived = run_live(options);
    guest.join();
  }
  ASSERT_TRUE(lived.ok()) << lived.message();
  EXPECT_EQ(status, 200);
  EXPECT_TRUE(is_room_there);
  EXPECT_TRUE(is_followed);
  EXPECT_TRUE(is_left);
  EXPECT_NE(read_file(folder / "recording/events.jsonl").value().find("\"guest_eye\":["), std::string::npos);
  EXPECT_EQ(state["slots"][0]["variant"], "sport");
  EXPECT_EQ(state["last_edit"]["who"], "Ann");
  EXPECT_EQ(state["looks"], json({"by Ann"}));
  ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << (replayed ? "" : replayed.message());
}

}  // namespace
}  // namespace limn::apps
