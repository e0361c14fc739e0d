#include "exchange/cad/cad_output.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "core/file.h"
#include "exchange/cad/cad_glb.h"
#include "scene/files/source_file.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// What tells whether a GLB still belongs to its CAD file (scene/cad_file.cpp reads it).
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

ordered_json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

Result<std::vector<WrittenPart>> write_parts(const CadModel& model,
                                             TakenAs as,
                                             const Tessellation& how,
                                             const fs::path& out) {
  const ordered_json extras = extras_of(model, how);
  std::vector<WrittenPart> written;
  if (as == TakenAs::part) {
    LIMN_TRY_STATUS(write_file(out, encode_cad_glb(model, model.nodes, extras)));
    written.push_back({out.stem().string(), out});
    return written;
  }
  LIMN_TRY_STATUS(make_folder(out));
  std::set<std::string> names;
  std::set<std::size_t> meshes;
  for (const CadNode& node : model.nodes) {
    if (!meshes.insert(node.mesh).second && as == TakenAs::variants) continue;
    const std::string base = file_name(node.name);
    std::string name = base;
    for (int number = 2; !names.insert(name).second; ++number) name = fmt::format("{} {}", base, number);
    const fs::path file = out / (name + ".glb");
    LIMN_TRY_STATUS(write_file(file, encode_cad_glb(model, std::span(&node, 1), extras)));
    written.push_back({name, file});
  }
  return written;
}

ordered_json cad_report(const CadModel& model,
                        const Tessellation& how,
                        const std::vector<WrittenPart>& written) {
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
  for (const WrittenPart& part : written)
    json["files"].push_back({{"name", part.name}, {"file", part.file.string()}});
  json["warnings"] = model.warnings;
  return json;
}

}  // namespace limn::cad
