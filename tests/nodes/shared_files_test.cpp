// A session's files on their way from a host's server to nodes, over TLS on the loopback.
#include "nodes/shared_files.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <future>
#include <random>
#include <thread>

#include "core/file.h"
#include "core/stopwatch.h"
#include "core/user_folder.h"
#include "nodes/file_cache.h"
#include "nodes/file_listing.h"
#include "nodes/file_server.h"
#include "nodes/sha256.h"
#include "remote/http/own_addresses.h"
#include "tests/nodes/broken_file_server.h"
#include "tests/remote/remote_client.h"
#include "tests/support/matchers.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::string random_bytes(std::size_t count) {
  std::mt19937_64 random = test::test_rng();
  std::string bytes(count, '\0');
  for (std::size_t i = 0; i < count; i += 8) {
    const std::uint64_t number = random();
    for (std::size_t j = i; j < std::min(i + 8, count); ++j)
      bytes[j] = static_cast<char>(number >> 8 * (j - i));
  }
  return bytes;
}

// A host with a session, and nodes that fetch it.
class SharedFiles : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* folder : {"host/rig", "host/scene/textures"}) fs::create_directories(all_ / folder);
    put("session.json", "{}");
    put("rig/rig.json", "a rig");
    put("rig/empty", "");
    put("scene/textures/paint.png", random_bytes(100000));
    auto server = FileServer::open();
    ASSERT_TRUE(server) << server.message();
    server_ = std::move(*server);
  }

  void put(const std::string& path, const std::string& content) const {
    ASSERT_TRUE(write_file(all_ / "host" / path, content));
  }

  nodes::Setup share() const {
    nodes::Setup setup;
    auto files = server_->share(all_ / "host");
    EXPECT_TRUE(files) << files.message();
    if (files) setup.files = *files;
    return setup;
  }

  Offer offer() const {
    Offer out;
    out.servers = server_->servers();
    out.fingerprint = server_->fingerprint();
    out.token = server_->token();
    return out;
  }

  Status fetch(const nodes::Setup& setup, const Offer& host, const std::string& node = "node") const {
    return fetch_from_host(all_ / (node + "_cache"))(setup, host, all_ / node);
  }

  // The message of a fetch that fails and must leave no folder.
  std::string refusal(const nodes::Setup& setup, const Offer& host) const {
    const Status status = fetch(setup, host);
    EXPECT_FALSE(status);
    EXPECT_FALSE(fs::exists(all_ / "node"));
    return status ? "" : status.message();
  }

  void expect_all_files(const std::string& node = "node") const {
    int files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(all_ / node)) files += entry.is_regular_file();
    int expected = 0;
    for (const auto& entry : fs::recursive_directory_iterator(all_ / "host")) {
      if (!entry.is_regular_file()) continue;
      ++expected;
      const fs::path path = all_ / node / fs::relative(entry.path(), all_ / "host");
      EXPECT_TRUE(fs::is_regular_file(path) && read_file(path).value() == read_file(entry.path()).value())
          << path;
    }
    EXPECT_EQ(files, expected);
  }

  test::RemoteClient::Answer ask(const std::string& target, const std::string& token) const {
    const std::string server = server_->servers().back();
    return test::RemoteClient(std::stoi(server.substr(server.find(':') + 1)), true).get(target, token);
  }

  const fs::path all_ = test::test_folder();
  std::unique_ptr<FileServer> server_;
};

bool has(const std::string& message, const std::string& part) {
  return message.find(part) != std::string::npos;
}

// 10 files of 3 MB, as meshes and textures are.
TEST_F(SharedFiles, ThirtyMegabytesComeOnce) {
  const std::string bytes = random_bytes(3000000);
  for (int i = 0; i < 10; ++i) put("scene/" + std::to_string(i) + ".glb", std::to_string(i) + bytes);
  auto now = std::chrono::steady_clock::now();
  const nodes::Setup setup = share();
  const double share_ms = milliseconds_since(now);
  now = std::chrono::steady_clock::now();
  const Status first = fetch(setup, offer());
  const double first_ms = milliseconds_since(now);
  ASSERT_TRUE(first) << first.message();
  expect_all_files();
  EXPECT_LT(first_ms, 5000);

  server_.reset();
  ASSERT_TRUE(write_file(all_ / "node/scene/0.glb", "the session wrote here"));
  ASSERT_TRUE(write_file(all_ / "node/scene/of_before.glb", ""));
  now = std::chrono::steady_clock::now();
  const Status second = fetch(setup, {});
  const double second_ms = milliseconds_since(now);
  ASSERT_TRUE(second) << second.message();
  expect_all_files();
  printf("30 MB: listed in %.0f ms, fetched in %.0f ms, from the cache in %.0f ms\n", share_ms, first_ms,
         second_ms);
}

TEST_F(SharedFiles, AFileOfManyPiecesComesWhole) {
  for (const std::size_t more : {std::size_t{0}, std::size_t{1}}) {
    put("scene/large.glb", random_bytes(2 * k_piece_bytes + more));
    const Status status = fetch(share(), offer());
    ASSERT_TRUE(status) << status.message();
    expect_all_files();
  }
}

TEST_F(SharedFiles, TwoNodesFetchAtOnce) {
  put("scene/large.glb", random_bytes(3 * k_piece_bytes));
  const nodes::Setup setup = share();
  for (const bool is_one_cache : {false, true}) {
    std::vector<std::future<Status>> fetched;
    for (const char* node : {"a", "b", "c"})
      fetched.push_back(std::async(std::launch::async, [&, node] {
        return fetch_from_host(all_ / (is_one_cache ? "cache" : node + std::string("_cache")))(setup, offer(),
                                                                                               all_ / node);
      }));
    for (auto& each : fetched) {
      const Status status = each.get();
      EXPECT_TRUE(status) << status.message();
    }
    for (const char* node : {"a", "b", "c"}) expect_all_files(node);
  }
}

TEST_F(SharedFiles, WithoutTheTokenNothingIsServed) {
  share();
  const std::string file = "/files/" + sha256_of("a rig") + "/0";
  EXPECT_EQ(ask(file, server_->token()).status, 200);
  EXPECT_EQ(server_->token().size(), 32u);
  EXPECT_EQ(ask(file, "").status, 401);
  EXPECT_EQ(ask(file, std::string(32, '0')).status, 401);
  EXPECT_EQ(ask(file, server_->token() + "0").status, 401);
  EXPECT_EQ(ask("/", "").status, 401) << "a stranger learns nothing of what is there";

  Offer host = offer();
  host.token = std::string(32, '0');
  EXPECT_TRUE(has(refusal(share(), host), "refuses this machine's token"));
  host.token = "1\r\nX: 1";
  EXPECT_TRUE(has(refusal(share(), host), "expected a token"));
}

TEST_F(SharedFiles, OnlyListedPiecesAreServed) {
  const std::string hash = sha256_of("a rig"), token = server_->token();
  EXPECT_EQ(ask("/files/" + hash + "/0", token).status, 404) << "before it is listed";
  nodes::Setup setup = share();
  const auto answer = ask("/files/" + hash + "/0", token);
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "a rig");
  for (const std::string& target :
       {"/files/" + hash + "/1", "/files/" + hash + "/18446744073709551616", "/files/" + hash + "/-1",
        "/files/" + hash, "/files/" + hash + "/", "/files/" + hash + "/0x",
        "/files/" + std::string(64, '0') + "/0", std::string("/files/../../../etc/passwd/0"),
        std::string("/files//0"), std::string("/")})
    EXPECT_EQ(ask(target, token).status, 404) << target;

  setup.files.back().sha256 = std::string(64, '0');
  EXPECT_TRUE(has(refusal(setup, offer()), "HTTP 404"));
}

TEST_F(SharedFiles, AnotherServersCertificateIsRefused) {
  const test::BrokenFileServer stranger([](const auto& send) { send("HTTP/1.1 404 Not Found\r\n\r\n"); });
  const nodes::Setup setup = share();
  Offer host = offer();
  host.servers = stranger.offer().servers;
  EXPECT_TRUE(has(refusal(setup, host), "another certificate"));
  // The stranger's end of the handshake may come after the refusal.
  for (int i = 0; i < 1000 && stranger.connections() == 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(stranger.connections(), 1);
  EXPECT_EQ(stranger.requests(), 0) << "it got the token";
  host.fingerprint = "";
  EXPECT_TRUE(has(refusal(setup, host), "another certificate"));

  host = offer();
  host.servers.insert(host.servers.begin(), stranger.offer().servers.front());
  const Status status = fetch(setup, host);
  EXPECT_TRUE(status) << "the host has another address, too: " << status.message();
}

// A port whose queue of connections is full, so that the system does not answer, as behind a firewall.
class SilentPort {
 public:
  SilentPort() {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address_;
    ::bind(listener_, reinterpret_cast<const sockaddr*>(&address_), length);
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address_), &length);
    ::listen(listener_, 0);
    for (int& client : clients_) {
      client = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
      ::connect(client, reinterpret_cast<const sockaddr*>(&address_), sizeof address_);
    }
  }
  ~SilentPort() {
    for (const int client : clients_) ::close(client);
    ::close(listener_);
  }
  SilentPort(const SilentPort&) = delete;
  SilentPort& operator=(const SilentPort&) = delete;
  std::string server() const { return "127.0.0.1:" + std::to_string(ntohs(address_.sin_port)); }

 private:
  int listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address_{};
  std::array<int, 3> clients_{};
};

TEST_F(SharedFiles, AHostIsFoundAtAnyOfItsAddresses) {
  const nodes::Setup setup = share();
  const SilentPort silent;
  Offer host = offer();
  EXPECT_EQ(host.servers.back().substr(0, 10), "127.0.0.1:");
  host.servers = {silent.server(), "127.0.0.1:1", "nonsense", "[::1]" + host.servers.back().substr(9)};
  const auto now = std::chrono::steady_clock::now();
  Status status = fetch(setup, host);
  EXPECT_TRUE(status) << status.message();
  EXPECT_GT(milliseconds_since(now), 900);
  EXPECT_LT(milliseconds_since(now), 2000);
  fs::remove_all(all_ / "node_cache");
  host.servers.pop_back();
  const std::string message = refusal(setup, host);
  for (const std::string& part :
       {silent.server() + ": no answer in time", std::string("127.0.0.1:1: Connection refused"),
        std::string("nonsense: not an address"), std::string("firewall")})
    EXPECT_TRUE(has(message, part)) << message;
  EXPECT_TRUE(has(refusal(setup, {}), "no address in its offer"));
}

TEST_F(SharedFiles, ALinkLocalAddressIsTriedAtAllInterfaces) {
  Offer host = offer();
  std::erase_if(host.servers, [](const std::string& server) { return !server.starts_with("[fe80"); });
  if (host.servers.empty()) GTEST_SKIP() << "this machine has no link-local address of IPv6.";
  const Status status = fetch(share(), host);
  EXPECT_TRUE(status) << status.message();
}

TEST_F(SharedFiles, AnAnswerThatEndsEarlyOrIsWrongIsNamed) {
  nodes::Setup setup;
  setup.files = {{"scene/door.glb", sha256_of("the door"), 8}};
  const std::string head = "HTTP/1.1 200 OK\r\nContent-Length: 8\r\n\r\n";
  const auto message_after = [&](const std::string& answer, int connections) {
    const test::BrokenFileServer server([&](const auto& send) { send(answer); });
    const std::string message = refusal(setup, server.offer());
    EXPECT_EQ(server.connections(), connections) << answer;
    EXPECT_TRUE(fs::is_empty(all_ / "node_cache")) << answer;
    return message;
  };
  EXPECT_TRUE(has(message_after(head + "the ", 2), "the connection ended"));
  EXPECT_TRUE(has(message_after("", 2), "the connection ended"));
  EXPECT_TRUE(has(message_after(head + "the wall", 1), "expected the 8 bytes that the host announced"));
  EXPECT_TRUE(
      has(message_after("HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nthe", 1), "expected 8 bytes, found 3"));
  EXPECT_FALSE(message_after("HTTP/1.1 200 OK\r\nContent-Length: 99999999\r\n\r\nthe", 2).empty());
}

TEST_F(SharedFiles, ABusyHostAndOneThatEndsTheConnectionAreAskedAgain) {
  nodes::Setup setup;
  setup.files = {{"scene/door.glb", sha256_of("the door"), 8}};
  for (const std::string first : {"", "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n"}) {
    fs::remove_all(all_ / "node_cache");
    int asked = 0;
    const test::BrokenFileServer server([&](const auto& send) {
      send(asked++ == 0 ? first : "HTTP/1.1 200 OK\r\nContent-Length: 8\r\n\r\nthe door");
    });
    const Status status = fetch(setup, server.offer());
    EXPECT_TRUE(status) << status.message();
    EXPECT_EQ(server.requests(), 2);
  }
  setup.files = {{"scene/wheel.glb", sha256_of("the wheel"), 9}};
  const test::BrokenFileServer busy([&](const auto& send) {
    send("HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n");
  });
  const auto now = std::chrono::steady_clock::now();
  EXPECT_TRUE(has(refusal(setup, busy.offer()), "HTTP 503"));
  EXPECT_LT(milliseconds_since(now), 7000);
  EXPECT_GT(busy.requests(), 10);
}

TEST_F(SharedFiles, AHostThatStallsIsGivenUp) {
  std::promise<void> end;
  const auto ended = end.get_future().share();
  {
    const test::BrokenFileServer server([&](const auto& send) {
      send("HTTP/1.1 200 OK\r\nContent-Length: 8\r\n\r\nthe ");
      ended.wait();
    });
    nodes::Setup setup;
    setup.files = {{"scene/door.glb", sha256_of("the door"), 8}};
    const auto now = std::chrono::steady_clock::now();
    EXPECT_TRUE(has(refusal(setup, server.offer()), "no answer in time"));
    EXPECT_LT(milliseconds_since(now), 7000);
    EXPECT_GT(milliseconds_since(now), 4500);
    end.set_value();
  }
}

TEST_F(SharedFiles, AFileThatChangedIsNotServedUnderItsOldHash) {
  const std::string before = random_bytes(k_piece_bytes + 1000);
  put("scene/door.glb", before);
  const nodes::Setup setup = share();
  const std::string file = "/files/" + sha256_of(before), token = server_->token();
  std::string after = before;
  after.back() ^= 1;
  const auto expect = [&](int first, int second) {
    EXPECT_EQ(ask(file + "/0", token).status, first);
    EXPECT_EQ(ask(file + "/1", token).status, second);
  };
  expect(200, 200);
  put("scene/door.glb", after);
  expect(200, 410);
  EXPECT_TRUE(has(refusal(setup, offer()), "door.glb: the file has changed"));
  put("scene/door.glb", before.substr(0, 1000));
  expect(410, 410);
  fs::remove(all_ / "host/scene/door.glb");
  expect(410, 410);
  put("scene/copy.glb", before);
  share();
  expect(200, 200);
}

TEST_F(SharedFiles, HostilePathsAreRefused) {
  put("scene/door.glb", "the door");
  const std::string hash = sha256_of("the door");
  const auto message_for = [&](const std::vector<std::string>& paths) {
    nodes::Setup setup;
    for (const std::string& path : paths) setup.files.push_back({path, hash, 8});
    return refusal(setup, offer());
  };
  share();
  for (const std::string path : {"", "/etc/limn", "../out", "scene/../../out", "scene/..", "..", ".",
                                 "scene/./a", "scene//a", "scene/", "scene\\a", "scene/\n", "scene/\x7f"})
    EXPECT_TRUE(has(message_for({path}), "relative path inside the session's folder")) << path;
  EXPECT_TRUE(has(message_for({std::string("scene/a\0b", 9)}), "control character"));
  EXPECT_TRUE(has(message_for({std::string(256, 'a')}), "over 255 bytes"));
  std::string long_path;
  for (int i = 0; i < 600; ++i) long_path += "a/";
  EXPECT_TRUE(has(message_for({long_path + "b"}), "over 1024 bytes"));
  EXPECT_TRUE(has(message_for({"a", "a"}), "twice"));
  EXPECT_TRUE(has(message_for({"a", "a.b", "a/b"}), "is a file"));
  EXPECT_FALSE(fs::exists(all_ / "out"));

  nodes::Setup setup;
  for (std::size_t i = 0; i <= k_max_files; ++i) setup.files.push_back({std::to_string(i), hash, 8});
  EXPECT_TRUE(has(refusal(setup, offer()), "at most 4096 files"));
  setup.files = {{"a", hash, 3ull << 30}, {"b", hash, 1ull << 30}, {"c", hash, 1}};
  EXPECT_TRUE(has(refusal(setup, offer()), "at most 4 GB"));
  setup.files = {{"a", hash, 8}, {"b", hash, UINT64_MAX}};
  EXPECT_TRUE(has(refusal(setup, offer()), "at most 4 GB"));
  for (const std::string& wrong :
       {std::string(), hash.substr(1), "../" + hash.substr(3), "A" + hash.substr(1)}) {
    setup.files = {{"a", wrong, 8}};
    EXPECT_TRUE(has(refusal(setup, offer()), "expected a SHA-256")) << wrong;
  }
  setup.files = {{"..a/b..", hash, 8}};
  const Status status = fetch(setup, offer());
  EXPECT_TRUE(status) << status.message();
}

TEST_F(SharedFiles, AFolderWithMoreThanFilesIsNotListed) {
  ASSERT_TRUE(write_file(all_ / "secret", "secret"));
  const fs::path link = all_ / "host/scene/link";
  const auto message = [&] {
    const auto files = server_->share(all_ / "host");
    EXPECT_FALSE(files);
    return files ? "" : files.message();
  };
  fs::create_symlink("../../secret", link);
  EXPECT_TRUE(has(message(), "link to a folder or to a file elsewhere"));
  fs::remove(link);
  fs::create_directory_symlink("..", link);
  EXPECT_TRUE(has(message(), "link to a folder or to a file elsewhere"));
  fs::remove(link);
  fs::create_symlink("nowhere", link);
  EXPECT_TRUE(has(message(), "found something else"));
  fs::remove(link);
  ASSERT_EQ(::mkfifo(link.c_str(), 0600), 0);
  EXPECT_TRUE(has(message(), "found something else"));
  fs::remove(link);
  fs::create_symlink("textures/paint.png", link);
  const Status status = fetch(share(), offer());
  EXPECT_TRUE(status) << status.message();
  EXPECT_EQ(fs::file_size(all_ / "node/scene/link"), 100000u) << "a link inside is sent as a file";
  EXPECT_FALSE(server_->share(all_ / "nothing"));
}

TEST_F(SharedFiles, ADamagedFileInTheCacheIsFetchedAgain) {
  const nodes::Setup setup = share();
  ASSERT_TRUE(fetch(setup, offer()));
  const fs::path cached = all_ / "node_cache" / sha256_of("a rig");
  for (const char* content : {"a pig", "", "a rig that is longer"}) {
    ASSERT_TRUE(write_file(cached, content));
    const Status status = fetch(setup, offer());
    ASSERT_TRUE(status) << status.message();
    expect_all_files();
  }
  fs::remove(cached);
  fs::create_symlink(all_ / "host/session.json", cached);
  const Status status = fetch(setup, offer());
  ASSERT_TRUE(status) << status.message();
  expect_all_files();
}

TEST(FileCache, TheLeastRecentlyUsedIsRemoved) {
  const fs::path folder = test::test_folder();
  const FileCache cache(folder / "cache", 20);
  const auto file = [](const std::string& content) {
    return SharedFile{"a", sha256_of(content), content.size()};
  };
  const auto age = [&](const std::string& content, std::chrono::hours hours) {
    fs::last_write_time(folder / "cache" / sha256_of(content), fs::file_time_type::clock::now() - hours);
  };
  const std::vector<std::string> contents = {"eight  0", "eight  1", "eight  2"};
  for (const std::string& content : contents)
    ASSERT_TRUE(cache.add_file(file(content), [&](const auto& write) { return write(content); }));
  ASSERT_TRUE(write_file(folder / "cache/README", "not from the cache"));
  for (int i = 0; i < 3; ++i) age(contents[static_cast<std::size_t>(i)], 3h - i * 1h);
  ASSERT_TRUE(cache.copy_file(file(contents[0]), folder / "copy").value()) << "now the newest";
  cache.remove_oldest({});
  EXPECT_FALSE(cache.copy_file(file(contents[1]), folder / "copy").value());
  EXPECT_TRUE(cache.copy_file(file(contents[2]), folder / "copy").value());
  EXPECT_TRUE(cache.copy_file(file(contents[0]), folder / "copy").value());
  FileCache(folder / "cache", 0).remove_oldest({sha256_of(contents[2])});
  EXPECT_TRUE(cache.copy_file(file(contents[2]), folder / "copy").value()) << "it is needed";
  EXPECT_FALSE(cache.copy_file(file(contents[0]), folder / "copy").value());
  EXPECT_TRUE(fs::exists(folder / "cache/README"));
}

TEST(FileCache, IsInTheUsersCacheFolder) {
  ::setenv("XDG_CACHE_HOME", "/somewhere", 1);
  EXPECT_EQ(user_cache_folder().value(), "/somewhere/limn");
  ::unsetenv("XDG_CACHE_HOME");
  const fs::path home = test::test_folder();
  ::setenv("HOME", home.c_str(), 1);
  EXPECT_EQ(user_cache_folder().value(), home / ".cache/limn");
}

TEST(UserFolder, AHomeThatDoesNotExistIsNamed) {
  ::unsetenv("XDG_CONFIG_HOME");
  ::setenv("HOME", "/nonexistent", 1);
  const auto folder = user_folder();
  ASSERT_FALSE(folder);
  EXPECT_NE(folder.message().find("/nonexistent: expected the user's home folder"), std::string::npos)
      << folder.message();
}

// A small file system, which only this thread sees.
bool mount_small_disk(const fs::path& folder) {
  fs::create_directories(folder);
  return ::unshare(CLONE_NEWNS) == 0 && ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         ::mount("tmpfs", folder.c_str(), "tmpfs", 0, "size=1m") == 0;
}

TEST_F(SharedFiles, AFullDiskIsNamed) {
  put("scene/large.glb", random_bytes(2000000));
  const nodes::Setup setup = share();
  const fs::path disk = all_ / "disk";
  if (!mount_small_disk(disk)) GTEST_SKIP() << "only root may mount a small disk.";
  const auto message_for = [&](const fs::path& cache, const fs::path& folder) {
    const Status status = fetch_from_host(cache)(setup, offer(), folder);
    EXPECT_FALSE(status);
    EXPECT_FALSE(fs::exists(folder));
    return status ? "" : status.message();
  };
  std::string message = message_for(disk / "cache", all_ / "node");
  EXPECT_TRUE(has(message, (disk / "cache").string() + ": expected room")) << message;
  EXPECT_TRUE(has(message, "No space left") && has(message, "set XDG_CACHE_HOME")) << message;
  message = message_for(all_ / "node_cache", disk / "node");
  EXPECT_TRUE(has(message, (disk / "node/scene").string() + ": expected room")) << message;
  EXPECT_TRUE(has(message, "Free some space")) << message;
  EXPECT_TRUE(fs::exists(all_ / "node_cache" / setup.files.front().sha256)) << "what has come stays";
  ::umount(disk.c_str());
}

}  // namespace
}  // namespace limn::nodes
