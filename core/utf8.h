#pragma once

#include <string>
#include <string_view>

namespace limn {

/// Whether the bytes are UTF-8. File names, datagrams and device names need not be.
bool is_utf8(std::string_view text);

/// The text with each sequence of bytes that is not UTF-8 replaced by U+FFFD.
std::string as_utf8(std::string_view text);

}  // namespace limn
