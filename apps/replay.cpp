#include "apps/replay.h"

#include <chrono>
#include <deque>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "session/session_output.h"
#include "session/recording.h"
#include "session/session.h"
#include "session/perception.h"
#include "core/log.h"
#include "device/gl_context.h"
#include "device/window.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Stamp stamp_of(std::int64_t nanoseconds) { return Stamp{} + std::chrono::nanoseconds(nanoseconds); }

// Lines of events.jsonl, as far as they are whole.
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
          event.contains("scene") || event.contains("rig") || event.contains("eye"))) {
      events.damage =
          fmt::format("{}:{}: expected an event (watch, edit, eye, scene, rig, paint), found something else",
                      path.string(), events.all.size() + 1);
      break;
    }
    events.all.push_back(std::move(event));
  }
  return events;
}

class Replay {
 public:
  Replay(const ReplayOptions& options, Perception perception, Session session, SessionOutput output)
      : options_(options),
        perception_(std::move(perception)),
        session_(std::move(session)),
        output_(std::move(output)) {}

  Status play(const Events& events) {
    if (options_.window) {
      LIMN_TRY(window_, device::Window::open("Limn replay", 1280, 720));
    }
    Progress progress("replay", static_cast<int>(events.all.size()));
    int done = 0;
    for (const Json& event : events.all) {
      const Status played = play(event);
      if (!played) return played;
      progress.step(++done);
      if (window_ && !window_->is_open()) break;
    }
    return {};
  }

  // Error: what differs from the recording.
  Status close() {
    LIMN_TRY_STATUS(output_.close(&session_, options_.json));
    if (first_pose_)
      return error("{}: expected the recorded poses, found others in {} of {} pictures, first at {:.3f} s.",
                   options_.session.string(), other_poses_, images_, *first_pose_);
    if (first_image_)
      return error(
          "{}: expected the recorded projector pictures, found others in {} of {}, first at {:.3f} s "
          "(poses are identical; another machine or driver draws a little differently).",
          options_.session.string(), other_images_, images_, *first_image_);
    log_info("replay: {} pictures, poses and pictures identical to the recording's", images_);
    return {};
  }

 private:
  Status play(const Json& event) try {
    if (event.contains("watch")) {
      unwatched_.push_back(event.at("watch"));
      return {};
    }
    if (event.contains("scene")) return show(event.at("scene"));
    if (event.contains("rig")) {
      LIMN_TRY_STATUS(watch_until(event.at("moments")));
      return mend(event.at("rig"));
    }
    if (event.contains("edit")) {
      LIMN_TRY_STATUS(watch_until(event.value("moments", moments_)));
      return edit(event.at("edit"), event.at("source"));
    }
    if (event.contains("eye")) {
      see(event.at("eye"));
      return {};
    }
    return paint(event);
  } catch (const nlohmann::json::exception& problem) {
    return error("{}: expected whole events, found a damaged one ({}).",
                 (options_.session / "events.jsonl").string(), problem.what());
  }

  Status watch(const Json& list) {
    std::vector<Frame> frames;
    for (const Json& item : list) {
      const std::string file = item.at("file"), camera = item.at("camera");
      if (fs::path(file).is_absolute() || file.find("..") != std::string::npos ||
          !session_.setup().rig.find(camera))
        return error("{}: expected a frame of one of the rig's cameras inside the folder, found {} of {}.",
                     options_.session.string(), file, camera);
      LIMN_TRY(Frame frame, load_frame(options_.session / file));
      frame.camera = camera;
      frame.captured_at = stamp_of(item.at("captured_at_ns"));
      frames.push_back(std::move(frame));
    }
    perception_.watch(frames);
    ++moments_;
    return {};
  }

  // Frames that the image knew of; a thread of its own watched them, perhaps further than that.
  Status watch_until(std::size_t moments) {
    if (moments <= moments_) return {};
    while (moments_ < moments && !unwatched_.empty()) {
      LIMN_TRY_STATUS(watch(unwatched_.front()));
      unwatched_.pop_front();
    }
    Percepts watched = perception_.watched();
    watched.uses.clear();  // what came of them was recorded as edits
    session_.take(std::move(watched), moments_);
    return {};
  }

  Result<fs::path> inside(const std::string& folder) const {
    if (!folder.empty() && folder.find_first_of("/\\.") == std::string::npos)
      return options_.session / folder;
    return error("{}: expected a folder inside the recording, found '{}'.", options_.session.string(),
                 folder);
  }

  Status mend(const std::string& folder) {
    LIMN_TRY(const fs::path path, inside(folder));
    LIMN_TRY(Rig rig, load_rig(path));
    LIMN_TRY_STATUS(session_.mend(std::move(rig), session_.watched().captured_at));
    const SessionSetup& setup = session_.setup();
    LIMN_TRY(perception_, Perception::create(setup.scene, setup.rig, setup.watch));
    return {};
  }

  Status show(const std::string& folder) {
    LIMN_TRY(const fs::path path, inside(folder));
    std::vector<scene::SkippedVariant> skipped_variants;  // as the session left it out
    LIMN_TRY(scene::Scene scene, scene::load_scene(path, &skipped_variants));
    return session_.show(std::move(scene), session_.watched().captured_at);
  }

  Status edit(const Json& json, const std::string& source) {
    const scene::Edit edit{json.at("action"), json.at("slot"), json.at("value")};
    return session_.edit(edit, source, session_.watched().captured_at);
  }

  void see(const Json& eye) {
    std::optional<Eigen::Vector3d> p_world;
    if (eye.contains("p_world")) {
      const Json& p = eye.at("p_world");
      p_world = {p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>()};
    }
    session_.see(eye.at("guest"), p_world, stamp_of(eye.at("at_ns")));
  }

  Status paint(const Json& event) {
    const Stamp shown_at = stamp_of(event.at("paint").at("shown_at_ns"));
    LIMN_TRY_STATUS(watch_until(event.at("moments")));
    wait_for(shown_at);
    const Stamp painted_at = stamp_of(event.at("paint").at("painted_at_ns"));
    const ComposedFrame& painted = session_.paint(painted_at, shown_at);
    session_.look_for_drift(painted_at);
    ++images_;
    const double at_s = seconds_between(Stamp{}, shown_at);
    if (pose_log(painted) != event.at("paint") && ++other_poses_ == 1) first_pose_ = at_s;
    const std::string print = fmt::format("{:016x}", fingerprint(painted.projectors));
    if (print != event.at("pictures") && ++other_images_ == 1) first_image_ = at_s;
    if (window_)
      if (const cv::Mat screen = session_.screen(); !screen.empty()) window_->show(screen);
    output_.shown(session_.measured(), painted);
    return {};
  }

  void wait_for(Stamp shown_at) {
    if (options_.step) {
      fmt::print(stderr, "{:.3f} s; enter for the next picture\n", seconds_between(Stamp{}, shown_at));
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
  Perception perception_;
  Session session_;
  SessionOutput output_;
  std::optional<device::Window> window_;
  std::optional<std::pair<std::chrono::steady_clock::time_point, Stamp>> begun_;
  std::deque<Json> unwatched_;
  std::size_t moments_ = 0, images_ = 0, other_poses_ = 0, other_images_ = 0;
  std::optional<double> first_pose_, first_image_;
};

}  // namespace

Status run_replay(const ReplayOptions& options) {
  if (!(options.speed >= 0)) return usage_error("--speed: expected 0 or more, found {}.", options.speed);
  LIMN_TRY(SessionSetup setup, load_setup(options.session));
  LIMN_TRY(const Events events, load_events(options.session / "events.jsonl"));
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  LIMN_TRY(SessionOutput output, SessionOutput::open(options.out, {}, &setup));
  LIMN_TRY(Perception perception, Perception::create(setup.scene, setup.rig, setup.watch));
  LIMN_TRY(Session session, Session::create(setup, nullptr, nullptr, false));
  Replay replay(options, std::move(perception), std::move(session), std::move(output));
  const Status played = replay.play(events);
  LIMN_TRY_STATUS(replay.close());
  LIMN_TRY_STATUS(played);
  if (events.damage) return error("{}; what stands before it was replayed.", *events.damage);
  return {};
}

}  // namespace limn::apps
