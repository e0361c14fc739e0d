#include "session/device_session.h"

#include <algorithm>
#include <chrono>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "session/camera_threads.h"
#include "session/latest.h"
#include "session/live_recalibration.h"
#include "session/scene_watch.h"
#include "core/stopwatch.h"
#include "core/log.h"

namespace limn::apps {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto k_wait = std::chrono::milliseconds(50);  // for news, before the next image is painted anyway
constexpr auto k_errand_wait = std::chrono::milliseconds(10);  // for what a repair wants
constexpr double k_patience_s = 5;                             // for an image of a repair
constexpr double k_longest_exposure_s = 0.1;                   // while a camera's period is not known
constexpr double k_blend = 0.1;                                // of a new time into the expected one

struct Seen {
  Percepts watched;
  std::size_t moments = 0;
};

class DeviceLoop {
 public:
  DeviceLoop(SessionDevices* devices,
             const std::atomic<bool>& is_ended,
             Perception* perception,
             Session* session,
             SessionOutput* output,
             OperatorConsole* console,
             OscPort* osc,
             RemoteLink* remote)
      : devices_(devices),
        is_ended_(is_ended),
        perception_(perception),
        session_(session),
        output_(output),
        console_(console),
        osc_(osc),
        remote_(remote),
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
      output_->telemetry().note(now(), fmt::format("{} is missing: {}", missing.name, missing.why));
    }
    for (std::size_t i = 0; i < cameras.size(); ++i)
      if (devices_->cameras[i]) cameras_.add(std::move(devices_->cameras[i]), cameras[i]);
    start_watching();
  }

  ~DeviceLoop() {
    recalibration_.reset();
    stop_watching();
  }

  // False: the operator ends the session.
  bool step() {
    if (recalibration_) continue_recalibration();
    if (recalibration_ && recalibration_->is_capturing()) {  // the light is its own
      hear_people();
      return serve_console({});
    }
    if (auto seen = seen_.take(k_wait)) session_->take(std::move(seen->watched), seen->moments);
    session_->show_news(&files_, now());
    hear_people();
    if (session_->take_recalibration_request()) begin_recalibration();
    const Stamp painting_at = now();
    const ComposedFrame& painted = session_->paint(painting_at, shifted(painting_at, paint_s_ + display_s_));
    ShownFrame shown = session_->measured();
    paint_s_ += k_blend * (1e-3 * shown.paint_ms - paint_s_);
    show(painted);
    if (osc_) osc_->tell(*session_, now());
    if (remote_) serve();  // what came while it painted need not wait for screens and news
    shown.missed = static_cast<int>(cameras_.missed());
    const Stamp begun = now();
    const std::map<scene::Screen, cv::Mat> images = screen_images();
    shown.screen_ms = images.empty() ? -1 : milliseconds_since(begun);
    show_screens(images);
    session_->look_for_drift(painting_at);
    if (session_->watched().captured_at != Stamp{}) {  // something was seen
      output_->shown(shown, painted);
      if (console_) console_->shown(shown);
    }
    const auto screen = images.find(session_->show_state().screen);
    return serve_console(screen == images.end() ? cv::Mat() : screen->second);
  }

 private:
  void hear_people() {
    hear_keys();
    if (osc_) osc_->hear(session_, &output_->telemetry(), now());
    if (remote_) serve();
  }

  // False: the operator ends the session.
  bool serve_console(const cv::Mat& screen) {
    for (const std::string& what : health_->news()) {
      output_->telemetry().note(now(), what);
      log_warning("live: {}", what);
    }
    return !console_ || console_->serve(session_, &output_->telemetry(), *health_, screen, now());
  }

  void hear_keys() {
    Keys& keys = console_ ? console_->keys() : keys_;
    for (std::size_t i = 0; i < devices_->keys.size(); ++i) {
      const auto pressed = devices_->keys[i].poll_pressed_keys();
      if (static_cast<bool>(pressed) == are_keys_gone_[i])  // it went, or it came back
        pressed ? health_->works(key_sources_[i]) : health_->fails(key_sources_[i], pressed.message());
      are_keys_gone_[i] = !pressed;
      if (!pressed) continue;
      for (const int key : *pressed) {
        const auto edit = keys.edit_of(key);
        const Status done = edit ? session_->edit(*edit, devices_->keys[i].name(), now()) : Status();
        if (done) continue;
        output_->telemetry().note(now(), done.message());
        log_warning("live: {}", done.message());
      }
    }
  }

  void serve() {
    remote_->apply_requests(session_, now());
    remote_->publish_state(*session_, output_->telemetry(), *health_, now());
  }

  void start_watching() {
    is_stopping_ = false;
    watching_ = std::thread([this] { watch(); });
  }

  void stop_watching() {
    is_stopping_ = true;
    if (watching_.joinable()) watching_.join();
  }

  // The session knows all that was watched.
  void pause_watching() {
    stop_watching();
    if (auto seen = seen_.take({})) session_->take(std::move(seen->watched), seen->moments);
  }

  // Nobody watches while it captures: the cameras' images are of patterns.
  void begin_recalibration() {
    if (recalibration_) return;
    const auto folder = recalibration_folder(output_->out());
    if (!folder) return session_->warn(now(), folder.message());
    pause_watching();
    recalibration_ = std::make_unique<LiveRecalibration>(session_->setup().rig, *folder,
                                       [this](ImageWriter* writer) { return surroundings(writer); });
  }

  void continue_recalibration() {
    if (recalibration_->is_capturing()) recalibration_->serve(k_errand_wait);
    session_->set_recalibration_progress(recalibration_->words());
    const auto checked = recalibration_->take();
    if (!checked) {
      if (!recalibration_->is_capturing() && !watching_.joinable()) start_watching();
      return;
    }
    pause_watching();
    apply_recalibration(*checked, recalibration_->folder(), now(), perception_, session_);
    recalibration_.reset();
    start_watching();
  }

  // The session's devices as a repair wants them.
  Surroundings surroundings(ImageWriter* writer) {
    grabbed_.clear();
    latency_s_.assign(devices_->projectors.size(), FlashOptions().limit_s);
    Surroundings around;
    around.stage.show = [this](int projector, const cv::Mat& image) {
      return show_pattern(static_cast<std::size_t>(projector), image);
    };
    around.stage.grab = [this](int camera) {
      return grab(session_->setup().rig.cameras.at(static_cast<std::size_t>(camera)).name);
    };
    around.stage.store = [writer](const std::filesystem::path& path, const cv::Mat& image) {
      return writer->store(path, image);
    };
    around.written = [writer] { return writer->finish(); };
    around.use_latency = [this](int projector, double seconds) {
      latency_s_.at(static_cast<std::size_t>(projector)) = seconds;
    };
    return around;
  }

  // One projector shows an image, the others nothing.
  Status show_pattern(std::size_t projector, const cv::Mat& image) {
    for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
      device::Display* display = devices_->projectors[i].get();
      if (!display)
        return error("{}: expected a projector that works, found none.",
                     session_->setup().rig.projectors[i].name);
      const Stamp begun = now();
      LIMN_TRY(const Stamp shown_at,
               display->show(i == projector ? image : cv::Mat(display->size(), CV_8UC1, cv::Scalar(0))));
      lit_at_ = std::max({lit_at_, shown_at, shifted(begun, latency_s_[i])});
    }
    return {};
  }

  // An image whose whole exposure lies after what was shown last: a stamp is of an exposure's middle.
  Result<cv::Mat> grab(const std::string& camera) {
    const Stamp begun = now();
    for (;;) {
      auto newest = cameras_.take(k_wait);
      if (newest)
        for (auto& [name, frame] : *newest) {
          const auto [known, is_first] = grabbed_.try_emplace(name);
          if (!is_first)
            known->second.period_s = std::min(
                known->second.period_s, seconds_between(known->second.frame.captured_at, frame.captured_at));
          known->second.frame = std::move(frame);
        }
      const auto found = grabbed_.find(camera);
      if (found != grabbed_.end() &&
          found->second.frame.captured_at >= shifted(lit_at_, found->second.period_s / 2))
        return found->second.frame.image;
      if (is_ended_) return error("the session was ended.");
      if (seconds_between(begun, now()) > k_patience_s)
        return error("{}: expected a picture within {} s, found none.", camera, k_patience_s);
    }
  }

  void watch() try {
    while (!is_stopping_) {
      auto newest = cameras_.take(k_wait);
      if (!newest) continue;
      std::vector<Frame> frames;
      for (auto& [name, frame] : *newest) frames.push_back(std::move(frame));
      std::sort(frames.begin(), frames.end(),
                [](const Frame& a, const Frame& b) { return a.captured_at < b.captured_at; });
      if (output_->recorder()) output_->recorder()->watched(frames);
      seen_.put({perception_->watch(frames), ++moments_}, [](const Seen& old, Seen& next) {
        next.watched.uses.insert(next.watched.uses.begin(), old.watched.uses.begin(), old.watched.uses.end());
      });
    }
  } catch (const std::exception& bug) {
    health_->note(
        fmt::format("the tracker stopped: this is a bug in Limn, please report it: {}", bug.what()));
  }

  void show(const ComposedFrame& painted) {
    double latest_s = 0;
    for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
      device::Display* display = devices_->projectors[i].get();
      if (!display) continue;
      const Stamp begun = now();
      const Result<Stamp> shown_at =
          display->show(remote_ ? remote_->projector_image(session_, i) : painted.projectors[i]);
      if (!shown_at) {
        health_->fails(projectors_[i], shown_at.message());
        continue;
      }
      health_->works(projectors_[i]);
      latest_s = std::max(latest_s, seconds_between(begun, *shown_at));
    }
    if (latest_s > 0) display_s_ += k_blend * (latest_s - display_s_);
  }

  // Of what screens and the desk show: each choice is painted once.
  std::map<scene::Screen, cv::Mat> screen_images() {
    const scene::ShowState& show_state = session_->show_state();
    std::map<scene::Screen, cv::Mat> out;
    for (const auto& screen : devices_->screens)
      if (screen) out.try_emplace(scene::screen_content(show_state, screen->name()));
    if (console_ && console_->is_due()) out.try_emplace(show_state.screen);
    for (auto& [what, image] : out) image = session_->screen(what);
    return out;
  }

  // `off` is black.
  void show_screens(const std::map<scene::Screen, cv::Mat>& images) {
    for (std::size_t i = 0; i < devices_->screens.size(); ++i) {
      device::Display* screen = devices_->screens[i].get();
      if (!screen) continue;
      const scene::Screen what = scene::screen_content(session_->show_state(), screen->name());
      const cv::Mat& image = images.at(what);
      if (image.empty() && what != scene::Screen::off) continue;
      const Result<Stamp> shown_at =
          screen->show(image.empty() ? cv::Mat(screen->size(), CV_8UC3, cv::Scalar::all(0))
                                       : fitted(image, screen->size()));
      shown_at ? health_->works(screens_[i]) : health_->fails(screens_[i], shown_at.message());
    }
  }

  // The image as large as the screen takes it, with black bars.
  static cv::Mat fitted(const cv::Mat& image, cv::Size size);

  // A camera's newest image during a repair.
  struct Grabbed {
    Frame frame;
    double period_s = k_longest_exposure_s;
  };

  SessionDevices* devices_;
  const std::atomic<bool>& is_ended_;
  Perception* perception_;
  Session* session_;
  SessionOutput* output_;
  OperatorConsole* console_;
  OscPort* osc_;
  RemoteLink* remote_;
  Keys keys_;  // where there is no desk
  SceneWatch files_;
  std::shared_ptr<DeviceHealth> health_ = std::make_shared<DeviceHealth>();
  CameraThreads cameras_{health_};
  std::vector<std::size_t> projectors_, screens_, key_sources_;  // as health_ calls them
  std::vector<bool> are_keys_gone_;
  std::map<std::string, Grabbed> grabbed_;
  std::vector<double> latency_s_;  // of the projectors, during a repair
  Stamp lit_at_;                   // what a repair showed last is on the surface
  std::size_t moments_ = 0;        // of the watching thread
  Latest<Seen> seen_;
  std::atomic<bool> is_stopping_ = false;
  double paint_s_ = 0.02, display_s_ = 0.02;  // as expected of the next image
  std::thread watching_;
  std::unique_ptr<LiveRecalibration> recalibration_;
};

cv::Mat DeviceLoop::fitted(const cv::Mat& image, cv::Size size) {
  const double scale = std::min(1.0 * size.width / image.cols, 1.0 * size.height / image.rows);
  const cv::Size inner(std::max(1, cvRound(scale * image.cols)),
                       std::max(1, cvRound(scale * image.rows)));
  cv::Mat out(size, image.type(), cv::Scalar::all(0));
  const cv::Rect place((size.width - inner.width) / 2, (size.height - inner.height) / 2, inner.width,
                       inner.height);
  cv::resize(image, out(place), inner, 0, 0, cv::INTER_AREA);
  return out;
}

}  // namespace

Status play_on_devices(SessionDevices* devices,
                       double seconds,
                       const std::atomic<bool>& is_ended,
                       Perception* perception,
                       Session* session,
                       SessionOutput* output,
                       OperatorConsole* console,
                       OscPort* osc,
                       RemoteLink* remote) {
  const auto any = [](const auto& all) {
    return std::any_of(all.begin(), all.end(), [](const auto& device) { return device != nullptr; });
  };
  if (!any(devices->cameras))
    return error("live: expected a camera that works, found none. Run limn doctor.");
  if (!any(devices->projectors))
    return error("live: expected a projector that works, found none. Run limn doctor.");
  const Stamp begun = now();
  DeviceLoop loop(devices, is_ended, perception, session, output, console, osc, remote);
  while (!is_ended && !(seconds > 0 && seconds_between(begun, now()) >= seconds)) {
    if (!loop.step()) break;
  }
  return {};
}

}  // namespace limn::apps
