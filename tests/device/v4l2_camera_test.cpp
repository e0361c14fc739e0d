// Tests of V4l2Camera with simulated drivers: a good one, and ones that give false answers, fail or are
// unplugged. No kernel module can replace a camera here, so this file answers the ioctls.

#include "device/v4l2_camera.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;
using test::expect_contains;

struct Shot {
  std::vector<std::uint8_t> bytes;
  double age_s = 0.01;  // age of its stamp when it is dequeued
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
};

// A driver whose behaviour is set by its fields.
struct Driver {
  std::vector<std::uint32_t> formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  v4l2_pix_format format = {};                   // present format
  std::function<void(v4l2_pix_format*)> on_set;  // changes the requested format
  std::function<void(v4l2_pix_format*)> on_get;  // changes the reported format
  std::map<std::uint32_t, int> controls = {{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
                                           {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 1},
                                           {V4L2_CID_EXPOSURE_ABSOLUTE, 250},
                                           {V4L2_CID_AUTOGAIN, 1},
                                           {V4L2_CID_GAIN, 0},
                                           {V4L2_CID_AUTO_WHITE_BALANCE, 1},
                                           {V4L2_CID_WHITE_BALANCE_TEMPERATURE, 4000}};
  int exposure_step = 1;
  std::set<std::uint32_t> stuck;          // controls that accept a value but keep their own
  std::map<unsigned long, int> refusals;  // request -> errno
  std::uint32_t buffer_count = 4;
  std::uint32_t buffer_bytes = 0;  // 0: as large as the format needs
  std::uint32_t odd_index = 0;
  std::deque<Shot> shots;  // frames that are ready; when empty, `last` is repeated
  std::deque<Shot> later;  // frames that become ready one at a time, when the camera waits
  Shot last;
  int opened = 0, closed = 0, streaming = 0, mapped = 0;
  int open_problem = 0;
  std::vector<std::vector<std::uint8_t>> memory;
  std::deque<std::uint32_t> queued;

  Driver() {
    format.pixelformat = V4L2_PIX_FMT_YUYV;
    format.width = 64;
    format.height = 48;
  }

  std::uint32_t frame_bytes() const {
    return format.pixelformat == V4L2_PIX_FMT_GREY ? format.width * format.height
                                                   : 2 * format.width * format.height;
  }
  int fail(int problem) const {
    errno = problem;
    return -1;
  }
  int control(v4l2_control* asked, bool set) {
    if (!controls.contains(asked->id)) return fail(EINVAL);
    int& value = controls.at(asked->id);
    if (set && asked->id == V4L2_CID_EXPOSURE_ABSOLUTE && asked->value > 5000) return fail(ERANGE);
    if (set && !stuck.contains(asked->id))
      value = asked->id == V4L2_CID_EXPOSURE_ABSOLUTE ? asked->value / exposure_step * exposure_step
                                                      : asked->value;
    if (!set) asked->value = value;
    return 0;
  }
  int dequeue(v4l2_buffer* buffer) {
    if (queued.empty()) return fail(EAGAIN);
    if (!shots.empty()) {
      last = shots.front();
      shots.pop_front();
    }
    buffer->index = queued.front();
    queued.pop_front();
    std::memcpy(memory[buffer->index].data(), last.bytes.data(),
                std::min(last.bytes.size(), memory[buffer->index].size()));
    buffer->bytesused = static_cast<std::uint32_t>(last.bytes.size());
    buffer->flags = last.flags;
    const auto since = shifted(Clock::now(), -last.age_s).time_since_epoch();
    buffer->timestamp.tv_sec = std::chrono::duration_cast<std::chrono::seconds>(since).count();
    buffer->timestamp.tv_usec =
        std::chrono::duration_cast<std::chrono::microseconds>(since).count() % 1000000;
    if (odd_index != 0) buffer->index = odd_index;
    return 0;
  }
  int ioctl(unsigned long request, void* argument) {
    if (refusals.contains(request)) return fail(refusals.at(request));
    auto* pixels = &static_cast<v4l2_format*>(argument)->fmt.pix;
    auto* buffer = static_cast<v4l2_buffer*>(argument);
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto* able = static_cast<v4l2_capability*>(argument);
        std::strcpy(reinterpret_cast<char*>(able->card), "Test camera");
        able->capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        able->device_caps = capabilities;
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto* found = static_cast<v4l2_fmtdesc*>(argument);
        if (found->index >= formats.size()) return fail(EINVAL);
        found->pixelformat = formats[found->index];
        return 0;
      }
      case VIDIOC_G_FMT:
        *pixels = format;
        if (on_get) on_get(pixels);
        return 0;
      case VIDIOC_S_FMT:
        if (on_set) on_set(pixels);
        format = *pixels;
        format.bytesperline = format.pixelformat == V4L2_PIX_FMT_YUYV ? 2 * format.width : 0;
        *pixels = format;
        return 0;
      case VIDIOC_QUERYCTRL: {
        auto* range = static_cast<v4l2_queryctrl*>(argument);
        if (!controls.contains(range->id)) return fail(EINVAL);
        range->minimum = 3;
        range->maximum = 5000;
        range->step = 1;
        return 0;
      }
      case VIDIOC_S_CTRL:
        return control(static_cast<v4l2_control*>(argument), true);
      case VIDIOC_G_CTRL:
        return control(static_cast<v4l2_control*>(argument), false);
      case VIDIOC_REQBUFS:
        static_cast<v4l2_requestbuffers*>(argument)->count = buffer_count;
        memory.assign(buffer_count, std::vector<std::uint8_t>(buffer_bytes ? buffer_bytes : frame_bytes()));
        queued.clear();
        return 0;
      case VIDIOC_QUERYBUF:
        buffer->length = static_cast<std::uint32_t>(memory[buffer->index].size());
        buffer->m.offset = buffer->index;
        return 0;
      case VIDIOC_QBUF:
        queued.push_back(buffer->index);
        return 0;
      case VIDIOC_DQBUF:
        return dequeue(buffer);
      case VIDIOC_STREAMON:
        ++streaming;
        return 0;
      default:
        return fail(ENOTTY);
    }
  }
  V4l2System system() {
    return {.open =
                [this](const std::string& path) {
                  if (path != "/dev/video2") return fail(ENOENT);
                  if (open_problem != 0) return fail(open_problem);
                  ++opened;
                  return 7;
                },
            .close = [this](int) { ++closed; },
            .ioctl = [this](int, unsigned long request, void* argument) { return ioctl(request, argument); },
            .map = [this](int, std::size_t, long offset) -> void* {
              ++mapped;
              return memory[static_cast<std::size_t>(offset)].data();
            },
            .unmap = [this](void*, std::size_t) { --mapped; },
            .wait =
                [this](int, double seconds) {
                  // If there are shots, only these are ready; else a frame comes whenever the camera waits.
                  if (refusals.contains(VIDIOC_DQBUF)) return true;
                  if (seconds > 0 && shots.empty() && !later.empty()) {
                    shots.push_back(later.front());
                    later.pop_front();
                  }
                  return seconds > 0 ? !last.bytes.empty() || !shots.empty() : !shots.empty();
                }};
  }
};

// A grey frame of brightness `value`.
Shot yuyv(int value) {
  Shot shot;
  for (int i = 0; i < 64 * 48; ++i) {
    shot.bytes.push_back(static_cast<std::uint8_t>(value));
    shot.bytes.push_back(128);
  }
  return shot;
}

Shot mjpg(int value, int width = 64) {
  Shot shot;
  cv::imencode(".jpg", cv::Mat(48, width, CV_8UC3, cv::Scalar::all(value)), shot.bytes);
  return shot;
}

Result<V4l2Camera> opened(Driver* driver, V4l2CameraOptions options = {}) {
  options.limit_s = 0.25;
  return V4l2Camera::open("/dev/video2", options, driver->system());
}

// The error message of opening the camera.
std::string problem(Driver* driver, const V4l2CameraOptions& options = {}) {
  const auto camera = opened(driver, options);
  EXPECT_FALSE(camera);
  EXPECT_EQ(driver->opened, driver->closed);
  EXPECT_EQ(driver->mapped, 0);
  return camera ? "" : camera.message();
}

TEST(V4l2Camera, DecodesMjpgYuyvAndGrey) {
  Driver driver;
  driver.last = mjpg(90);
  auto camera = opened(&driver, {.name = "left", .size = {64, 48}});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(camera->size(), cv::Size(64, 48));
  expect_contains(camera->description(), "MJPG 64x48");
  auto frame = camera->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->camera, "left");
  EXPECT_EQ(frame->image.type(), CV_8UC3);
  EXPECT_NEAR(frame->image.ptr()[0], 90, 2);
  EXPECT_EQ(opened(&driver, {.grey = true})->next()->image.type(), CV_8UC1);

  driver.formats = {V4L2_PIX_FMT_YUYV};
  driver.last = yuyv(126);
  frame = opened(&driver)->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->image.type(), CV_8UC3);
  EXPECT_NEAR(frame->image.ptr()[0], (126 - 16) * 255 / 219, 2);  // black is 16 in YUV
  EXPECT_EQ(opened(&driver, {.grey = true})->next()->image.ptr()[0], 126);

  driver.formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY};
  driver.last.bytes.assign(64 * 48, 77);
  frame = opened(&driver, {.grey = true})->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->image.type(), CV_8UC1);
  EXPECT_EQ(frame->image.ptr()[0], 77);
  EXPECT_EQ(driver.opened, driver.closed + 1);  // `camera` is still open
}

TEST(V4l2Camera, RowsMayBeLongerThanTheImage) {
  Driver driver;
  driver.formats = {V4L2_PIX_FMT_GREY};
  driver.on_get = [](v4l2_pix_format* format) { format->bytesperline = 80; };
  driver.buffer_bytes = 80 * 48;
  driver.last.bytes.assign(80 * 48, 10);
  for (int y = 0; y < 48; ++y)
    driver.last.bytes[static_cast<std::size_t>(80 * y)] = static_cast<std::uint8_t>(y);
  const auto frame = opened(&driver)->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->image.at<std::uint8_t>(47, 0), 47);
  EXPECT_EQ(frame->image.at<std::uint8_t>(47, 1), 10);
}

TEST(V4l2Camera, TheNewestFrameIsKeptAndStampedAtTheMiddleOfItsExposure) {
  Driver driver;
  driver.last = mjpg(10);
  driver.last.age_s = 0.9;
  auto camera = opened(&driver, {.sensor = {.exposure_ms = 80}});
  ASSERT_TRUE(camera) << camera.message();
  for (const int value : {20, 30, 40}) driver.shots.push_back(mjpg(value));
  driver.shots.back().age_s = 0.05;
  const auto is_between = [](Stamp captured_at, Stamp begun, double after_s) {
    return captured_at >= shifted(begun, after_s - 1e-6) &&  // drivers' stamps have a resolution of 1 us
           captured_at <= shifted(Clock::now(), after_s);
  };
  Stamp begun = Clock::now();
  auto frame = camera->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_TRUE(is_between(frame->captured_at, begun, -0.05 + 0.04));
  EXPECT_NEAR(frame->image.ptr()[0], 40, 2);
  EXPECT_EQ(driver.queued.size(), 4u);  // the driver has all buffers again
  expect_contains(camera->description(), "2 frames skipped");

  driver.shots.push_back(mjpg(50));  // its stamp is the end of the exposure
  driver.shots.back().flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  begun = Clock::now();
  frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(is_between(frame->captured_at, begun, -0.05));
}

// Frames that come while all buffers are full are lost, so the full buffers contain only older frames.
TEST(V4l2Camera, WhereAllBuffersWereFilledTheNextFrameIsTheNewest) {
  Driver driver;
  driver.last = mjpg(10);
  auto camera = opened(&driver);
  ASSERT_TRUE(camera) << camera.message();
  for (const int value : {20, 30, 40, 50}) driver.shots.push_back(mjpg(value));
  driver.later.push_back(mjpg(90));
  const auto frame = camera->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_NEAR(frame->image.ptr()[0], 90, 2);
  EXPECT_EQ(driver.queued.size(), 4u);
  expect_contains(camera->description(), "4 frames skipped");
}

TEST(V4l2Camera, StampsThatCannotBeAreThoseOfReading) {
  Driver driver;
  driver.last = mjpg(10);
  auto camera = opened(&driver);
  ASSERT_TRUE(camera);
  for (const auto& [age_s, flags] : {std::pair{-5.0, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC},
                                     {300.0, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC},
                                     {0.5, V4L2_BUF_FLAG_TIMESTAMP_COPY}}) {
    driver.shots.push_back(mjpg(20));
    driver.shots.back().age_s = age_s;
    driver.shots.back().flags = static_cast<std::uint32_t>(flags);
    const Stamp begun = Clock::now();
    const auto frame = camera->next();
    ASSERT_TRUE(frame);
    EXPECT_GE(frame->captured_at, begun);
    EXPECT_LE(frame->captured_at, Clock::now());
  }
  expect_contains(camera->description(), "3 with an impossible stamp");
}

TEST(V4l2Camera, SensorSettingsAreLockedAndReadBack) {
  Driver driver;
  driver.last = mjpg(10);
  auto camera = opened(&driver, {.sensor = {.exposure_ms = 8, .gain = 12, .white_balance_k = 5200}});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_AUTO_PRIORITY], 0);
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 80);
  EXPECT_EQ(driver.controls[V4L2_CID_AUTOGAIN], 0);
  EXPECT_EQ(driver.controls[V4L2_CID_AUTO_WHITE_BALANCE], 0);
  const auto settings = camera->settings();
  ASSERT_EQ(settings.size(), 3u);
  const double expected[] = {8, 12, 5200};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(settings[i].problem, "");
    EXPECT_EQ(settings[i].found, expected[i]);
  }
}

TEST(V4l2Camera, WhatTheDriverDidNotDoIsSaid) {
  const SensorSettings wanted = {.exposure_ms = 8};
  const auto said = [&](Driver* driver, const SensorSettings& sensor) {
    driver->last = mjpg(10);
    const auto camera = opened(driver, {.sensor = sensor});
    return camera ? camera->settings().at(0).problem : camera.message();
  };
  Driver coarse;
  coarse.exposure_step = 50;
  expect_contains(said(&coarse, wanted),
                  "asked for 8, the driver says 5. It takes 0.3 to 500 in steps of 0.1");
  Driver refusing;
  expect_contains(said(&refusing, {.exposure_ms = 900}),
                  "exposure_ms is refused (Numerical result out of range). It takes");
  Driver without;
  without.controls.erase(V4L2_CID_GAIN);
  expect_contains(said(&without, {.gain = 3}), "no such control");
  Driver stubborn;
  stubborn.stuck = {V4L2_CID_EXPOSURE_AUTO};
  expect_contains(said(&stubborn, wanted), "own control of it stays on");
  Driver mute;
  mute.refusals = {{VIDIOC_G_CTRL, EIO}};
  expect_contains(said(&mute, wanted), "cannot be read back");
}

TEST(V4l2Camera, ADriverThatLiesAboutItsFormatIsNamed) {
  Driver smaller;
  smaller.on_set = [](v4l2_pix_format* format) { format->width = 32; };
  expect_contains(problem(&smaller, {.size = {64, 48}}),
                  "expected the format MJPG 64x48, the driver offers MJPG 32x48");
  Driver other;
  other.on_set = [](v4l2_pix_format* format) { format->pixelformat = V4L2_PIX_FMT_YUYV; };
  expect_contains(problem(&other), "the driver offers YUYV");
  Driver forgetful;
  forgetful.on_get = [asked = 0](v4l2_pix_format* format) mutable {
    if (++asked % 2 == 0) format->height = 40;
  };
  expect_contains(problem(&forgetful), "then says MJPG 64x40");
  Driver larger;  // the JPEG has another size than the format
  larger.last = mjpg(10, 80);
  expect_contains(problem(&larger), "64x48, found 80x48");
}

TEST(V4l2Camera, FaultsAreNamedWithWhatToDo) {
  const auto refusing = [](unsigned long request, int reason) {
    Driver driver;
    driver.last = mjpg(10);
    driver.refusals[request] = reason;
    return problem(&driver);
  };
  expect_contains(refusing(VIDIOC_STREAMON, ENOSPC), "USB controller");
  expect_contains(refusing(VIDIOC_REQBUFS, EBUSY), "other program");
  expect_contains(refusing(VIDIOC_DQBUF, EIO), "taking a frame fails: Input/output error");
  expect_contains(refusing(VIDIOC_QUERYBUF, EINVAL), "asking for a buffer fails");
  expect_contains(refusing(VIDIOC_S_FMT, EBUSY), "setting its format fails");
  Driver metadata;
  metadata.capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  expect_contains(problem(&metadata), "gives no images");
  Driver exotic;
  exotic.formats = {V4L2_PIX_FMT_H264};
  expect_contains(problem(&exotic), "expected a camera with MJPG, YUYV or GREY, found H264");
  Driver forbidden;
  forbidden.open_problem = EACCES;
  expect_contains(problem(&forbidden), "group video");
  Driver silent;
  expect_contains(problem(&silent), "sends no frame");
  Driver few;
  few.buffer_count = 1;
  expect_contains(problem(&few), "expected 4 buffers, the driver gives 1");
  Driver narrow;
  narrow.formats = {V4L2_PIX_FMT_YUYV};
  narrow.buffer_bytes = 6000;
  expect_contains(problem(&narrow),
                  "expected buffers of at least 6144 bytes for YUYV 64x48, the driver gives 6000");
  Driver wild;
  wild.last = mjpg(10);
  wild.odd_index = 9;
  expect_contains(problem(&wild), "buffer 9");
  const auto absent = V4l2Camera::open("/dev/video5", {.limit_s = 0.1}, few.system());
  ASSERT_FALSE(absent);
  expect_contains(absent.message(), "camera0 (/dev/video5)");
  expect_contains(absent.message(), "Plug the camera in");
}

TEST(V4l2Camera, DamagedAndShortFramesArePassedOver) {
  Driver driver;
  driver.formats = {V4L2_PIX_FMT_YUYV};
  driver.last = yuyv(100);
  auto camera = opened(&driver);
  ASSERT_TRUE(camera);
  Shot marked = yuyv(1), shorter = yuyv(2), longer = yuyv(3);
  marked.flags |= V4L2_BUF_FLAG_ERROR;
  shorter.bytes.resize(6143);
  longer.bytes.resize(7000);  // more bytes than the buffer has
  for (const Shot& bad : {marked, shorter, longer}) {
    driver.last = bad;
    const auto none = camera->next();
    ASSERT_FALSE(none);
    expect_contains(none.message(),
                    bad.flags & V4L2_BUF_FLAG_ERROR ? "marks its frames as damaged" : "at least 6144 bytes");
    driver.last = yuyv(100);
    EXPECT_TRUE(camera->next());
  }
  EXPECT_EQ(driver.opened, 1);
}

TEST(V4l2Camera, APulledPlugIsNamedAndTheCameraComesBack) {
  Driver driver;
  driver.last = mjpg(10);
  auto camera = opened(&driver, {.sensor = {.exposure_ms = 8}});
  ASSERT_TRUE(camera);
  driver.refusals[VIDIOC_DQBUF] = ENODEV;
  driver.open_problem = ENOENT;
  const auto gone = camera->next();
  ASSERT_FALSE(gone);
  expect_contains(gone.message(), "opening it fails: No such file or directory");
  EXPECT_EQ(driver.mapped, 0);
  EXPECT_EQ(camera->settings().size(), 0u);
  driver.refusals.clear();
  driver.open_problem = 0;
  driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = 250;  // a camera restarts with its own settings
  Result<Frame> back = camera->next();
  for (int i = 0; !back && i < 8; ++i) back = camera->next();
  ASSERT_TRUE(back) << back.message();
  EXPECT_EQ(driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 80);
  expect_contains(camera->description(), "opened 2 times");

  driver.refusals[VIDIOC_DQBUF] = ENODEV;  // then another camera has the same path
  driver.on_set = [](v4l2_pix_format* format) { format->width = 32; };
  EXPECT_FALSE(camera->next());
  driver.refusals.clear();
  Result<Frame> other = camera->next();
  for (int i = 0; i < 3; ++i) other = camera->next();
  ASSERT_FALSE(other);
  expect_contains(other.message(), "expected the format MJPG 64x48, the driver offers MJPG 32x48");
}

TEST(V4l2Camera, CamerasAreListed) {
  Driver driver;
  auto found = v4l2_cameras(driver.system());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].path, "/dev/video2");
  EXPECT_EQ(found[0].card, "Test camera");
  EXPECT_EQ(found[0].problem, "");
  driver.capabilities = V4L2_CAP_META_CAPTURE;
  EXPECT_TRUE(v4l2_cameras(driver.system()).empty());
  driver.open_problem = EACCES;
  found = v4l2_cameras(driver.system());
  ASSERT_EQ(found.size(), 1u);
  expect_contains(found[0].problem, "group video");
  EXPECT_EQ(driver.opened, driver.closed);
}

}  // namespace
}  // namespace limn::device
