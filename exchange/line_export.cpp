#include "exchange/line_export.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/log.h"
#include "core/names.h"
#include "exchange/line_report.h"
#include "scene/drawn_lines.h"
#include "scene/kept_files.h"
#include "scene/lines/line_file.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::exchange {
namespace {

namespace fs = std::filesystem;

Result<std::vector<scene::Look>> looks_of(const scene::Scene& scene, const std::string& wanted) {
  std::vector<scene::Look> looks;
  std::vector<std::string> names;
  for (const fs::path& file : scene::look_files(scene.folder)) {
    auto look = scene::load_look(file, scene);
    if (!look) {
      log_warning("{} This look is left out.", look.message());
      continue;
    }
    names.push_back(look->name);
    if (wanted.empty() || look->name == wanted) looks.push_back(std::move(*look));
  }
  if (!wanted.empty() && looks.empty())
    return error("--look: expected a look of the scene ({}), found '{}'.", joined_names(names), wanted);
  return looks;
}

// Adds a look's drawn lines; one that another look has under the same name, but otherwise, gets a name with
// the look's.
void add_drawn(const scene::Look& look, scene::PosedScene* posed, std::vector<std::string>* from) {
  for (scene::DrawnLine line : look.drawn) {
    if (const scene::DrawnLine* known = find_named(posed->drawn, line.name)) {
      if (known->curve == line.curve) continue;
      line.name = fmt::format("{} ({})", line.name, look.name);
    }
    from->push_back("look " + look.name);
    posed->drawn.push_back(std::move(line));
  }
}

// The lines that sessions keep, as they were at the end of the last one.
void add_kept(const scene::Scene& scene, scene::PosedScene* posed, std::vector<std::string>* from) {
  const fs::path file = scene::kept_file(scene.folder, scene::k_drawn_lines_file);
  if (std::error_code none; !fs::exists(file, none)) return;
  const auto kept = scene::with_drawn_lines(file, scene, scene::initial_show_state(scene));
  if (!kept) return log_warning("{} These lines are left out.", kept.message());
  posed->drawn = kept->drawn;
  from->assign(posed->drawn.size(), "the last session");
}

std::vector<LineRow> exported_rows(const scene::Scene& scene,
                                   const std::vector<scene::Look>& looks,
                                   bool is_of_look) {
  scene::PosedScene posed;
  std::vector<std::string> from;
  if (!is_of_look) add_kept(scene, &posed, &from);
  for (const scene::Look& look : looks) add_drawn(look, &posed, &from);
  if (is_of_look)
    posed.lines = looks.front().lines.value_or(scene::first_lines(scene));
  else
    for (const scene::Line& line : scene.lines) posed.lines.push_back(line.name);
  std::vector<LineRow> rows;
  for (NamedCurve& curve : scene::shown_curves(scene, posed)) {
    LineRow* row = find_named(rows, curve.name);
    if (!row) {
      const scene::DrawnLine* drawn = find_named(posed.drawn, curve.name);
      const bool is_drawn = drawn && !find_named(scene.lines, curve.name);
      rows.push_back(
          {curve.name, is_drawn ? from[static_cast<std::size_t>(drawn - posed.drawn.data())] : "the scene"});
      row = &rows.back();
    }
    row->curves.push_back(std::move(curve));
  }
  for (const std::string& name : posed.lines)
    if (const scene::Line* line = find_named(scene.lines, name); line && line->curves.empty())
      log_info("export: line '{}' is no curve ({}) and is left out", name,
               line->outline_of.empty() ? "planes or a pattern" : "an outline, which moves with its part");
  return rows;
}

Status keep_only(const std::vector<std::string>& names, std::vector<LineRow>* rows) {
  if (names.empty()) return {};
  for (const std::string& name : names)
    if (!find_named(*rows, name))
      return error("--line: expected a line that has a curve ({}), found '{}'.", joined_names(*rows), name);
  std::erase_if(*rows, [&](const LineRow& row) {
    return std::find(names.begin(), names.end(), row.name) == names.end();
  });
  return {};
}

}  // namespace

Status export_lines(const LineExportOptions& options) {
  LIMN_TRY(const scene::Scene scene, scene::load_usable_scene(options.scene));
  LIMN_TRY(const std::vector<scene::Look> looks, looks_of(scene, options.look));
  std::vector<LineRow> rows = exported_rows(scene, looks, !options.look.empty());
  LIMN_TRY_STATUS(keep_only(options.lines, &rows));
  if (rows.empty())
    return error(
        "{}: expected lines with curves, found none. Write some into scene.json (config/README.md), or draw "
        "one in a session and save a look.",
        options.scene.string());
  std::vector<NamedCurve> curves;
  for (const LineRow& row : rows) curves.insert(curves.end(), row.curves.begin(), row.curves.end());
  LIMN_TRY_STATUS(scene::write_line_file(curves, options.out, options.form));
  print_lines(rows, options.out, options.json);
  return {};
}

}  // namespace limn::exchange
