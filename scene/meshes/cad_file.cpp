#include "scene/meshes/cad_file.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/file.h"
#include "core/json_text.h"
#include "core/user_folder.h"
#include "core/utf8.h"
#include "scene/files/glb_header.h"
#include "scene/files/source_file.h"
#include "scene/meshes/read_gltf.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::array<const char*, 4> k_cad_ends = {".step", ".stp", ".iges", ".igs"};
constexpr std::array<const char*, 2> k_kept_ends = {".glb", ".failed"};

// The GLB if it was made with these options from the CAD file as it is.
std::optional<CadGlb> kept_glb(const fs::path& glb, const fs::path& file, const CadOptions& options) {
  try {
    const json header = json::parse(glb_header(glb), nullptr, false);
    if (!header.is_object()) return std::nullopt;
    const json& made = header.at("asset").at("extras").at("limn_cad");
    if (made.value("format", 0) != k_cad_glb_format || made.at("chord_mm") != options.chord_mm ||
        made.at("angle_deg") != options.angle_deg)
      return std::nullopt;
    const json& sources = made.at("sources");
    if (sources.empty()) return std::nullopt;
    for (std::size_t i = 0; i < sources.size(); ++i) {
      const auto name = sources[i].at("name").get<std::string>();
      if (i > 0 && !stays_inside(name)) return std::nullopt;  // anybody may have written this file
      const std::string now = file_fingerprint(i == 0 ? file : file.parent_path() / name);
      if (now != sources[i].at("fingerprint").get<std::string>()) return std::nullopt;
    }
    return CadGlb{glb, made.at("metres_per_unit").get<double>(),
                  made.at("warnings").get<std::vector<std::string>>()};
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

// The CAD files in a file's folder with what changes when they do, if the file refers to others: which of
// them a failure is about only limn-cad knows.
json files_beside(const fs::path& file, const std::string& content) {
  constexpr std::size_t k_most = 10000;
  json files = json::object();
  if (content.find("DOCUMENT_FILE") == std::string::npos) return files;
  std::error_code none;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, none), end;
  for (std::size_t i = 0; !none && at != end && i < k_most; ++i, at.increment(none)) {
    std::error_code gone;
    if (is_cad_name(at->path()) && at->is_regular_file(gone))
      files[as_utf8(at->path().string())] = {at->file_size(gone),
                                             at->last_write_time(gone).time_since_epoch().count()};
  }
  return files;
}

// What tells whether reading a file would fail once more.
json attempt_at(const fs::path& file, const CadOptions& options, const fs::path& program) {
  std::error_code none;
  const auto read = read_file(file);
  const std::string content = read ? *read : "";
  return {{"fingerprint", fingerprint(content)},
          {"beside", files_beside(file, content)},
          {"program", as_utf8(program.string())},
          {"program_bytes", fs::file_size(program, none)},
          {"chord_mm", options.chord_mm},
          {"angle_deg", options.angle_deg},
          {"limits", {options.limits.seconds, options.limits.silent_seconds, options.limits.memory_mb}}};
}

std::optional<Error> kept_failure(const fs::path& failed, const json& attempt) {
  const auto text = read_file(failed);
  const json kept = text ? json::parse(*text, nullptr, false) : json();
  if (!kept.is_object() || kept.value("attempt", json()) != attempt) return std::nullopt;
  const json message = kept.value("message", json());
  if (!message.is_string()) return std::nullopt;
  return Error{message.get<std::string>()};
}

// The folder and the beginning of the names of what is kept of a CAD file.
Result<fs::path> place_of(const fs::path& file) {
  const std::string name = fmt::format(".{}", file.filename().string());
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (access(folder.c_str(), W_OK) == 0) return folder / name;
  LIMN_TRY(const fs::path own, user_cache_folder());
  LIMN_TRY_STATUS(make_folder(own / "cad"));
  std::error_code none;
  return own / "cad" / fmt::format(".{}{}", fingerprint(fs::absolute(file, none).string()), name);
}

fs::path with_end(const fs::path& place, const char* end) { return place.string() + end; }

}  // namespace

bool is_cad_name(const fs::path& path) {
  const std::string end = lower_extension(path);
  return std::find(k_cad_ends.begin(), k_cad_ends.end(), end) != k_cad_ends.end();
}

bool is_cad_cache_name(const fs::path& path) {
  const std::string end = path.extension().string();
  return path.filename().string().starts_with('.') && is_cad_name(path.stem()) &&
         std::find(k_kept_ends.begin(), k_kept_ends.end(), end) != k_kept_ends.end();
}

Result<CadGlb> cad_as_glb(const fs::path& file, const CadOptions& options, const CadWait& wait) {
  LIMN_TRY_STATUS(check_regular_file(file));
  // A folder that was copied, or that cannot be written, may have the GLB beside the file.
  const fs::path beside = file.parent_path() / fmt::format(".{}.glb", file.filename().string());
  if (auto kept = kept_glb(beside, file, options)) return *kept;
  LIMN_TRY(const fs::path place, place_of(file));
  const fs::path glb = with_end(place, ".glb"), failed = with_end(place, ".failed");
  if (glb != beside)
    if (auto kept = kept_glb(glb, file, options)) return *kept;
  LIMN_TRY(const fs::path program, limn_cad_for(file));
  const json attempt = attempt_at(file, options, program);
  if (auto failure = kept_failure(failed, attempt)) return *failure;
  if (wait.unread) {
    wait.unread->push_back(file);
    return error("{}: limn-cad is still reading it. It is loaded when that is done.", file.string());
  }
  const std::vector<std::string> arguments = {"--out",       glb.string(),
                                              "--chord-mm",  fmt::format("{}", options.chord_mm),
                                              "--angle-deg", fmt::format("{}", options.angle_deg)};
  const auto [report, fails_again] = try_limn_cad(file, arguments, options.limits, wait.stop);
  std::error_code none;
  if (report) {
    fs::remove(failed, none);
    if (auto made = kept_glb(glb, file, options)) return *made;
    return error("{}: expected that it stays as it is while limn-cad reads it, found it changed. Try again.",
                 file.string());
  }
  if (fails_again)  // what cannot be written is only read once more
    static_cast<void>(
        write_file(failed, json_text(json{{"attempt", attempt}, {"message", report.message()}})));
  return report.error();
}

MeshContent with_cad_unit(MeshContent content, const CadGlb& glb) {
  for (MeshPiece& piece : content.pieces)
    for (Eigen::Vector3f& p : piece.positions) p /= static_cast<float>(glb.metres_per_unit);
  content.metres_per_unit = glb.metres_per_unit;
  content.warnings.insert(content.warnings.end(), glb.warnings.begin(), glb.warnings.end());
  return content;
}

Result<MeshContent> read_cad(const fs::path& path) {
  LIMN_TRY(const CadGlb glb, cad_as_glb(path));
  LIMN_TRY(MeshContent content, read_gltf(glb.path));
  return with_cad_unit(std::move(content), glb);
}

}  // namespace limn::scene
