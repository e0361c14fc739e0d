#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn {

/// A file or folder that comes with Limn, such as "config/worlds/studio.json" or "remote/web". `relative` is
/// its path in the data folder, which is the same in the source tree. The data folder is
///   1. the folder that the environment variable LIMN_DATA names,
///   2. the source tree, if the program is in a build folder,
///   3. ../share/limn, seen from the program.
/// Errors: there is no such folder; it has no stamp (`version`), or that of another version of Limn.
Result<std::filesystem::path> data_file(std::string_view relative);

/// Where a shared library that comes with Limn is expected: beside the program; where this code is in
/// liblimn.so, beside that or in the folder liblimn/ beside it; in the build folder that the program is in;
/// else in Limn's folder for libraries, seen from the program (../lib/limn or ../lib/MACHINE/limn).
std::filesystem::path private_library(std::string_view name);

/// Whether the program is in a build folder, so that it reads the source tree unless LIMN_DATA names another
/// folder.
bool is_development_build();

/// What decides where the data folder is; data_file() fills it for this program.
struct DataPlaces {
  std::string chosen = {};                               ///< The value of LIMN_DATA; "": not set.
  std::filesystem::path program = {};                    ///< The program's own file.
  std::filesystem::path from_program = "../share/limn";  ///< From the program's folder to the data folder.
  std::string version = {};                              ///< The version that the data must have.
};

/// The data folder by the rules of data_file().
Result<std::filesystem::path> find_data_folder(const DataPlaces& places);

}  // namespace limn
