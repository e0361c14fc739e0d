#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn {

/// Whole content of a file.
Result<std::string> read_file(const std::filesystem::path& path);

/// Writes a temporary file in the same folder and renames it, so that `path` has either its old content or
/// all of the new one. A read-only folder or a full disk is an error that names the file.
Status write_file(const std::filesystem::path& path, std::string_view content);

/// Appends all of `content` or nothing; the old content stays.
Status append_file(const std::filesystem::path& path, std::string_view content);

/// Makes the folder and its parents if they are absent, and checks that the folder is writable.
Status make_folder(const std::filesystem::path& path);

}  // namespace limn
