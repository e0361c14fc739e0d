#include "core/csv.h"

#include "core/utf8.h"

namespace limn {

std::string csv_field(std::string_view text) {
  const std::string field = as_utf8(text);
  const bool has_blank_end = !field.empty() && (field.front() == ' ' || field.back() == ' ');
  if (!has_blank_end && field.find_first_of(",\"\r\n") == std::string::npos) return field;
  std::string quoted = "\"";
  for (const char c : field) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace limn
