#include "session/device_session.h"

#include <algorithm>
#include <chrono>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "core/log.h"
#include "session/camera_threads.h"
#include "session/device_capture.h"
#include "session/key_client.h"
#include "session/perception_thread.h"
#include "session/scene_files_client.h"

namespace limn::session {
namespace {

// Wait for new percepts; after it a frame is made without them.
constexpr auto k_wait = std::chrono::milliseconds(50);
constexpr double k_blend = 0.1;  // weight of a new time in the expected one

// The machine's clock. The light of a frame arrives after drawing and display have taken as long as they did
// recently.
class DeviceClock final : public FrameClock {
 public:
  Stamp now() const override { return limn::now(); }
  Result<std::optional<FrameTimes>> next_frame() override {
    const Stamp at = now();
    return std::optional(FrameTimes{at, shifted(at, paint_s_ + display_s_)});
  }

  void painted_in(double seconds) { paint_s_ += k_blend * (seconds - paint_s_); }
  void displayed_in(double seconds) { display_s_ += k_blend * (seconds - display_s_); }

 private:
  double paint_s_ = 0.02, display_s_ = 0.02;
};

// The newest results of the perception thread.
class DeviceSource final : public FrameSource {
 public:
  DeviceSource(double seconds, CameraThreads* cameras, PerceptionThread* perception)
      : seconds_(seconds), cameras_(cameras), perception_(perception) {}

  bool is_over() const override { return seconds_ > 0 && seconds_between(begun_, now()) >= seconds_; }
  Result<Perceived> perceive() override {
    Perceived out = perception_->take_percepts(k_wait);
    out.missed = static_cast<int>(cameras_->missed());
    return out;
  }

 private:
  double seconds_;
  Stamp begun_ = now();
  CameraThreads* cameras_;
  PerceptionThread* perception_;
};

// Projectors and screens. One that fails is reported and tried again.
class DeviceSink final : public FrameSink {
 public:
  DeviceSink(SessionDevices* devices,
             const Session* session,
             CameraThreads* cameras,
             DeviceHealth* health,
             DeviceClock* clock)
      : devices_(devices), session_(session), cameras_(cameras), health_(health), clock_(clock) {
    for (const auto& display : devices->projectors) projectors_.push_back(added(display.get(), "projector"));
    for (const auto& display : devices->screens) screens_.push_back(added(display.get(), "screen"));
  }

  Status show(const ComposedFrame&, const std::vector<EyeImages>& light) override {
    clock_->painted_in(1e-3 * session_->measured().paint_ms);
    double latest_s = 0;
    dark_.clear();
    for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
      device::Display* display = devices_->projectors[i].get();
      const std::string& name = session_->setup().rig.projectors[i].name;
      if (!display) {
        dark_.push_back(name);
        continue;
      }
      const Stamp begun = now();
      const Result<Stamp> shown_at = display->show_eyes(light[i]);
      note(projectors_[i], shown_at);
      if (shown_at)
        latest_s = std::max(latest_s, seconds_between(begun, *shown_at));
      else
        dark_.push_back(name);
    }
    if (latest_s > 0) clock_->displayed_in(latest_s);
    return {};
  }

  std::optional<std::vector<std::string>> dark_projectors() const override { return dark_; }

  std::vector<ScreenRequest> wanted_screens() const override {
    std::vector<ScreenRequest> out;
    for (const auto& screen : devices_->screens)
      if (screen) out.push_back(request_of(*screen));
    return out;
  }

  // Screens show every image of their camera. One that shows `off` is black, and so is a wall that the viewer
  // is behind.
  void show_screens(std::span<const ScreenImages> images) override {
    const Rig& rig = session_->setup().rig;
    const bool is_shown =
        std::ranges::any_of(images, [](const auto& drawn) { return !drawn.images.left.empty(); });
    using Images = tracker::DetectionSource::Images;
    cameras_->want_images(rig.cameras[rig.first_visible_camera()].name,
                          is_shown ? Images::all : Images::some);
    for (std::size_t i = 0; i < devices_->screens.size(); ++i) {
      device::Display* screen = devices_->screens[i].get();
      if (!screen) continue;
      const ScreenRequest request = request_of(*screen);
      const auto found = std::ranges::find(images, request, &ScreenImages::request);
      if (found == images.end()) continue;
      const EyeImages& drawn = found->images;
      if (!drawn.left.empty())
        note(screens_[i],
             screen->show_eyes({fitted(drawn.left, screen->size()), fitted(drawn.right, screen->size())}));
      else if (request.what == scene::Screen::off || request.wall)
        note(screens_[i], screen->show(cv::Mat(screen->size(), CV_8UC3, cv::Scalar::all(0))));
    }
  }

 private:
  std::size_t added(const device::Display* display, const char* kind) {
    return display ? health_->add({display->name(), kind}) : 0;
  }
  ScreenRequest request_of(const device::Display& screen) const {
    ScreenRequest out{.what = scene::screen_content(session_->show_state(), screen.name()),
                      .for_two_eyes = screen.is_stereo()};
    if (const auto wall = devices_->walls.find(screen.name()); wall != devices_->walls.end()) {
      out.wall = wall->second;
      out.wall_pixels = screen.size();
    }
    return out;
  }
  void note(std::size_t number, const Result<Stamp>& shown_at) {
    shown_at ? health_->works(number) : health_->fails(number, shown_at.message());
  }
  // The image scaled to fit the screen, with black bars; empty for an empty one.
  static cv::Mat fitted(const cv::Mat& image, cv::Size size);

  SessionDevices* devices_;
  const Session* session_;
  CameraThreads* cameras_;
  DeviceHealth* health_;
  DeviceClock* clock_;
  std::vector<std::size_t> projectors_, screens_;  // in health_
  std::vector<std::string> dark_;                  // projectors that did not show the last frame
};

cv::Mat DeviceSink::fitted(const cv::Mat& image, cv::Size size) {
  if (image.empty()) return {};
  const double scale = std::min(1.0 * size.width / image.cols, 1.0 * size.height / image.rows);
  const cv::Size inner(std::max(1, cvRound(scale * image.cols)), std::max(1, cvRound(scale * image.rows)));
  cv::Mat out(size, image.type(), cv::Scalar::all(0));
  const cv::Rect place((size.width - inner.width) / 2, (size.height - inner.height) / 2, inner.width,
                       inner.height);
  cv::resize(image, out(place), inner, 0, 0, cv::INTER_AREA);
  return out;
}

// Hands the cameras to their threads; null ones are missing.
void start_cameras(SessionDevices* devices, DeviceHealth* health, CameraThreads* threads) {
  std::vector<std::size_t> numbers;
  for (const auto& camera : devices->cameras)
    numbers.push_back(camera ? health->add({camera->name(), "camera"}) : 0);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (devices->cameras[i]) threads->add(std::move(devices->cameras[i]), numbers[i]);
}

void note_missing(const SessionDevices& devices, DeviceHealth* health, Telemetry* telemetry) {
  for (const DeviceState& missing : devices.missing) {
    health->add(missing);
    telemetry->note(now(), fmt::format("{} is missing: {}", missing.name, missing.why));
  }
}

}  // namespace

Status check_devices(const SessionDevices& devices) {
  const auto any = [](const auto& all) {
    return std::ranges::any_of(all, [](const auto& device) { return device != nullptr; });
  };
  if (!any(devices.cameras)) return error("live: expected a camera that works, found none. Run limn doctor.");
  if (!any(devices.projectors))
    return error("live: expected a projector that works, found none. Run limn doctor.");
  return {};
}

Status play_on_devices(SessionDevices* devices,
                       double seconds,
                       const std::atomic<bool>& is_ended,
                       const SessionParts& parts) {
  LIMN_TRY_STATUS(check_devices(*devices));
  const auto health = std::make_shared<DeviceHealth>();
  CameraThreads cameras(health);
  DeviceClock clock;
  start_cameras(devices, health.get(), &cameras);
  DeviceSink sink(devices, &parts.session, &cameras, health.get(), &clock);
  KeyClient keys(devices->keys, parts.session.setup().scene, devices->chosen, health.get());
  note_missing(*devices, health.get(), &parts.output.telemetry());
  SceneFilesClient files(parts.session.setup().scene.folder);
  PerceptionThread perception(&parts.perception, &cameras, parts.output.recorder(), parts.feeds,
                              health.get());
  DeviceSource source(seconds, &cameras, &perception);
  DeviceCapture capture(devices, &cameras, &perception, parts.session.setup().rig, is_ended);
  SessionParts with_own = parts;
  with_own.clients.insert(with_own.clients.begin(), {&files, &keys});
  FrameLoop loop(std::move(with_own), {clock, source, sink, *health, &capture});
  return loop.run(is_ended);
}

}  // namespace limn::session
