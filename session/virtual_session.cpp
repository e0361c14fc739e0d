#include "session/virtual_session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "session/session_output.h"
#include "session/frame_gate.h"
#include "session/device_health.h"
#include "session/live_recalibration.h"
#include "session/scene_watch.h"
#include "core/stopwatch.h"
#include "wizard/capture/virtual_backend.h"
#include "core/log.h"

namespace limn::apps {
namespace {

constexpr auto k_errand_wait = std::chrono::milliseconds(10);  // for what a repair wants

double seconds_of(Stamp at) { return seconds_between(Stamp{}, at); }

// RMS distance of the parts' origins from where they truly are when the light arrives, on the prototype; -1
// when none is shown.
double placement_mm(const ComposedFrame& painted,
                    const Session& session,
                    const ScriptedRoom& room,
                    const sim::World& world) {
  std::vector<Track> truth;
  const auto add = [&](const std::string& body, const Pose& world_from_body) {
    truth.emplace_back();
    truth.back().body = body;
    truth.back().world_from_body = world_from_body;
  };
  const scene::Scene& scene = session.setup().scene;
  if (scene.prototype) add("prototype", world.world_from_prototype);
  const double at_s = seconds_of(painted.shown_at);
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const MarkerName& marker = scene::slot_marker(scene, session.show_state(), i);
    if (sim::world_from_marker(world, marker)) add(scene.slots[i].name, room.world_from_marker(marker, at_s));
  }
  const scene::PosedScene right = scene::compose_scene(scene, session.show_state(), truth);
  const auto base = [](const scene::PosedScene& posed) {
    return posed.world_from_prototype ? posed.world_from_prototype->inverse() : Pose{};
  };
  double sum = 0;
  int count = 0;
  for (const scene::PosedPart& part : painted.posed.parts) {
    for (const scene::PosedPart& other : right.parts) {
      if (other.slot != part.slot) continue;
      const Eigen::Vector3d off = base(painted.posed) * part.world_from_part.translation -
                                  base(right) * other.world_from_part.translation;
      sum += off.squaredNorm();
      ++count;
    }
  }
  return count > 0 ? 1e3 * std::sqrt(sum / count) : -1;
}

class VirtualLoop {
 public:
  VirtualLoop(const std::atomic<bool>& is_ended,
              sim::VirtualRig* rig,
              ScriptedRoom* room,
              Perception* perception,
              Session* session,
              SessionOutput* output,
              OperatorConsole* console,
              OscPort* osc,
              RemoteLink* remote)
      : is_ended_(is_ended),
        rig_(rig),
        room_(room),
        perception_(perception),
        session_(session),
        output_(output),
        console_(console),
        osc_(osc),
        remote_(remote),
        files_(session->setup().scene.folder) {
    for (const Imager& camera : rig->world().rig.cameras) {
      cameras_.push_back(health_.add({camera.name, "camera"}));
      gates_.emplace_back(camera.name, cv::Size(camera.width, camera.height), cameras_.back(), &health_);
    }
    for (const Imager& projector : session->setup().rig.projectors)
      projectors_.push_back(health_.add({projector.name, "projector"}));
  }

  // False: the operator ends the session.
  Result<bool> step() {
    const Stamp exposed_at = rig_->next_exposure();
    room_->set(seconds_of(exposed_at));
    const std::vector<Frame> frames = exposed(exposed_at);
    double frames_ms = 0;  // to hand over to the recording
    if (!frames.empty()) {
      const auto begun = std::chrono::steady_clock::now();
      if (output_->recorder()) output_->recorder()->watched(frames);
      frames_ms = milliseconds_since(begun);
      session_->take(perception_->watch(frames), ++moments_);
    }
    play_edits(exposed_at);
    session_->show_news(&files_, rig_->now());
    if (osc_) osc_->hear(session_, &output_->telemetry(), rig_->now());
    if (remote_) serve();
    if (session_->take_recalibration_request()) {
      LIMN_TRY(const bool should_continue, mend());
      if (!should_continue) return false;
    }
    const ComposedFrame& painted = session_->paint(rig_->now(), shifted(rig_->now(), k_virtual_display_s));
    for (std::size_t i = 0; i < painted.projectors.size(); ++i) {
      if (!is_there(session_->setup().rig.projectors[i].name, projectors_[i], rig_->now())) continue;
      LIMN_TRY(const Stamp shown_at, rig_->projector(static_cast<int>(i)).show(lit(painted, i)));
      LIMN_CHECK(shown_at == painted.shown_at);
    }
    session_->look_for_drift(rig_->now());
    if (osc_) osc_->tell(*session_, rig_->now());
    if (remote_) serve();  // what came while it painted need not wait for the next exposure
    ShownFrame shown = session_->measured();
    if (shown.record_ms >= 0) shown.record_ms += frames_ms;
    shown.missed = static_cast<int>(rig_->world().rig.cameras.size() - frames.size());
    shown.placement_mm = placement_mm(painted, *session_, *room_, rig_->world());
    const auto begun = std::chrono::steady_clock::now();
    const bool wants_screen = console_ && console_->is_due();
    const cv::Mat screen = wants_screen ? session_->screen() : cv::Mat();
    shown.screen_ms = wants_screen ? milliseconds_since(begun) : -1;
    output_->shown(shown, painted);
    if (!console_) return true;
    console_->shown(shown);
    return console_->serve(session_, &output_->telemetry(), health_, screen, rig_->now());
  }

 private:
  // The clock goes on while patterns are shown and stands while the rest is computed; the room stays as it
  // is. People are answered. False: somebody ends the session.
  Result<bool> mend() {
    LIMN_TRY(const std::filesystem::path folder, recalibration_folder(output_->out()));
    const Plan no_board{};
    LiveRecalibration repair(session_->setup().rig, folder, [&](ImageWriter* writer) {
      Surroundings around = virtual_backend(no_board, rig_, writer);
      for (std::size_t i = 0; i < projectors_.size(); ++i)
        around.use_latency(static_cast<int>(i), k_virtual_display_s);
      return around;
    });
    for (;;) {
      repair.serve(k_errand_wait);
      session_->set_recalibration_progress(repair.words());
      if (osc_) osc_->hear(session_, &output_->telemetry(), rig_->now());
      if (remote_) serve();
      const bool is_left = console_ && !console_->serve(session_, &output_->telemetry(), health_, {}, rig_->now());
      if (is_left || is_ended_) return false;
      if (const auto checked = repair.take()) {
        apply_recalibration(*checked, folder, rig_->now(), perception_, session_);
        return true;
      }
    }
  }

  void serve() {
    remote_->apply_requests(session_, rig_->now());
    remote_->publish_state(*session_, output_->telemetry(), health_, rig_->now());
  }

  cv::Mat lit(const ComposedFrame& painted, std::size_t projector) {
    return remote_ ? remote_->projector_image(session_, projector) : painted.projectors[projector];
  }

  // What is taken of this moment's images.
  std::vector<Frame> exposed(Stamp at) {
    std::vector<int> plugged;
    const std::vector<Imager>& cameras = rig_->world().rig.cameras;
    for (std::size_t i = 0; i < cameras.size(); ++i)
      if (room_->script().is_plugged(cameras[i].name, seconds_of(at)))
        plugged.push_back(static_cast<int>(i));
      else
        health_.fails(cameras_[i], "");
    std::vector<Frame> exposed = rig_->expose(plugged), taken;
    for (std::size_t k = 0; k < plugged.size(); ++k) {
      FrameGate& gate = gates_[static_cast<std::size_t>(plugged[k])];
      auto frame = gate.taken(room_->sent(std::move(exposed[k]), seconds_of(at)), rig_->now());
      if (frame) taken.push_back(std::move(*frame));
    }
    tell_of_devices(at);
    return taken;
  }

  bool is_there(const std::string& projector, std::size_t number, Stamp at) {
    const bool is = room_->script().is_plugged(projector, seconds_of(at));
    is ? health_.works(number) : health_.fails(number, "");
    tell_of_devices(at);
    return is;
  }

  // Of those that came or went, or whose clocks stepped.
  void tell_of_devices(Stamp at) {
    for (const std::string& what : health_.news()) {
      output_->telemetry().note(at, what);
      log_warning("live: {:.2f} s: {}", seconds_of(at), what);
    }
  }

  void play_edits(Stamp at) {
    const std::vector<Script::Action>& edits = room_->script().edits;
    for (; played_ < edits.size() && edits[played_].at_s <= seconds_of(at); ++played_) {
      const Status done = session_->edit(edits[played_].edit, "script", at);
      if (!done) log_warning("live: {:.2f} s: {}", seconds_of(at), done.message());
    }
  }

  const std::atomic<bool>& is_ended_;
  sim::VirtualRig* rig_;
  ScriptedRoom* room_;
  Perception* perception_;
  Session* session_;
  SessionOutput* output_;
  OperatorConsole* console_;
  OscPort* osc_;
  RemoteLink* remote_;
  SceneWatch files_;
  DeviceHealth health_;
  std::vector<std::size_t> cameras_, projectors_;  // as health_ calls them
  std::vector<FrameGate> gates_;              // of cameras_
  std::size_t moments_ = 0, played_ = 0;
};

}  // namespace

Status play_virtually(double end_s,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      Perception* perception,
                      Session* session,
                      SessionOutput* output,
                      OperatorConsole* console,
                      OscPort* osc,
                      RemoteLink* remote) {
  VirtualLoop loop(is_ended, rig, room, perception, session, output, console, osc, remote);
  std::optional<Progress> progress;
  if (std::isfinite(end_s)) progress.emplace("live", static_cast<int>(std::ceil(end_s)));
  while (!is_ended && seconds_of(rig->next_exposure()) <= end_s) {
    LIMN_TRY(const bool should_continue, loop.step());
    if (progress) progress->step(static_cast<int>(seconds_of(rig->now())));
    if (!should_continue) break;
  }
  return {};
}

}  // namespace limn::apps
