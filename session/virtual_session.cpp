#include "session/virtual_session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <thread>

#include "core/log.h"
#include "core/names.h"
#include "core/scale_resolution.h"
#include "core/stopwatch.h"
#include "device/gl_context.h"
#include "session/frame_gate.h"
#include "session/scene_files_client.h"
#include "wizard/capture/virtual_backend.h"

namespace limn::session {
namespace {

// RMS distance (mm, on the prototype) of the parts' origins from their true positions when the light arrives;
// -1 when no part is shown.
double placement_mm(const ComposedFrame& composed,
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
  const double at_s = seconds_of(composed.shown_at);
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
  for (const scene::PosedPart& part : composed.posed.parts) {
    for (const scene::PosedPart& other : right.parts) {
      if (other.slot != part.slot) continue;
      const Eigen::Vector3d off = base(composed.posed) * part.world_from_part.translation -
                                  base(right) * other.world_from_part.translation;
      sum += off.squaredNorm();
      ++count;
    }
  }
  return count > 0 ? 1e3 * std::sqrt(sum / count) : -1;
}

class VirtualClock final : public FrameClock {
 public:
  explicit VirtualClock(const sim::VirtualRig* rig) : rig_(rig) {}
  Stamp now() const override { return rig_->now(); }
  Result<std::optional<FrameTimes>> next_frame() override {
    return std::optional(FrameTimes{rig_->now(), shifted(rig_->now(), k_virtual_display_s)});
  }

 private:
  const sim::VirtualRig* rig_;
};

// Makes the rig's clock follow the wall clock from the first call on.
class WallPace {
 public:
  // Returns how long the caller was busy since the last call; nullopt at the first call.
  std::optional<double> keep(sim::VirtualRig* rig) {
    using Seconds = std::chrono::duration<double>;
    const auto now = std::chrono::steady_clock::now();
    std::optional<double> busy_s;
    if (kept_at_) busy_s = Seconds(now - *kept_at_).count();
    if (!begun_) begun_ = Begin{now, rig->now()};
    const double ahead_s = seconds_between(begun_->clock, rig->now()) - Seconds(now - begun_->wall).count();
    if (ahead_s > 0)
      std::this_thread::sleep_for(Seconds(ahead_s));
    else
      rig->advance(-ahead_s);
    kept_at_ = std::chrono::steady_clock::now();
    return busy_s;
  }
  // The time until the next call does not count.
  void forget() { kept_at_.reset(); }

 private:
  struct Begin {
    std::chrono::steady_clock::time_point wall;
    Stamp clock;
  };
  std::optional<Begin> begun_;
  std::optional<std::chrono::steady_clock::time_point> kept_at_;
};

// The rig with the image sizes of `sizes`, which has the same devices.
Rig with_sizes(Rig rig, const Rig& sizes) {
  const auto resize = [](const std::vector<Imager>& from, std::vector<Imager>* to) {
    for (Imager& imager : *to) {
      const Imager* size = find_named(from, imager.name);
      const auto changed = size ? resized(imager, size->width, size->height) : std::nullopt;
      LIMN_CHECK(changed.has_value());
      imager = *changed;
    }
  };
  resize(sizes.cameras, &rig.cameras);
  resize(sizes.projectors, &rig.projectors);
  return rig;
}

// Keeps real time: follows the wall clock and chooses the effort.
class EffortControl {
 public:
  EffortControl(const RealTime& real_time, sim::VirtualRig* rig, const SessionParts& parts)
      : real_time_(real_time),
        control_(costs_of(real_time.efforts), real_time.frame_period_s, real_time.first),
        rig_(rig),
        parts_(parts) {
    rig_->set_trace_effort(effort().trace);
    report();
  }

  const Effort& effort() const { return real_time_.efforts[control_.chosen()]; }
  // To be called before each frame. True: the images have another size from now on.
  bool keep() {
    const auto busy_s = pace_.keep(rig_);
    if (const auto& edited = parts_.session.last_edit(); edited && edited->count != edits_) {
      edits_ = edited->count;
      control_.delay_rise();
    }
    if (parts_.session.show_state().frozen) control_.forget_frames();
    const Effort before = effort();
    if (is_ended_ || !busy_s || !control_.add_frame(*busy_s)) return false;
    const Status changed = apply(before);
    if (!changed) {
      is_ended_ = true;
      parts_.session.warn(rig_->now(), changed.message());
    }
    pace_.forget();  // the change itself is no frame
    report();
    return changed.ok() && before.resolution != effort().resolution;
  }
  void forget() {
    pace_.forget();
    control_.forget_frames();
  }

 private:
  static std::vector<double> costs_of(std::span<const Effort> efforts) {
    std::vector<double> costs;
    for (const Effort& effort : efforts) costs.push_back(guessed_cost(effort));
    return costs;
  }

  Status apply(const Effort& before) {
    rig_->set_trace_effort(effort().trace);
    if (effort().resolution == before.resolution) return {};
    Rig sized = real_time_.whole;
    LIMN_TRY_STATUS(scale_resolution(effort().resolution, &sized));
    Session& session = parts_.session;
    LIMN_TRY_STATUS(session.replace_rig(with_sizes(session.setup().rig, sized), rig_->now()));
    const SessionSetup& setup = session.setup();
    LIMN_TRY(parts_.perception, parts_.perception.successor(setup.scene, setup.rig));
    rig_->resize(with_sizes(rig_->world().rig, sized));
    return {};
  }

  void report() {
    const std::string what = sentence(effort());
    if (what == parts_.session.pace()) return;
    const std::string note = what.empty() ? "This machine keeps real time at the whole resolution." : what;
    parts_.session.set_pace(what);
    parts_.output.telemetry().note(rig_->now(), note);
    log_info("live: {}", note);
  }

  const RealTime& real_time_;
  PaceControl control_;
  WallPace pace_;
  sim::VirtualRig* rig_;
  SessionParts parts_;
  std::size_t edits_ = 0;  // the number of edits so far
  bool is_ended_ = false;  // after a change that failed
};

// Each perception uses the room's next exposure; edits come from the script.
class VirtualSource final : public FrameSource {
 public:
  VirtualSource(double end_s,
                EffortControl* control,
                sim::VirtualRig* rig,
                ScriptedRoom* room,
                Perception* perception,
                Recorder* recorder,
                PoseFeeds* feeds,
                DeviceHealth* health)
      : end_s_(end_s),
        control_(control),
        feeds_(feeds),
        rig_(rig),
        room_(room),
        perception_(perception),
        recorder_(recorder),
        health_(health) {
    for (const Imager& camera : rig->world().rig.cameras)
      cameras_.push_back(health->add({camera.name, "camera"}));
    make_gates();
  }

  bool is_over() const override { return !is_paused_ && seconds_of(rig_->next_exposure()) > end_s_; }

  Result<Perceived> perceive() override {
    if (control_ && control_->keep()) make_gates();
    exposed_at_ = rig_->next_exposure();
    room_->set(seconds_of(exposed_at_));
    const std::vector<Frame> frames = exposed();
    Perceived out;
    out.missed = static_cast<int>(rig_->world().rig.cameras.size() - frames.size());
    const FeedInput input = feeds_ ? feeds_->received(rig_->now(), control_ != nullptr) : FeedInput();
    if (frames.empty() && input.is_empty()) return out;
    const auto begun = std::chrono::steady_clock::now();
    if (recorder_) recorder_->record_frames(frames, input);
    out.record_ms = milliseconds_since(begun);
    out.percepts = perception_->watch(frames, input);
    out.moments = ++moments_;
    return out;
  }

  Status edit(Session* session) override {
    const std::vector<Script::Action>& edits = room_->script().edits;
    for (; edited_ < edits.size() && edits[edited_].at_s <= seconds_of(exposed_at_); ++edited_) {
      const Status done = session->edit(edits[edited_].edit, "script", exposed_at_);
      if (!done) log_warning("live: {:.2f} s: {}", seconds_of(exposed_at_), done.message());
    }
    return {};
  }

  // While it is paused the session is not over, whatever the time.
  void pause(bool is_paused) {
    is_paused_ = is_paused;
    if (control_) control_->forget();
  }

 private:
  void make_gates() {
    gates_.clear();
    const std::vector<Imager>& cameras = rig_->world().rig.cameras;
    for (std::size_t i = 0; i < cameras.size(); ++i)
      gates_.emplace_back(cameras[i].name, cv::Size(cameras[i].width, cameras[i].height), cameras_[i],
                          health_);
  }

  // The accepted frames of this moment.
  std::vector<Frame> exposed() {
    std::vector<int> plugged;
    const std::vector<Imager>& cameras = rig_->world().rig.cameras;
    for (std::size_t i = 0; i < cameras.size(); ++i)
      if (room_->script().is_plugged(cameras[i].name, seconds_of(exposed_at_)))
        plugged.push_back(static_cast<int>(i));
      else
        health_->fails(cameras_[i], "");
    std::vector<Frame> exposed = rig_->expose(plugged), taken;
    for (std::size_t k = 0; k < plugged.size(); ++k) {
      FrameGate& gate = gates_[static_cast<std::size_t>(plugged[k])];
      auto frame = gate.taken(room_->sent(std::move(exposed[k]), seconds_of(exposed_at_)), rig_->now());
      if (frame) taken.push_back(std::move(*frame));
    }
    return taken;
  }

  double end_s_;
  EffortControl* control_;  // null: no real time
  PoseFeeds* feeds_;        // null: none
  sim::VirtualRig* rig_;
  ScriptedRoom* room_;
  Perception* perception_;
  Recorder* recorder_;
  DeviceHealth* health_;
  std::vector<std::size_t> cameras_;  // in health_
  std::vector<FrameGate> gates_;      // one per entry of cameras_
  Stamp exposed_at_;
  std::size_t moments_ = 0, edited_ = 0;
  bool is_paused_ = false;
};

// The virtual projectors; the script may unplug some of them.
class VirtualSink final : public FrameSink {
 public:
  VirtualSink(sim::VirtualRig* rig,
              const ScriptedRoom* room,
              const Session* session,
              DeviceHealth* health,
              const EffortControl* control)
      : rig_(rig), room_(room), session_(session), health_(health), control_(control) {
    for (const Imager& projector : session->setup().rig.projectors)
      projectors_.push_back(health->add({projector.name, "projector"}));
  }

  // The virtual cameras expose what a projector shows to both eyes.
  Status show(const ComposedFrame& composed, const std::vector<EyeImages>& light) override {
    for (std::size_t i = 0; i < light.size(); ++i) {
      if (!is_there(i)) continue;
      LIMN_TRY(const Stamp shown_at, rig_->projector(static_cast<int>(i)).show(mean_light(light[i])));
      LIMN_CHECK(shown_at == composed.shown_at);
    }
    return {};
  }

  std::optional<std::vector<std::string>> dark_projectors() const override {
    std::vector<std::string> out;
    for (const Imager& projector : session_->setup().rig.projectors)
      if (!room_->script().is_plugged(projector.name, seconds_of(rig_->now()))) out.push_back(projector.name);
    return out;
  }

  double screen_interval_s() const override { return control_ ? control_->effort().screen_interval_s : 0; }

  double placement_mm(const ComposedFrame& composed) const override {
    return session::placement_mm(composed, *session_, *room_, rig_->world());
  }

 private:
  bool is_there(std::size_t projector) {
    const std::string& name = session_->setup().rig.projectors[projector].name;
    const bool is = room_->script().is_plugged(name, seconds_of(rig_->now()));
    is ? health_->works(projectors_[projector]) : health_->fails(projectors_[projector], "");
    return is;
  }

  sim::VirtualRig* rig_;
  const ScriptedRoom* room_;
  const Session* session_;
  DeviceHealth* health_;
  const EffortControl* control_;         // null: no real time
  std::vector<std::size_t> projectors_;  // in health_
};

// The clock runs while patterns are shown; the room does not change meanwhile. Without real time it stands
// still while the result is computed, so that a session comes out the same on every machine.
class VirtualCapture final : public CaptureDevices {
 public:
  VirtualCapture(sim::VirtualRig* rig, VirtualSource* source, bool is_real_time)
      : rig_(rig), source_(source), is_real_time_(is_real_time) {}

  wizard::WizardBackend backend(ImageWriter* writer) override {
    wizard::WizardBackend out = wizard::virtual_backend(no_board_, rig_, writer);
    for (std::size_t i = 0; i < rig_->world().rig.projectors.size(); ++i)
      out.use_latency(static_cast<int>(i), k_virtual_display_s);
    return out;
  }
  void pause_perception(Session*) override { source_->pause(true); }
  void resume_perception() override { source_->pause(false); }
  bool waits_for_result() const override { return !is_real_time_; }

 private:
  sim::VirtualRig* rig_;
  VirtualSource* source_;
  bool is_real_time_;
  const wizard::Plan no_board_{};
};

// Runs the loop; `each_frame` is called after every frame.
Status play(double end_s,
            const RealTime* real_time,
            const std::atomic<bool>& is_ended,
            sim::VirtualRig* rig,
            ScriptedRoom* room,
            const SessionParts& parts,
            const std::function<void()>& each_frame) {
  DeviceHealth health;
  VirtualClock clock(rig);
  std::optional<EffortControl> control;
  if (real_time) control.emplace(*real_time, rig, parts);
  EffortControl* const kept = control ? &*control : nullptr;
  VirtualSource source(end_s, kept, rig, room, &parts.perception, parts.output.recorder(), parts.feeds,
                       &health);
  VirtualSink sink(rig, room, &parts.session, &health, kept);
  VirtualCapture capture(rig, &source, real_time != nullptr);
  SceneFilesClient files(parts.session.setup().scene.folder);
  SessionParts with_own = parts;
  with_own.clients.insert(with_own.clients.begin(), &files);
  FrameLoop loop(std::move(with_own), {clock, source, sink, health, &capture});
  return loop.run(is_ended, each_frame);
}

}  // namespace

sim::VirtualRigOptions virtual_rig_options(double frame_period_s) {
  return {.display_delay_s = k_virtual_display_s,
          .camera_delay_s = k_virtual_camera_s,
          .frame_period_s = frame_period_s,
          .grab_waits_for_light = false,
          .follows_changes = true};
}

Status play_virtually(double end_s,
                      const RealTime* real_time,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      const SessionParts& parts) {
  std::optional<Progress> progress;
  if (std::isfinite(end_s)) progress.emplace("live", static_cast<int>(std::ceil(end_s)));
  return play(end_s, real_time, is_ended, rig, room, parts, [&] {
    if (progress) progress->step(static_cast<int>(seconds_of(rig->now())));
  });
}

Result<double> measure_frame_s(const sim::World& world, SessionSetup setup) {
  constexpr int k_frames = 3;  // that prepare everything, and as many that are measured
  constexpr double k_period_s = 1 / 30.0;
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  sim::VirtualRig rig(world, virtual_rig_options(k_period_s));
  LIMN_TRY(ScriptedRoom room, ScriptedRoom::create({}, &rig));
  LIMN_TRY(SessionOutput output, SessionOutput::open({}, {}, &setup));
  LIMN_TRY(Perception perception, Perception::create(setup.scene, setup.rig, setup.watch));
  LIMN_TRY(Session session, Session::create(setup, &output.telemetry(), nullptr, false));
  const SessionParts parts{perception, session, output, {}};
  const std::atomic<bool> is_ended = false;
  const auto play_until = [&](double end_s) {
    return play(end_s, nullptr, is_ended, &rig, &room, parts, [] {});
  };
  LIMN_TRY_STATUS(play_until(k_frames * k_period_s));
  const Stamp from = rig.now();
  const auto begun = std::chrono::steady_clock::now();
  LIMN_TRY_STATUS(play_until(seconds_of(from) + k_frames * k_period_s));
  const double frames = std::max(1.0, std::round(seconds_between(from, rig.now()) / k_period_s));
  return 1e-3 * milliseconds_since(begun) / frames;
}

}  // namespace limn::session
