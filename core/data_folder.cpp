#include "core/data_folder.h"

#include <dlfcn.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <optional>

#include "core/file.h"
#include "core/version.h"

namespace limn {

namespace fs = std::filesystem;
namespace {

constexpr const char *k_variable = "LIMN_DATA", *k_stamp = "version";
constexpr const char* k_libraries = "liblimn";  // the folder of further libraries beside liblimn.so
// CMake writes this file into the build folder. Its content is the source tree's path.
constexpr const char* k_source_tree = "limn-source-tree";

fs::path own_program() {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored);
}

// The file that this code is in: the program, or liblimn.so.
fs::path own_file() {
  Dl_info info{};
  std::error_code ignored;
  if (!dladdr(reinterpret_cast<const void*>(&own_file), &info) || !info.dli_fname) return {};
  return fs::canonical(info.dli_fname, ignored);
}

std::string trimmed(std::string text) {
  const auto is_space = [](unsigned char letter) { return std::isspace(letter) != 0; };
  text.erase(std::find_if_not(text.rbegin(), text.rend(), is_space).base(), text.end());
  return text;
}

// The build folder that the program is in: the nearest folder above it with the path of a source tree.
std::optional<fs::path> build_folder_of(const fs::path& program) {
  std::error_code ignored;
  for (fs::path folder = program.parent_path(); folder.has_relative_path(); folder = folder.parent_path())
    if (fs::is_regular_file(folder / k_source_tree, ignored)) return folder;
  return {};
}

// Error: the folder's stamp is absent or is that of another version.
Status check_stamp(const fs::path& folder, const DataPlaces& places) {
  const auto stamp = read_file(folder / k_stamp);
  if (!stamp)
    return error(
        "{}: expected the folder of Limn's data with the file '{}' in it, found none. Install Limn again, or "
        "name the folder in {}.",
        folder.string(), k_stamp, k_variable);
  const std::string found = trimmed(*stamp);
  if (found == places.version) return {};
  return error(
      "{}: expected the data of Limn {}, the version of {}, found data of '{}'. Install the program and its "
      "data in the same version{}.",
      (folder / k_stamp).string(), places.version, places.program.string(), found,
      places.chosen.empty() ? std::string(", or name another folder in ") + k_variable
                            : std::string(", or remove ") + k_variable + " from the environment");
}

}  // namespace

Result<fs::path> find_data_folder(const DataPlaces& places) {
  if (places.chosen.empty()) {
    if (const auto build = build_folder_of(places.program)) {
      LIMN_TRY(const std::string source, read_file(*build / k_source_tree));
      const fs::path folder = trimmed(source);
      if (fs::is_directory(folder / "config")) return folder;
      return error(
          "{}: expected the source tree that {} was built from, found none. Configure this build folder "
          "again "
          "(cmake --preset), or name Limn's data folder in {}.",
          folder.string(), places.program.string(), k_variable);
    }
  }
  const fs::path folder = places.chosen.empty()
                              ? (places.program.parent_path() / places.from_program).lexically_normal()
                              : fs::path(places.chosen);
  LIMN_TRY_STATUS(check_stamp(folder, places));
  return folder;
}

Result<fs::path> data_file(std::string_view relative) {
  const char* chosen = std::getenv(k_variable);
  LIMN_TRY(const fs::path folder, find_data_folder({.chosen = chosen ? chosen : "",
                                                    .program = own_program(),
                                                    .from_program = LIMN_DATA_FROM_PROGRAM,
                                                    .version = std::string(version())}));
  return folder / relative;
}

fs::path private_library(std::string_view name) {
  const fs::path program = own_program();
  std::error_code ignored;
  if (const fs::path beside = program.parent_path() / name; fs::exists(beside, ignored)) return beside;
  if (const fs::path own = own_file(); own != program)
    for (const fs::path& folder : {own.parent_path(), own.parent_path() / k_libraries})
      if (fs::exists(folder / name, ignored)) return folder / name;
  if (const auto build = build_folder_of(program)) return *build / name;
  return (program.parent_path() / LIMN_LIBRARIES_FROM_PROGRAM / name).lexically_normal();
}

bool is_development_build() { return build_folder_of(own_program()).has_value(); }

}  // namespace limn
