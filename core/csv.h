#pragma once

#include <string>
#include <string_view>

namespace limn {

/// The text as a field of a CSV file (RFC 4180): in quotes if it holds a comma, a quote, a line break, or a
/// blank at its ends. Bytes that are not UTF-8 become U+FFFD.
std::string csv_field(std::string_view text);

}  // namespace limn
