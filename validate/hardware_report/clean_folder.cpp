#include "validate/hardware_report/clean_folder.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "validate/hardware_report/image_metadata.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

Result<std::vector<fs::path>> entries_in(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code failure;
  if (!fs::exists(folder, failure) && !failure) return entries;
  for (fs::recursive_directory_iterator at(folder, failure), end; !failure && at != end;
       at.increment(failure))
    entries.push_back(at->path());
  if (failure)
    return error("{}: expected to read this folder, to take private words out of it: {}.", folder.string(),
                 failure.message());
  return entries;
}

std::string lower_extension(const fs::path& path) {
  std::string kind = path.extension().string();
  std::ranges::transform(kind, kind.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return kind;
}

bool is_unneeded(const fs::path& path) {
  static const std::set<std::string> k_names = {"comments.json", "pairings.json", "drawn.json", "looks"};
  static const std::set<std::string> k_kinds = {".pem", ".key", ".crt", ".cer", ".p12", ".pfx"};
  std::error_code none;
  return fs::is_symlink(path, none) || k_names.contains(path.filename().string()) ||
         k_kinds.contains(lower_extension(path));
}

bool is_text(const fs::path& path) {
  static const std::set<std::string> k_kinds = {".json", ".jsonl",       ".csv",  ".html", ".txt",
                                                ".log",  ".cameramodel", ".gltf", ".mtl",  ".yml",
                                                ".xml",  ".md",          ".svg"};
  return k_kinds.contains(lower_extension(path));
}

// In JSON, names of values and numbers stay: programs read them. Other text is cleaned as text.
std::string json_without(const std::string& text, const PrivateWords& words, int indent) {
  const auto json = nlohmann::ordered_json::parse(text, nullptr, false);
  if (json.is_discarded()) return words.without(text);
  const auto cleaned = words.json_without(json);
  return cleaned == json ? text : json_text(cleaned, indent);
}

std::string lines_without(const std::string& text, const PrivateWords& words) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    out += json_without(text.substr(at, end - at), words, -1);
    if (end < text.size()) out += '\n';
    at = end + 1;
  }
  return out;
}

}  // namespace

Status remove_unneeded(const fs::path& folder) {
  LIMN_TRY(const std::vector<fs::path> entries, entries_in(folder));
  for (const fs::path& path : entries) {
    std::error_code failure;
    if (!is_unneeded(path)) continue;
    fs::remove_all(path, failure);
    if (failure)
      return error("{}: expected to remove it from the report: {}.", path.string(), failure.message());
  }
  return {};
}

Status clean_folder(const fs::path& folder, const PrivateWords& words) {
  LIMN_TRY(const std::vector<fs::path> entries, entries_in(folder));
  for (const fs::path& path : entries) {
    const std::string kind = lower_extension(path);
    const bool is_jpeg = kind == ".jpg" || kind == ".jpeg";
    std::error_code none;
    if (!fs::is_regular_file(path, none) || !(is_jpeg || is_text(path))) continue;
    LIMN_TRY(const std::string old, read_file(path));
    if (is_jpeg) {
      const auto image = without_metadata(old);
      if (!image) {
        log_warning("{}: {} It is removed from the report.", path.string(), image.message());
        std::error_code failure;
        fs::remove(path, failure);
        if (failure)
          return error("{}: expected to remove it from the report: {}.", path.string(), failure.message());
      } else if (*image) {
        LIMN_TRY_STATUS(write_file(path, **image));
      }
      continue;
    }
    const std::string cleaned = kind == ".json"    ? json_without(old, words, 2)
                                : kind == ".jsonl" ? lines_without(old, words)
                                                   : words.without(old);
    if (cleaned != old) LIMN_TRY_STATUS(write_file(path, cleaned));
  }
  return {};
}

}  // namespace limn::validate
