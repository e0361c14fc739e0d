#include "session/frame_loop.h"

#include "core/log.h"
#include "core/stopwatch.h"

namespace limn::apps {

FrameLoop::FrameLoop(SessionParts parts, FrameSetting setting)
    : parts_(std::move(parts)),
      setting_(setting),
      recalibration_(&parts_.perception, &parts_.session, &parts_.output, setting.capture) {}

Status FrameLoop::run(const std::atomic<bool>& is_ended, const std::function<void()>& after_each) {
  while (!is_ended && !setting_.source.is_over()) {
    LIMN_TRY(const bool goes_on, step());
    if (after_each) after_each();
    if (!goes_on) break;
  }
  return {};
}

// The same order on devices, on the virtual rig and in a replay.
Result<bool> FrameLoop::step() {
  Session& session = parts_.session;

  // Recalibrate, where somebody asked for it. While it captures, the projectors' light is its own.
  recalibration_.step(setting_.clock);
  if (recalibration_.holds_light()) {
    hear_clients();
    note_devices();
    return tell_clients(nullptr, {});
  }

  // Perceive: markers, bodies and gestures in the cameras' newest frames.
  LIMN_TRY(Perceived perceived, setting_.source.perceive());
  if (perceived.watched) session.take(std::move(*perceived.watched), perceived.moments);

  // Edit: what a script, a recording, files and people change.
  LIMN_TRY_STATUS(setting_.source.edit(&session));
  hear_clients();
  LIMN_TRY(const std::optional<FrameTimes> times, setting_.clock.next_frame());
  if (!times) return true;

  // Predict, once: where every body is when this frame's light arrives. What was edited just now counts.
  const FrameInput input = session.predict(*times);

  // Compose and draw the projectors' images (Painter::compose).
  const ComposedFrame& painted = session.compose(input);

  // Overlay what clients want to be seen on the prototype alone.
  const std::vector<cv::Mat> light = with_overlays(painted, session.setup().rig, client_overlays());

  // Show: the projectors first, for people look there.
  LIMN_TRY_STATUS(setting_.sink.show(painted, light));
  const Stamp begun = now();
  const std::map<scene::Screen, cv::Mat> screens = screen_images();
  const double screen_ms = screens.empty() ? -1 : milliseconds_since(begun);
  setting_.sink.show_screens(screens);

  // Monitor: whether light lies where the rig says, and which devices work. No light waits for this.
  session.look_for_drift(times->now);
  note_devices();
  session.tell_unwritten(times->now);

  // Store.
  session.record_frame();
  ShownFrame shown = session.measured();
  shown.screen_ms = screen_ms;
  shown.missed = perceived.missed;
  if (shown.record_ms >= 0) shown.record_ms += perceived.record_ms;
  shown.placement_mm = setting_.sink.placement_mm(painted);
  const bool is_anything_seen = session.watched().captured_at != Stamp{};
  if (is_anything_seen) parts_.output.shown(shown, painted);

  // Tell people.
  const auto screen = screens.find(session.show_state().screen);
  return tell_clients(is_anything_seen ? &shown : nullptr,
                      screen == screens.end() ? cv::Mat() : screen->second);
}

void FrameLoop::hear_clients() {
  for (SessionClient* client : parts_.clients)
    client->hear({parts_.session, parts_.output.telemetry(), setting_.health, setting_.clock.now()});
}

// False: one of them has ended the session.
bool FrameLoop::tell_clients(const ShownFrame* shown, const cv::Mat& screen) {
  bool goes_on = true;
  for (SessionClient* client : parts_.clients) {
    client->tell(
        {parts_.session, parts_.output.telemetry(), setting_.health, setting_.clock.now(), shown, screen});
    goes_on &= !client->ends_session();
  }
  return goes_on;
}

std::vector<Overlay> FrameLoop::client_overlays() {
  std::vector<Overlay> out;
  for (SessionClient* client : parts_.clients)
    for (Overlay& overlay : client->overlays(&parts_.session)) out.push_back(std::move(overlay));
  return out;
}

// Each choice of what a screen shows is drawn once.
std::map<scene::Screen, cv::Mat> FrameLoop::screen_images() {
  std::set<scene::Screen> wanted = setting_.sink.wanted_screens();
  for (const SessionClient* client : parts_.clients)
    if (client->wants_screen()) wanted.insert(parts_.session.show_state().screen);
  std::map<scene::Screen, cv::Mat> out;
  for (const scene::Screen what : wanted) out[what] = parts_.session.screen(what);
  return out;
}

void FrameLoop::note_devices() {
  for (const std::string& what : setting_.health.news()) {
    parts_.output.telemetry().note(setting_.clock.now(), what);
    log_warning("live: {}", what);
  }
}

}  // namespace limn::apps
