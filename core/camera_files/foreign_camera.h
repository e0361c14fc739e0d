#pragma once

#include <optional>
#include <string_view>

namespace limn {

/// A camera file's format that Limn does not read.
struct ForeignFormat {
  std::string_view name;  ///< "a numpy archive (.npz)"
  std::string_view help;  ///< What to do: a whole sentence.
};

/// Recognises formats that Limn does not read, by how the bytes start or by words in the text; nullopt: it is
/// none of them.
std::optional<ForeignFormat> foreign_format(std::string_view bytes);

}  // namespace limn
