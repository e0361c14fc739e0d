#include "session/session.h"

#include <algorithm>
#include <chrono>

#include "session/contact_sheet.h"
#include "core/stopwatch.h"
#include "session/swapped_cameras.h"
#include "core/file.h"
#include "core/log.h"
#include "core/image_io.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr double k_compare_cameras_every_s = 2;
constexpr double k_renew_every_s = 1;  // a context that was lost
constexpr const char* k_pairings = "pairings.json";
constexpr const char* k_deleted = "deleted";  // in the folder of looks

// A turn backwards undoes what a turn forwards does.
scene::Edit edit_of(const scene::Control& control, int steps) {
  const scene::Action* action = scene::find_action(control.action);
  LIMN_CHECK(action != nullptr);  // Session::create() has seen to it
  return scene::make_edit(steps > 0 ? action->id : action->opposite.value_or(action->id), control.slot);
}

// What is not there is not moved.
Status move_look(const std::string& name, const fs::path& from, const fs::path& to) {
  LIMN_TRY_STATUS(make_folder(to));
  std::error_code failed;
  for (const char* end : {".json", ".png"}) {
    const fs::path file = from / (name + end);
    if (fs::exists(file, failed)) fs::rename(file, to / file.filename(), failed);
    if (failed)
      return error("{}: could not be moved to {}: {}.", file.string(), to.string(), failed.message());
  }
  return {};
}

std::vector<std::string> variant_names(const scene::Slot& slot) {
  std::vector<std::string> names;
  for (const scene::Variant& variant : slot.variants) names.push_back(variant.name);
  return names;
}

// Whether the same markers carry the same bodies and act alike.
bool is_carried_alike(const scene::Scene& a, const scene::Scene& b) {
  const auto carriers = [](const scene::Scene& scene) {
    std::string text;
    for (const Body& body : scene::bodies(scene)) {
      text += body.name + ":";
      for (const BodyMarker& marker : body.markers) {
        const Eigen::Quaterniond& q = marker.body_from_marker.rotation;
        const Eigen::Vector3d& t = marker.body_from_marker.translation;
        text += fmt::format(" {} {} {} {} {} {} {} {} {}", marker.marker.text(), marker.size_m, q.w(), q.x(),
                            q.y(), q.z(), t.x(), t.y(), t.z());
      }
      text += "\n";
    }
    for (const scene::Control& control : scene.controls)
      text +=
          fmt::format("{} {} {} {}\n", control.marker.text(), control.action, control.slot, control.gesture);
    return text;
  };
  return carriers(a) == carriers(b);
}

}  // namespace

void tell(std::span<const scene::SkippedVariant> skipped_variants, Stamp at, Telemetry* telemetry) {
  for (const scene::SkippedVariant& part : skipped_variants) {
    const std::string what = fmt::format("{} of slot {} is left out: {}", part.variant, part.slot, part.why);
    if (telemetry) telemetry->note(at, what);
    log_warning("live: {}", what);
  }
}

Result<Session> Session::create(const SessionSetup& setup,
                                Telemetry* telemetry,
                                Recorder* recorder,
                                bool keeps_looks) {
  for (const scene::Control& control : setup.scene.controls) {
    const scene::Action* action = scene::find_action(control.action);
    if (!action)
      return error("scene.json: controls: {}: expected an action ({}), found '{}'.", control.marker.text(),
                   scene::action_names(), control.action);
    if (action->of_slot && control.slot.empty())
      return error("scene.json: controls: {}: expected a slot for {}, found none.", control.marker.text(),
                   control.action);
  }
  LIMN_TRY(FrameComposer composer, FrameComposer::create(setup.scene, setup.rig, setup.paint));
  Session out(setup, std::move(composer), telemetry, recorder);
  out.keeps_looks_ = keeps_looks;
  out.load_looks();
  out.load_pairings();
  out.ask_units();
  return out;
}

Session::Session(SessionSetup setup, FrameComposer composer, Telemetry* telemetry, Recorder* recorder)
    : setup_(std::move(setup)),
      composer_(std::move(composer)),
      painted_(composer_->painted()),
      telemetry_(telemetry),
      recorder_(recorder),
      show_state_(scene::initial_show_state(setup_.scene)) {
  for (const std::string& name : setup_.screens) show_state_.screens.push_back({name});
  if (setup_.rig.cameras.empty()) return;
  const Eigen::Quaterniond world_from_camera = setup_.rig.cameras[0].imager_from_world.rotation.inverse();
  show_state_.d_up_world = world_from_camera * -Eigen::Vector3d::UnitY();
  show_state_.d_front_world = world_from_camera * -Eigen::Vector3d::UnitZ();
}

void Session::load_looks() {
  std::error_code none;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(setup_.scene.folder / "looks", none))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    Result<scene::Look> look = scene::load_look(file, setup_.scene);
    if (look)
      show_state_.looks.push_back(std::move(*look));
    else
      log_warning("live: {} The look is left alone.", look.message());
  }
}

void Session::load_pairings() {
  const fs::path file = setup_.scene.folder / k_pairings;
  std::error_code none;
  if (!fs::exists(file, none)) return;
  auto paired = scene::with_pairings(file, setup_.scene, show_state_);
  if (paired)
    show_state_ = std::move(*paired);
  else
    log_warning("live: {} The scene's own markers carry the parts.", paired.message());
}

// Of parts that were dropped in, once each.
void Session::ask_units() {
  for (const scene::Slot& slot : setup_.scene.slots)
    for (const scene::Variant& variant : slot.variants) {
      const std::string question = scene::units_question(slot, variant);
      if (!question.empty() && telemetry_ && asked_.insert(question).second)
        telemetry_->note(watched_.captured_at, question);
    }
}

void Session::take(Percepts watched, std::size_t moments) {
  watched_ = std::move(watched);
  moments_ = moments;
  show_state_ =
      scene::without_moved_pins(setup_.scene, show_state_,
                      scene::assign_tracks(setup_.scene, show_state_,
                                     tracker::predicted(watched_.motions, watched_.captured_at,
                                                        setup_.paint.prediction, setup_.paint.motion)));
  for (const ControlUse& use : watched_.uses) {
    const scene::Control& control = setup_.scene.controls[use.control];
    const Status done = edit(edit_of(control, use.steps), control.marker.text(), watched_.captured_at);
    if (!done) log_warning("live: {}: {}", control.marker.text(), done.message());
  }
  watched_.uses.clear();
  tell_of_swapped_cameras();
}

void Session::warn(Stamp at, const std::string& what) {
  if (telemetry_) telemetry_->note(at, what);
  log_warning("live: {}", what);
}

void Session::tell_of_swapped_cameras() {
  if (told_swapped_ || setup_.rig.cameras.size() < 2 ||
      seconds_between(compared_cameras_at_, watched_.captured_at) < k_compare_cameras_every_s)
    return;
  compared_cameras_at_ = watched_.captured_at;
  const auto swapped =
      swapped_cameras(setup_.rig, scene::bodies(setup_.scene), watched_.detections, watched_.captured_at);
  if (!swapped) return;
  told_swapped_ = true;
  const std::string what = fmt::format(
      "{} and {} seem to be exchanged: each sees what the other should. Exchange their cables, or their "
      "addresses in the devices file.",
      swapped->first, swapped->second);
  warn(watched_.captured_at, what);
}

Status Session::edit(const scene::Edit& wanted, const std::string& source, Stamp at) {
  scene::Edit edit = wanted;
  LIMN_TRY(scene::Command command, scene::command_of(setup_.scene, edit));
  if (auto* marker = std::get_if<std::optional<MarkerName>>(&command.value); marker && !*marker)
    if (const auto waiting = waiting_markers(setup_.scene, show_state_, watched_); !waiting.empty()) {
      *marker = waiting.back().marker;  // the one that glows; it is recorded by its name
      edit.value = (*marker)->text();
    }
  LIMN_TRY(scene::ShowState changed, scene::apply_edit(setup_.scene, show_state_, painted_.posed, command));
  std::swap(show_state_, changed);
  last_edit_ = Edited{edit, source, last_edit_ ? last_edit_->count + 1 : 1};
  if (recorder_) recorder_->edited(edit, source, moments_);
  recalibration_requested_ |= command.action == scene::ActionId::repair;
  if (telemetry_)
    telemetry_->note(at, fmt::format("{}{}{}{}{} ({})", edit.action, edit.slot.empty() ? "" : " ", edit.slot,
                                     edit.value.empty() ? "" : " ", edit.value, source));
  return keeps_looks_ ? keep(changed, command) : Status();
}

void Session::see(const std::string& guest, const std::optional<Eigen::Vector3d>& p_eye_world, Stamp at) {
  if (p_eye_world && !p_eye_world->allFinite()) return;
  if (p_eye_world)
    windows_.insert(guest);
  else
    windows_.erase(guest);
  const bool counts = guest == show_state_.viewer || setup_.scene.find_tablet(guest);
  const auto known = std::find_if(places_.begin(), places_.end(),
                                  [&](const TabletViewpoint& place) { return place.guest == guest; });
  const bool is_known = known != places_.end();
  if (!counts || (!p_eye_world && !is_known)) return;
  if (is_known) places_.erase(known);
  if (p_eye_world) places_.push_back({guest, *p_eye_world, at});
  if (recorder_) recorder_->saw(guest, p_eye_world, at);
}

Status Session::show(scene::Scene scene, Stamp at) {
  if (!is_carried_alike(setup_.scene, scene))
    return error(
        "{}: expected the markers, slots and controls that the session began with, found others. Begin a "
        "new session to take them; this one goes on with the parts as they were.",
        (scene.folder / "scene.json").string());
  LIMN_TRY(FrameComposer composer, FrameComposer::create(scene, setup_.rig, setup_.paint));
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const std::vector<std::string> now = variant_names(scene.slots[i]),
                                   before = variant_names(setup_.scene.slots[i]);
    const auto is_in = [](const std::vector<std::string>& names, const std::string& name) {
      return std::find(names.begin(), names.end(), name) != names.end();
    };
    std::string& shown = show_state_.slots[i].variant;
    for (const std::string& name : now)
      if (!is_in(before, name)) shown = name;
    if (!is_in(now, shown)) shown = now.front();
  }
  if (recorder_) recorder_->shown(scene);
  if (telemetry_) telemetry_->note(at, "the scene's files have changed; it was loaded anew");
  composer_ = std::move(composer);
  setup_.scene = std::move(scene);
  ++scenes_;
  ask_units();
  return {};
}

Status Session::mend(Rig rig, Stamp at) {
  if (recorder_) rig = recorder_->mended(std::move(rig), moments_);
  LIMN_TRY(FrameComposer composer, FrameComposer::create(setup_.scene, rig, setup_.paint));
  composer_ = std::move(composer);
  setup_.rig = std::move(rig);
  ++scenes_;
  told_drift_.reset();
  told_swapped_ = false;
  compared_cameras_at_ = at;
  return {};
}

void Session::show_news(SceneWatch* files, Stamp at) {
  auto news = files->news();
  if (!news) return;
  const Status shown = *news ? show_if_whole(std::move(**news), at) : Status(news->error());
  if (shown) return;
  const std::string what = shown.message() + " The parts stay as they were.";
  warn(at, what);
}

// A part that is shown and cannot be loaded any more stays; one that never could be is no reason.
Status Session::show_if_whole(SceneNews news, Stamp at) {
  for (const scene::SkippedVariant& skipped_variants : news.skipped_variants) {
    const scene::Slot* slot = setup_.scene.find_slot(skipped_variants.slot);
    if (!slot) continue;
    for (const std::string& name : variant_names(*slot))
      if (name == skipped_variants.variant) return error("{}", skipped_variants.why);
  }
  LIMN_TRY_STATUS(show(std::move(news.scene), at));
  tell(news.skipped_variants, at, telemetry_);
  return {};
}

Status Session::keep(const scene::ShowState& before, const scene::Command& command) {
  LIMN_TRY_STATUS(keep_pairings(before));
  if (const auto* unit = std::get_if<scene::PartUnit>(&command.value))
    LIMN_TRY_STATUS(keep_unit(setup_.scene.slots[command.slot], *unit));
  return keep_looks(before);
}

Status Session::keep_pairings(const scene::ShowState& before) {
  const std::string text = scene::pairings_json(setup_.scene, show_state_);
  if (text == scene::pairings_json(setup_.scene, before)) return {};
  const fs::path file = setup_.scene.folder / k_pairings;
  if (!text.empty()) return write_file(file, text);
  std::error_code ignored;
  fs::remove(file, ignored);
  return {};
}

// The part comes anew when SceneWatch sees the answer.
Status Session::keep_unit(const scene::Slot& slot, const scene::PartUnit& unit) {
  return write_file(setup_.scene.folder / "slots" / slot.name / "units.json",
                    scene::units_json(slot, unit.part, unit.unit));
}

// Looks that were saved or deleted, on disk, and the page of all.
Status Session::keep_looks(const scene::ShowState& before) {
  const auto text_of = [](const scene::ShowState& show_state, const std::string& name) {
    for (const scene::Look& look : show_state.looks)
      if (look.name == name) return scene::look_json(look);
    return std::string();
  };
  const fs::path folder = setup_.scene.folder / "looks";
  bool has_changed = false;
  for (const scene::Look& look : before.looks) {
    if (!text_of(show_state_, look.name).empty()) continue;
    has_changed = true;
    LIMN_TRY_STATUS(move_look(look.name, folder, folder / k_deleted));
  }
  for (const scene::Look& look : show_state_.looks) {
    const std::string text = scene::look_json(look);
    if (text == text_of(before, look.name)) continue;
    has_changed = true;
    if (before.deleted_look && text == scene::look_json(*before.deleted_look) && !show_state_.deleted_look) {
      LIMN_TRY_STATUS(move_look(look.name, folder / k_deleted, folder));
      continue;
    }
    LIMN_TRY_STATUS(make_folder(folder));
    LIMN_TRY_STATUS(write_file(folder / (look.name + ".json"), text));
    const cv::Mat image = screen(scene::Screen::view);
    if (!image.empty()) LIMN_TRY_STATUS(write_png(folder / (look.name + ".png"), image));
  }
  return has_changed ? write_contact_sheet(show_state_.looks, folder, folder / "looks.html") : Status();
}

const ComposedFrame& Session::paint(Stamp now, Stamp shown_at) {
  const auto begun = std::chrono::steady_clock::now();
  if (composer_) composer_->paint(watched_, show_state_, now, shown_at, places_);
  if (composer_ && !(drawing_.is_lost && drawing_.is_lost()))
    painted_ = composer_->painted();
  else
    draw_anew(now, shown_at);
  paint_ms_ = milliseconds_since(begun);
  const auto recording = std::chrono::steady_clock::now();
  if (recorder_) recorder_->painted(painted_, moments_);
  record_ms_ = recorder_ ? milliseconds_since(recording) : -1;
  return painted_;
}

// The GL context is gone, and what was drawn in it: the image before it stays until there is another.
void Session::draw_anew(Stamp now, Stamp shown_at) {
  if (!composer_ && seconds_between(renewed_at_, now) < k_renew_every_s) return;
  const bool was_drawing = composer_.has_value();
  composer_.reset();
  renewed_at_ = now;
  Status renewed = drawing_.renew();
  if (renewed) {
    auto composer = FrameComposer::create(setup_.scene, setup_.rig, setup_.paint);
    if (composer) {
      composer_ = std::move(*composer);
      painted_ = composer_->paint(watched_, show_state_, now, shown_at, places_);
    } else {
      renewed = composer.error();
    }
  }
  if (!renewed && !was_drawing) return;
  const std::string what =
      renewed ? "the graphics card lost what it drew; it was drawn anew"
              : fmt::format(
                    "the graphics card lost what it drew; the last picture stays until it can draw "
                    "again: {}",
                    renewed.message());
  warn(now, what);
}

void Session::look_for_drift(Stamp now) {
  if (!composer_) return;
  composer_->look_for_drift(watched_);
  const std::optional<Drift>& drift = composer_->drift();
  const bool is_news =
      drift.has_value() != told_drift_.has_value() || (drift && drift->devices != told_drift_->devices);
  if (!is_news) return;
  told_drift_ = drift;
  const std::string what = drift ? sentence(*drift) : "all light is where the rig says again";
  warn(now, what);
}

ShownFrame Session::measured() const {
  const ComposedFrame& painted = painted_;
  ShownFrame out{.captured_at = watched_.captured_at,
                 .shown_at = painted.shown_at,
                 .detect_ms = watched_.detect_ms,
                 .filter_ms = watched_.filter_ms,
                 .paint_ms = paint_ms_,
                 .screen_ms = -1,
                 .record_ms = record_ms_};
  for (const auto& detections : watched_.detections) out.markers += static_cast<int>(detections.size());
  for (const Track& track : painted.tracks)
    out.lost += track.tracking == TrackingState::lost && !scene::is_loose_body(track.body);
  return out;
}

cv::Mat Session::free_surface(std::size_t projector) {
  return composer_ && painted_.posed.world_from_prototype ? composer_->free_surface(projector) : cv::Mat();
}

cv::Mat Session::screen(scene::Screen what) {
  return composer_ ? composer_->screen(watched_, show_state_, what) : cv::Mat();
}

}  // namespace limn::apps
