// Tests of MjpegCamera with a server on the loopback that behaves like good and faulty cameras.

#include "device/mjpeg_camera.h"

#include <chrono>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>
#include <utility>

#include "tests/device/loopback_server.h"
#include "tests/device/mjpeg_answer.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

using test::k_mjpeg_answer;
using test::LoopbackClient;
using test::LoopbackServer;
using test::mjpeg_part;
using Clock = std::chrono::steady_clock;

std::string jpeg(int value, int width = 64) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", cv::Mat(48, width, CV_8UC3, cv::Scalar::all(value)), bytes);
  return {bytes.begin(), bytes.end()};
}

void pause(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

int value_of(const Frame& frame) { return frame.image.ptr()[0]; }

std::string url(const LoopbackServer& server, const std::string& login = "") {
  return fmt::format("http://{}127.0.0.1:{}/stream", login, server.port());
}

constexpr double k_clocks_apart_s = 1e-3;  // the kernel stamps by the wall clock, whose rate is adjusted

// Sends images of increasing brightness every 5 ms until the client closes the connection.
void stream_well(LoopbackClient& client) {
  client.receive_until("\r\n\r\n");
  bool there = client.send(k_mjpeg_answer);
  for (int i = 0; there; i = (i + 1) % 250) {
    there = client.send(mjpeg_part(jpeg(i)));
    pause(5);
  }
}

TEST(MjpegCamera, DeliversImagesInOrderStampedOnArrival) {
  std::string asked;
  std::mutex mutex;
  std::vector<Stamp> sent(200);
  LoopbackServer server([&](LoopbackClient& client) {
    asked = client.receive_until("\r\n\r\n");
    client.send(k_mjpeg_answer);
    for (int i = 0; i < 200; ++i) {
      const std::string bytes = mjpeg_part(jpeg(i));
      {
        const std::lock_guard lock(mutex);
        sent[static_cast<std::size_t>(i)] = Clock::now();
      }
      if (!client.send(bytes)) return;
      pause(10);
    }
  });
  auto camera = MjpegCamera::open(url(server, "me:secret@"), {.name = "left"});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->size(), cv::Size(64, 48));
  int last = -1;
  for (int i = 0; i < 10; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->camera, "left");
    EXPECT_EQ(frame->image.type(), CV_8UC3);
    EXPECT_GT(value_of(*frame), last);
    last = value_of(*frame);
    const std::lock_guard lock(mutex);
    EXPECT_GE(seconds_between(sent[static_cast<std::size_t>(last)], frame->captured_at), -k_clocks_apart_s);
    EXPECT_LE(frame->captured_at, Clock::now());
  }
  EXPECT_NE(asked.find("GET /stream HTTP/1.0\r\n"), std::string::npos) << asked;
  EXPECT_NE(asked.find("Authorization: Basic bWU6c2VjcmV0\r\n"), std::string::npos) << asked;
}

TEST(MjpegCamera, GreyWhenAskedTo) {
  LoopbackServer server(stream_well);
  auto camera = MjpegCamera::open(url(server), {.grey = true});
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->next()->image.type(), CV_8UC1);
}

// After a pause the reader gets the newest image with its arrival time, not the time of reading.
TEST(MjpegCamera, OldImagesThatWaitAreDropped) {
  std::atomic<bool> is_away = false, are_sent = false, is_over = false;
  Stamp last_sent;
  LoopbackServer server([&](LoopbackClient& client) {
    client.receive_until("\r\n\r\n");
    client.send(k_mjpeg_answer);
    while (!is_away && client.send(mjpeg_part(jpeg(0)))) pause(2);
    for (int i = 1; i <= 40; ++i) {
      pause(2);
      const std::string bytes = mjpeg_part(jpeg(i));
      last_sent = Clock::now();
      client.send(bytes);
    }
    are_sent = true;
    while (!is_over) pause(1);
  });
  const std::shared_ptr<void> ending(nullptr, [&](void*) { is_over = true; });
  auto camera = MjpegCamera::open(url(server));
  ASSERT_TRUE(camera) << camera.message();
  Stamp read_at = Clock::now();
  Result<Frame> frame = camera->next();
  // The kernel starts to stamp shortly after the request; until then stamps are the times of reading.
  for (int i = 0; i < 500 && frame && frame->captured_at >= read_at; ++i) {
    pause(20);
    read_at = Clock::now();
    frame = camera->next();
  }
  ASSERT_TRUE(frame) << frame.message();
  ASSERT_LT(frame->captured_at, read_at);
  is_away = true;
  while (!are_sent) pause(1);
  pause(150);  // enough time for the kernel to deliver it, even on a busy machine
  read_at = Clock::now();
  frame = camera->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(value_of(*frame), 40);
  EXPECT_GE(seconds_between(last_sent, frame->captured_at), -k_clocks_apart_s);
  EXPECT_LT(frame->captured_at, read_at);
  EXPECT_EQ(camera->description().find(" 0 images skipped"), std::string::npos) << camera->description();
}

// A server that can be switched off while a client is connected.
struct Switched {
  std::atomic<bool> on = true;
  std::unique_ptr<LoopbackServer> server;

  explicit Switched(int port = 0) {
    server = std::make_unique<LoopbackServer>(
        [this](LoopbackClient& client) {
          client.receive_until("\r\n\r\n");
          bool there = client.send(k_mjpeg_answer);
          while (there && on) {
            there = client.send(mjpeg_part(jpeg(100)));
            pause(5);
          }
        },
        port);
  }
  ~Switched() { on = false; }
};

TEST(MjpegCamera, ReconnectsWhenTheServerComesBack) {
  auto switched = std::make_unique<Switched>();
  const int port = switched->server->port();
  auto camera = MjpegCamera::open(url(*switched->server), {.limit_s = 0.4});
  ASSERT_TRUE(camera) << camera.message();
  ASSERT_TRUE(camera->next());
  switched.reset();
  Result<Frame> frame = camera->next();
  for (int i = 0; frame && i < 100; ++i) frame = camera->next();  // images that had arrived before
  ASSERT_FALSE(frame);
  EXPECT_NE(frame.message().find("refused"), std::string::npos) << frame.message();
  switched = std::make_unique<Switched>(port);
  for (int i = 0; !frame && i < 6; ++i) frame = camera->next();  // the interval may already be 0.8 s
  EXPECT_TRUE(frame) << frame.message();
  EXPECT_NE(camera->description().find(" 2 connections"), std::string::npos) << camera->description();
}

TEST(MjpegCamera, ALostConnectionIsMendedInsideOneCall) {
  LoopbackServer server([](LoopbackClient& client) {  // one image, then the end
    client.receive_until("\r\n\r\n");
    client.send(k_mjpeg_answer + mjpeg_part(jpeg(50)) + "--frame--\r\n");
  });
  auto camera = MjpegCamera::open(url(server));
  ASSERT_TRUE(camera) << camera.message();
  for (int i = 0; i < 3; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
  }
  EXPECT_GE(server.clients(), 4);
}

// The camera's error when the server sends one good image and then `rest` repeatedly.
std::string problem_after_one_image(const std::string& rest) {
  constexpr double k_limit_s = 1;
  LoopbackServer server([&, first = true](LoopbackClient& client) mutable {
    client.receive_until("\r\n\r\n");
    bool there = client.send(k_mjpeg_answer + (std::exchange(first, false) ? mjpeg_part(jpeg(50)) : ""));
    pause(50);
    while (there && !rest.empty()) {
      there = client.send(rest);
      pause(5);
    }
    if (there) client.receive_until("the client's end");
  });
  auto camera = MjpegCamera::open(url(server), {.limit_s = k_limit_s, .max_part_bytes = 20000});
  if (!camera) return "not opened: " + camera.message();
  const Stamp begun = Clock::now();
  const auto frame = camera->next();
  EXPECT_LT(seconds_between(begun, Clock::now()), 2 * k_limit_s);
  return frame ? "a picture came" : frame.message();
}

TEST(MjpegCamera, FaultsAreNamed) {
  const auto contains = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " in: " << message;
    EXPECT_NE(message.find("camera0 (http://127.0.0.1:"), std::string::npos) << message;
  };
  const std::string half = jpeg(50).substr(0, jpeg(50).size() / 2);
  contains(problem_after_one_image(mjpeg_part(half)), "truncated or damaged");
  contains(problem_after_one_image(mjpeg_part(jpeg(50, 80))), "64x48, found 80x48");
  contains(problem_after_one_image("--other\r\n"), "expected the boundary \"--frame\"");
  contains(problem_after_one_image(mjpeg_part(std::string(30000, 'x'))), "at most 20000 bytes");
  contains(problem_after_one_image(""), "silent");
}

TEST(MjpegCamera, ADamagedImageAmongGoodOnesIsPassedOver) {
  LoopbackServer server([](LoopbackClient& client) {
    client.receive_until("\r\n\r\n");
    bool there = client.send(k_mjpeg_answer);
    for (int i = 0; there; ++i) {
      const std::string image = jpeg(60);
      there = client.send(mjpeg_part(i % 2 ? image.substr(0, image.size() / 2) : image));
      pause(5);
    }
  });
  auto camera = MjpegCamera::open(url(server));
  ASSERT_TRUE(camera);
  for (int i = 0; i < 5; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_NEAR(value_of(*frame), 60, 2);
  }
  EXPECT_EQ(camera->description().find(" 0 damaged"), std::string::npos) << camera->description();
}

TEST(MjpegCamera, ARefusingServerIsNotStormed) {
  LoopbackServer server([](LoopbackClient& client) {
    client.receive_until("\r\n\r\n");
    client.send("HTTP/1.0 503 Busy\r\n\r\n");
  });
  const Stamp begun = Clock::now();
  const auto camera = MjpegCamera::open(url(server, "me:secret@"), {.limit_s = 1.7});
  const double took_s = seconds_between(begun, Clock::now());
  EXPECT_GE(took_s, 1.7);
  EXPECT_LT(took_s, 2.7);
  ASSERT_FALSE(camera);
  EXPECT_NE(camera.message().find("503 Busy"), std::string::npos) << camera.message();
  EXPECT_EQ(camera.message().find("secret"), std::string::npos) << camera.message();
  EXPECT_GE(server.clients(), 3);  // at 0, 0.1, 0.3, 0.7, 1.5 s
  EXPECT_LE(server.clients(), 5);
}

TEST(MjpegCamera, OtherAddressesAreRefused) {
  for (const char* address : {"https://host/", "http://", "http://:80/", "http://host:http/",
                              "http://host/a b", "http://host/\r\nX: y", "host"}) {
    const auto camera = MjpegCamera::open(address, {.limit_s = 0.1});
    ASSERT_FALSE(camera) << address;
    EXPECT_NE(camera.message().find("http://HOST[:PORT]/PATH"), std::string::npos) << camera.message();
  }
  const auto nobody = MjpegCamera::open("http://[::1]:1/", {.limit_s = 0.2});
  ASSERT_FALSE(nobody);
  EXPECT_NE(nobody.message().find("::1:1 does not answer"), std::string::npos) << nobody.message();
}

}  // namespace
}  // namespace limn::device
