#include "scene/meshes/scan_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>

#include "core/file.h"
#include "scene/files/ply_file.h"

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

// The destination of each property of a vertex; -1: ignored.
enum Field { k_x, k_y, k_z, k_nx, k_ny, k_nz, k_stddev, k_red, k_green, k_blue, k_fields };
constexpr const char* k_field_names[k_fields] = {"x",  "y",      "z",   "nx",    "ny",
                                                 "nz", "stddev", "red", "green", "blue"};

std::array<int, k_fields> field_places(const PlyElement& element) {
  std::array<int, k_fields> places;
  places.fill(-1);
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    for (std::size_t f = 0; f < k_fields; ++f)
      if (element.properties[i].name == k_field_names[f] && element.properties[i].count_type.size == 0)
        places[f] = static_cast<int>(i);
  return places;
}

void read_vertices(const PlyElement& element, double metres, PlyValues* values, ScanSurface* surface) {
  const auto place = field_places(element);
  const bool normals = place[k_nx] >= 0 && place[k_ny] >= 0 && place[k_nz] >= 0;
  std::vector<double> row(element.properties.size());
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i) {
    for (std::size_t p = 0; p < row.size(); ++p) {
      const PlyProperty& property = element.properties[p];
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
bool read_faces(const PlyElement& element, std::size_t vertices, PlyValues* values, ScanSurface* surface) {
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i) {
    for (const PlyProperty& property : element.properties) {
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

void skip(const PlyElement& element, PlyValues* values) {
  for (std::size_t i = 0; i < element.count && !values->failed(); ++i)
    for (const PlyProperty& property : element.properties)
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
  LIMN_TRY(const PlyHeader header, read_ply_header(bytes, where));
  ScanSurface surface;
  PlyValues values(bytes, header);
  for (const PlyElement& element : header.elements) {
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

Mesh mesh_of(const ScanSurface& surface) {
  Mesh mesh;
  mesh.positions = surface.positions;
  mesh.normals = surface.normals;
  mesh.triangles = surface.triangles;
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
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
