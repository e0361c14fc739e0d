#include "apps/live/session.h"

#include <algorithm>
#include <chrono>

#include "core/file.h"
#include "core/log.h"
#include "core/picture.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

double milliseconds_since(std::chrono::steady_clock::time_point begun) {
  return 1e3 * seconds_between(begun, std::chrono::steady_clock::now());
}

// A turn backwards undoes what a turn forwards does.
scene::Edit edit_of(const scene::Control& control, int steps) {
  scene::Edit edit{control.action, control.slot, ""};
  if (steps > 0) return edit;
  if (edit.action == "next_variant")
    edit.action = "previous_variant";
  else if (edit.action == "previous_variant")
    edit.action = "next_variant";
  else if (edit.action == "next_look")
    edit.action = "previous_look";
  else if (edit.action == "previous_look")
    edit.action = "next_look";
  return edit;
}

}  // namespace

Result<Session> Session::create(const SessionSetup& setup,
                                Telemetry* telemetry,
                                Recorder* recorder,
                                bool keeps_looks) {
  const std::vector<scene::Action>& actions = scene::actions();
  for (const scene::Control& control : setup.scene.controls) {
    const auto action = std::find_if(actions.begin(), actions.end(),
                                     [&](const scene::Action& a) { return a.name == control.action; });
    std::string names;
    for (const scene::Action& known : actions) names += (names.empty() ? "" : ", ") + known.name;
    if (action == actions.end())
      return error("scene.json: controls: {}: expected an action ({}), found '{}'.", control.marker.text(),
                   names, control.action);
    if (action->of_slot && control.slot.empty())
      return error("scene.json: controls: {}: expected a slot for {}, found none.", control.marker.text(),
                   control.action);
  }
  LIMN_TRY(Painter painter, Painter::create(setup.scene, setup.rig, setup.paint));
  Session out(setup, std::move(painter), telemetry, recorder);
  out.keeps_looks_ = keeps_looks;
  out.load_looks();
  return out;
}

Session::Session(SessionSetup setup, Painter painter, Telemetry* telemetry, Recorder* recorder)
    : setup_(std::move(setup)),
      painter_(std::move(painter)),
      telemetry_(telemetry),
      recorder_(recorder),
      staging_(scene::first_staging(setup_.scene)) {}

void Session::load_looks() {
  std::error_code none;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(setup_.scene.folder / "looks", none))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    Result<scene::Look> look = scene::load_look(file, setup_.scene);
    if (look)
      staging_.looks.push_back(std::move(*look));
    else
      log_warning("live: {} The look is left alone.", look.message());
  }
}

void Session::take(Watched watched, std::size_t moments) {
  watched_ = std::move(watched);
  moments_ = moments;
  staging_ = scene::unpinned(setup_.scene, staging_,
                             tracker::predicted(watched_.motions, watched_.captured_at,
                                                setup_.paint.prediction, setup_.paint.motion));
  for (const ControlUse& use : watched_.uses) {
    const scene::Control& control = setup_.scene.controls[use.control];
    const Status done = edit(edit_of(control, use.steps), control.marker.text(), watched_.captured_at);
    if (!done) log_warning("live: {}: {}", control.marker.text(), done.message());
  }
  watched_.uses.clear();
}

Status Session::edit(const scene::Edit& edit, const std::string& source, Stamp at) {
  LIMN_TRY(scene::Staging changed, scene::edited(setup_.scene, staging_, painter_.painted().posed, edit));
  std::swap(staging_, changed);
  if (recorder_) recorder_->edited(edit, source);
  if (telemetry_)
    telemetry_->note(at, fmt::format("{}{}{}{}{} ({})", edit.action, edit.slot.empty() ? "" : " ", edit.slot,
                                     edit.value.empty() ? "" : " ", edit.value, source));
  return keeps_looks_ ? keep_looks(changed) : Status();
}

// Looks that were saved or deleted, on disk.
Status Session::keep_looks(const scene::Staging& before) {
  const fs::path folder = setup_.scene.folder / "looks";
  const auto has = [](const scene::Staging& staging, const std::string& name) {
    return std::any_of(staging.looks.begin(), staging.looks.end(),
                       [&](const scene::Look& look) { return look.name == name; });
  };
  for (const scene::Look& look : before.looks) {
    if (has(staging_, look.name)) continue;
    std::error_code ignored;
    for (const char* end : {".json", ".png"}) fs::remove(folder / (look.name + end), ignored);
  }
  if (staging_.looks.empty()) return {};
  const scene::Look& newest = staging_.looks.back();
  const auto same = [&](const scene::Look& look) {
    return scene::look_json(look) == scene::look_json(newest);
  };
  if (std::any_of(before.looks.begin(), before.looks.end(), same)) return {};
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY_STATUS(write_file(folder / (newest.name + ".json"), scene::look_json(newest)));
  scene::Staging shown = staging_;
  shown.screen = scene::Screen::view;
  const cv::Mat picture = painter_.screen(watched_, shown);
  return picture.empty() ? Status() : write_png(folder / (newest.name + ".png"), picture);
}

const Painted& Session::paint(Stamp now, Stamp shown_at) {
  const auto begun = std::chrono::steady_clock::now();
  const Painted& painted = painter_.paint(watched_, staging_, now, shown_at);
  paint_ms_ = milliseconds_since(begun);
  const auto recording = std::chrono::steady_clock::now();
  if (recorder_) recorder_->painted(painted, moments_);
  record_ms_ = recorder_ ? milliseconds_since(recording) : -1;
  return painted;
}

cv::Mat Session::screen() { return painter_.screen(watched_, staging_); }

}  // namespace limn::apps
