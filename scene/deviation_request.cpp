#include "scene/deviation_request.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

namespace limn::scene {
namespace {

using What = DeviationRequest::What;

constexpr double k_most_box_mm = 20'000;
constexpr double k_least_tolerance_mm = 0.05, k_most_tolerance_mm = 2;

// The words of the text, without blanks and commas.
std::vector<std::string> words_of(std::string text) {
  std::ranges::replace(text, ',', ' ');
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

// Numbers of at most `most`; empty when a word is not one.
std::vector<double> numbers_of(std::span<const std::string> words, double most) {
  std::vector<double> numbers;
  for (const std::string& word : words) {
    std::istringstream stream(word);
    double number = 0;
    std::string rest;
    if (!(stream >> number) || stream >> rest || !(std::abs(number) <= most)) return {};
    numbers.push_back(number);
  }
  return numbers;
}

Result<DeviationRequest> fit_request(const std::string& action, std::span<const std::string> words) {
  if (words.size() == 1 && words[0] == "off") return DeviationRequest{.what = What::fit_all};
  const std::vector<double> mm = numbers_of(words, k_most_box_mm);
  if (mm.size() != 6)
    return error(
        "{}: fit: expected off, or X Y Z X Y Z of two corners in mm of the prototype's frame, at most {:g}, "
        "found {} words.",
        action, k_most_box_mm, words.size());
  DeviationRequest request{.what = What::fit_box};
  for (const std::size_t first : {std::size_t{0}, std::size_t{3}})
    request.box.extend(1e-3 * Eigen::Vector3d(mm[first], mm[first + 1], mm[first + 2]));
  if (!(request.box.sizes().minCoeff() > 0))
    return error("{}: fit: expected two corners that differ along x, y and z, found a flat box.", action);
  return request;
}

Result<DeviationRequest> tolerance_request(const std::string& action, std::span<const std::string> words) {
  const std::vector<double> mm = numbers_of(words, k_most_tolerance_mm);
  if (mm.size() != 1 || mm[0] < k_least_tolerance_mm)
    return error("{}: tolerance: expected {:g} to {:g} mm, found '{}'.", action, k_least_tolerance_mm,
                 k_most_tolerance_mm, words.empty() ? "" : words[0]);
  return DeviationRequest{.what = What::tolerance, .tolerance_m = 1e-3 * mm[0]};
}

}  // namespace

Result<DeviationRequest> parse_deviation_request(const std::string& action, const std::string& text) {
  const std::vector<std::string> words = words_of(text);
  if (words.empty()) return DeviationRequest{};
  const std::span rest = std::span(words).subspan(1);
  const std::string& first = words[0];
  if (first == "fit") return fit_request(action, rest);
  if (first == "tolerance") return tolerance_request(action, rest);
  if (first == "hold" && rest.size() == 1 && rest[0] == "on") return DeviationRequest{.what = What::hold};
  if (first == "hold" && rest.size() == 1 && rest[0] == "off") return DeviationRequest{.what = What::release};
  const std::pair<const char*, What> plain[] = {{"scan", What::scan},
                                                {"on", What::on},
                                                {"off", What::off},
                                                {"toggle", What::toggle},
                                                {"report", What::report}};
  for (const auto& [word, what] : plain)
    if (first == word && rest.empty()) return DeviationRequest{.what = what};
  return error(
      "{}: expected scan, on, off, toggle, hold on, hold off, fit X Y Z X Y Z, fit off, tolerance MM or "
      "report, found '{}'.",
      action, text);
}

}  // namespace limn::scene
