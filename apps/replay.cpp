#include "apps/replay.h"

#include <atomic>
#include <chrono>
#include <deque>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "core/file.h"
#include "core/log.h"
#include "device/gl_context.h"
#include "device/window.h"
#include "session/frame_loop.h"
#include "session/recording.h"
#include "session/scene_change.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Stamp stamp_of(std::int64_t nanoseconds) { return Stamp{} + std::chrono::nanoseconds(nanoseconds); }

// Lines of events.jsonl up to the first damaged one.
struct Events {
  std::vector<Json> all;
  std::optional<std::string> damage;
};

Result<Events> load_events(const fs::path& path) {
  std::ifstream file(path);
  if (!file) return error("{}: expected the recording's events, found no such file.", path.string());
  Events events;
  std::string line;
  while (std::getline(file, line)) {
    Json event = Json::parse(line, nullptr, false);
    if (event.is_discarded() || !event.is_object() ||
        !(event.contains("watch") || event.contains("edit") || event.contains("paint") ||
          event.contains("scene") || event.contains("rig") || event.contains("deviation") ||
          event.contains("eye") || event.contains("dark"))) {
      events.damage = fmt::format(
          "{}:{}: expected an event (watch, edit, eye, dark, scene, rig, deviation, paint), found something "
          "else",
          path.string(), events.all.size() + 1);
      break;
    }
    events.all.push_back(std::move(event));
  }
  return events;
}

// The number of moments whose frames had been perceived when an event happened, if the event depends on it; 0
// for others.
std::size_t known_moments(const Json& event) {
  const bool depends = event.contains("paint") || event.contains("rig") || event.contains("deviation");
  return depends ? event.at("moments").get<std::size_t>() : event.value("moments", std::size_t{0});
}

// A recording as the clock and source of the frame loop. A frame of the loop ends with an image, or earlier
// if an edit happened after more camera frames had been perceived, because those must be perceived first.
class Recording final : public session::FrameClock, public session::FrameSource {
 public:
  Recording(const ReplayOptions& options,
            const Events& events,
            session::Perception* perception,
            session::Session* session)
      : options_(options), events_(events.all), perception_(perception), session_(session) {}

  Stamp now() const override { return now_; }

  Result<std::optional<session::FrameTimes>> next_frame() override try {
    const Json* event = next();
    if (!event || !event->contains("paint") || !is_perceived(*event))
      return std::optional<session::FrameTimes>();
    const Json& paint = event->at("paint");
    const session::FrameTimes times{stamp_of(paint.at("painted_at_ns")), stamp_of(paint.at("shown_at_ns"))};
    painted_ = {paint, event->at("pictures")};
    pass();
    wait_for(times.shown_at);
    now_ = times.now;
    return std::optional(times);
  } catch (const nlohmann::json::exception& problem) {
    return damage(problem);
  }
  // The newest image's record.
  struct PaintedBefore {
    Json poses, images;
  };
  const PaintedBefore& painted() const { return painted_; }
  // Number of events replayed.
  int passed() const { return static_cast<int>(at_); }

  bool is_over() const override { return !next(); }

  // Perceives the camera frames that the next event depends on. In the session another thread perceived them,
  // perhaps ahead of the event.
  Result<session::Perceived> perceive() override try {
    while (next() && next()->contains("watch")) queue_frames();
    session::Perceived out;
    if (!next() || is_perceived(*next())) return out;
    asked_ = known_moments(*next());
    while (moments_ < asked_ && !unwatched_.empty()) {
      LIMN_TRY_STATUS(watch(*unwatched_.front()));
      unwatched_.pop_front();
    }
    out.percepts = perception_->percepts();
    out.percepts->uses.clear();  // their effects were recorded as edits
    out.moments = moments_;
    return out;
  } catch (const nlohmann::json::exception& problem) {
    return damage(problem);
  }

  Status edit(session::Session*) override try {
    for (; next() && !next()->contains("paint") && is_perceived(*next()); pass()) {
      const Status done = apply(*next());
      if (!done) return done;
    }
    return {};
  } catch (const nlohmann::json::exception& problem) {
    return damage(problem);
  }

 private:
  const Json* next() const { return at_ < events_.size() ? &events_[at_] : nullptr; }
  void pass() { ++at_; }
  // Whether all camera frames that an event depends on were perceived.
  bool is_perceived(const Json& event) const { return known_moments(event) <= asked_; }

  Error damage(const nlohmann::json::exception& problem) const {
    return error("{}: expected whole events, found a damaged one ({}).",
                 (options_.session / "events.jsonl").string(), problem.what());
  }

  void queue_frames() {
    unwatched_.push_back(next());
    pass();
  }

  Status watch(const Json& event) {
    LIMN_TRY(const std::vector<Frame> frames, frames_of(event.at("watch")));
    session::FeedInput input = session::recorded_feeds(event);
    for (const tracker::CameraDetections& found : input.detections)
      if (!session_->setup().rig.find(found.camera))
        return error("{}: expected detections of one of the rig's cameras, found {}.",
                     options_.session.string(), found.camera);
    if (event.contains("images")) {
      LIMN_TRY(input.images, frames_of(event.at("images")));
    }
    perception_->watch(frames, input);
    ++moments_;
    return {};
  }

  Result<std::vector<Frame>> frames_of(const Json& list) const {
    std::vector<Frame> frames;
    for (const Json& item : list) {
      const std::string file = item.at("file"), camera = item.at("camera");
      if (fs::path(file).is_absolute() || file.find("..") != std::string::npos ||
          !session_->setup().rig.find(camera))
        return error("{}: expected a frame of one of the rig's cameras inside the folder, found {} of {}.",
                     options_.session.string(), file, camera);
      LIMN_TRY(Frame frame, session::load_frame(options_.session / file));
      frame.camera = camera;
      frame.captured_at = stamp_of(item.at("captured_at_ns"));
      frames.push_back(std::move(frame));
    }
    return frames;
  }

  Status apply(const Json& event) {
    if (event.contains("watch")) unwatched_.push_back(&event);
    if (event.contains("scene")) return replace_scene(event.at("scene"));
    if (event.contains("rig")) return replace_rig(event.at("rig"));
    if (event.contains("deviation")) return show_deviation(event.at("deviation"));
    if (event.contains("edit")) return edit(event.at("edit"), event.at("source"));
    if (event.contains("eye")) replay_tablet(event.at("eye"));
    if (event.contains("dark")) session_->set_dark_projectors(event.at("dark"));
    return {};
  }

  Result<fs::path> inside(const std::string& folder) const {
    if (!folder.empty() && folder.find_first_of("/\\.") == std::string::npos)
      return options_.session / folder;
    return error("{}: expected a folder inside the recording, found '{}'.", options_.session.string(),
                 folder);
  }

  Status replace_rig(const std::string& folder) {
    LIMN_TRY(const fs::path path, inside(folder));
    LIMN_TRY(Rig rig, load_rig(path));
    LIMN_TRY_STATUS(session_->replace_rig(std::move(rig), session_->percepts().captured_at));
    const session::SessionSetup& setup = session_->setup();
    LIMN_TRY(*perception_, perception_->successor(setup.scene, setup.rig));
    return {};
  }

  Status show_deviation(const std::string& file) {
    LIMN_TRY(const fs::path path, inside(file));
    LIMN_TRY(const std::string bytes, read_file(path));
    auto layer = scene::deviation_layer_of(bytes);
    if (!layer) return error("{}: {}", path.string(), layer.message());
    session_->show_deviation(std::make_shared<const scene::DeviationLayer>(std::move(*layer)));
    return {};
  }

  Status replace_scene(const std::string& folder) {
    LIMN_TRY(const fs::path path, inside(folder));
    session::LoadedScene loaded;  // the session left out and kept the same variants
    LIMN_TRY(loaded.scene, scene::load_scene(path, &loaded.skipped_variants, scene::EmptySlots::kept));
    session::keep_old_variants(session_->setup().scene, &loaded);
    return session_->replace_scene(std::move(loaded.scene), session_->percepts().captured_at);
  }

  Status edit(const Json& json, const std::string& source) {
    const scene::Edit edit{json.at("action"), json.at("slot"), json.at("value")};
    return session_->edit(edit, source, session_->percepts().captured_at);
  }

  void replay_tablet(const Json& eye) {
    std::optional<Eigen::Vector3d> p_world;
    if (eye.contains("p_world")) {
      const Json& p = eye.at("p_world");
      p_world = {p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>()};
    }
    session_->note_tablet(eye.at("guest"), p_world, stamp_of(eye.at("at_ns")));
  }

  void wait_for(Stamp shown_at) {
    if (options_.step) {
      log_info("{:.3f} s; press enter for the next image", seconds_of(shown_at));
      std::string line;
      std::getline(std::cin, line);
      return;
    }
    if (options_.speed <= 0) return;
    const auto now = std::chrono::steady_clock::now();
    if (!begun_) begun_ = {now, shown_at};
    const double due_s = seconds_between(begun_->second, shown_at) / options_.speed;
    std::this_thread::sleep_until(begun_->first + std::chrono::duration<double>(due_s));
  }

  const ReplayOptions& options_;
  const std::vector<Json>& events_;
  session::Perception* perception_;
  session::Session* session_;
  std::size_t at_ = 0;                   // the next event
  std::deque<const Json*> unwatched_;    // moments whose frames are not perceived yet
  std::size_t moments_ = 0, asked_ = 0;  // moments perceived; moments needed by the next event
  PaintedBefore painted_;
  Stamp now_;
  std::optional<std::pair<std::chrono::steady_clock::time_point, Stamp>> begun_;
};

// Compares what is painted with the recording, and can show a screen in a window.
class Comparison final : public session::FrameSink {
 public:
  Comparison(const Recording* recording,
             const session::Session* session,
             std::optional<device::Window> window)
      : recording_(recording), session_(session), window_(std::move(window)) {}

  Status show(const session::ComposedFrame& painted, const std::vector<EyeImages>&) override {
    ++images_;
    const double at_s = seconds_of(painted.shown_at);
    if (session::pose_log(painted) != recording_->painted().poses && ++other_poses_ == 1) first_pose_ = at_s;
    const Json print = fmt::format("{:016x}", session::fingerprint(painted.eye_images()));
    if (print != recording_->painted().images && ++other_images_ == 1) first_image_ = at_s;
    return {};
  }

  std::vector<session::ScreenRequest> wanted_screens() const override {
    if (!window_) return {};
    return {{.what = session_->show_state().screen}};
  }
  void show_screens(std::span<const session::ScreenImages> screens) override {
    for (const session::ScreenImages& screen : screens)
      if (window_ && !screen.images.left.empty()) window_->show(screen.images.left);
    is_closed_ = window_ && !window_->is_open();
  }
  const std::atomic<bool>& is_closed() const { return is_closed_; }

  // Error: what differs from the recording.
  Status result(const fs::path& session) const {
    if (first_pose_)
      return error("{}: expected the recorded poses, found others in {} of {} images, first at {:.3f} s.",
                   session.string(), other_poses_, images_, *first_pose_);
    if (first_image_)
      return error(
          "{}: expected the recorded projector images, found others in {} of {}, first at {:.3f} s (poses "
          "are identical; another machine or driver draws a little differently).",
          session.string(), other_images_, images_, *first_image_);
    log_info("replay: {} images, poses and images are identical to the recorded ones", images_);
    return {};
  }

 private:
  const Recording* recording_;
  const session::Session* session_;
  std::optional<device::Window> window_;
  std::atomic<bool> is_closed_ = false;
  std::size_t images_ = 0, other_poses_ = 0, other_images_ = 0;
  std::optional<double> first_pose_, first_image_;
};

}  // namespace

Status run_replay(const ReplayOptions& options) {
  if (!(options.speed >= 0)) return usage_error("--speed: expected 0 or more, found {}.", options.speed);
  LIMN_TRY(session::SessionSetup setup, session::load_setup(options.session));
  setup.follows_pen = false;  // its strokes were recorded as edits
  LIMN_TRY(const Events events, load_events(options.session / "events.jsonl"));
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  LIMN_TRY(session::SessionOutput output, session::SessionOutput::open(options.out, {}, &setup));
  LIMN_TRY(session::Perception perception, session::Perception::create(setup.scene, setup.rig, setup.watch));
  LIMN_TRY(session::Session session, session::Session::create(setup, nullptr, nullptr, false));
  std::optional<device::Window> window;
  if (options.window) {
    LIMN_TRY(window, device::Window::open("Limn replay", 1280, 720));
  }
  Recording recording(options, events, &perception, &session);
  Comparison comparison(&recording, &session, std::move(window));
  session::DeviceHealth no_devices;
  session::FrameLoop loop({perception, session, output}, {recording, recording, comparison, no_devices});
  std::optional<Progress> progress(std::in_place, "replay", static_cast<int>(events.all.size()));
  const Status played = loop.run(comparison.is_closed(), [&] { progress->step(recording.passed()); });
  progress.reset();
  LIMN_TRY_STATUS(output.close(&session, options.json));
  LIMN_TRY_STATUS(comparison.result(options.session));
  LIMN_TRY_STATUS(played);
  if (events.damage) return error("{}; the events before it were replayed.", *events.damage);
  return {};
}

}  // namespace limn::apps
