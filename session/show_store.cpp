#include "session/show_store.h"

#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "scene/drawn_lines.h"
#include "scene/kept_files.h"
#include "scene/part_units.h"
#include "session/contact_sheet.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_pairings = "pairings.json";
constexpr auto k_between_drawn = std::chrono::milliseconds(500);
constexpr const char* k_deleted = "deleted";  // subfolder of the folder of looks

// Moves a look's files, both or none; a file that does not exist is skipped.
Status move_look(const std::string& name, const fs::path& from, const fs::path& to) {
  LIMN_TRY_STATUS(make_folder(to));
  std::error_code failed, ignored;
  for (const char* end : {".json", ".png"}) {
    const fs::path file = from / (name + end);
    if (fs::exists(file, failed)) fs::rename(file, to / file.filename(), failed);
    if (!failed) continue;
    if (end == std::string(".png")) fs::rename(to / (name + ".json"), from / (name + ".json"), ignored);
    return error("{}: could not be moved to {}: {}.", file.string(), to.string(), failed.message());
  }
  return {};
}

Status write_look(const fs::path& folder,
                  const std::string& name,
                  const std::string& json,
                  const cv::Mat& image) {
  return write_together(folder, [&](const fs::path& into) -> Status {
    LIMN_TRY_STATUS(write_file(into / (name + ".json"), json));
    return image.empty() ? Status() : write_png(into / (name + ".png"), image);
  });
}

// A file of drawn lines that is damaged, or another version's, is not replaced: it gets another name.
Status put_damaged_aside(const fs::path& file) {
  std::error_code failed;
  if (!fs::exists(file, failed) || scene::with_drawn_lines(file, {}, {})) return {};
  const fs::path aside = file.parent_path() / (file.stem().string() + "-damaged" + file.extension().string());
  fs::rename(file, aside, failed);
  return failed ? error("{}: could not be renamed: {}.", file.string(), failed.message()) : Status();
}

// The JSON text of a look; empty: there is no such look.
std::string json_of(const std::vector<scene::Look>& looks, const std::string& name) {
  for (const scene::Look& look : looks)
    if (look.name == name) return scene::look_json(look);
  return {};
}

}  // namespace

ShowStore::ShowStore(bool keeps) : writer_(keeps ? std::make_unique<FileWriter>() : nullptr) {}

scene::ShowState ShowStore::loaded(const scene::Scene& scene, scene::ShowState show_state) {
  if (const Status is_kept = scene::check_kept_folder(scene.folder); !is_kept)
    log_warning("live: {} Until then looks are not saved.", is_kept.message());
  else if (const fs::path folder = scene::kept_folder(scene.folder); folder != scene.folder)
    log_info("live: {} cannot be written here, so looks are kept in {}.", scene.folder.string(),
             folder.string());
  for (const fs::path& file : scene::look_files(scene.folder)) {
    Result<scene::Look> look = scene::load_look(file, scene);
    if (look)
      show_state.looks.push_back(std::move(*look));
    else
      log_warning("live: {} This look is not used; its file was not changed.", look.message());
  }
  const fs::path drawn = scene::kept_file(scene.folder, scene::k_drawn_lines_file);
  if (std::error_code none; fs::exists(drawn, none)) {
    auto with_lines = scene::with_drawn_lines(drawn, scene, show_state);
    if (with_lines)
      show_state = std::move(*with_lines);
    else
      log_warning("live: {} The drawn lines are not used.", with_lines.message());
  }
  const fs::path file = scene::kept_file(scene.folder, k_pairings);
  if (std::error_code none; !fs::exists(file, none)) return show_state;
  auto paired = scene::with_pairings(file, scene, show_state);
  if (paired) return std::move(*paired);
  log_warning("live: {} The saved pairings are not used; the scene's own markers carry the parts.",
              paired.message());
  return show_state;
}

void ShowStore::keep(const scene::Scene& scene,
                     const scene::ShowState& before,
                     const scene::ShowState& after,
                     const scene::Command& command,
                     const std::function<cv::Mat()>& look_image) {
  if (!writer_) return;
  keep_pairings(scene, before, after);
  keep_drawn(scene, before, after);
  if (const auto* unit = std::get_if<scene::PartUnit>(&command.value))
    keep_unit(scene, scene.slots[command.slot], *unit);
  keep_looks(scene::kept_folder(scene.folder) / "looks", before, after, look_image);
}

void ShowStore::keep_pairings(const scene::Scene& scene,
                              const scene::ShowState& before,
                              const scene::ShowState& after) {
  const std::string text = scene::pairings_json(scene, after);
  if (text == scene::pairings_json(scene, before)) return;
  writer_->add([file = scene::kept_folder(scene.folder) / k_pairings, text]() -> Status {
    LIMN_TRY_STATUS(make_folder(file.parent_path()));
    if (!text.empty()) return write_file(file, text);
    std::error_code ignored;
    fs::remove(file, ignored);
    return {};
  });
}

void ShowStore::keep_drawn(const scene::Scene& scene,
                           const scene::ShowState& before,
                           const scene::ShowState& after) {
  if (before.drawn == after.drawn && (after.drawn.empty() || before.lines == after.lines)) return;
  waiting_ = Drawn{scene::kept_folder(scene.folder) / scene::k_drawn_lines_file, after.drawn, after.lines};
  keep_waiting();
}

void ShowStore::keep_waiting() {
  if (waiting_ && std::chrono::steady_clock::now() - drawn_written_at_ >= k_between_drawn) write_drawn();
}

void ShowStore::write_drawn() {
  drawn_written_at_ = std::chrono::steady_clock::now();
  writer_->add([drawn = *std::exchange(waiting_, std::nullopt)]() -> Status {
    const std::string text = scene::drawn_lines_json(drawn.lines, drawn.shown);
    LIMN_TRY_STATUS(make_folder(drawn.file.parent_path()));
    LIMN_TRY_STATUS(put_damaged_aside(drawn.file));
    if (!text.empty()) return write_file(drawn.file, text);
    std::error_code ignored;
    fs::remove(drawn.file, ignored);
    return {};
  });
}

// SceneWatch notices the new file and loads the part again.
void ShowStore::keep_unit(const scene::Scene& scene, const scene::Slot& slot, const scene::PartUnit& unit) {
  writer_->add([file = scene.folder / "slots" / slot.name / "units.json",
                text = scene::units_json(slot, unit.part, unit.unit)] { return write_file(file, text); });
}

// Saves or moves the files of looks that were saved, deleted or restored, and writes the overview page.
void ShowStore::keep_looks(const fs::path& folder,
                           const scene::ShowState& before,
                           const scene::ShowState& after,
                           const std::function<cv::Mat()>& look_image) {
  bool has_changed = false;
  for (const scene::Look& look : before.looks) {
    if (!json_of(after.looks, look.name).empty()) continue;
    has_changed = true;
    writer_->add([=, name = look.name] { return move_look(name, folder, folder / k_deleted); });
  }
  for (const scene::Look& look : after.looks) {
    const std::string text = scene::look_json(look);
    if (text == json_of(before.looks, look.name)) continue;
    has_changed = true;
    const bool is_back =
        before.deleted_look && text == scene::look_json(*before.deleted_look) && !after.deleted_look;
    if (is_back)
      writer_->add([=, name = look.name] { return move_look(name, folder / k_deleted, folder); });
    else
      writer_->add(
          [=, name = look.name, image = look_image()] { return write_look(folder, name, text, image); });
  }
  if (has_changed)
    writer_->add(
        [=, looks = after.looks] { return write_contact_sheet(looks, folder, folder / "looks.html"); });
}

void ShowStore::finish() {
  if (writer_ && waiting_) write_drawn();
  if (writer_) writer_->finish();
}

std::vector<std::string> ShowStore::failures() {
  return writer_ ? writer_->failures() : std::vector<std::string>();
}

}  // namespace limn::session
