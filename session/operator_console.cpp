#include "session/operator_console.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/log.h"
#include "core/names.h"
#include "device/gui/qr_code.h"
#include "tracker/camera_encoding.h"

namespace limn::session {
namespace {

constexpr int k_window_width = 1600, k_window_height = 1000;
constexpr int k_escape = 256;  // GLFW's code
constexpr std::size_t k_recent = 600, k_notices = 100;
// Side of a QR code's module: its edges stay sharp when the code is drawn smaller.
constexpr double k_module_px = 12;
constexpr double k_pace_s = 1;  // time over which image rates are measured

std::string list_of(const std::vector<BodyMarker>& markers) {
  std::vector<std::string> texts;
  for (const BodyMarker& marker : markers) texts.push_back(marker.marker.text());
  return joined_names(texts, "");
}

std::vector<OperatorView::Image> cameras_of(const Session& session) {
  std::vector<OperatorView::Image> out;
  const Percepts& percepts = session.percepts();
  const std::vector<Imager>& cameras = session.setup().rig.cameras;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    out.push_back({.name = cameras[i].name, .image = {}});
    out.back().is_linear = tracker::encoding_of(session.setup().rig, cameras[i]) == tracker::Encoding::linear;
    if (i >= percepts.frames.size()) continue;
    out.back().image = percepts.frames[i].image;
    for (const tracker::Detection& detection : percepts.detections[i])
      out.back().found.push_back({detection.marker.id, detection.corners_px});
  }
  return out;
}

std::vector<OperatorView::Body> bodies_of(const Session& session) {
  std::vector<OperatorView::Body> out;
  for (const Body& body : scene::bodies(session.setup().scene))
    out.push_back({body.name, list_of(body.markers), std::nullopt});
  for (const Constellation& balls : scene::constellations(session.setup().scene))
    out.push_back({balls.name, fmt::format("{} balls", balls.p_balls.size()), std::nullopt});
  for (OperatorView::Body& body : out)
    for (const Track& track : session.composed().tracks)
      if (track.body == body.name) body.track = track;
  return out;
}

std::vector<OperatorView::Slot> slots_of(const Session& session, const std::string& chosen) {
  std::vector<OperatorView::Slot> out;
  const std::vector<scene::Slot>& slots = session.setup().scene.slots;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const scene::ShowState::Slot& staged = session.show_state().slots[i];
    out.push_back({slots[i].name, {}, slots[i].name == chosen, staged.pin || !staged.nudge.isZero()});
    for (const scene::Variant& variant : slots[i].variants) out.back().variants.push_back(variant.name);
  }
  return out;
}

}  // namespace

OperatorView::Remote remote_view(const Invitation& invitation) {
  OperatorView::Remote out{invitation.url, invitation.fingerprint, invitation.authority_fingerprint, {}};
  for (const scene::Role role : {scene::Role::look, scene::Role::work, scene::Role::operate}) {
    cv::Mat code = gui::qr_code(invitation.url_for(role));
    if (!code.empty()) cv::resize(code, code, {}, k_module_px, k_module_px, cv::INTER_NEAREST);
    out.entrances.push_back({role, invitation.pins[static_cast<std::size_t>(role)], std::move(code)});
  }
  return out;
}

Result<OperatorConsole> OperatorConsole::open(const device::Desktop& desktop, const scene::Scene& scene) {
  LIMN_TRY(gui::GuiWindow window, gui::GuiWindow::open(desktop, "Limn", k_window_width, k_window_height));
  return OperatorConsole(std::move(window), scene);
}

void OperatorConsole::invite(RemoteLink* remote) {
  remote_link_ = remote;
  remote_ = remote_view(remote->invitation());
}

void OperatorConsole::count_frame(const ShownFrame& frame) {
  recent_.push_back(frame);
  if (recent_.size() > k_recent) recent_.pop_front();
  if (frame.screen_ms >= 0) screen_s_ = 1e-3 * frame.screen_ms;
}

void OperatorConsole::publish_state(const SessionMoment& moment) {
  if (moment.shown) count_frame(*moment.shown);
  ends_session_ = !serve(&moment.session, &moment.telemetry, moment.health, moment.screen, moment.at);
}

bool OperatorConsole::serve(
    Session* session, Telemetry* telemetry, const DeviceHealth& health, const cv::Mat& screen, Stamp now) {
  if (!begun_at_) begun_at_ = paced_at_ = now;
  if (!screen.empty()) screen_ = screen;
  const auto edit = [&](const scene::Edit& what, const char* source) {
    const Status done = session->edit(what, source, now);
    if (done) return;
    telemetry->note(now, done.message());
    log_warning("live: {}", done.message());
  };
  for (const int key : window_.pressed_keys()) {
    if (key == k_escape) panel_.ask_to_end();
    if (const auto wanted = keys_.edit_of(key)) edit(*wanted, "key");
  }
  if (!is_due()) return window_.is_wanted();
  const OperatorView view = view_of(*session, *telemetry, health, now);
  OperatorAsked asked;
  window_.draw([&](gui::Gui& gui) { asked = panel_.draw(gui, view); });
  for (const scene::Edit& wanted : asked.edits) edit(wanted, "operator");
  if (asked.code && remote_link_) remote_link_->show_code(asked.code->projector, asked.code->role);
  return !asked.ends && window_.is_wanted();
}

OperatorView OperatorConsole::view_of(const Session& session,
                                      const Telemetry& telemetry,
                                      const DeviceHealth& health,
                                      Stamp now) {
  OperatorView view;
  view.at_s = seconds_between(*begun_at_, now);
  view.cameras = cameras_of(session);
  const std::vector<Imager>& projectors = session.setup().rig.projectors;
  for (std::size_t i = 0; i < projectors.size(); ++i)
    view.projectors.push_back({.name = projectors[i].name, .image = session.composed().projectors[i]});
  view.screen = {.name = "screen", .image = screen_};
  view.devices = devices_of(health, now);
  view.bodies = bodies_of(session);
  view.slots = slots_of(session, keys_.slot());
  view.show_state = session.show_state();
  for (const LooseMarker& loose :
       waiting_markers(session.setup().scene, session.show_state(), session.percepts()))
    view.waiting.push_back(loose.marker.text());
  view.remote = remote_;
  if (view.remote) view.remote->projector = remote_link_->code_projector();
  if (view.remote) view.remote->glasses = remote_link_->glasses();
  view.windows = {session.windows().begin(), session.windows().end()};
  view.follows = session.composed().follows;
  if (const auto& drift = session.drift())
    for (const std::string& device : drift->devices)
      view.moved += (view.moved.empty() ? "" : " or ") + device;
  view.recalibration_progress = session.recalibration().progress;
  view.has_prototype = session.setup().scene.prototype.has_value();
  view.deviation_progress = session.deviation().progress;
  view.recent = {recent_.begin(), recent_.end()};
  const auto& notes = telemetry.notes();
  const double begun_s = seconds_of(*begun_at_);
  for (std::size_t i = notes.size() > k_notices ? notes.size() - k_notices : 0; i < notes.size(); ++i)
    view.notices.push_back({notes[i].first - begun_s, notes[i].second});
  return view;
}

std::vector<OperatorView::Device> OperatorConsole::devices_of(const DeviceHealth& health, Stamp now) {
  const double seconds = seconds_between(paced_at_, now);
  const bool is_over = seconds >= k_pace_s;
  std::vector<OperatorView::Device> out;
  for (const DeviceState& state : health.all()) {
    Pace& pace = paces_[state.name];
    if (is_over) pace = {state.images, static_cast<double>(state.images - pace.images) / seconds};
    out.push_back({state, pace.per_second});
  }
  if (is_over) paced_at_ = now;
  return out;
}

}  // namespace limn::session
