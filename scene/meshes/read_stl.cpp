#include "scene/meshes/read_stl.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "core/file.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_header = 80, k_before_facets = 84, k_facet = 50;  // bytes

template <class T>
T value_at(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// The words of a text, in lower case.
class Words {
 public:
  explicit Words(const std::string& text) : text_(text) {}
  std::string next() {
    while (at_ < text_.size() && (std::isspace(byte()) || text_[at_] == '\0')) ++at_;
    std::string word;
    while (at_ < text_.size() && !std::isspace(byte()) && text_[at_] != '\0')
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(text_[at_++])));
    return word;
  }
  void skip_line() {
    while (at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '\r') ++at_;
  }

 private:
  int byte() const { return static_cast<unsigned char>(text_[at_]); }
  const std::string& text_;
  std::size_t at_ = 0;
};

std::optional<float> number_of(std::string word) {
  for (char& c : word)
    if (c == ',') c = '.';  // programs of some languages write decimal commas
  char* end = nullptr;
  const float value = std::strtof(word.c_str(), &end);
  return !word.empty() && *end == '\0' ? std::optional(value) : std::nullopt;
}

std::size_t stated_facets(const std::string& bytes) {
  return bytes.size() < k_before_facets ? 0 : value_at<std::uint32_t>(bytes, k_header);
}

// Binary files may begin with "solid", too: the size decides, then whether a line begins like a text's.
bool is_ascii(const std::string& bytes) {
  const std::size_t whole = k_before_facets + k_facet * stated_facets(bytes);
  if (bytes.size() > k_before_facets && bytes.size() == whole) return false;
  constexpr std::size_t k_looked_at = 4096;
  const std::string begin = bytes.substr(bytes.starts_with("\xef\xbb\xbf") ? 3 : 0, k_looked_at);
  Words words(begin);
  if (words.next() != "solid") return false;
  constexpr int k_most_lines = 5;  // before the first facet
  for (int i = 0; i < k_most_lines; ++i) {
    words.skip_line();
    const std::string word = words.next();
    if (word == "facet" || word == "endsolid") return true;
  }
  return false;
}

void add_triangle(const std::array<Eigen::Vector3f, 3>& corners, MeshPiece* piece) {
  const auto first = static_cast<std::uint32_t>(piece->positions.size());
  piece->positions.insert(piece->positions.end(), corners.begin(), corners.end());
  piece->triangles.push_back({first, first + 1, first + 2});
}

Result<MeshPiece> read_ascii(const std::string& text, const fs::path& path, MeshContent* content) {
  MeshPiece piece;
  Words words(text);
  std::vector<Eigen::Vector3f> corners;
  bool is_in_facet = false, has_end = false;
  for (std::string word = words.next(); !word.empty(); word = words.next()) {
    if (word == "solid") words.skip_line();
    has_end = word == "endsolid" || (has_end && word != "facet");
    if (word == "endsolid") words.skip_line();
    if (word == "facet") {
      corners.clear();
      is_in_facet = true;
    }
    if (word == "vertex" && is_in_facet) {
      Eigen::Vector3f p;
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = number_of(words.next());
        if (!value)
          return damaged_mesh(
              path, fmt::format("facet {}: a vertex without three numbers", piece.triangles.size()));
        p[axis] = *value;
      }
      corners.push_back(p);
    }
    if (word != "endfacet" || !is_in_facet) continue;
    if (corners.size() < 3)
      return damaged_mesh(path, fmt::format("facet {}: fewer than three vertices", piece.triangles.size()));
    for (const auto& t : polygon_triangles(corners))
      add_triangle({corners[t[0]], corners[t[1]], corners[t[2]]}, &piece);
    is_in_facet = false;
  }
  if (is_in_facet) return damaged_mesh(path, fmt::format("it ends inside facet {}", piece.triangles.size()));
  if (!has_end)
    content->warnings.push_back(
        fmt::format("{}: expected 'endsolid' behind the last facet, found none. The file may be cut; {} "
                    "facets are shown.",
                    path.string(), piece.triangles.size()));
  return piece;
}

// A facet's 15-bit colour: linear RGB, or none.
std::optional<Eigen::Vector3f> facet_colour(std::uint16_t bits, bool is_materialise) {
  const bool has_flag = (bits & 0x8000) != 0;
  if (has_flag == is_materialise) return std::nullopt;
  Eigen::Vector3f rgb;
  for (int i = 0; i < 3; ++i) {
    const int from = is_materialise ? i : 2 - i;  // fifth of bits, from the lowest
    rgb[i] = linear_from_srgb(static_cast<float>(bits >> (5 * from) & 31) / 31);
  }
  return rgb;
}

// The colour of the whole object that Materialise writes into the header.
std::optional<Eigen::Vector3f> header_colour(const std::string& bytes) {
  const auto at = std::string_view(bytes).substr(0, k_header).find("COLOR=");
  if (at == std::string::npos || at + 10 > k_header) return std::nullopt;
  Eigen::Vector3f rgb;
  for (std::size_t i = 0; i < 3; ++i)
    rgb[static_cast<Eigen::Index>(i)] =
        linear_from_srgb(static_cast<float>(value_at<std::uint8_t>(bytes, at + 6 + i)) / 255);
  return rgb;
}

Result<MeshPiece> read_binary(const std::string& bytes, const fs::path& path) {
  std::size_t count = stated_facets(bytes);
  if (count == 0 && bytes.size() > k_before_facets && (bytes.size() - k_before_facets) % k_facet == 0)
    count = (bytes.size() - k_before_facets) / k_facet;  // a program that never filled in the number
  if (bytes.size() < k_before_facets || (bytes.size() - k_before_facets) / k_facet < count)
    return damaged_mesh(path, fmt::format("{} bytes that are to hold {} facets", bytes.size(), count));
  const auto of_all = header_colour(bytes);
  MeshPiece piece;
  bool has_colours = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = k_before_facets + k_facet * i;
    std::array<Eigen::Vector3f, 3> corners;
    for (std::size_t k = 0; k < 9; ++k)
      corners[k / 3][static_cast<Eigen::Index>(k % 3)] = value_at<float>(bytes, at + 12 + 4 * k);
    add_triangle(corners, &piece);
    const auto own = facet_colour(value_at<std::uint16_t>(bytes, at + 48), of_all.has_value());
    has_colours |= own || of_all;
    const Eigen::Vector3f colour = own ? *own : of_all.value_or(Eigen::Vector3f::Constant(k_no_colour));
    piece.colours.insert(piece.colours.end(), 3, colour);
  }
  if (!has_colours) piece.colours.clear();
  return piece;
}

}  // namespace

Result<MeshContent> read_stl(const fs::path& path) {
  LIMN_TRY(const std::string bytes, read_file(path));
  MeshContent content;
  LIMN_TRY(MeshPiece piece, is_ascii(bytes) ? read_ascii(bytes, path, &content) : read_binary(bytes, path));
  content.materials.emplace_back();
  if (piece.colours.empty()) content.materials[0].base_colour.setConstant(k_no_colour);
  content.pieces.push_back(std::move(piece));
  return content;
}

}  // namespace limn::scene
