#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace limn {

/// JSON (nlohmann::json or ordered_json) as text, in one line or with `indent` blanks a level. Bytes in it
/// that are not UTF-8 become U+FFFD, so that every value can be written.
template <class Json = nlohmann::ordered_json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace limn
