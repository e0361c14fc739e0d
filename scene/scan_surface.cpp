#include "scene/scan_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>

#include "core/enum_names.h"
#include "core/file.h"

namespace limn::scene {
namespace {

static_assert(std::endian::native == std::endian::little);  // binary PLY is written as a copy of memory

template <class T>
void put(std::string* bytes, const T& value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string header_of(const ScanSurface& surface) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment Limn: metres\n";
  text += fmt::format("element vertex {}\n", surface.positions.size());
  text += "property float x\nproperty float y\nproperty float z\n";
  if (!surface.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!surface.stddevs.empty()) text += "property float stddev\n";
  if (!surface.colours_rgb.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!surface.triangles.empty())
    text +=
        fmt::format("element face {}\nproperty list uchar int vertex_indices\n", surface.triangles.size());
  return text + "end_header\n";
}

// The type of a property's values.
struct Type {
  int size = 0;
  bool real = false, sign = false;
};

Type type_of(const std::string& name) {
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

struct Property {
  std::string name;
  Type type, count_type;  // count_type.size > 0: a list
};
struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};
enum class Format { ascii, little_endian, big_endian };
constexpr EnumNames<Format, 3> k_formats{{"ascii", "binary_little_endian", "binary_big_endian"}};
struct Header {
  std::string format_name;
  std::optional<Format> format;  // none: unknown
  std::vector<Element> elements;
  std::size_t bytes = 0;
};

// Reads a header line; false when it is not part of PLY.
bool read_header_line(const std::string& line, Header* header) {
  std::istringstream words(line);
  std::string word;
  if (!(words >> word) || word == "ply" || word == "comment" || word == "obj_info") return true;
  if (word == "format") {
    const bool is_there = static_cast<bool>(words >> header->format_name);
    header->format = k_formats.find(header->format_name);
    return is_there;
  }
  if (word == "element") {
    Element element;
    if (!(words >> element.name >> element.count)) return false;
    header->elements.push_back(std::move(element));
    return true;
  }
  if (word != "property" || header->elements.empty()) return false;
  Property property;
  std::string type;
  words >> type;
  if (type == "list") {
    std::string count_type;
    words >> count_type >> type;
    property.count_type = type_of(count_type);
    if (property.count_type.size == 0 || property.count_type.real) return false;
  }
  property.type = type_of(type);
  words >> property.name;
  header->elements.back().properties.push_back(property);
  return property.type.size > 0 && !property.name.empty();
}

Result<Header> read_header(const std::string& bytes, const std::string& where) {
  constexpr std::size_t k_longest = 100000;  // bytes; a header has only a few lines of text
  const std::size_t end = bytes.substr(0, k_longest).find("end_header");
  if (bytes.compare(0, 3, "ply") != 0 || end == std::string::npos)
    return error("{}: expected a PLY file, found something else. Export the scan as PLY.", where);
  Header header;
  header.bytes = bytes.find('\n', end);
  if (header.bytes == std::string::npos)
    return error(
        "{}: expected a line after the PLY header, found the end of the file. Copy or export it again.",
        where);
  ++header.bytes;
  std::istringstream lines(bytes.substr(0, end));
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (!read_header_line(line, &header))
      return error("{}: expected a line of a PLY header, found '{}'.", where, line);
  }
  return header;
}

// Reads the values one by one, in any format; `failed` is set when the file ends too early.
class Values {
 public:
  Values(const std::string& bytes, const Header& header)
      : bytes_(bytes),
        at_(header.bytes),
        ascii_(header.format == Format::ascii),
        swapped_(header.format == Format::big_endian) {}

  double next(const Type& type) { return ascii_ ? next_word() : next_binary(type); }
  bool failed() const { return failed_; }

 private:
  double next_word() {
    const char* begin = bytes_.c_str() + at_;
    char* end = nullptr;
    const double value = std::strtod(begin, &end);
    failed_ |= end == begin;
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }

  template <class T>
  static double as(const unsigned char* raw) {
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return static_cast<double>(value);
  }

  double next_binary(const Type& type) {
    const auto size = static_cast<std::size_t>(type.size);
    if (at_ + size > bytes_.size()) failed_ = true;
    if (failed_) return 0;
    unsigned char raw[8];
    std::memcpy(raw, bytes_.data() + at_, size);
    at_ += size;
    if (swapped_) std::reverse(raw, raw + size);
    if (type.real) return size == 4 ? as<float>(raw) : as<double>(raw);
    if (size == 1) return type.sign ? as<std::int8_t>(raw) : as<std::uint8_t>(raw);
    if (size == 2) return type.sign ? as<std::int16_t>(raw) : as<std::uint16_t>(raw);
    return type.sign ? as<std::int32_t>(raw) : as<std::uint32_t>(raw);
  }

  const std::string& bytes_;
  std::size_t at_;
  bool ascii_, swapped_, failed_ = false;
};

// The destination of each property of a vertex; -1: ignored.
enum Field { k_x, k_y, k_z, k_nx, k_ny, k_nz, k_stddev, k_red, k_green, k_blue, k_fields };
constexpr const char* k_field_names[k_fields] = {"x",  "y",      "z",   "nx",    "ny",
                                                 "nz", "stddev", "red", "green", "blue"};

std::array<int, k_fields> field_places(const Element& element) {
  std::array<int, k_fields> places;
  places.fill(-1);
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    for (std::size_t f = 0; f < k_fields; ++f)
      if (element.properties[i].name == k_field_names[f] && element.properties[i].count_type.size == 0)
        places[f] = static_cast<int>(i);
  return places;
}

void read_vertices(const Element& element, double metres, Values* values, ScanSurface* surface) {
  const auto place = field_places(element);
  const bool normals = place[k_nx] >= 0 && place[k_ny] >= 0 && place[k_nz] >= 0;
  std::vector<double> row(element.properties.size());
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i) {
    for (std::size_t p = 0; p < row.size(); ++p) {
      const Property& property = element.properties[p];
      if (property.count_type.size == 0)
        row[p] = values->next(property.type);
      else
        for (double n = values->next(property.count_type); n > 0 && !values->failed(); --n)
          values->next(property.type);
    }
    const auto value = [&](Field f) { return place[f] < 0 ? 0.0 : row[static_cast<std::size_t>(place[f])]; };
    surface->positions.push_back(
        (Eigen::Vector3d(value(k_x), value(k_y), value(k_z)) * metres).cast<float>());
    if (normals)
      surface->normals.push_back(
          Eigen::Vector3d(value(k_nx), value(k_ny), value(k_nz)).normalized().cast<float>());
    if (place[k_stddev] >= 0) surface->stddevs.push_back(static_cast<float>(value(k_stddev) * metres));
    if (place[k_red] >= 0 && place[k_green] >= 0 && place[k_blue] >= 0) {
      const auto level = [](double v) { return static_cast<std::uint8_t>(std::clamp(v, 0.0, 255.0)); };
      surface->colours_rgb.push_back({level(value(k_red)), level(value(k_green)), level(value(k_blue))});
    }
  }
}

// Reads the faces; false when an index is beyond the vertices.
bool read_faces(const Element& element, std::size_t vertices, Values* values, ScanSurface* surface) {
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i) {
    for (const Property& property : element.properties) {
      if (property.count_type.size == 0) {
        values->next(property.type);
        continue;
      }
      const bool corners = property.name == "vertex_indices" || property.name == "vertex_index";
      std::vector<std::uint32_t> polygon;
      for (double n = values->next(property.count_type); n > 0 && !values->failed(); --n) {
        const double index = values->next(property.type);
        if (!corners) continue;
        if (!(index >= 0 && index < static_cast<double>(vertices))) return values->failed();
        polygon.push_back(static_cast<std::uint32_t>(index));
      }
      for (std::size_t k = 2; k < polygon.size(); ++k)
        surface->triangles.push_back({polygon[0], polygon[k - 1], polygon[k]});
    }
  }
  return true;
}

void skip(const Element& element, Values* values) {
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i)
    for (const Property& property : element.properties)
      for (double n = property.count_type.size ? values->next(property.count_type) : 1;
           n > 0 && !values->failed(); --n)
        values->next(property.type);
}

Status check_surface(const ScanSurface& surface, const std::string& where) {
  if (surface.positions.empty())
    return error("{}: expected points, found none. The scan is empty: scan again.", where);
  for (std::size_t i = 0; i < surface.positions.size(); ++i)
    if (!surface.positions[i].allFinite())
      return error(
          "{}: vertex {}: expected finite coordinates, found NaN or infinity. Export the scan again.", where,
          i);
  if (surface.normals.empty() && surface.triangles.empty())
    return error(
        "{}: expected normals or triangles beside the points, found neither. Export the scan with them.",
        where);
  return {};
}

std::uint32_t root_of(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

}  // namespace

Status save_ply(const ScanSurface& surface, const std::filesystem::path& path) {
  std::string bytes = header_of(surface);
  bytes.reserve(bytes.size() + surface.positions.size() * 31 + surface.triangles.size() * 13);
  for (std::size_t i = 0; i < surface.positions.size(); ++i) {
    put(&bytes, surface.positions[i]);
    if (!surface.normals.empty()) put(&bytes, surface.normals[i]);
    if (!surface.stddevs.empty()) put(&bytes, surface.stddevs[i]);
    if (!surface.colours_rgb.empty()) put(&bytes, surface.colours_rgb[i]);
  }
  for (const auto& triangle : surface.triangles) {
    put(&bytes, std::uint8_t{3});
    put(&bytes, triangle);
  }
  return write_file(path, bytes);
}

Result<ScanSurface> load_ply(const std::filesystem::path& path, double metres_per_unit) {
  LIMN_TRY(const std::string bytes, read_file(path));
  const std::string where = path.string();
  LIMN_TRY(const Header header, read_header(bytes, where));
  if (!header.format)
    return error("{}: expected PLY format ascii or binary, found '{}'.", where, header.format_name);
  ScanSurface surface;
  Values values(bytes, header);
  for (const Element& element : header.elements) {
    if (element.name == "vertex")
      read_vertices(element, metres_per_unit, &values, &surface);
    else if (element.name != "face")
      skip(element, &values);
    else if (!read_faces(element, surface.positions.size(), &values, &surface))
      return error(
          "{}: expected faces with indices of its {} points, found an index beyond them. Export the scan "
          "again.",
          where, surface.positions.size());
    if (values.failed())
      return error(
          "{}: expected a complete {} list, found the end of a truncated file. Copy or export it again.",
          where, element.name);
  }
  LIMN_TRY_STATUS(check_surface(surface, where));
  if (surface.normals.empty()) surface.normals = normals_from_triangles(surface);
  return surface;
}

std::vector<Eigen::Vector3f> normals_from_triangles(const ScanSurface& surface) {
  std::vector<Eigen::Vector3f> normals(surface.positions.size(), Eigen::Vector3f::Zero());
  for (const auto& [i, j, k] : surface.triangles) {
    const Eigen::Vector3f area =
        (surface.positions[j] - surface.positions[i]).cross(surface.positions[k] - surface.positions[i]);
    for (const std::uint32_t corner : {i, j, k}) normals[corner] += area;
  }
  for (Eigen::Vector3f& normal : normals) normal.normalize();
  return normals;
}

ConnectedComponents connected_components(const ScanSurface& surface) {
  std::vector<std::uint32_t> parent(surface.positions.size());
  std::iota(parent.begin(), parent.end(), 0U);
  std::vector<bool> used(parent.size(), false);
  for (const auto& [i, j, k] : surface.triangles) {
    used[i] = used[j] = used[k] = true;
    parent[root_of(parent, j)] = root_of(parent, i);
    parent[root_of(parent, k)] = root_of(parent, i);
  }
  std::vector<double> area(parent.size(), 0);
  for (const auto& [i, j, k] : surface.triangles) {
    const Eigen::Vector3d a = surface.positions[i].cast<double>();
    const Eigen::Vector3d b = surface.positions[j].cast<double>() - a;
    const Eigen::Vector3d c = surface.positions[k].cast<double>() - a;
    area[root_of(parent, i)] += b.cross(c).norm() / 2;
  }
  std::vector<std::uint32_t> roots;
  for (std::uint32_t i = 0; i < parent.size(); ++i)
    if (used[i] && root_of(parent, i) == i) roots.push_back(i);
  std::stable_sort(roots.begin(), roots.end(), [&](auto a, auto b) { return area[a] > area[b]; });
  std::vector<int> number(parent.size(), -1);
  ConnectedComponents pieces;
  for (const std::uint32_t root : roots) {
    number[root] = static_cast<int>(pieces.areas.size());
    pieces.areas.push_back(area[root]);
  }
  for (std::uint32_t i = 0; i < parent.size(); ++i)
    pieces.of_vertex.push_back(used[i] ? number[root_of(parent, i)] : -1);
  return pieces;
}

ScanSurface with_vertices_kept(const ScanSurface& surface, const std::vector<bool>& keep) {
  ScanSurface out;
  std::vector<std::uint32_t> number(surface.positions.size(), 0);
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    number[i] = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(surface.positions[i]);
    if (!surface.normals.empty()) out.normals.push_back(surface.normals[i]);
    if (!surface.stddevs.empty()) out.stddevs.push_back(surface.stddevs[i]);
    if (!surface.colours_rgb.empty()) out.colours_rgb.push_back(surface.colours_rgb[i]);
  }
  for (const auto& [i, j, k] : surface.triangles)
    if (keep[i] && keep[j] && keep[k]) out.triangles.push_back({number[i], number[j], number[k]});
  return out;
}

}  // namespace limn::scene
