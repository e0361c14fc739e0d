#include "session/frame_loop.h"

#include <algorithm>

#include "core/log.h"
#include "core/stopwatch.h"

namespace limn::session {

FrameLoop::FrameLoop(SessionParts parts, FrameSetting setting)
    : parts_(std::move(parts)),
      setting_(setting),
      captures_(&parts_.perception, &parts_.session, &parts_.output, setting.capture) {}

Status FrameLoop::run(const std::atomic<bool>& is_ended, const std::function<void()>& after_each) {
  while (!is_ended && !setting_.source.is_over()) {
    LIMN_TRY(const bool goes_on, step());
    if (after_each) after_each();
    if (!goes_on) break;
  }
  return {};
}

// The order is the same on devices, on the virtual rig and in a replay.
Result<bool> FrameLoop::step() {
  Session& session = parts_.session;

  // Capture, if somebody has asked for a repair or a scan. No frames are composed while it uses the
  // projectors.
  captures_.step(setting_.clock);
  if (captures_.holds_light()) {
    apply_client_edits();
    note_devices();
    return publish_to_clients(nullptr, {});
  }

  // Perceive: markers, bodies and gestures in the cameras' newest frames.
  LIMN_TRY(Perceived perceived, setting_.source.perceive());
  if (perceived.percepts) session.update_percepts(std::move(*perceived.percepts), perceived.moments);

  // Edit: changes by a script, a recording, files and people.
  LIMN_TRY_STATUS(setting_.source.edit(&session));
  apply_client_edits();
  LIMN_TRY(std::optional<FrameTimes> times, setting_.clock.next_frame());
  if (!times) return true;
  for (const SessionClient* client : parts_.clients) times->shown_at = client->light_at(times->shown_at);

  if (auto dark = setting_.sink.dark_projectors()) session.set_dark_projectors(std::move(*dark));

  // Predict, once: where every body is when this frame's light arrives. Edits of this frame already count.
  const FrameInput input = session.predict(*times);

  // Compose and draw the projectors' images (FrameComposer::compose).
  const ComposedFrame& composed = session.compose(input, [&](const FrameDescription& frame) {
    for (SessionClient* client : parts_.clients) client->note_description(frame);
  });

  // Add the clients' overlays to the projected light only.
  const std::vector<EyeImages> light = with_overlays(composed, session.setup().rig, client_overlays());

  // Show: the projectors first, because people look at them.
  LIMN_TRY_STATUS(setting_.sink.show(composed, light));
  const Stamp begun = now();
  const std::vector<ScreenImages> screens = screen_images();
  const double screen_ms = screens.empty() ? -1 : milliseconds_since(begun);
  setting_.sink.show_screens(screens);

  // Monitor: has a device moved, which devices work? This comes after the frame is shown and does not delay
  // it.
  session.check_drift(times->now);
  note_devices();
  session.report_unwritten(times->now);

  // Store.
  session.record_frame();
  ShownFrame shown = session.measured();
  shown.screen_ms = screen_ms;
  shown.missed = perceived.missed;
  if (shown.record_ms >= 0) shown.record_ms += perceived.record_ms;
  shown.placement_mm = setting_.sink.placement_mm(composed);
  const bool is_anything_seen = session.percepts().captured_at != Stamp{};
  if (is_anything_seen) parts_.output.add_frame(shown, composed);

  // Update the clients.
  const ScreenRequest for_clients{.what = session.show_state().screen};
  const auto screen = std::ranges::find(screens, for_clients, &ScreenImages::request);
  return publish_to_clients(is_anything_seen ? &shown : nullptr,
                            screen == screens.end() ? cv::Mat() : screen->images.left);
}

void FrameLoop::apply_client_edits() {
  for (SessionClient* client : parts_.clients)
    client->apply_edits({parts_.session, parts_.output.telemetry(), setting_.health, setting_.clock.now()});
}

// False: a client has ended the session.
bool FrameLoop::publish_to_clients(const ShownFrame* shown, const cv::Mat& screen) {
  bool goes_on = true;
  for (SessionClient* client : parts_.clients) {
    client->publish_state(
        {parts_.session, parts_.output.telemetry(), setting_.health, setting_.clock.now(), shown, screen});
    goes_on &= !client->ends_session();
  }
  return goes_on;
}

std::vector<projector::Overlay> FrameLoop::client_overlays() {
  std::vector<projector::Overlay> out;
  for (SessionClient* client : parts_.clients)
    for (projector::Overlay& overlay : client->overlays(&parts_.session)) out.push_back(std::move(overlay));
  return out;
}

// Draws each kind of screen image once, and only those that somebody looks at.
std::vector<ScreenImages> FrameLoop::screen_images() {
  std::vector<ScreenRequest> wanted = setting_.sink.wanted_screens();
  const bool is_wanted = std::ranges::any_of(parts_.clients, &SessionClient::wants_screen);
  const Stamp at = now();
  if (is_wanted &&
      (!client_screen_at_ || seconds_between(*client_screen_at_, at) >= setting_.sink.screen_interval_s())) {
    wanted.push_back({.what = parts_.session.show_state().screen});
    client_screen_at_ = at;
  }
  std::vector<ScreenImages> out;
  for (const ScreenRequest& request : wanted) {
    if (std::ranges::find(out, request, &ScreenImages::request) == out.end())
      out.push_back({request, parts_.session.screen(request)});
  }
  return out;
}

void FrameLoop::note_devices() {
  for (const std::string& what : setting_.health.take_messages()) {
    parts_.output.telemetry().note(setting_.clock.now(), what);
    log_warning("live: {}", what);
  }
}

}  // namespace limn::session
