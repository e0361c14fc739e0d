#include "scene/kept_files.h"

#include <unistd.h>

#include <cerrno>
#include <map>
#include <system_error>

#include "core/user_folder.h"

namespace limn::scene {

namespace fs = std::filesystem;

fs::path kept_folder(const fs::path& scene_folder) {
  if (::access(scene_folder.c_str(), W_OK) == 0) return scene_folder;
  std::error_code failed;
  const fs::path whole = fs::canonical(scene_folder, failed);
  const auto own = user_data_folder();
  if (failed || !own) return scene_folder;
  return *own / "scenes" / whole.relative_path();
}

Status check_kept_folder(const fs::path& scene_folder) {
  if (::access(scene_folder.c_str(), W_OK) == 0) return {};
  if (const auto own = user_data_folder(); !own)
    return error("{}: cannot be written here, and no folder of the user can take its place. {}",
                 scene_folder.string(), own.message());
  fs::path there = kept_folder(scene_folder);
  std::error_code ignored;
  while (!fs::exists(there, ignored) && there.has_relative_path()) there = there.parent_path();
  if (::access(there.c_str(), W_OK | X_OK) == 0) return {};
  return error(
      "{}: expected to write here what is made of {}, found: {}. Make the folder writable, or set "
      "XDG_DATA_HOME "
      "to another.",
      there.string(), scene_folder.string(), std::generic_category().message(errno));
}

fs::path kept_file(const fs::path& scene_folder, const fs::path& name) {
  std::error_code ignored;
  const fs::path kept = kept_folder(scene_folder) / name;
  return fs::exists(kept, ignored) ? kept : scene_folder / name;
}

std::vector<fs::path> look_files(const fs::path& scene_folder) {
  std::map<fs::path, fs::path> by_name;
  for (const fs::path& folder : {kept_folder(scene_folder), scene_folder}) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder / "looks", none))
      if (entry.path().extension() == ".json") by_name.try_emplace(entry.path().filename(), entry.path());
  }
  std::vector<fs::path> files;
  for (const auto& [name, file] : by_name) files.push_back(file);
  return files;
}

}  // namespace limn::scene
