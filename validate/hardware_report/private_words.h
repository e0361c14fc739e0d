#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace limn::validate {

/// Replaces what would say whose machine this is: the machine's, the user's and the home folder's name,
/// network addresses, and numbers that look like serial numbers (ten or more characters with six digits).
class PrivateWords {
 public:
  /// Those of this machine.
  static PrivateWords of_this_machine();

  explicit PrivateWords(std::vector<std::pair<std::string, std::string>> replaced)
      : replaced_(std::move(replaced)) {}

  std::string without(std::string text) const;
  /// All texts in it.
  nlohmann::ordered_json json_without(const nlohmann::ordered_json& json) const;

 private:
  std::vector<std::pair<std::string, std::string>> replaced_;  // word -> what stands for it
};

}  // namespace limn::validate
