#include "apps/live/device_session.h"

#include <algorithm>
#include <chrono>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "apps/live/camera_threads.h"
#include "apps/live/latest.h"
#include "apps/live/scene_watch.h"
#include "apps/live/stopwatch.h"
#include "core/log.h"

namespace limn::apps {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto k_wait = std::chrono::milliseconds(50);  // for news, before the next picture is painted anyway
constexpr double k_blend = 0.1;                         // of a new time into the expected one

// The session's clock: all stamps are of it.
Stamp now() { return std::chrono::time_point_cast<Stamp::duration>(Clock::now()); }

struct Seen {
  Watched watched;
  std::size_t moments = 0;
};

class DeviceLoop {
 public:
  DeviceLoop(SessionDevices* devices,
             Watcher* watcher,
             Session* session,
             Books* books,
             OperatorDesk* desk,
             OscPort* osc,
             Server* server)
      : devices_(devices),
        watcher_(watcher),
        session_(session),
        books_(books),
        desk_(desk),
        osc_(osc),
        server_(server),
        keys_(session->setup().scene),
        files_(session->setup().scene.folder) {
    const auto added = [this](const auto& all, const char* kind) {
      std::vector<std::size_t> numbers;
      for (const auto& device : all) numbers.push_back(device ? health_->add({device->name(), kind}) : 0);
      return numbers;
    };
    const std::vector<std::size_t> cameras = added(devices_->cameras, "camera");
    projectors_ = added(devices_->projectors, "projector");
    screens_ = added(devices_->screens, "screen");
    for (const device::KeySource& source : devices_->keys)
      key_sources_.push_back(health_->add({source.name(), "keys"}));
    are_keys_gone_.assign(key_sources_.size(), false);
    for (const DeviceState& missing : devices_->missing) {
      health_->add(missing);
      books_->telemetry().note(now(), fmt::format("{} is missing: {}", missing.name, missing.why));
    }
    for (std::size_t i = 0; i < cameras.size(); ++i)
      if (devices_->cameras[i]) cameras_.add(std::move(devices_->cameras[i]), cameras[i]);
    watching_ = std::thread([this] { watch(); });
  }

  ~DeviceLoop() {
    is_stopping_ = true;
    watching_.join();
  }

  // False: the operator ends the session.
  bool step() {
    if (auto seen = seen_.take(k_wait)) session_->take(std::move(seen->watched), seen->moments);
    session_->show_news(&files_, now());
    hear_keys();
    if (osc_) osc_->hear(session_, &books_->telemetry(), now());
    if (server_) serve();
    const Stamp painting_at = now();
    const Painted& painted = session_->paint(painting_at, shifted(painting_at, paint_s_ + display_s_));
    ShownFrame shown = session_->measured();
    paint_s_ += k_blend * (1e-3 * shown.paint_ms - paint_s_);
    show(painted);
    if (osc_) osc_->tell(*session_);
    shown.missed = static_cast<int>(cameras_.missed());
    const Stamp begun = now();
    const bool wants_screen = !devices_->screens.empty() || (desk_ && desk_->is_due());
    const cv::Mat screen = wants_screen ? session_->screen() : cv::Mat();
    shown.screen_ms = wants_screen ? milliseconds_since(begun) : -1;
    if (!screen.empty()) show_screen(screen);
    if (session_->watched().captured_at != Stamp{}) {  // something was seen
      books_->shown(shown, painted);
      if (desk_) desk_->shown(shown);
    }
    for (const std::string& what : health_->news()) {
      books_->telemetry().note(now(), what);
      log_warning("live: {}", what);
    }
    return !desk_ || desk_->serve(session_, &books_->telemetry(), *health_, screen, now());
  }

 private:
  void hear_keys() {
    Keys& keys = desk_ ? desk_->keys() : keys_;
    for (std::size_t i = 0; i < devices_->keys.size(); ++i) {
      const auto pressed = devices_->keys[i].pressed();
      if (static_cast<bool>(pressed) == are_keys_gone_[i])  // it went, or it came back
        pressed ? health_->works(key_sources_[i]) : health_->fails(key_sources_[i], pressed.message());
      are_keys_gone_[i] = !pressed;
      if (!pressed) continue;
      for (const int key : *pressed) {
        const auto edit = keys.edit_of(key);
        const Status done = edit ? session_->edit(*edit, devices_->keys[i].name(), now()) : Status();
        if (done) continue;
        books_->telemetry().note(now(), done.message());
        log_warning("live: {}", done.message());
      }
    }
  }

  void serve() {
    server_->hear(session_, now());
    server_->tell(*session_, books_->telemetry(), *health_, now());
  }

  void watch() try {
    std::size_t moments = 0;
    while (!is_stopping_) {
      auto newest = cameras_.take(k_wait);
      if (!newest) continue;
      std::vector<Frame> frames;
      for (auto& [name, frame] : *newest) frames.push_back(std::move(frame));
      std::sort(frames.begin(), frames.end(),
                [](const Frame& a, const Frame& b) { return a.captured_at < b.captured_at; });
      if (books_->recorder()) books_->recorder()->watched(frames);
      seen_.put({watcher_->watch(frames), ++moments}, [](const Seen& old, Seen& next) {
        next.watched.uses.insert(next.watched.uses.begin(), old.watched.uses.begin(), old.watched.uses.end());
      });
    }
  } catch (const std::exception& bug) {
    health_->note(
        fmt::format("the tracker stopped: this is a bug in Limn, please report it: {}", bug.what()));
  }

  void show(const Painted& painted) {
    double latest_s = 0;
    for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
      device::Display* display = devices_->projectors[i].get();
      if (!display) continue;
      const Stamp begun = now();
      const Result<Stamp> shown_at =
          display->show(server_ ? server_->lit(session_, i) : painted.projectors[i]);
      if (!shown_at) {
        health_->fails(projectors_[i], shown_at.message());
        continue;
      }
      health_->works(projectors_[i]);
      latest_s = std::max(latest_s, seconds_between(begun, *shown_at));
    }
    if (latest_s > 0) display_s_ += k_blend * (latest_s - display_s_);
  }

  void show_screen(const cv::Mat& screen) {
    for (std::size_t i = 0; i < devices_->screens.size(); ++i) {
      if (!devices_->screens[i]) continue;
      const Result<Stamp> shown_at = devices_->screens[i]->show(fitted(screen, devices_->screens[i]->size()));
      shown_at ? health_->works(screens_[i]) : health_->fails(screens_[i], shown_at.message());
    }
  }

  // The picture as large as the screen takes it, with black bars.
  static cv::Mat fitted(const cv::Mat& picture, cv::Size size);

  SessionDevices* devices_;
  Watcher* watcher_;
  Session* session_;
  Books* books_;
  OperatorDesk* desk_;
  OscPort* osc_;
  Server* server_;
  Keys keys_;  // where there is no desk
  SceneWatch files_;
  std::shared_ptr<DeviceHealth> health_ = std::make_shared<DeviceHealth>();
  CameraThreads cameras_{health_};
  std::vector<std::size_t> projectors_, screens_, key_sources_;  // as health_ calls them
  std::vector<bool> are_keys_gone_;
  Latest<Seen> seen_;
  std::atomic<bool> is_stopping_ = false;
  double paint_s_ = 0.02, display_s_ = 0.02;  // as expected of the next picture
  std::thread watching_;
};

cv::Mat DeviceLoop::fitted(const cv::Mat& picture, cv::Size size) {
  const double scale = std::min(1.0 * size.width / picture.cols, 1.0 * size.height / picture.rows);
  const cv::Size inner(std::max(1, cvRound(scale * picture.cols)),
                       std::max(1, cvRound(scale * picture.rows)));
  cv::Mat out(size, picture.type(), cv::Scalar::all(0));
  const cv::Rect place((size.width - inner.width) / 2, (size.height - inner.height) / 2, inner.width,
                       inner.height);
  cv::resize(picture, out(place), inner, 0, 0, cv::INTER_AREA);
  return out;
}

}  // namespace

Status play_on_devices(SessionDevices* devices,
                       double seconds,
                       const std::atomic<bool>& is_ended,
                       Watcher* watcher,
                       Session* session,
                       Books* books,
                       OperatorDesk* desk,
                       OscPort* osc,
                       Server* server) {
  const auto any = [](const auto& all) {
    return std::any_of(all.begin(), all.end(), [](const auto& device) { return device != nullptr; });
  };
  if (!any(devices->cameras))
    return error("live: expected a camera that works, found none. Run limn doctor.");
  if (!any(devices->projectors))
    return error("live: expected a projector that works, found none. Run limn doctor.");
  const Stamp begun = now();
  DeviceLoop loop(devices, watcher, session, books, desk, osc, server);
  while (!is_ended && !(seconds > 0 && seconds_between(begun, now()) >= seconds)) {
    if (!loop.step()) break;
  }
  return {};
}

}  // namespace limn::apps
