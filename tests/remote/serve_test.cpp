// The remote over a real network, the loopback, without a session: who comes in, and what is refused. Guests
// are tests/apps/remote_client.
#include <sys/resource.h>

#include "remote/http/own_addresses.h"
#include "tests/remote/a_server.h"
#include "tests/support/text.h"

namespace limn::remote {
namespace {

const std::string k_jpeg = "\xff\xd8\xff\xd9";  // its first and last bytes

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
  open({}, echoing_providers());
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
  for (int i = 0; i < k_max_wrong_pins; ++i) EXPECT_EQ(client()->post("/api/pair", wrong).status, 401) << i;
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
  int refused = 0;
  for (const auto& each : crowd) {
    each->send("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const int status = each->answer().status;
    EXPECT_TRUE(status == 200 || status == 503 || status == 0) << status;
    refused += status == 503;
  }
  EXPECT_GE(refused, 16) << "some are told why";
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

TEST_F(AServer, ClosesSilentConnectionsOfOneAddressForThoseOfOthers) {
  open();
  const auto operates = guest(Role::operate);
  std::vector<std::unique_ptr<RemoteClient>> silent;
  for (std::size_t i = 0; i < NetworkLimits{}.connections + 20; ++i)
    silent.push_back(std::make_unique<RemoteClient>(server_->port(), false, "127.0.0.1", "127.0.0.2"));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(client()->get("/").status, 200) << i;
  operates->send_text("?");
  EXPECT_TRUE(operates->message_of("refused")) << "a WebSocket stays";
}

TEST_F(AServer, AnswersEveryFrameOfAWindowWithItsNumber) {
  open({}, echoing_providers(5ms));
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
  open({}, echoing_providers());
  const std::array<const char*, 5> names = {"Ann", "Bea", "Carl", "Dora", "Emil"};
  std::vector<std::unique_ptr<RemoteClient>> tablets;
  for (std::ptrdiff_t i = 0; i <= k_max_windows; ++i) {
    tablets.push_back(guest(Role::look, names.at(static_cast<std::size_t>(i / k_max_windows_of_guest))));
    tablets.back()->send_text(
        fmt::format(R"({{"type": "window", "device": "tablet-{:04}", "on": true}})", i));
  }
  EXPECT_TRUE(tablets.back()->message_of("refused"));
  tablets.front()->send_binary(number_bytes(1) + k_jpeg);
  const auto answer = tablets.front()->message();
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->is_text);
}

TEST_F(AServer, OneGuestCannotTakeAllWindows) {
  open({}, echoing_providers());
  std::vector<std::unique_ptr<RemoteClient>> tabs;
  const auto open_window = [&](const std::string& token) {
    tabs.push_back(client());
    EXPECT_EQ(tabs.back()->upgrade(token).status, 101);
    EXPECT_TRUE(tabs.back()->message_of("hello"));
    tabs.back()->send_text(
        fmt::format(R"({{"type": "window", "device": "tablet-{:04}", "on": true}})", tabs.size()));
  };
  const std::string ann = token_of(Role::look), bea = token_of(Role::look, "Bea");
  for (std::ptrdiff_t i = 0; i <= k_max_windows_of_guest; ++i) open_window(ann);
  const auto refused = tabs.back()->message_of("refused");
  ASSERT_TRUE(refused);
  test::expect_contains(*refused, "close one of them first");
  open_window(bea);
  tabs.back()->send_binary(number_bytes(1) + k_jpeg);
  const auto answer = tabs.back()->message();
  ASSERT_TRUE(answer);
  EXPECT_FALSE(answer->is_text);
}

// Two windows of one guest, as of two tabs of a browser: light follows the one that was opened last, and the
// other one only when that has been still for a second.
TEST_F(AServer, OneWindowOfAGuestIsItsTablet) {
  ImageProviders providers;
  std::mutex mutex;
  std::map<std::string, std::string> named;  // by device
  providers.draw_window = [&](const TabletWindow& window, std::vector<std::uint8_t>, ImageCallback answer) {
    {
      const std::lock_guard lock(mutex);
      named[window.device] = window.guest;
    }
    answer({R"({"sees": "markers"})", {0xff, 0xd8}, Eigen::Vector3d(window.device == "tablet-0001", 0, 0)});
  };
  open({}, providers);
  const std::string token = token_of(Role::work);
  const auto window = [&](const std::string& device) {
    auto out = client();
    EXPECT_EQ(out->upgrade(token).status, 101);
    EXPECT_TRUE(out->message_of("hello"));
    out->send_text(json({{"type", "window"}, {"device", device}, {"on", true}}).dump());
    return out;
  };
  std::uint32_t number = 0;
  const auto is_tablet = [&](RemoteClient* of, const std::string& device) {
    of->send_binary(number_bytes(++number) + k_jpeg);
    EXPECT_TRUE(of->message());
    const std::lock_guard lock(mutex);
    return named.at(device) == "Ann";
  };
  const auto first = window("tablet-0001");
  EXPECT_TRUE(is_tablet(first.get(), "tablet-0001"));
  const auto second = window("tablet-0002");
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(is_tablet(second.get(), "tablet-0002"));
    EXPECT_FALSE(is_tablet(first.get(), "tablet-0001"));
  }
  std::this_thread::sleep_for(1100ms);  // the second one is hidden
  EXPECT_TRUE(is_tablet(first.get(), "tablet-0001"));
  EXPECT_FALSE(is_tablet(second.get(), "tablet-0002")) << "it is back, and takes it from nobody";
  first->send_text(R"({"type": "window", "device": "tablet-0001", "on": false})");
  while (!is_tablet(second.get(), "tablet-0002")) ASSERT_LT(number, 50u);
}

TEST_F(AServer, SaysWhyThereIsNoRoomImage) {
  ImageProviders providers;
  providers.draw_room = [](ImageCallback answer) { answer({R"({"why":"no camera"})", {}}); };
  open({}, providers);
  const auto one = guest(Role::look);
  one->send_text(R"({"type": "pictures", "room": true})");
  const auto image = one->message();
  ASSERT_TRUE(image && !image->is_text);
  EXPECT_EQ(image->bytes.substr(12), R"({"why":"no camera"})");
  EXPECT_EQ(client()->get("/picture/room.jpg", token_of(Role::look)).status, 404);
}

TEST_F(AServer, LooksAtTheNewestOfFramesThatComeTogether) {
  open({}, echoing_providers(200ms));
  const auto tablet = guest(Role::look);
  tablet->send_text(R"({"type": "window", "device": "tablet-0001", "on": true})");
  for (std::uint32_t i = 1; i <= 10; ++i) tablet->send_binary(number_bytes(i) + k_jpeg);
  std::vector<std::uint32_t> answered;
  while (const auto answer = tablet->message(1)) answered.push_back(number_at(answer->bytes, 4));
  EXPECT_EQ(answered, (std::vector<std::uint32_t>{1, 10}));
}

TEST_F(AServer, RefusesLargeFramesAndForgetsHalfOnes) {
  open({}, echoing_providers());
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

TEST_F(AServer, SendsRoomImagesOneInFlight) {
  open({}, echoing_providers());
  const auto one = guest(Role::look), other = guest(Role::look);
  for (const auto* each : {&one, &other}) (*each)->send_text(R"({"type": "pictures", "room": true})");
  std::uint32_t last = 0;
  for (int i = 0; i < 3; ++i) {
    const auto image = one->message();
    ASSERT_TRUE(image && !image->is_text);
    EXPECT_EQ(number_at(image->bytes, 0), 1u);
    EXPECT_GT(number_at(image->bytes, 4), last);
    last = number_at(image->bytes, 4);
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
  open(options, echoing_providers(0ms, 3'000'000));
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
    GTEST_SKIP()
        << "no address but the loopback's (IPv4): AServer.IsEncryptedFromTheFirstByteAwayFromTheLoopback";
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
  EXPECT_EQ(encrypted.get("/limn.crt").headers.at("content-type"), "application/x-x509-ca-cert");
}

TEST_F(AServer, SpeaksTlsAllTheWay) {
  ServeOptions options;
  options.always_encrypted = true;
  options.limits.read = 500ms;
  open(options, echoing_providers());
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
  open({}, echoing_providers(300ms));
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

}  // namespace
}  // namespace limn::remote
