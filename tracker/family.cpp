#include "tracker/family.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <opencv2/aruco/dictionary.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <utility>

#include "core/file.h"
#include "core/names.h"
#include "core/opencv_file.h"
#include "core/predefined_family.h"
#include "tracker/barcode.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

// Largest probability that a quad with random cells passes as a marker. Clutter gives some hundred quads an
// image, and the border and margin tests of identify.cpp reject all but one in 1000 of them.
constexpr double k_max_random_hit = 2e-4;
constexpr int k_max_cells = 7;  // 49 bits: OpenCV's largest code
constexpr int k_max_codes = 100000;
// The largest ARToolKit pattern resolution that is accepted (ARToolKit's own AR_PATT_SIZE1_MAX).
constexpr int k_max_template_size = 64;
constexpr const char* k_aruco_file = "aruco:";
constexpr const char* k_artoolkit = "artoolkit:";

std::string known_families() {
  return joined_names(predefined_families()) + ", " + joined_names(barcodes()) +
         ", aruco:FILE.yml, artoolkit:FILE.patt";
}

bool bit_of(std::uint64_t code, int cells, int row, int column) {
  return (code >> (cells * cells - 1 - (row * cells + column))) & 1;
}

// The code turned clockwise by 90 degrees: the top left cell comes to the top right.
std::uint64_t turned(std::uint64_t code, int cells) {
  std::uint64_t result = 0;
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column)
      result = (result << 1) | std::uint64_t{bit_of(code, cells, cells - 1 - column, row)};
  return result;
}

std::array<std::uint64_t, 4> four_turns(std::uint64_t code, int cells) {
  std::array<std::uint64_t, 4> turns{code};
  for (std::size_t k = 1; k < 4; ++k) turns[k] = turned(turns[k - 1], cells);
  return turns;
}

// Smallest Hamming distance between any two codes in any rotation, and between a code and its own rotations.
int smallest_distance(const CodeFamily& family) {
  int smallest = family.cells * family.cells;
  for (std::size_t i = 0; i < family.codes.size(); ++i) {
    for (std::size_t k = 1; k < 4; ++k)
      smallest = std::min(smallest, std::popcount(family.codes[i][0] ^ family.codes[i][k]));
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < 4; ++k)
        smallest = std::min(smallest, std::popcount(family.codes[i][0] ^ family.codes[j][k]));
  }
  return smallest;
}

// Negative when even an error-free reading of the other bits does not determine the code.
int correctable_errors(const CodeFamily& family, int distance, int hidden) {
  const int bits = family.cells * family.cells - hidden;
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

// A code without errors is always read, whatever the family's size.
std::vector<int> correctable_errors(const CodeFamily& family) {
  const int bits = family.cells * family.cells;
  if (4 * static_cast<double>(family.codes.size()) > std::ldexp(k_max_random_hit, bits)) return {0};
  const int distance = smallest_distance(family);
  std::vector<int> errors = {std::max(0, correctable_errors(family, distance, 0))};
  for (int hidden = 1;; ++hidden) {
    const int more = correctable_errors(family, distance, hidden);
    if (more < 0) return errors;
    errors.push_back(more);
  }
}

CodeFamily from_opencv(const std::string& name, int index) {
  const cv::Ptr<cv::aruco::Dictionary> dictionary = cv::aruco::getPredefinedDictionary(index);
  CodeFamily family;
  family.name = name;
  family.cells = dictionary->markerSize;
  for (int id = 0; id < dictionary->bytesList.rows; ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.rowRange(id, id + 1), family.cells);
    std::uint64_t code = 0;
    for (int row = 0; row < family.cells; ++row)
      for (int column = 0; column < family.cells; ++column)
        code = (code << 1) | std::uint64_t{bits.at<std::uint8_t>(row, column) != 0};
    family.codes.push_back(four_turns(code, family.cells));
  }
  family.max_errors = correctable_errors(family);
  return family;
}

CodeFamily from_barcode(const Barcode& barcode) {
  CodeFamily family;
  family.name = barcode.name;
  family.cells = barcode.cells;
  family.border_cells = 0.5 * barcode.cells;
  for (std::size_t id = 0; id < barcode.ids(); ++id)
    family.codes.push_back(four_turns(barcode_cells(barcode, id), family.cells));
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
  CodeFamily family;
  family.name = k_aruco_file + path.filename().string();
  family.cells = *cells;
  for (int id = 0; id < *count; ++id) {
    const std::string key = "marker_" + std::to_string(id);
    const OpencvFile::Value* bits = file->find(key);
    if (!bits)
      return error("{}: {}: expected a text of bits because nmarkers is {}, found none", path.string(), key,
                   *count);
    LIMN_TRY(const std::uint64_t code, code_of_text(bits->text, family.cells, path.string() + ": " + key));
    family.codes.push_back(four_turns(code, family.cells));
  }
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

Result<TemplatePattern> load_template(const std::filesystem::path& path) {
  LIMN_TRY(const std::string text, read_file(path));
  bool only_numbers = true;
  const std::vector<double> values = numbers_in(text, &only_numbers);
  if (!only_numbers)
    return error(
        "{}: expected numbers from 0 to 255 (an ARToolKit template), found something else after {} of them",
        path.string(), values.size());
  // A file has four rotations of three colours each.
  const int size = static_cast<int>(std::lround(std::sqrt(static_cast<double>(values.size()) / 12)));
  if (size < 8 || size > k_max_template_size || values.size() != static_cast<std::size_t>(12 * size * size))
    return error(
        "{}: expected 3072 numbers (4 rotations x 3 colours x 16 x 16; or another square), found {}. The "
        "file is cut short or is not an ARToolKit template.",
        path.string(), values.size());
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

std::optional<std::string> file_after(const std::string& name, const std::string& prefix) {
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
    return inside && bit_of(family.codes[id][0], family.cells, r / 2, c / 2) ? 255 : 0;
  });
}

cv::Mat drawn_code(const CodeFamily& family, std::size_t id, int pixels_per_cell) {
  if (family.border_cells != 1) return drawn_barcode(family, id, pixels_per_cell);
  return drawn_cells(family.cells + 2, pixels_per_cell, [&](int row, int column) -> std::uint8_t {
    const bool border = row == 0 || column == 0 || row > family.cells || column > family.cells;
    return !border && bit_of(family.codes[id][0], family.cells, row - 1, column - 1) ? 255 : 0;
  });
}

cv::Mat drawn_template(const TemplatePattern& pattern, int pixels_per_cell) {
  const int border = pattern.size / 2;
  return drawn_cells(2 * pattern.size, pixels_per_cell, [&](int row, int column) -> std::uint8_t {
    const int r = row - border;
    const int c = column - border;
    const bool inside = r >= 0 && c >= 0 && r < pattern.size && c < pattern.size;
    return inside ? pattern.grey[static_cast<std::size_t>(r * pattern.size + c)] : std::uint8_t{0};
  });
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

Result<Families> Families::load(std::span<const std::string> names, const std::filesystem::path& folder) {
  Families families;
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second) continue;
    if (const PredefinedFamily* known = find_predefined_family(name)) {
      families.codes_.push_back(from_opencv(name, known->opencv_dictionary));
    } else if (const Barcode* barcode = find_barcode(name)) {
      families.codes_.push_back(from_barcode(*barcode));
    } else if (const auto dictionary = file_after(name, k_aruco_file)) {
      LIMN_TRY(CodeFamily family, load_dictionary(folder / *dictionary));
      families.codes_.push_back(std::move(family));
    } else if (const auto file = file_after(name, k_artoolkit)) {
      LIMN_TRY(TemplatePattern pattern, load_template(folder / *file));
      families.templates_.push_back(std::move(pattern));
    } else {
      return error("family \"{}\": expected one of {}", name, known_families());
    }
  }
  return families;
}

std::vector<std::string> families_of(std::span<const Body> bodies) {
  std::vector<std::string> names;
  for (const Body& body : bodies)
    for (const BodyMarker& marker : body.markers) {
      const bool is_template = marker.marker.family + ":" == k_artoolkit;
      std::string name = is_template ? marker.marker.text() : marker.marker.family;
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(std::move(name));
    }
  return names;
}

Result<cv::Mat> draw_marker(const MarkerName& marker,
                            int pixels_per_cell,
                            const std::filesystem::path& folder) {
  LIMN_CHECK(pixels_per_cell > 0);
  const bool is_template = marker.family + ":" == k_artoolkit;
  const std::vector<std::string> names = {is_template ? marker.text() : marker.family};
  LIMN_TRY(const Families families, Families::load(names, folder));
  if (is_template) return drawn_template(families.templates().front(), pixels_per_cell);
  const CodeFamily& family = families.codes().front();
  std::size_t id = 0;
  const auto [rest, problem] = std::from_chars(marker.id.data(), marker.id.data() + marker.id.size(), id);
  if (problem != std::errc{} || rest != marker.id.data() + marker.id.size() || id >= family.codes.size())
    return error("marker {}: expected an id from 0 to {}, found \"{}\"", marker.text(),
                 family.codes.size() - 1, marker.id);
  return drawn_code(family, id, pixels_per_cell);
}

}  // namespace limn::tracker
