// Tests with video files that OpenCV wrote, and of RTSP with a server on the loopback.

#include "device/video_camera.h"

#include <chrono>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "core/file.h"
#include "device/video_clock.h"
#include "tests/device/rtsp_server.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using test::LoopbackClient;
using test::LoopbackServer;
using test::RtspClient;

cv::Mat grey_level(int value, int width = 64) { return {48, width, CV_8UC3, cv::Scalar::all(value)}; }

int value_of(const Frame& frame) { return frame.image.ptr()[0]; }

void pause(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

TEST(VideoClock, AHeldUpFrameKeepsItsOwnMoment) {
  VideoClock clock;
  const auto read = [](double seconds) { return shifted(Stamp{}, 1000 + seconds); };
  clock.stamp(5.0, read(0.030));
  clock.stamp(5.1, read(0.110));  // the least delay: 10 ms
  EXPECT_NEAR(seconds_between(read(0.210), clock.stamp(5.2, read(0.290))), 0, 1e-4);
  EXPECT_NEAR(seconds_between(read(0.310), clock.stamp(5.3, read(0.315))), 0, 1e-4);
  EXPECT_EQ(clock.stamp(0.0, read(0.4)), read(0.4));  // a new stream
  EXPECT_EQ(clock.stamp(0.0, read(0.5)), read(0.5));  // a stream without times
}

TEST(VideoClock, FollowsASendersClockThatRunsOff) {
  for (const double drift : {-1e-4, 1e-4}) {
    VideoClock clock;
    for (int i = 0; i < 36000; ++i) {  // an hour at 10 Hz
      const double seconds = 0.1 * i;
      const Stamp read_at = shifted(Stamp{}, 1000 + seconds + 0.005 * (i % 3));
      const Stamp stamp = clock.stamp(seconds * (1 + drift), read_at);
      ASSERT_LE(stamp, read_at);
      ASSERT_LT(seconds_between(stamp, shifted(Stamp{}, 1000 + seconds)), 0.001) << i;
      ASSERT_GT(seconds_between(stamp, shifted(Stamp{}, 1000 + seconds)), -0.001) << i;
    }
  }
}

TEST(VideoCamera, AFilePlaysAtItsOwnFrameTimesAndEnds) {
  const fs::path path = test::test_folder() / "clip.avi";
  cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20,
                         {64, 48});
  for (int i = 0; i < 6; ++i) writer.write(grey_level(40 * i));
  writer.release();
  auto camera = VideoCamera::open_file(path, {.name = "left"});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->size(), cv::Size(64, 48));
  EXPECT_TRUE(camera->is_finite());
  for (int i = 0; i < 6; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->camera, "left");
    EXPECT_NEAR(value_of(*frame), 40 * i, 3);
    EXPECT_NEAR(seconds_between(Stamp{}, frame->captured_at), i / 20.0, 1e-6);
  }
  const auto end = camera->next();
  ASSERT_FALSE(end);
  EXPECT_NE(end.message().find("left: all 6 frames"), std::string::npos) << end.message();
}

TEST(VideoCamera, AbsentAndDamagedFilesAreNamed) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "damaged.mp4", "not a video"));
  for (const char* name : {"nowhere.mp4", "damaged.mp4"}) {
    const auto camera = VideoCamera::open_file(folder / name);
    ASSERT_FALSE(camera);
    EXPECT_NE(camera.message().find(name), std::string::npos) << camera.message();
  }
}

std::string url(const LoopbackServer& server) {
  return fmt::format("rtsp://127.0.0.1:{}/live", server.port());
}

TEST(VideoCamera, AnRtspStreamIsStampedOnArrival) {
  std::atomic<double> begun_s = 0;
  LoopbackServer server([&](LoopbackClient& client) {
    if (!RtspClient::begin(client)) return;
    RtspClient stream(client);
    const Stamp begun = Clock::now();
    begun_s = seconds_between(Stamp{}, begun);
    for (int i = 0; i < 250; ++i) {
      if (!stream.send(grey_level(i), 0.02 * i)) return;
      std::this_thread::sleep_until(shifted(begun, 0.02 * (i + 1)));
    }
  });
  auto camera = VideoCamera::open_rtsp(url(server), {.name = "left"});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->size(), cv::Size(64, 48));
  EXPECT_FALSE(camera->is_finite());
  int last = -1;
  for (int i = 0; i < 10; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_GT(value_of(*frame), last);
    last = value_of(*frame);
    const double sent_s = begun_s + 0.02 * last;
    EXPECT_NEAR(seconds_between(Stamp{}, frame->captured_at), sent_s, 0.08) << last;
  }
  pause(600);  // after a pause the reader gets the newest frame
  const double now_s = seconds_between(Stamp{}, Clock::now());
  const auto frame = camera->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_GT(value_of(*frame), (now_s - begun_s) / 0.02 - 8) << camera->description();
  EXPECT_NEAR(seconds_between(Stamp{}, frame->captured_at), begun_s + 0.02 * value_of(*frame), 0.08);
}

TEST(VideoCamera, AnRtspStreamIsOpenedAgainAndFaultsAreNamed) {
  auto server = std::make_unique<LoopbackServer>([](LoopbackClient& client) {
    if (!RtspClient::begin(client)) return;
    RtspClient stream(client);
    for (int i = 0; i < 80 && stream.send(grey_level(50), 0.01 * i); ++i) pause(10);
  });
  auto camera = VideoCamera::open_rtsp(url(*server), {.limit_s = 4});
  ASSERT_TRUE(camera) << camera.message();
  const auto is_opened_again = [&] {
    return camera->description().find(" 2 connections") != std::string::npos;
  };
  for (int i = 0; i < 80 && !is_opened_again(); ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame) << frame.message();
  }
  EXPECT_TRUE(is_opened_again()) << camera->description();
  server.reset();
  Result<Frame> frame = camera->next();
  for (int i = 0; frame && i < 100; ++i) frame = camera->next();
  ASSERT_FALSE(frame);
  EXPECT_NE(frame.message().find("does not answer"), std::string::npos) << frame.message();
}

TEST(VideoCamera, WhatIsNoRtspIsNamedInTime) {
  LoopbackServer server([](LoopbackClient& client) {
    client.receive_until("\r\n\r\n");
    client.send("RTSP/1.0 404 Not Found\r\nCSeq: 1\r\n\r\n");
  });
  Stamp begun = Clock::now();
  const auto refused = VideoCamera::open_rtsp(url(server), {.limit_s = 0.5});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.message().find("no video"), std::string::npos) << refused.message();
  EXPECT_LT(seconds_between(begun, Clock::now()), 2.5);
  LoopbackServer silent([](LoopbackClient& client) { client.receive_until("never"); });
  begun = Clock::now();
  EXPECT_FALSE(VideoCamera::open_rtsp(url(silent), {.limit_s = 0.5}));
  EXPECT_LT(seconds_between(begun, Clock::now()), 2.5);
}

}  // namespace
}  // namespace limn::device
