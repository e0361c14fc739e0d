#include "session/session.h"

#include <algorithm>
#include <chrono>

#include "core/log.h"
#include "core/stopwatch.h"
#include "scene/part_units.h"
#include "session/scene_change.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

// A turn backwards triggers the opposite of the control's action, if there is one.
scene::Edit edit_of(const scene::Control& control, int steps) {
  const scene::ActionId backwards = scene::action_of(control.action).opposite.value_or(control.action);
  return scene::make_edit(steps > 0 ? control.action : backwards, control.slot, control.value);
}

}  // namespace

Result<Session> Session::create(const SessionSetup& setup,
                                Telemetry* telemetry,
                                Recorder* recorder,
                                bool keeps_looks) {
  for (const scene::Control& control : setup.scene.controls) {
    const scene::Action& action = scene::action_of(control.action);
    if (action.of_slot && control.slot.empty())
      return error("scene.json: controls: {}: expected a slot for {}, found none.", control.marker.text(),
                   action.name);
  }
  LIMN_TRY(FrameComposer composer, FrameComposer::create(setup.scene, setup.rig, setup.paint));
  Session out(setup, std::move(composer), telemetry, recorder, keeps_looks);
  out.show_state_ = ShowStore::loaded(out.setup_.scene, std::move(out.show_state_));
  out.ask_units();
  return out;
}

Session::Session(
    SessionSetup setup, FrameComposer composer, Telemetry* telemetry, Recorder* recorder, bool keeps_looks)
    : setup_(std::move(setup)),
      composer_(std::move(composer)),
      store_(keeps_looks),
      telemetry_(telemetry),
      recorder_(recorder),
      show_state_(scene::initial_show_state(setup_.scene)) {
  for (const std::string& name : setup_.screens) show_state_.screens.push_back({name});
  if (setup_.rig.cameras.empty()) return;
  const Eigen::Quaterniond world_from_camera = setup_.rig.cameras[0].imager_from_world.rotation.inverse();
  show_state_.d_up_world = world_from_camera * -Eigen::Vector3d::UnitY();
  show_state_.d_front_world = world_from_camera * -Eigen::Vector3d::UnitZ();
}

// Asks for the units of parts that were added without one, once for each question.
void Session::ask_units() {
  for (const scene::Slot& slot : setup_.scene.slots)
    for (const scene::Variant& variant : slot.variants) {
      const std::string question = scene::units_question(slot, variant);
      if (!question.empty() && telemetry_ && asked_.insert(question).second)
        telemetry_->note(percepts_.captured_at, question);
    }
}

void Session::update_percepts(Percepts percepts, std::size_t moments) {
  percepts_ = std::move(percepts);
  moments_ = moments;
  prediction_ = predicted_at_capture(percepts_, setup_.paint);
  const auto tracks = scene::assign_tracks(setup_.scene, show_state_, prediction_.at_capture);
  show_state_ = scene::without_moved_pins(setup_.scene, show_state_, tracks);
  show_state_ = scene::with_section_seen(setup_.scene, std::move(show_state_), tracks);
  section_rest_.note(tracks);
  draw_with_pen(tracks);
  for (const ControlUse& use : percepts_.uses) {
    const scene::Control& control = setup_.scene.controls[use.control];
    const auto& section = setup_.scene.section;
    if (section && control.marker == section->marker && !section_rest_.has_rested()) continue;  // taken away
    const Status done = edit(edit_of(control, use.steps), control.marker.text(), percepts_.captured_at);
    if (!done) log_warning("live: {}: {}", control.marker.text(), done.message());
  }
  percepts_.uses.clear();
  for (const std::string& note : percepts_.feed_notes) warn(percepts_.captured_at, note);
  percepts_.feed_notes.clear();
  const auto swapped =
      swapped_.check(setup_.rig, scene::bodies(setup_.scene), percepts_.detections, percepts_.captured_at);
  if (swapped) warn(percepts_.captured_at, *swapped);
}

// The pen draws as a tablet does, by edits.
void Session::draw_with_pen(std::span<const Track> tracks) {
  if (!setup_.scene.pen || !setup_.follows_pen) return;
  const PenStroke::Addition addition = pen_.note(setup_.scene, tracks, percepts_.captured_at);
  if (addition.points.empty()) return;
  if (addition.begins) {
    pen_line_.clear();
    is_pen_refused_ = false;
  }
  if (is_pen_refused_) return;
  std::string value = "points";
  for (const Eigen::Vector3d& p : addition.points)
    value += fmt::format(" {:.4f} {:.4f} {:.4f}", 1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z());
  const Status done =
      edit(scene::make_edit(scene::ActionId::draw_line, pen_line_, value), "pen", percepts_.captured_at);
  if (!done) {
    is_pen_refused_ = true;  // until the next stroke
    return warn(percepts_.captured_at, done.message());
  }
  if (pen_line_.empty()) pen_line_ = show_state_.drawn.back().name;
}

void Session::warn(Stamp at, const std::string& what) {
  if (telemetry_) telemetry_->note(at, what);
  log_warning("live: {}", what);
}

Status Session::edit(const scene::Edit& wanted, const std::string& source, Stamp at) {
  scene::Edit edit = wanted;
  LIMN_TRY(scene::Command command, scene::command_of(setup_.scene, edit));
  if (auto* marker = std::get_if<std::optional<MarkerName>>(&command.value); marker && !*marker)
    if (const auto waiting = waiting_markers(setup_.scene, show_state_, percepts_); !waiting.empty()) {
      *marker = waiting.back().marker;  // this name is also what is recorded
      edit.value = (*marker)->text();
    }
  LIMN_TRY(scene::ShowState changed, scene::apply_edit(setup_.scene, show_state_, composed().posed, command));
  std::swap(show_state_, changed);
  last_edit_ = Edited{edit, source, last_edit_ ? last_edit_->count + 1 : 1};
  if (recorder_) recorder_->record_edit(edit, source, moments_);
  if (command.action == scene::ActionId::repair) recalibration_.is_requested = true;
  if (const auto* request = std::get_if<scene::DeviationRequest>(&command.value)) request_deviation(*request);
  if (telemetry_)
    telemetry_->note(at, fmt::format("{}{}{}{}{} ({})", edit.action, edit.slot.empty() ? "" : " ", edit.slot,
                                     edit.value.empty() ? "" : " ", edit.value, source));
  store_.keep(setup_.scene, changed, show_state_, command, [this] { return screen(scene::Screen::view); });
  return {};
}

// `show_state_` is the one after the request.
void Session::request_deviation(const scene::DeviationRequest& request) {
  using enum scene::DeviationRequest::What;
  const bool has_result = show_state_.deviation.layer != nullptr;
  if (request.what == scan || (request.what == toggle && !has_result)) deviation_.is_scan_requested = true;
  if (request.what == report) deviation_.is_report_requested = true;
  if (request.what == fit_box || request.what == fit_all || request.what == tolerance)
    deviation_.is_comparison_requested |= has_result;
}

// Its values belong to another mesh.
void Session::forget_deviation() {
  show_state_.deviation.layer.reset();
  show_state_.deviation.is_shown = show_state_.deviation.is_held = false;
  deviation_.result.reset();
  deviation_.text.clear();
}

void Session::show_deviation(std::shared_ptr<const scene::DeviationLayer> layer) {
  if (recorder_) recorder_->record_deviation(*layer, moments_);
  show_state_.deviation.layer = std::move(layer);
  show_state_.deviation.is_shown = true;
}

void Session::note_tablet(const std::string& guest,
                          const std::optional<Eigen::Vector3d>& p_eye_world,
                          Stamp at) {
  if (p_eye_world && !p_eye_world->allFinite()) return;
  const bool goes_by_it = guest == show_state_.viewer || setup_.scene.find_tablet(guest);
  if (!tablets_.note(guest, p_eye_world, goes_by_it, at)) return;
  if (recorder_) recorder_->record_tablet(guest, p_eye_world, at);
}

void Session::set_dark_projectors(std::vector<std::string> names) {
  if (names == dark_projectors_) return;
  dark_projectors_ = std::move(names);
  if (recorder_) recorder_->record_dark_projectors(dark_projectors_);
}

Status Session::replace_scene(scene::Scene scene, Stamp at) {
  LIMN_TRY_STATUS(check_same_markers(setup_.scene, scene));
  LIMN_TRY(FrameComposer composer, FrameComposer::create(scene, setup_.rig, setup_.paint));
  show_state_ = with_variants_of(scene, setup_.scene, std::move(show_state_));
  if (recorder_) recorder_->record_scene(scene);
  if (telemetry_) telemetry_->note(at, "the scene's files have changed; the scene was loaded again");
  composer_.replace(std::move(composer));
  if (!has_same_prototype(setup_.scene, scene)) forget_deviation();
  setup_.scene = std::move(scene);
  ++scenes_;
  ask_units();
  return {};
}

Status Session::replace_rig(Rig rig, Stamp at) {
  if (recorder_) rig = recorder_->record_rig(std::move(rig), moments_);
  LIMN_TRY(FrameComposer composer, FrameComposer::create(setup_.scene, rig, setup_.paint));
  composer_.replace(std::move(composer));
  setup_.rig = std::move(rig);
  ++scenes_;
  drift_.forget();
  swapped_.begin_anew(at);
  return {};
}

void Session::reload_changed_scene(SceneWatch* files, Stamp at) {
  auto changed = files->take_changed_scene();
  if (!changed) return;
  if (!*changed) return warn(at, changed->message() + " The parts stay as they were.");
  const std::vector<scene::SkippedVariant> kept = keep_old_variants(setup_.scene, &**changed);
  const Status done = replace_scene(std::move((*changed)->scene), at);
  if (!done) return warn(at, done.message() + " The parts stay as they were.");
  for (const scene::SkippedVariant& old : kept)
    warn(at, fmt::format("{} of slot {} stays as it was: {}", old.variant, old.slot, old.why));
  report_skipped((*changed)->skipped_variants, at);
}

void Session::report_skipped(std::span<const scene::SkippedVariant> skipped_variants, Stamp at) {
  for (const scene::SkippedVariant& skipped : skipped_variants)
    if (const std::string what = scene::to_text(skipped); left_out_.insert(what).second) warn(at, what);
}

FrameInput Session::predict(const FrameTimes& times) {
  prediction_.at_light = predicted_at_light(percepts_, setup_.paint, times);
  return {percepts_,
          show_state_,
          times,
          scene::assign_tracks(setup_.scene, show_state_, prediction_.at_light),
          tablets_.places(),
          dark_projectors_};
}

const ComposedFrame& Session::compose(const FrameInput& input, const DescriptionListener& listener) {
  const auto begun = std::chrono::steady_clock::now();
  if (const auto message = composer_.compose(input, setup_, listener)) warn(input.times.now, *message);
  paint_ms_ = milliseconds_since(begun);
  return composed();
}

void Session::record_frame() {
  const auto begun = std::chrono::steady_clock::now();
  if (recorder_) recorder_->record_images(composed(), moments_);
  record_ms_ = recorder_ ? milliseconds_since(begun) : -1;
}

const ComposedFrame& Session::compose_and_record(Stamp now, Stamp shown_at) {
  compose(predict({now, shown_at}));
  record_frame();
  return composed();
}

void Session::check_drift(Stamp now) {
  FrameComposer* composer = composer_.composer();
  if (!composer) return;
  composer->check_drift(percepts_);
  if (const auto message = drift_.new_notice(composer->drift())) warn(now, *message);
}

void Session::report_unwritten(Stamp at) {
  store_.keep_waiting();
  for (const std::string& what : store_.failures()) warn(at, what);
}

ShownFrame Session::measured() const {
  const ComposedFrame& composed = composer_.composed();
  ShownFrame out{.captured_at = percepts_.captured_at,
                 .shown_at = composed.shown_at,
                 .detect_ms = percepts_.detect_ms,
                 .filter_ms = percepts_.filter_ms,
                 .paint_ms = paint_ms_,
                 .screen_ms = -1,
                 .record_ms = record_ms_};
  for (const auto& detections : percepts_.detections) out.markers += static_cast<int>(detections.size());
  for (const auto& balls : percepts_.balls) out.markers += static_cast<int>(balls.size());
  for (const Track& track : composed.tracks)
    out.lost += track.tracking == TrackingState::lost && !scene::is_loose_body(track.body);
  return out;
}

cv::Mat Session::free_surface(std::size_t projector) {
  FrameComposer* composer = composer_.composer();
  return composer && composed().posed.world_from_prototype ? composer->free_surface(projector) : cv::Mat();
}

EyeImages Session::screen(const ScreenRequest& request) {
  FrameComposer* composer = composer_.composer();
  return composer ? composer->screen(percepts_, prediction_.at_image, show_state_, request) : EyeImages();
}

}  // namespace limn::session
