#include "core/utf8.h"

#include <utf8cpp/utf8.h>

#include <iterator>

namespace limn {

bool is_utf8(std::string_view text) { return utf8::is_valid(text.begin(), text.end()); }

std::string as_utf8(std::string_view text) {
  std::string valid;
  utf8::replace_invalid(text.begin(), text.end(), std::back_inserter(valid));
  return valid;
}

}  // namespace limn
