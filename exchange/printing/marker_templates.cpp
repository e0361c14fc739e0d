#include "exchange/printing/marker_templates.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string_view>

#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/print.h"
#include "tracker/identify.h"
#include "tracker/template_comparison.h"
#include "tracker/template_training.h"

namespace limn::exchange {
namespace {

using tracker::Discriminability;
using tracker::TemplateSimilarity;

std::string_view name_of(Discriminability telling) {
  switch (telling) {
    case Discriminability::confused:
      return "confused";
    case Discriminability::alike:
      return "alike";
    case Discriminability::apart:
      return "apart";
  }
  return "";
}

void print_table(const std::vector<TemplateSimilarity>& pairs) {
  print_out("{:<24} {:<24} {:>6} {:>12}  verdict\n", "template", "and", "turned", "correlation");
  for (const TemplateSimilarity& pair : pairs)
    print_out("{:<24} {:<24} {:>5}° {:>12.3f}  {}\n", pair.a, pair.a == pair.b ? "itself" : pair.b,
              90 * pair.quarter_turns, pair.correlation, name_of(pair.telling));
}

void print_verdict(const TemplateSimilarity& worst) {
  const std::string who = worst.a == worst.b ? worst.a + " and itself turned" : worst.a + " and " + worst.b;
  switch (worst.telling) {
    case Discriminability::confused:
      print_out("Worst: {}: confused, correlation above {:g}: change one of them.\n", who,
                1 - tracker::k_min_rotation_lead);
      return;
    case Discriminability::alike:
      print_out(
          "Worst: {}: alike, correlation of {:g} or more: the detector may mistake one for the other.\n", who,
          tracker::k_min_correlation);
      return;
    case Discriminability::apart:
      print_out("Worst: {}: apart; all can be distinguished.\n", who);
  }
}

std::string similarities_json(const std::vector<TemplateSimilarity>& pairs) {
  nlohmann::json list = nlohmann::json::array();
  for (const TemplateSimilarity& pair : pairs)
    list.push_back({{"a", pair.a},
                    {"b", pair.b},
                    {"quarter_turns", pair.quarter_turns},
                    {"correlation", pair.correlation},
                    {"verdict", name_of(pair.telling)}});
  return json_text(nlohmann::json{{"min_correlation", tracker::k_min_correlation},
                                  {"min_rotation_lead", tracker::k_min_rotation_lead},
                                  {"pairs", list}},
                   1) +
         "\n";
}

}  // namespace

Status train_template(const std::filesystem::path& image,
                      double pattern_ratio,
                      const std::filesystem::path& out) {
  if (!tracker::is_pattern_ratio(pattern_ratio))
    return usage_error("--pattern-ratio: expected {} to {}, found {}.", tracker::k_least_pattern_ratio,
                       tracker::k_most_pattern_ratio, pattern_ratio);
  if (out.extension() != ".patt")
    return usage_error("--out: expected a file that ends in .patt for a template, found '{}'.", out.string());
  LIMN_TRY(const cv::Mat pixels, read_image(image, {.used_bits = k_found_in_image}));
  const auto trained = tracker::train_template(pixels, pattern_ratio);
  if (!trained) return error("{}: {}", image.string(), trained.message());
  LIMN_TRY_STATUS(write_file(out, tracker::template_text(*trained)));
  print_out("{}: the frame at ({:.0f}, {:.0f}), {:.0f} px wide\n", out.string(), trained->corners_px[0].x(),
            trained->corners_px[0].y(), trained->side_px);
  constexpr double k_usual_ratio = 0.5;
  if (pattern_ratio != k_usual_ratio)
    print_out("Name it with its pattern ratio: artoolkit:{}@{:g}\n", out.string(), pattern_ratio);
  return {};
}

Status compare_templates(const std::vector<std::filesystem::path>& files, const std::filesystem::path& json) {
  std::vector<std::string> names;
  for (const auto& file : files) names.push_back("artoolkit:" + file.string());
  LIMN_TRY(const tracker::Families families, tracker::Families::load(names));
  const auto& templates = families.templates();
  for (const auto& pattern : templates)
    if (pattern.size != templates.front().size)
      return error("{}: expected {} values on each side as in {}, found {}. Train both in the same size.",
                   pattern.id, templates.front().size, templates.front().id, pattern.size);
  const auto pairs = tracker::compared(templates);
  print_table(pairs);
  print_verdict(pairs.front());
  if (!json.empty()) LIMN_TRY_STATUS(write_file(json, similarities_json(pairs)));
  return {};
}

}  // namespace limn::exchange
