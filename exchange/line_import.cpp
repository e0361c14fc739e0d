#include "exchange/line_import.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/json_text.h"
#include "core/names.h"
#include "core/utf8.h"
#include "exchange/curves/csv_curves.h"
#include "exchange/line_report.h"
#include "exchange/scene_text.h"
#include "scene/lines/line_file.h"
#include "scene/scene.h"

namespace limn::exchange {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* k_folder = "lines";  // for the points, in the scene's folder

fs::path scene_file(const fs::path& scene) {
  std::error_code none;
  return fs::is_directory(scene, none) ? scene / "scene.json" : scene;
}

// The curves by the names of their lines, in the file's order.
Result<std::vector<LineRow>> read_rows(const LineImportOptions& options) {
  LIMN_TRY(std::vector<NamedCurve> curves, scene::read_line_file(options.file, options.edges));
  const std::string stem = as_utf8(options.file.stem().string());
  std::vector<LineRow> rows;
  for (NamedCurve& curve : curves) {
    const std::string name = !options.name.empty() ? options.name : curve.name.empty() ? stem : curve.name;
    if (!scene::is_line_name(name) || !is_utf8(name))
      return error("{}: expected curves whose names have 1 to {} bytes (UTF-8), found '{}'. Give a --name.",
                   options.file.string(), scene::k_longest_line_name, as_utf8(name));
    LineRow* row = find_named(rows, name);
    if (!row) row = &rows.emplace_back(LineRow{name, {}});
    curve.name = name;
    row->curves.push_back(std::move(curve));
  }
  return rows;
}

Status check_names(const scene::Scene& scene,
                   const std::vector<LineRow>& rows,
                   const LineImportOptions& options) {
  std::size_t count = scene.lines.size();
  for (const LineRow& row : rows) {
    const bool is_known = find_named(scene.lines, row.name) != nullptr;
    if (is_known && !options.replace)
      return error(
          "{}: expected a name that no line of the scene has ({}), found '{}'. Give another --name, or "
          "--replace the line's curve.",
          options.file.string(), joined_names(scene.lines), row.name);
    count += is_known ? 0 : 1;
  }
  if (count > scene::k_most_lines)
    return error(
        "{}: expected at most {} lines in a scene, found {} with those of the file. Give a --name, "
        "under which all curves are one line.",
        options.file.string(), scene::k_most_lines, count);
  return {};
}

Status check_on_prototype(const scene::Scene& scene, const std::vector<LineRow>& rows, const fs::path& file) {
  if (!scene.drape)
    return error("{}: expected a prototype for the lines, found a scene without.", scene.folder.string());
  for (const LineRow& row : rows)
    for (const NamedCurve& curve : row.curves) {
      const auto laid = scene.drape->laid(curve, fmt::format("{}: line '{}'", file.string(), row.name));
      if (!laid) return laid.error();
    }
  return {};
}

// A name for the line's file that `folder` has not yet.
fs::path unused_file(const fs::path& folder, const std::string& name, const std::vector<LineRow>& rows) {
  std::string stem = name;
  for (char& c : stem)
    if (std::string_view("/\\:*?\"<>|").find(c) != std::string_view::npos) c = '_';
  if (stem.front() == '.') stem.front() = '_';
  const auto is_used = [&](const std::string& file) {
    std::error_code none;
    return fs::exists(folder / file, none) || std::any_of(rows.begin(), rows.end(), [&](const LineRow& row) {
             return row.from == std::string(k_folder) + "/" + file;
           });
  };
  for (int number = 1;; ++number)
    if (const std::string file = number == 1 ? stem + ".csv" : fmt::format("{} {}.csv", stem, number);
        !is_used(file))
      return fs::path(k_folder) / file;
}

std::string curve_json(const LineRow& row) {
  return fmt::format("{{\"file\": {}}}", json_text(ordered_json(row.from)));
}

std::string entry_json(const LineRow& row, const LineImportOptions& options) {
  std::string text = fmt::format("{{\"name\": {}", json_text(ordered_json(row.name)));
  if (options.colour)
    text += fmt::format(", \"colour\": [{}, {}, {}]", options.colour->x(), options.colour->y(),
                        options.colour->z());
  if (options.width_mm) text += fmt::format(", \"width_mm\": {}", *options.width_mm);
  return text + fmt::format(", \"curve\": {}}}", curve_json(row));
}

Result<std::string> changed_scene(const scene::Scene& scene,
                                  const std::vector<LineRow>& rows,
                                  const fs::path& file,
                                  const LineImportOptions& options) {
  LIMN_TRY(const std::string text, read_file(file));
  std::vector<ReplacedCurve> replaced;
  std::vector<std::string> added;
  for (const LineRow& row : rows) {
    if (const scene::Line* line = find_named(scene.lines, row.name))
      replaced.push_back({static_cast<std::size_t>(line - scene.lines.data()), curve_json(row)});
    else
      added.push_back(entry_json(row, options));
  }
  return with_lines(text, replaced, added, file.string());
}

// The points first: scene.json is replaced when all that it names is there.
Status write_files(const std::vector<LineRow>& rows, const fs::path& file, const std::string& text) {
  const fs::path folder = file.parent_path();
  LIMN_TRY_STATUS(make_folder(folder / k_folder));
  Status written;
  std::size_t count = 0;
  for (; written && count < rows.size(); ++count) {
    const std::string points = encode_csv_curves(rows[count].curves);
    const auto again = decode_csv_curves(points, rows[count].name);
    written = again ? write_file(folder / rows[count].from, points) : Status(again.error());
  }
  if (written) written = write_file(file, text);
  std::error_code none;
  for (std::size_t i = 0; !written && i < count; ++i) fs::remove(folder / rows[i].from, none);
  return written;
}

}  // namespace

Status import_lines(const LineImportOptions& options) {
  LIMN_TRY(std::vector<LineRow> rows, read_rows(options));
  const fs::path file = scene_file(options.scene);
  std::vector<scene::SkippedVariant> skipped;  // parts do not matter here
  LIMN_TRY(const scene::Scene scene, scene::load_scene(file, &skipped, scene::EmptySlots::kept));
  LIMN_TRY_STATUS(check_names(scene, rows, options));
  LIMN_TRY_STATUS(check_on_prototype(scene, rows, options.file));
  for (LineRow& row : rows) row.from = unused_file(scene.folder / k_folder, row.name, rows).string();
  LIMN_TRY(const std::string text, changed_scene(scene, rows, file, options));
  LIMN_TRY_STATUS(write_files(rows, file, text));
  print_lines(rows, file, options.json);
  return {};
}

}  // namespace limn::exchange
