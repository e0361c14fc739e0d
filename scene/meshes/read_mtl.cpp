#include "scene/meshes/read_mtl.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>
#include <sstream>

#include "core/file.h"
#include "scene/files/named_file.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// Options of a map statement with the most words that follow each.
const std::map<std::string, int>& map_options() {
  static const std::map<std::string, int> k_options = {
      {"-blendu", 1}, {"-blendv", 1}, {"-cc", 1},         {"-clamp", 1}, {"-imfchan", 1},
      {"-mm", 2},     {"-bm", 1},     {"-o", 3},          {"-s", 3},     {"-t", 3},
      {"-texres", 1}, {"-boost", 1},  {"-colorspace", 1}, {"-type", 1}};
  return k_options;
}

// Whether the option's words are numbers, of which some may be absent.
bool has_numbers(const std::string& option) {
  return option == "-mm" || option == "-o" || option == "-s" || option == "-t";
}

std::string next_word(const std::string& text, std::size_t* at) {
  while (*at < text.size() && std::isspace(static_cast<unsigned char>(text[*at]))) ++*at;
  std::string word;
  while (*at < text.size() && !std::isspace(static_cast<unsigned char>(text[*at]))) word += text[(*at)++];
  return word;
}

// A map statement: options, then the name of a file, which may have blanks.
TextureUse read_map(const std::string& rest, const fs::path& folder) {
  Eigen::Vector2f scale(1, 1), offset(0, 0);
  std::size_t at = 0;
  for (;;) {
    std::size_t behind = at;
    const std::string option = next_word(rest, &behind);
    const auto known = map_options().find(option);
    if (known == map_options().end()) break;
    at = behind;
    for (int i = 0; i < known->second; ++i) {
      std::size_t next = at;
      const auto value = number_of_word(next_word(rest, &next));
      if (has_numbers(option) && !value) break;
      at = next;
      if (i < 2 && option == "-s") scale[i] = static_cast<float>(*value);
      if (i < 2 && option == "-o") offset[i] = static_cast<float>(*value);
    }
  }
  TextureUse use{.name = trimmed(rest.substr(at)), .folder = folder};
  use.place.moved = Eigen::Translation2f(offset) * Eigen::Scaling(scale.x(), scale.y());
  return use;
}

// Kd: three numbers, or one for all.
std::optional<Eigen::Vector3f> read_colour(const std::string& rest) {
  std::vector<float> values;
  for (const std::string& word : words_of(rest))
    if (const auto value = number_of_word(word)) values.push_back(static_cast<float>(*value));
  if (values.size() == 1) return Eigen::Vector3f::Constant(values[0]);
  if (values.size() < 3) return std::nullopt;
  return Eigen::Vector3f(values[0], values[1], values[2]);
}

// Reads a line into a material; false: it cannot be read.
bool read_mtl_line(const std::string& word,
                   const std::string& rest,
                   const fs::path& folder,
                   MaterialSource* to) {
  if (word == "kd") {
    const auto colour = read_colour(rest);
    if (colour) to->base_colour = *colour;
    return colour.has_value();
  }
  if (word == "map_kd") {
    to->base = read_map(rest, folder);
    return to->base.is_there();
  }
  if (word != "pr" && word != "pm") return true;
  const auto value = number_of_word(rest);
  if (value) (word == "pr" ? to->roughness : to->metallic) = static_cast<float>(*value);
  return value.has_value();
}

}  // namespace

std::optional<double> number_of_word(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  return !word.empty() && *end == '\0' ? std::optional(value) : std::nullopt;
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word && word[0] != '#';) words.push_back(word);
  return words;
}

std::vector<ObjLine> obj_lines(const std::string& text) {
  std::vector<ObjLine> lines;
  std::size_t number = 0, begun = 0;
  std::string joined;
  for (std::size_t at = text.starts_with("\xef\xbb\xbf") ? 3 : 0; at <= text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
    std::string line = trimmed(text.substr(at, end - at));
    at = end + (text.compare(end, 2, "\r\n") == 0 ? 2 : 1);
    ++number;
    if (joined.empty()) begun = number;
    const bool goes_on = line.ends_with('\\') && !line.starts_with('#');
    if (goes_on) line.back() = ' ';
    joined += line;
    if (goes_on) continue;
    std::size_t behind = 0;
    const std::string word = next_word(joined, &behind);
    if (!word.empty() && word[0] != '#') lines.push_back({begun, word, trimmed(joined.substr(behind))});
    joined.clear();
  }
  return lines;
}

Result<std::vector<MaterialSource>> read_mtl(const fs::path& path, std::vector<std::string>* warnings) {
  LIMN_TRY(const std::string text, read_file(path));
  std::vector<MaterialSource> materials;
  for (const ObjLine& line : obj_lines(text)) {
    std::string word = line.word;
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::tolower(c); });
    if (word == "newmtl") {
      materials.push_back({.name = line.rest, .base_colour = Eigen::Vector3f::Constant(k_no_colour)});
    } else if (!materials.empty() && !read_mtl_line(word, line.rest, path.parent_path(), &materials.back())) {
      warnings->push_back(
          fmt::format("{}: line {}: expected numbers or a file's name behind {}, found '{}'. The "
                      "line is left out.",
                      path.string(), line.number, line.word, line.rest));
    }
  }
  // Some programs write black beside a texture and mean the texture.
  for (MaterialSource& material : materials)
    if (material.base.is_there() && material.base_colour.isZero()) material.base_colour.setOnes();
  return materials;
}

}  // namespace limn::scene
