#include "sim/glb.h"

#include <cstring>
#include <nlohmann/json.hpp>

namespace limn::sim {
namespace {

using nlohmann::ordered_json;

constexpr int k_float = 5126, k_unsigned_int = 5125, k_unsigned_short = 5123;  // glTF component types
constexpr int k_array_buffer = 34962, k_element_array_buffer = 34963;

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));  // glTF is little endian, as every machine that this runs on
  bytes.append(raw, sizeof(T));
}

// The binary chunk and the JSON that describes it, growing together.
struct Document {
  std::string bytes;
  ordered_json views = ordered_json::array();
  ordered_json accessors = ordered_json::array();

  int add(const std::string& data, int target, ordered_json accessor) {
    while (bytes.size() % 4 != 0) bytes.push_back('\0');
    views.push_back(
        {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", data.size()}, {"target", target}});
    bytes += data;
    accessor["bufferView"] = views.size() - 1;
    accessors.push_back(accessor);
    return static_cast<int>(accessors.size()) - 1;
  }

  template <class Vector>
  int add_vectors(const std::vector<Vector>& values, const char* type, bool bounds) {
    std::string data;
    Vector low = values.front(), high = values.front();
    for (const Vector& v : values) {
      low = low.cwiseMin(v);
      high = high.cwiseMax(v);
      for (Eigen::Index i = 0; i < v.size(); ++i) append(data, v[i]);
    }
    ordered_json accessor = {{"componentType", k_float}, {"count", values.size()}, {"type", type}};
    if (bounds) {
      accessor["min"] = std::vector<float>(low.data(), low.data() + low.size());
      accessor["max"] = std::vector<float>(high.data(), high.data() + high.size());
    }
    return add(data, k_array_buffer, accessor);
  }

  int add_triangles(const scene::Mesh& mesh, std::size_t material) {
    const bool small = mesh.positions.size() < 65536;
    std::string data;
    std::size_t count = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (!mesh.triangle_materials.empty() && mesh.triangle_materials[t] != material) continue;
      for (const std::uint32_t corner : mesh.triangles[t])
        small ? append(data, static_cast<std::uint16_t>(corner)) : append(data, corner);
      count += 3;
    }
    if (count == 0) return -1;
    return add(
        data, k_element_array_buffer,
        {{"componentType", small ? k_unsigned_short : k_unsigned_int}, {"count", count}, {"type", "SCALAR"}});
  }
};

ordered_json material_json(const scene::Material& material) {
  const Eigen::Vector3f& c = material.base_colour;
  ordered_json json = {
      {"pbrMetallicRoughness",
       {{"baseColorFactor", {c.x(), c.y(), c.z(), 1}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}}};
  if (material.unlit) json["extensions"] = {{"KHR_materials_unlit", ordered_json::object()}};
  return json;
}

std::string chunk(const char* kind, std::string data, char filler) {
  while (data.size() % 4 != 0) data.push_back(filler);
  std::string bytes;
  append(bytes, static_cast<std::uint32_t>(data.size()));
  return bytes.append(kind, 4) + data;
}

}  // namespace

std::string glb(const scene::Mesh& mesh) {
  Document document;
  ordered_json attributes = {{"POSITION", document.add_vectors(mesh.positions, "VEC3", true)}};
  if (!mesh.normals.empty()) attributes["NORMAL"] = document.add_vectors(mesh.normals, "VEC3", false);
  if (!mesh.uvs.empty()) {
    std::vector<Eigen::Vector2f> flipped = mesh.uvs;  // glTF counts v from the top row
    for (Eigen::Vector2f& uv : flipped) uv.y() = 1 - uv.y();
    attributes["TEXCOORD_0"] = document.add_vectors(flipped, "VEC2", false);
  }
  ordered_json primitives = ordered_json::array(), materials = ordered_json::array();
  bool unlit = false;
  for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
    materials.push_back(material_json(mesh.materials[m]));
    unlit = unlit || mesh.materials[m].unlit;
    const int indices = document.add_triangles(mesh, m);
    if (indices >= 0)
      primitives.push_back({{"attributes", attributes}, {"indices", indices}, {"material", m}});
  }
  while (document.bytes.size() % 4 != 0) document.bytes.push_back('\0');
  ordered_json json = {{"asset", {{"version", "2.0"}, {"generator", "limn"}}},
                       {"scene", 0},
                       {"scenes", {{{"nodes", {0}}}}},
                       {"nodes", {{{"mesh", 0}}}},
                       {"meshes", {{{"primitives", primitives}}}},
                       {"materials", materials},
                       {"accessors", document.accessors},
                       {"bufferViews", document.views},
                       {"buffers", {{{"byteLength", document.bytes.size()}}}}};
  if (unlit) json["extensionsUsed"] = {"KHR_materials_unlit"};
  const std::string body =
      chunk("JSON", json.dump(), ' ') + chunk(std::string("BIN\0", 4).data(), document.bytes, '\0');
  std::string file = "glTF";
  append(file, std::uint32_t{2});
  append(file, static_cast<std::uint32_t>(12 + body.size()));
  return file + body;
}

}  // namespace limn::sim
