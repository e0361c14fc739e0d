#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn {

/// Whole content of a file.
Result<std::string> read_file(const std::filesystem::path& path);

/// Writes a temporary file in the same folder and renames it, so that `path` has either its old content or
/// all of the new one. A read-only folder or a full disk is an error that names the file.
Status write_file(const std::filesystem::path& path, std::string_view content);

/// Writes several files into `folder`, all of them or none: `write` writes them into an empty folder, from
/// which they then replace the files of the same names. Error, and the old files stay: `write` failed (its
/// message names `folder`), or a file cannot be replaced.
Status write_together(const std::filesystem::path& folder,
                      const std::function<Status(const std::filesystem::path& into)>& write);

/// Appends all of `content` or nothing; the old content stays.
Status append_file(const std::filesystem::path& path, std::string_view content);

/// Makes the folder and its parents if they are absent, and checks that the folder is writable.
Status make_folder(const std::filesystem::path& path);

}  // namespace limn
