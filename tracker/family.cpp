#include "tracker/family.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "core/file.h"
#include "core/log.h"
#include "core/names.h"
#include "core/opencv_markers.h"
#include "core/predefined_family.h"
#include "tracker/apriltag_codes.h"
#include "tracker/aruco_mip.h"
#include "tracker/barcode.h"
#include "tracker/opencv_file.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

// Largest probability that a quad with random cells passes as a marker. Clutter gives some hundred quads an
// image, and the border and margin tests of identify.cpp reject all but one in 1000 of them.
constexpr double k_max_random_hit = 2e-4;
constexpr int k_max_cells = 7;  // 49 bits: OpenCV's largest code
constexpr int k_max_codes = 100000;
constexpr std::size_t k_max_compared = 20000;  // comparing all pairs of more codes takes seconds
// The largest ARToolKit pattern resolution that is accepted (ARToolKit's own AR_PATT_SIZE1_MAX).
constexpr int k_max_template_size = 64;
constexpr const char* k_aruco_file = "aruco:";
constexpr const char* k_artoolkit = "artoolkit";
constexpr std::string_view k_inverted = "_inverted";
constexpr std::string_view k_mip = "aruco_mip_36h12";
constexpr int k_min_wide_cells =
    5;  // cells along a side of codes that are also read in a border of two cells

std::string known_families() {
  return joined_names(predefined_families()) + ", " + std::string(k_mip) + ", " +
         joined_names(apriltag3_families()) + ", " + joined_names(barcodes()) +
         ", aruco:FILE.yml, artoolkit:FILE.patt (FILE.patt@0.8 where the pattern is 0.8 of the square wide). "
         "White on black: with _inverted, such as aruco_4x4_50_inverted or artoolkit_inverted:FILE.patt";
}

// A family's name without the word for inverted colours.
struct FamilyWord {
  std::string name;
  bool inverted = false;
};

FamilyWord without_inverted(const std::string& name) {
  const std::size_t end = std::min(name.find(':'), name.size());
  if (!name.substr(0, end).ends_with(k_inverted)) return {name, false};
  return {name.substr(0, end - k_inverted.size()) + name.substr(end), true};
}

// The same with the word for inverted colours.
std::string with_inverted(const std::string& name) {
  const std::size_t end = std::min(name.find(':'), name.size());
  return name.substr(0, end) + std::string(k_inverted) + name.substr(end);
}

// The smallest Hamming distance between two codes of a family in any rotation, or between a code and itself
// turned: marker a, and marker b turned by k quarters.
struct NearestCodes {
  int distance = 64;
  std::size_t a = 0, b = 0, k = 0;
};

NearestCodes nearest_codes(const CodeFamily& family) {
  NearestCodes nearest{.distance = family.grid.bits};
  const auto compare = [&](std::size_t a, std::size_t b, std::size_t k) {
    const int distance = std::popcount(family.codes[a][0] ^ family.codes[b][k]);
    if (distance < nearest.distance) nearest = {distance, a, b, k};
  };
  for (std::size_t i = 0; i < family.codes.size(); ++i) {
    for (std::size_t k = 1; k < 4; ++k) compare(i, i, k);
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < 4; ++k) compare(j, i, k);
  }
  return nearest;
}

// Negative when even an error-free reading of the other bits does not determine the code.
int correctable_errors(const CodeFamily& family, int distance, int hidden) {
  const int bits = family.grid.bits - hidden;
  const int unique = distance > hidden ? (distance - hidden - 1) / 2 : -1;
  double words_with = 1;  // binomial(bits, errors)
  double words = 0;
  for (int errors = 0;; ++errors) {
    words += words_with;
    words_with *= static_cast<double>(bits - errors) / (errors + 1);
    const double hit = 4 * static_cast<double>(family.codes.size()) * words / std::ldexp(1.0, bits);
    if (hit > k_max_random_hit || errors > unique) return errors - 1;
  }
}

// Whether random cells show one of the codes so often that no error can be corrected.
bool is_dense(const CodeFamily& family) {
  return 4 * static_cast<double>(family.codes.size()) > std::ldexp(k_max_random_hit, family.grid.bits);
}

// A code without errors is always read, whatever the family's size.
std::vector<int> correctable_errors(const CodeFamily& family, int distance) {
  if (is_dense(family)) return {0};
  std::vector<int> errors = {std::max(0, correctable_errors(family, distance, 0))};
  for (int hidden = 1;; ++hidden) {
    const int more = correctable_errors(family, distance, hidden);
    if (more < 0) return errors;
    errors.push_back(more);
  }
}

std::vector<int> correctable_errors(const CodeFamily& family) {
  if (is_dense(family)) return {0};
  const bool compared = family.codes.size() <= k_max_compared;
  return correctable_errors(family, compared ? nearest_codes(family).distance : 1);
}

CodeFamily empty_family(const std::string& name, int cells) {
  CodeFamily family;
  family.name = name;
  family.cells = cells;
  family.grid = grid_inside_border(cells, 1);
  return family;
}

Result<CodeFamily> from_opencv(const std::string& name, int number) {
  LIMN_TRY(const OpencvDictionary dictionary, opencv_dictionary(number));
  CodeFamily family = empty_family(name, dictionary.cells);
  for (const std::uint64_t code : dictionary.codes) family.codes.push_back(four_turns(code, family.grid));
  family.max_errors = correctable_errors(family);
  return family;
}

CodeFamily from_mip(const std::string& name) {
  CodeFamily family = empty_family(name, 6);
  for (const std::uint64_t code : aruco_mip_36h12()) family.codes.push_back(four_turns(code, family.grid));
  family.max_errors = correctable_errors(family);
  return family;
}

CodeFamily from_apriltag3(const std::string& name) {
  const ApriltagCodes source = apriltag3_codes(name);
  CodeFamily family;
  family.name = name;
  family.cells = source.grid.side() - 2;
  family.grid = source.grid;
  family.light_on_dark = true;
  for (const std::uint64_t code : source.codes) family.codes.push_back(four_turns(code, family.grid));
  family.max_errors = correctable_errors(family, source.distance);
  return family;
}

CodeFamily from_barcode(const std::string& name, const Barcode& barcode) {
  CodeFamily family = empty_family(name, barcode.cells);
  family.border_cells = 0.5 * barcode.cells;
  for (std::size_t id = 0; id < barcode.ids(); ++id)
    family.codes.push_back(four_turns(barcode_cells(barcode, id), family.grid));
  family.max_errors = correctable_errors(family);
  return family;
}

Result<std::uint64_t> code_of_text(const std::string& text, int cells, const std::string& where) {
  const auto bits = static_cast<std::size_t>(cells * cells);
  if (text.size() != bits || text.find_first_not_of("01") != std::string::npos)
    return error("{}: expected {} characters 0 or 1 (markersize {} squared), found \"{}\"", where, bits,
                 cells, text.substr(0, 80));
  std::uint64_t code = 0;
  for (const char c : text) code = (code << 1) | std::uint64_t{c == '1'};
  return code;
}

Error alike(const std::filesystem::path& path, std::size_t a, std::size_t b, std::size_t quarters) {
  const std::string turned = quarters == 0 ? "" : fmt::format(" turned by {} degrees", 90 * quarters);
  const std::string pair = a == b ? fmt::format("marker_{} looks the same{}", a, turned)
                                  : fmt::format("marker_{} and marker_{}{} look the same", a, b, turned);
  return error("{}: {}, expected markers that can be told apart. Give {} other cells.", path.string(), pair,
               a == b ? "it" : "one of them");
}

// An error where two markers cannot be told apart, or a marker and itself turned; a warning where one or two
// wrong cells make one of the other.
Status check_distinct(const CodeFamily& family, const std::filesystem::path& path) {
  std::map<std::uint64_t, std::size_t> known;  // the ids, by the code
  for (std::size_t id = 0; id < family.codes.size(); ++id) {
    const auto& turns = family.codes[id];
    for (std::size_t k = 1; k < 4; ++k)
      if (turns[k] == turns[0]) return alike(path, id, id, k);
    for (std::size_t k = 0; k < 4; ++k)
      if (const auto other = known.find(turns[k]); other != known.end())
        return alike(path, other->second, id, k);
    known.emplace(turns[0], id);
  }
  if (family.codes.size() > k_max_compared) return {};
  constexpr int k_few = 2;
  if (const NearestCodes near = nearest_codes(family); near.distance <= k_few)
    log_warning(
        "{}: marker_{} and marker_{}{} differ in {} of {} cells only: a wrong cell may be read as the other "
        "marker. No wrong cell is corrected.",
        path.string(), near.a, near.b, near.k == 0 ? "" : fmt::format(" turned by {} degrees", 90 * near.k),
        near.distance, family.grid.bits);
  return {};
}

Result<CodeFamily> load_dictionary(const std::filesystem::path& path) {
  LIMN_TRY(const std::string text, read_file(path));
  const auto file = OpencvFile::parse(text);
  if (!file) return error("{}: expected an OpenCV dictionary file: {}", path.string(), file.message());
  const auto count = file->integer("nmarkers");
  const auto cells = file->integer("markersize");
  if (!count || !cells)
    return error("{}: expected integers nmarkers and markersize, found none. Use an OpenCV dictionary file.",
                 path.string());
  if (*cells < 3 || *cells > k_max_cells)
    return error("{}: markersize: expected 3 to {}, found {}", path.string(), k_max_cells, *cells);
  if (*count < 1 || *count > k_max_codes)
    return error("{}: nmarkers: expected 1 to {}, found {}", path.string(), k_max_codes, *count);
  CodeFamily family = empty_family(k_aruco_file + path.filename().string(), *cells);
  for (int id = 0; id < *count; ++id) {
    const std::string key = "marker_" + std::to_string(id);
    const OpencvFile::Value* bits = file->find(key);
    if (!bits)
      return error("{}: {}: expected a text of bits because nmarkers is {}, found none", path.string(), key,
                   *count);
    LIMN_TRY(const std::uint64_t code, code_of_text(bits->text, family.cells, path.string() + ": " + key));
    family.codes.push_back(four_turns(code, family.grid));
  }
  LIMN_TRY_STATUS(check_distinct(family, path));
  family.max_errors = correctable_errors(family);
  return family;
}

std::vector<double> numbers_in(const std::string& text, bool* only_numbers) {
  std::vector<double> values;
  const char* at = text.c_str();
  const char* end = at + text.size();
  *only_numbers = true;
  while (true) {
    while (at < end && std::isspace(static_cast<unsigned char>(*at))) ++at;
    if (at >= end) return values;
    double value = 0;
    const auto [rest, problem] = std::from_chars(at, end, value);
    if (problem != std::errc{} || !std::isfinite(value) || value < 0 || value > 255) {
      *only_numbers = false;
      return values;
    }
    values.push_back(value);
    at = rest;
  }
}

// Scales to zero mean and unit length; empty when all values are equal.
std::vector<float> normalised(const std::vector<float>& values) {
  double mean = 0;
  for (const float v : values) mean += v;
  mean /= static_cast<double>(values.size());
  double square = 0;
  for (const float v : values) square += (v - mean) * (v - mean);
  if (square < 1e-9) return {};
  std::vector<float> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    result[i] = static_cast<float>((values[i] - mean) / std::sqrt(square));
  return result;
}

std::vector<float> turned(const std::vector<float>& values, int size) {
  std::vector<float> result(values.size());
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column)
      result[static_cast<std::size_t>(row * size + column)] =
          values[static_cast<std::size_t>((size - 1 - column) * size + row)];
  return result;
}

// The numbers of the first line that is not blank.
std::size_t numbers_in_first_line(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  bool only_numbers = true;
  while (std::getline(lines, line))
    if (const std::size_t count = numbers_in(line, &only_numbers).size(); count > 0) return count;
  return 0;
}

// A template's file and the share of the square's side that its pattern is wide: `hiro.patt@0.8`.
struct TemplateWord {
  std::string file;
  double ratio = 0.5;
};

Result<TemplateWord> template_word(const std::string& text) {
  const auto at = text.rfind('@');
  if (at == std::string::npos || at == 0 ||
      text.find_first_not_of("0123456789.", at + 1) != std::string::npos)
    return TemplateWord{text};
  TemplateWord word{text.substr(0, at)};
  const char* const end = text.data() + text.size();
  const auto [rest, problem] = std::from_chars(text.data() + at + 1, end, word.ratio);
  if (problem != std::errc{} || rest != end || !is_pattern_ratio(word.ratio))
    return error(
        "template \"{}\": expected the pattern's share of the square's side after @, {} to {}, found \"{}\"",
        text, k_least_pattern_ratio, k_most_pattern_ratio, text.substr(at + 1));
  return word;
}

Result<TemplatePattern> load_template(const std::filesystem::path& path) {
  LIMN_TRY(const std::string text, read_file(path));
  bool only_numbers = true;
  const std::vector<double> values = numbers_in(text, &only_numbers);
  const auto lines = std::count(text.begin(), text.end(), '\n') + !text.ends_with('\n');
  if (!only_numbers)
    return error(
        "{}: expected numbers from 0 to 255 (an ARToolKit template), found something else after {} of them",
        path.string(), values.size());
  // A file has four rotations of three colours each, and a line for each row. Some programs write one line.
  const auto columns = static_cast<int>(numbers_in_first_line(text));
  const bool has_rows = columns <= k_max_template_size;
  const int size =
      has_rows ? columns : static_cast<int>(std::lround(std::sqrt(static_cast<double>(values.size()) / 12)));
  if (size < 8 || size > k_max_template_size || values.size() != static_cast<std::size_t>(12 * size * size)) {
    const int expected = size < 8 || size > k_max_template_size ? 16 : size;
    return error(
        "{}: line {}: expected {} numbers before the file's end (4 rotations x 3 colours x {} x {}{}), found "
        "{}. "
        "The file is cut short or is not an ARToolKit template.",
        path.string(), lines, 12 * expected * expected, expected, expected,
        has_rows && size == expected ? ", as its first line has " + std::to_string(size)
                                     : "; or another square",
        values.size());
  }
  TemplatePattern pattern;
  pattern.id = path.filename().string();
  pattern.size = size;
  const auto area = static_cast<std::size_t>(size * size);
  std::vector<float> grey(area);
  for (std::size_t i = 0; i < area; ++i) {
    grey[i] = static_cast<float>((values[i] + values[i + area] + values[i + 2 * area]) / 3);
    pattern.grey.push_back(static_cast<std::uint8_t>(std::lround(grey[i])));
  }
  // The file's other three rotations are the same values turned. Turning them here fixes the direction.
  pattern.rotations[0] = normalised(smoothed(grey, size));
  if (pattern.rotations[0].empty())
    return error("{}: expected different grey values, found the same value everywhere", path.string());
  for (std::size_t k = 1; k < 4; ++k) pattern.rotations[k] = turned(pattern.rotations[k - 1], size);
  return pattern;
}

Result<TemplatePattern> load_template(const std::string& text,
                                      bool inverted,
                                      const std::filesystem::path& folder) {
  LIMN_TRY(const TemplateWord word, template_word(text));
  LIMN_TRY(TemplatePattern pattern, load_template(folder / word.file));
  pattern.family = inverted ? with_inverted(k_artoolkit) : k_artoolkit;
  pattern.id = std::filesystem::path(text).filename().string();
  pattern.border = 0.5 * (1 - word.ratio);
  pattern.light_on_dark = inverted;
  return pattern;
}

std::optional<std::string> file_after(const std::string& name, std::string_view prefix) {
  if (name.rfind(prefix, 0) != 0 || name.size() == prefix.size()) return std::nullopt;
  return name.substr(prefix.size());
}

cv::Mat drawn_cells(int cells, int pixels_per_cell, auto&& grey_of_cell) {
  cv::Mat image(cells * pixels_per_cell, cells * pixels_per_cell, CV_8UC1);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image.at<std::uint8_t>(y, x) = grey_of_cell(y / pixels_per_cell, x / pixels_per_cell);
  return image;
}

// The black square with its cells, drawn in half cells.
cv::Mat drawn_barcode(const CodeFamily& family, std::size_t id, int pixels_per_half) {
  return drawn_cells(4 * family.cells, pixels_per_half, [&](int row, int column) -> std::uint8_t {
    const int r = row - family.cells;
    const int c = column - family.cells;
    const bool inside = r >= 0 && c >= 0 && r < 2 * family.cells && c < 2 * family.cells;
    if (!inside) return 0;
    return (family.codes[id][0] >> family.grid.at(r / 2 + 1, c / 2 + 1)) & 1 ? 255 : 0;
  });
}

cv::Mat drawn_code(const CodeFamily& family, std::size_t id, int pixels_per_cell) {
  if (is_barcode(family)) return drawn_barcode(family, id, pixels_per_cell);
  return drawn_cells(family.grid.width, pixels_per_cell, [&](int row, int column) -> std::uint8_t {
    const int cell = family.grid.at(row, column);
    if (cell < 0) return cell == CodeGrid::k_dark ? 0 : 255;
    return (family.codes[id][0] >> cell) & 1 ? 255 : 0;
  });
}

// The image is divided so finely that the border has whole cells.
cv::Mat drawn_template(const TemplatePattern& pattern, int pixels_per_cell) {
  constexpr int k_most_cells = 32;  // for each value
  const double border_values = pattern.size * pattern.border / (1 - 2 * pattern.border);
  int cells = 1;
  while (cells < k_most_cells && std::abs(cells * border_values - std::round(cells * border_values)) > 1e-6)
    ++cells;
  const int border = static_cast<int>(std::lround(cells * border_values));
  const int inner = cells * pattern.size;
  return drawn_cells(inner + 2 * border, pixels_per_cell, [&](int row, int column) -> std::uint8_t {
    const int r = row - border;
    const int c = column - border;
    const bool inside = r >= 0 && c >= 0 && r < inner && c < inner;
    return inside ? pattern.grey[static_cast<std::size_t>(r / cells * pattern.size + c / cells)]
                  : std::uint8_t{0};
  });
}

// Inverts a drawing of a square that is light on dark, with a dark ring around it unless it has rings of
// cells.
MarkerDrawing with_surroundings(cv::Mat image, int around_px, bool light_on_dark, int ring_px) {
  if (!light_on_dark) return {image, around_px};
  if (around_px == 0) {
    cv::copyMakeBorder(image, image, ring_px, ring_px, ring_px, ring_px, cv::BORDER_CONSTANT,
                       cv::Scalar(255));
    around_px = ring_px;
  }
  cv::bitwise_not(image, image);
  return {image, around_px};
}

bool is_template(const MarkerName& marker) { return without_inverted(marker.family).name == k_artoolkit; }

// The family names that the marker is found by.
std::string searched_name(const MarkerName& marker) {
  return is_template(marker) ? marker.text() : marker.family;
}

CodeFamily with_wide_border(CodeFamily family) {
  family.border_cells = 2;
  family.grid = grid_inside_border(family.cells, 2);
  return family;
}

Result<CodeFamily> load_codes(const std::string& name, const std::filesystem::path& folder) {
  if (const PredefinedFamily* known = find_predefined_family(name))
    return from_opencv(name, known->opencv_dictionary);
  if (name == k_mip) return from_mip(name);
  if (const auto known = apriltag3_families(); std::ranges::find(known, name) != known.end())
    return from_apriltag3(name);
  if (const Barcode* barcode = find_barcode(name)) return from_barcode(name, *barcode);
  if (const auto file = file_after(name, k_aruco_file)) return load_dictionary(folder / *file);
  return error("family \"{}\": expected one of {}", name, known_families());
}

// (1, 2, 1) / 4 over three rows, value by value.
LIMN_SIMD void smooth_across(const float* __restrict before,
                             const float* __restrict here,
                             const float* __restrict after,
                             std::size_t count,
                             float* __restrict into) {
  for (std::size_t i = 0; i < count; ++i) into[i] = 0.25f * (before[i] + 2 * here[i] + after[i]);
}

}  // namespace

// Values at the ends are repeated outside.
void smooth(std::span<float> values, std::span<float> scratch, int size) {
  const auto count = static_cast<std::size_t>(size);
  const std::size_t last = count - 1;
  for (std::size_t row = 0; row < count; ++row) {
    const float* line = &values[row * count];
    float* into = &scratch[row * count];
    into[0] = 0.25f * (3 * line[0] + line[std::min<std::size_t>(1, last)]);
    if (count > 2) smooth_across(line, line + 1, line + 2, count - 2, into + 1);
    into[last] = 0.25f * (line[last == 0 ? 0 : last - 1] + 3 * line[last]);
  }
  for (std::size_t row = 0; row < count; ++row)
    smooth_across(&scratch[(row == 0 ? row : row - 1) * count], &scratch[row * count],
                  &scratch[(row == last ? row : row + 1) * count], count, &values[row * count]);
}

std::vector<float> smoothed(std::vector<float> values, int size) {
  std::vector<float> scratch(values.size());
  smooth(values, scratch, size);
  return values;
}

bool is_barcode(const CodeFamily& family) { return family.border_cells == 0.5 * family.cells; }

Result<Families> Families::load(std::span<const std::string> names, const std::filesystem::path& folder) {
  Families families;
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second) continue;
    const FamilyWord word = without_inverted(name);
    if (const auto file = file_after(word.name, std::string(k_artoolkit) + ":")) {
      LIMN_TRY(TemplatePattern pattern, load_template(*file, word.inverted, folder));
      families.templates_.push_back(std::move(pattern));
      continue;
    }
    LIMN_TRY(CodeFamily family, load_codes(word.name, folder));
    if (word.inverted) {
      family.name = with_inverted(family.name);
      family.light_on_dark = !family.light_on_dark;
    }
    const bool may_be_wide =
        family.border_cells == 1 && family.grid.rings == 0 && family.cells >= k_min_wide_cells;
    if (may_be_wide) families.wide_borders_.push_back(with_wide_border(family));
    families.codes_.push_back(std::move(family));
  }
  return families;
}

Families Families::with_polarity(bool light_on_dark) const {
  Families chosen;
  const auto is_chosen = [&](const auto& item) { return item.light_on_dark == light_on_dark; };
  std::ranges::copy_if(codes_, std::back_inserter(chosen.codes_), is_chosen);
  std::ranges::copy_if(wide_borders_, std::back_inserter(chosen.wide_borders_), is_chosen);
  std::ranges::copy_if(templates_, std::back_inserter(chosen.templates_), is_chosen);
  return chosen;
}

bool Families::contains(const std::string& family) const {
  return std::ranges::any_of(codes_, [&](const CodeFamily& codes) { return codes.name == family; }) ||
         std::ranges::any_of(templates_,
                             [&](const TemplatePattern& drawn) { return drawn.family == family; });
}

double Families::thinnest_border() const {
  double least = 0.5;
  for (const CodeFamily& family : codes_)
    least = std::min(least, family.border_cells / (family.cells + 2 * family.border_cells));
  for (const TemplatePattern& drawn : templates_) least = std::min(least, drawn.border);
  return least;
}

double Families::reach() const {
  double most = 0;
  for (const CodeFamily& family : codes_)
    most = std::max(most, static_cast<double>(family.grid.rings) / family.grid.side());
  return most;
}

std::vector<std::string> families_of(std::span<const Body> bodies) {
  std::vector<std::string> names;
  for (const Body& body : bodies)
    for (const BodyMarker& marker : body.markers) {
      std::string name = searched_name(marker.marker);
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(std::move(name));
    }
  return names;
}

Result<MarkerDrawing> draw_whole_marker(const MarkerName& marker,
                                        int pixels_per_cell,
                                        const std::filesystem::path& folder) {
  LIMN_CHECK(pixels_per_cell > 0);
  LIMN_TRY(const Families families, Families::load(std::vector{searched_name(marker)}, folder));
  if (is_template(marker)) {
    const TemplatePattern& pattern = families.templates().front();
    const cv::Mat image = drawn_template(pattern, pixels_per_cell);
    return with_surroundings(image, 0, pattern.light_on_dark, image.cols / 8);
  }
  const CodeFamily& family = families.codes().front();
  std::size_t id = 0;
  const auto [rest, problem] = std::from_chars(marker.id.data(), marker.id.data() + marker.id.size(), id);
  if (problem != std::errc{} || rest != marker.id.data() + marker.id.size() || id >= family.codes.size())
    return error("marker {}: expected an id from 0 to {}, found \"{}\"", marker.text(),
                 family.codes.size() - 1, marker.id);
  return with_surroundings(drawn_code(family, id, pixels_per_cell), family.grid.rings * pixels_per_cell,
                           family.light_on_dark, (is_barcode(family) ? 2 : 1) * pixels_per_cell);
}

Result<cv::Mat> draw_marker(const MarkerName& marker,
                            int pixels_per_cell,
                            const std::filesystem::path& folder) {
  LIMN_TRY(const MarkerDrawing drawing, draw_whole_marker(marker, pixels_per_cell, folder));
  const int side = drawing.image.cols - 2 * drawing.around_px;
  return drawing.image(cv::Rect(drawing.around_px, drawing.around_px, side, side)).clone();
}

}  // namespace limn::tracker
