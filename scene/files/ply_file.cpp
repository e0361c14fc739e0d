#include "scene/files/ply_file.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <sstream>

#include "core/enum_names.h"

namespace limn::scene {
namespace {

PlyType type_of(const std::string& name) {
  if (name == "char" || name == "int8") return {1, false, true};
  if (name == "uchar" || name == "uint8") return {1, false, false};
  if (name == "short" || name == "int16") return {2, false, true};
  if (name == "ushort" || name == "uint16") return {2, false, false};
  if (name == "int" || name == "int32") return {4, false, true};
  if (name == "uint" || name == "uint32") return {4, false, false};
  if (name == "float" || name == "float32") return {4, true, true};
  if (name == "double" || name == "float64") return {8, true, true};
  return {};
}

constexpr EnumNames<PlyFormat, 3> k_ply_formats{{"ascii", "binary_little_endian", "binary_big_endian"}};

bool read_property(std::istringstream* words, PlyHeader* header) {
  if (header->elements.empty()) return false;
  PlyProperty property;
  std::string type;
  *words >> type;
  if (type == "list") {
    std::string count_type;
    *words >> count_type >> type;
    property.count_type = type_of(count_type);
    if (property.count_type.size == 0 || property.count_type.real) return false;
  }
  property.type = type_of(type);
  *words >> property.name;
  header->elements.back().properties.push_back(property);
  return property.type.size > 0 && !property.name.empty();
}

// Reads a header line; false when it is not part of PLY.
bool read_header_line(const std::string& line, std::string* format_name, PlyHeader* header) {
  std::istringstream words(line);
  std::string word;
  if (!(words >> word) || word == "ply" || word == "obj_info") return true;
  if (word == "comment") {
    std::getline(words >> std::ws, header->comments.emplace_back());
    return true;
  }
  if (word == "format") return static_cast<bool>(words >> *format_name);
  if (word == "element") {
    PlyElement element;
    if (!(words >> element.name >> element.count)) return false;
    header->elements.push_back(std::move(element));
    return true;
  }
  return word == "property" && read_property(&words, header);
}

}  // namespace

Result<PlyHeader> read_ply_header(const std::string& bytes, const std::string& where) {
  constexpr std::size_t k_longest = 100000;  // bytes; a header has only a few lines of text
  const std::string begin = bytes.substr(0, k_longest);
  const std::size_t first_end = begin.find_first_of("\r\n");
  const std::string line_end = first_end == std::string::npos         ? "\n"
                               : begin[first_end] == '\n'             ? "\n"
                               : begin.substr(first_end, 2) == "\r\n" ? "\r\n"
                                                                      : "\r";
  const std::size_t end = begin.find("end_header");
  if (!bytes.starts_with("ply") || end == std::string::npos)
    return error("{}: expected a PLY file, found no header from 'ply' to 'end_header'. Export it again.",
                 where);
  PlyHeader header;
  header.bytes = bytes.find(line_end.back(), end);
  if (header.bytes == std::string::npos)
    return error(
        "{}: expected a line after the PLY header, found the end of the file. Copy or export it again.",
        where);
  ++header.bytes;
  std::string format_name;
  std::istringstream lines(begin.substr(0, end));
  for (std::string line; std::getline(lines, line, line_end.back());)
    if (!read_header_line(line, &format_name, &header))
      return error("{}: expected a line of a PLY header, found '{}'.", where, line);
  const std::optional<PlyFormat> format = k_ply_formats.find(format_name);
  if (!format) return error("{}: expected PLY format ascii or binary, found '{}'.", where, format_name);
  header.format = *format;
  for (const PlyElement& element : header.elements)
    if (element.count > bytes.size())
      return error(
          "{}: expected a whole PLY file, found {} bytes that are to hold {} elements '{}'. Export it again.",
          where, bytes.size(), element.count, element.name);
  return header;
}

PlyValues::PlyValues(const std::string& bytes, const PlyHeader& header)
    : bytes_(bytes),
      at_(header.bytes),
      ascii_(header.format == PlyFormat::ascii),
      swapped_(header.format == PlyFormat::big_endian) {}

double PlyValues::next_word() {
  const char* begin = bytes_.c_str() + at_;
  char* end = nullptr;
  const double value = std::strtod(begin, &end);
  failed_ |= end == begin;
  at_ += static_cast<std::size_t>(end - begin);
  return value;
}

namespace {

template <class T>
double stored_as(const unsigned char* raw) {
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return static_cast<double>(value);
}

}  // namespace

double PlyValues::next_binary(const PlyType& type) {
  const auto size = static_cast<std::size_t>(type.size);
  if (at_ + size > bytes_.size()) failed_ = true;
  if (failed_) return 0;
  unsigned char raw[8];
  std::memcpy(raw, bytes_.data() + at_, size);
  at_ += size;
  if (swapped_) std::reverse(raw, raw + size);
  if (type.real) return size == 4 ? stored_as<float>(raw) : stored_as<double>(raw);
  if (size == 1) return type.sign ? stored_as<std::int8_t>(raw) : stored_as<std::uint8_t>(raw);
  if (size == 2) return type.sign ? stored_as<std::int16_t>(raw) : stored_as<std::uint16_t>(raw);
  return type.sign ? stored_as<std::int32_t>(raw) : stored_as<std::uint32_t>(raw);
}

}  // namespace limn::scene
