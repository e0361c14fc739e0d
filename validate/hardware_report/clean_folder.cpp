#include "validate/hardware_report/clean_folder.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "core/file.h"
#include "validate/hardware_report/image_metadata.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> entries_in(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code none;
  for (fs::recursive_directory_iterator at(folder, none), end; !none && at != end; at.increment(none))
    entries.push_back(at->path());
  return entries;
}

bool is_unneeded(const fs::path& path) {
  static const std::set<std::string> k_names = {"comments.json", "pairings.json", "looks"};
  static const std::set<std::string> k_kinds = {".pem", ".key", ".crt", ".cer", ".p12", ".pfx"};
  return fs::is_symlink(path) || k_names.contains(path.filename().string()) ||
         k_kinds.contains(path.extension().string());
}

bool is_text(const fs::path& path) {
  static const std::set<std::string> k_kinds = {".json", ".jsonl",       ".csv",  ".html", ".txt",
                                                ".log",  ".cameramodel", ".gltf", ".mtl",  ".yml",
                                                ".xml",  ".md",          ".svg"};
  return k_kinds.contains(path.extension().string());
}

}  // namespace

Status remove_unneeded(const fs::path& folder) {
  for (const fs::path& path : entries_in(folder)) {
    std::error_code failure;
    if (!is_unneeded(path)) continue;
    fs::remove_all(path, failure);
    if (failure)
      return error("{}: expected to remove it from the report: {}.", path.string(), failure.message());
  }
  return {};
}

Status clean_folder(const fs::path& folder, const PrivateWords& words) {
  for (const fs::path& path : entries_in(folder)) {
    const bool is_jpeg = path.extension() == ".jpg" || path.extension() == ".jpeg";
    if (!fs::is_regular_file(path) || !(is_jpeg || is_text(path))) continue;
    LIMN_TRY(const std::string old, read_file(path));
    if (is_jpeg) {
      if (const auto image = without_metadata(old)) LIMN_TRY_STATUS(write_file(path, *image));
      continue;
    }
    const std::string cleaned = words.without(old);
    if (cleaned != old) LIMN_TRY_STATUS(write_file(path, cleaned));
  }
  return {};
}

}  // namespace limn::validate
