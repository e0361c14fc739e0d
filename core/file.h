#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn {

/// Whole content of a file.
Result<std::string> read_file(const std::filesystem::path& path);

/// Writes through a temporary file in the same folder, then renamed: `path` is either old or complete.
/// A read-only folder or a full disk is an error that names it.
Status write_file(const std::filesystem::path& path, std::string_view content);

/// Writes at the file's end, all of it or nothing: what was there stays.
Status append_file(const std::filesystem::path& path, std::string_view content);

/// Makes the folder and its parents where absent and checks that it can be written.
Status make_folder(const std::filesystem::path& path);

}  // namespace limn
