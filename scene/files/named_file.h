#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace limn::scene {

/// A file that another file names.
struct NamedFile {
  std::filesystem::path path;
  bool is_other_case = false;  ///< Whether only a file whose letters differ in case was found.
};

/// Finds a file that a file in `folder` names: with slashes or backslashes, relative or (of another machine)
/// absolute, with blanks at the ends, percent-encoded, in other upper and lower case. The bare name in the
/// folder is tried, too. Nullopt: there is no such file.
std::optional<NamedFile> find_named_file(const std::filesystem::path& folder, const std::string& name);

/// The text with each %XX replaced by its byte (RFC 3986).
std::string percent_decoded(const std::string& text);

/// The bytes of a data: URI (RFC 2397), base64 or percent-encoded. Nullopt: the text is no data: URI or holds
/// other characters.
std::optional<std::string> data_uri_bytes(const std::string& uri);

/// The text without blanks, tabs and line ends at both ends.
std::string trimmed(const std::string& text);

}  // namespace limn::scene
