#include "apps/live/device_session.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "apps/live/keys.h"
#include "apps/live/latest.h"
#include "apps/live/scene_watch.h"
#include "core/log.h"

namespace limn::apps {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double k_other_clock_s = 60;  // stamps so far from now are of a source's own clock
constexpr auto k_retry = std::chrono::milliseconds(100);
constexpr auto k_wait = std::chrono::milliseconds(50);  // for news, before the next picture is painted anyway
constexpr double k_blend = 0.1;                         // of a new time into the expected one

// The session's clock: all stamps are of it.
Stamp now() { return std::chrono::time_point_cast<Stamp::duration>(Clock::now()); }

double milliseconds_since(Stamp begun) { return 1e3 * seconds_between(begun, now()); }

// Newest frames of all cameras that were not watched yet.
using Frames = std::map<std::string, Frame>;

struct Seen {
  Watched watched;
  std::size_t moments = 0;
};

// What people are told of: devices that come and go. From several threads.
class Notices {
 public:
  void put(const std::string& what) {
    const std::lock_guard lock(mutex_);
    all_.push_back(what);
  }
  std::vector<std::string> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(all_, {});
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> all_;
};

// Whether a device works, said once for each change.
class Health {
 public:
  Health(std::string device, Notices* notices) : device_(std::move(device)), notices_(notices) {}
  void works() {
    if (!works_) notices_->put(device_ + " is back");
    works_ = true;
  }
  void fails(const std::string& why) {
    if (works_) notices_->put(fmt::format("{} is gone; the session goes on without it: {}", device_, why));
    works_ = false;
  }

 private:
  std::string device_;
  Notices* notices_;
  bool works_ = true;
};

class DeviceLoop {
 public:
  DeviceLoop(SessionDevices* devices, Watcher* watcher, Session* session, Books* books)
      : devices_(devices),
        watcher_(watcher),
        session_(session),
        books_(books),
        keys_(session->setup().scene),
        files_(session->setup().scene.folder) {
    for (const auto& camera : devices_->cameras)
      if (camera) threads_.emplace_back([this, &camera = *camera] { grab(&camera); });
    threads_.emplace_back([this] { watch(); });
    for (const auto* displays : {&devices_->projectors, &devices_->screens})
      for (const auto& display : *displays) health_.emplace_back(display ? display->name() : "", &notices_);
  }

  ~DeviceLoop() {
    is_stopping_ = true;
    for (std::thread& thread : threads_) thread.join();
  }

  void step(device::Window* window) {
    if (auto seen = seen_.take(k_wait)) session_->take(std::move(seen->watched), seen->moments);
    session_->show_news(&files_, now());
    const Stamp painting_at = now();
    const Painted& painted = session_->paint(painting_at, shifted(painting_at, paint_s_ + display_s_));
    ShownFrame shown = session_->measured();
    paint_s_ += k_blend * (1e-3 * shown.paint_ms - paint_s_);
    show(painted);
    shown.missed = static_cast<int>(missed_.exchange(0));
    const Stamp begun = now();
    const bool wants_screen = window || !devices_->screens.empty();
    const cv::Mat screen = wants_screen ? session_->screen() : cv::Mat();
    shown.screen_ms = wants_screen ? milliseconds_since(begun) : -1;
    if (!screen.empty()) show_screen(screen, window);
    if (window) press(window->pressed_key());
    if (session_->watched().captured_at != Stamp{}) books_->shown(shown, painted);  // something was seen
    for (const std::string& what : notices_.take()) {
      books_->telemetry().note(now(), what);
      log_warning("live: {}", what);
    }
  }

 private:
  void grab(device::CameraSource* camera) try {
    Health health(camera->name(), &notices_);
    std::optional<double> offset_s;  // from the source's clock to the session's
    while (!is_stopping_) {
      Result<Frame> frame = camera->next();
      if (!frame) {
        health.fails(frame.message());
        std::this_thread::sleep_for(k_retry);
        continue;
      }
      health.works();
      if (!offset_s) {
        const double ahead_s = seconds_between(frame->captured_at, now());
        offset_s = std::abs(ahead_s) > k_other_clock_s ? ahead_s : 0;
      }
      frame->captured_at = shifted(frame->captured_at, *offset_s);
      if (*offset_s != 0) std::this_thread::sleep_until(frame->captured_at);
      Frames frames;
      frames.emplace(frame->camera, std::move(*frame));
      frames_.put(std::move(frames), [this](const Frames& old, Frames& newest) {
        for (const auto& [name, frame] : old) missed_ += !newest.emplace(name, frame).second;
      });
    }
  } catch (const std::exception& bug) {
    notices_.put(fmt::format("{}: this is a bug in Limn, please report it: {}", camera->name(), bug.what()));
  }

  void watch() try {
    std::size_t moments = 0;
    while (!is_stopping_) {
      auto newest = frames_.take(k_wait);
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
    notices_.put(fmt::format("the tracker stopped: this is a bug in Limn, please report it: {}", bug.what()));
  }

  void show(const Painted& painted) {
    double latest_s = 0;
    for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
      device::Display* display = devices_->projectors[i].get();
      if (!display) continue;
      const Stamp begun = now();
      const Result<Stamp> shown_at = display->show(painted.projectors[i]);
      if (!shown_at) {
        health_[i].fails(shown_at.message());
        continue;
      }
      health_[i].works();
      latest_s = std::max(latest_s, seconds_between(begun, *shown_at));
    }
    if (latest_s > 0) display_s_ += k_blend * (latest_s - display_s_);
  }

  void show_screen(const cv::Mat& screen, device::Window* window) {
    if (window) window->show(screen);
    for (std::size_t i = 0; i < devices_->screens.size(); ++i) {
      if (!devices_->screens[i]) continue;
      Health& health = health_[devices_->projectors.size() + i];
      const Result<Stamp> shown_at = devices_->screens[i]->show(fitted(screen, devices_->screens[i]->size()));
      shown_at ? health.works() : health.fails(shown_at.message());
    }
  }

  // The picture as large as the screen takes it, with black bars.
  static cv::Mat fitted(const cv::Mat& picture, cv::Size size);

  void press(int key) {
    const auto edit = keys_.edit_of(key);
    const Status done = edit ? session_->edit(*edit, "key", now()) : Status();
    if (!done) log_warning("live: {}", done.message());
  }

  SessionDevices* devices_;
  Watcher* watcher_;
  Session* session_;
  Books* books_;
  Keys keys_;
  SceneWatch files_;
  Notices notices_;
  std::vector<Health> health_;  // of projectors, then screens
  Latest<Frames> frames_;
  Latest<Seen> seen_;
  std::atomic<bool> is_stopping_ = false;
  std::atomic<std::size_t> missed_ = 0;
  double paint_s_ = 0.02, display_s_ = 0.02;  // as expected of the next picture
  std::vector<std::thread> threads_;
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
                       std::optional<device::Window>* window) {
  const auto any = [](const auto& all) {
    return std::any_of(all.begin(), all.end(), [](const auto& device) { return device != nullptr; });
  };
  if (!any(devices->cameras))
    return error("live: expected a camera that works, found none. Run limn doctor.");
  if (!any(devices->projectors))
    return error("live: expected a projector that works, found none. Run limn doctor.");
  const Stamp begun = now();
  DeviceLoop loop(devices, watcher, session, books);
  while (!is_ended && !(seconds > 0 && seconds_between(begun, now()) >= seconds)) {
    loop.step(*window ? &**window : nullptr);
    if (*window && !(*window)->is_open()) break;
  }
  return {};
}

}  // namespace limn::apps
