#include "exchange/cad/cad_output.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "core/file.h"
#include "core/utf8.h"
#include "exchange/cad/cad_glb.h"
#include "scene/files/glb_header.h"
#include "scene/files/source_file.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// What tells whether a GLB still belongs to its CAD file (scene/meshes/cad_file.cpp reads it).
ordered_json extras_of(const CadModel& model, const Tessellation& how) {
  ordered_json sources = ordered_json::array();
  for (const CadSource& source : model.sources)
    sources.push_back({{"name", source.name}, {"fingerprint", source.fingerprint}});
  return {{"limn_cad",
           {{"format", scene::k_cad_glb_format},
            {"chord_mm", how.chord_mm},
            {"angle_deg", how.angle_deg},
            {"metres_per_unit", model.metres_per_unit},
            {"sources", sources},
            {"warnings", model.warnings}}}};
}

// A file's name for a solid: without slashes and control characters, and not hidden.
std::string file_name(const std::string& name) {
  constexpr std::size_t k_longest = 100;  // bytes
  std::string text = name;
  for (char& c : text)
    if (std::iscntrl(static_cast<unsigned char>(c)) || c == '/' || c == '\\') c = '_';
  if (text.starts_with('.') || text.starts_with('~')) text.front() = '_';
  if (text.size() > k_longest) {
    std::size_t end = k_longest;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;  // inside a letter
    text.resize(end);
  }
  return text.empty() ? "part" : text;
}

// The name of the CAD file that a GLB was made of; empty if it was not made of one.
std::string made_of(const fs::path& glb) {
  try {
    return ordered_json::parse(scene::glb_header(glb))
        .at("asset")
        .at("extras")
        .at("limn_cad")
        .at("sources")
        .at(0)
        .at("name");
  } catch (const nlohmann::json::exception&) {
    return "";
  }
}

// The files of an earlier run on the same CAD file, without those in `now`.
std::vector<std::string> earlier_files(const fs::path& folder,
                                       const std::string& cad,
                                       const std::set<std::string>& now) {
  std::vector<std::string> files;
  std::error_code none;
  for (fs::directory_iterator at(folder, none), end; !none && at != end; at.increment(none)) {
    const fs::path& path = at->path();
    if (path.extension() == ".glb" && !now.contains(path.stem().string()) && made_of(path) == cad)
      files.push_back(as_utf8(path.filename().string()));
  }
  std::sort(files.begin(), files.end());
  return files;
}

ordered_json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

Result<WrittenParts> write_parts(const CadModel& model,
                                 TakenAs as,
                                 const Tessellation& how,
                                 const fs::path& out) {
  const ordered_json extras = extras_of(model, how);
  WrittenParts written;
  if (as == TakenAs::part) {
    LIMN_TRY_STATUS(write_file(out, encode_cad_glb(model, model.nodes, extras)));
    written.parts.push_back({out.stem().string(), out});
    return written;
  }
  const std::string& cad = model.sources.front().name;
  std::set<std::string> names;
  std::set<std::size_t> meshes;
  LIMN_TRY_STATUS(make_folder(out));
  LIMN_TRY_STATUS(write_together(out, [&](const fs::path& into) -> Status {
    for (const CadNode& node : model.nodes) {
      if (!meshes.insert(node.mesh).second && as == TakenAs::variants) continue;
      const std::string base = file_name(node.name);
      std::string name = base;
      for (int number = 2; !names.insert(name).second; ++number) name = fmt::format("{} {}", base, number);
      const fs::path file = out / (name + ".glb");
      if (std::error_code none; fs::exists(file, none) && made_of(file) != cad)
        return error(
            "{}: expected no file or one that was made of {}, found another file. Move it away, or choose "
            "another folder.",
            file.string(), cad);
      LIMN_TRY_STATUS(write_file(into / file.filename(), encode_cad_glb(model, std::span(&node, 1), extras)));
      written.parts.push_back({name, file});
    }
    return {};
  }));
  if (const auto files = earlier_files(out, cad, names); !files.empty())
    written.warnings.push_back(
        fmt::format("{} also has files of an earlier import of this file, which stay: {}", out.string(),
                    fmt::join(files, ", ")));
  return written;
}

ordered_json cad_report(const CadModel& model, const Tessellation& how, const WrittenParts& written) {
  ordered_json json = {{"schema", "limn.cad/1"},
                       {"format", model.format},
                       {"application_protocol", model.schema},
                       {"unit", model.unit},
                       {"metres_per_unit", model.metres_per_unit},
                       {"chord_mm", how.chord_mm},
                       {"angle_deg", how.angle_deg}};
  double chord_error_mm = 0;
  json["solids"] = ordered_json::array();
  for (const CadNode& node : model.nodes) {
    const CadMesh& mesh = model.meshes[node.mesh];
    chord_error_mm = std::max(chord_error_mm, mesh.chord_error_mm);
    const CadBox box = box_of(model, node);
    ordered_json colours = ordered_json::array();
    for (const CadPiece& piece : mesh.pieces) colours.push_back(piece.colour);
    json["solids"].push_back({{"name", node.name},
                              {"path", node.path},
                              {"mesh", node.mesh},
                              {"box_m", {list(box.low), list(box.high)}},
                              {"triangles", mesh.triangle_count()},
                              {"chord_error_mm", mesh.chord_error_mm},
                              {"closed", mesh.is_closed},
                              {"colours", colours}});
  }
  json["meshes"] = model.meshes.size();
  json["triangles"] = model.triangle_count();
  json["chord_error_mm"] = chord_error_mm;
  json["files"] = ordered_json::array();
  for (const WrittenPart& part : written.parts)
    json["files"].push_back({{"name", part.name}, {"file", part.file.string()}});
  json["warnings"] = model.warnings;
  for (const std::string& warning : written.warnings) json["warnings"].push_back(warning);
  return json;
}

}  // namespace limn::cad
