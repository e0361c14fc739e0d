#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "core/file.h"
#include "remote/server.h"
#include "tests/remote/remote_client.h"
#include "tests/support/matchers.h"

namespace limn::remote {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using test::RemoteClient;
using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point begun) {
  return std::chrono::duration<double>(Clock::now() - begun).count();
}

inline std::string number_bytes(std::uint32_t number) {
  std::string out;
  for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(number >> shift & 0xffu);
  return out;
}
inline std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t out = 0;
  for (std::size_t i = 4; i-- > 0;) out = out << 8 | static_cast<unsigned char>(bytes.at(at + i));
  return out;
}

// What a frame is answered with: the frame itself, after a moment, on another thread.
inline ImageProviders echoing_providers(std::chrono::milliseconds after = 0ms, std::size_t jpeg_bytes = 0) {
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
  ImageProviders providers;
  providers.draw_window = [later, jpeg_bytes](const TabletWindow& window, std::vector<std::uint8_t> jpeg,
                                              ImageCallback answer) {
    if (jpeg_bytes > 0) jpeg.resize(jpeg_bytes);
    later([device = window.device, jpeg = std::move(jpeg), answer = std::move(answer)] {
      answer({json({{"sees", "nothing"}, {"why", device}}).dump(), jpeg});
    });
  };
  const auto rooms = std::make_shared<std::atomic<std::uint8_t>>(0);
  providers.draw_room = [later, rooms](ImageCallback answer) {
    later([rooms, answer = std::move(answer)] {
      answer({R"({"why":""})", {0xff, 0xd8, static_cast<std::uint8_t>(++*rooms)}});
    });
  };
  return providers;
}

/// The remote on the loopback, with a page of its own, and guests.
class AServer : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = test::test_folder();
    fs::create_directories(folder_ / "page");
    ASSERT_TRUE(write_file(folder_ / "page/index.html", "<!doctype html><title>Limn</title>"));
    ASSERT_TRUE(write_file(folder_ / "secret.txt", "secret"));
  }

  void open(ServeOptions options = {}, ImageProviders providers = {}) {
    if (options.at.empty()) options.at = "0";
    options.page = folder_ / "page";
    options.keys = folder_ / "keys";
    is_encrypted_ = options.always_encrypted;
    auto server = Server::open(options, std::move(providers));
    ASSERT_TRUE(server) << server.message();
    server_ = std::move(*server);
  }

  std::unique_ptr<RemoteClient> client() const {
    return std::make_unique<RemoteClient>(server_->port(), is_encrypted_);
  }
  std::string pin(Role role) const { return server_->invitation().pins[static_cast<std::size_t>(role)]; }
  std::string wrong_pin() const {
    for (int i = 0;; ++i)
      if (std::string pin = fmt::format("{:06}", i);
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

}  // namespace limn::remote
