#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace limn::validate {

/// Replaces what would say whose machine this is. Known words are replaced wherever they stand alone, in
/// capitals or not, also as JSON, HTML and addresses write them. As a second net, what has the form of an
/// address or of a serial number in a device's path is replaced. Versions and numbers stay.
class PrivateWords {
 public:
  PrivateWords() = default;

  /// `by` stands for `word` from now on. Words that are too short or too common to identify anybody (`root`,
  /// `camera`, under three characters, under six digits alone) are not added.
  void add(const std::string& word, const std::string& by);

  /// The text without known words and without what has the form of a private one. It may be a whole file:
  /// JSON, HTML and CSV stay what they are.
  std::string without(const std::string& text) const;
  /// All texts in it, names of members included.
  nlohmann::ordered_json json_without(const nlohmann::ordered_json& json) const;
  /// Whether a known word is in the text.
  bool is_in(const std::string& text) const;

 private:
  std::string without_known(const std::string& text) const;

  std::vector<std::pair<std::string, std::string>> replaced_;  // word, in small letters -> what stands for it
};

}  // namespace limn::validate
