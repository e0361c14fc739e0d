#include "scene/glb.h"

#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "core/image_encoder.h"
#include "core/json_text.h"

namespace limn::scene {
namespace {

using nlohmann::ordered_json;

constexpr int k_float = 5126, k_unsigned_int = 5125, k_unsigned_short = 5123;  // glTF component types
constexpr int k_array_buffer = 34962, k_element_array_buffer = 34963;

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));  // glTF is little endian, like every machine that Limn supports
  bytes.append(raw, sizeof(T));
}

std::string chunk(const char* kind, std::string data, char filler) {
  while (data.size() % 4 != 0) data.push_back(filler);
  std::string bytes;
  append(bytes, static_cast<std::uint32_t>(data.size()));
  return bytes.append(kind, 4) + data;
}

// Builds the binary chunk together with the JSON that describes it.
struct Document {
  std::string bytes;
  ordered_json views = ordered_json::array(), accessors = ordered_json::array(),
               images = ordered_json::array();
  ordered_json meshes = ordered_json::array(), nodes = ordered_json::array();
  ordered_json materials = ordered_json::array();
  std::map<const Mesh*, int> numbers = {};                   // numbers of the meshes written so far
  std::map<const std::uint8_t*, std::size_t> textures = {};  // texture numbers by pixel address
  bool has_textures = true, is_unlit = false;

  std::size_t add_view(const std::string& data) {
    while (bytes.size() % 4 != 0) bytes.push_back('\0');
    views.push_back({{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", data.size()}});
    bytes += data;
    return views.size() - 1;
  }

  int add(const std::string& data, int target, ordered_json accessor) {
    accessor["bufferView"] = add_view(data);
    views.back()["target"] = target;
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

  int add_triangles(const Mesh& mesh, std::size_t material) {
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

  // The index of a texture; an image is written only once.
  ordered_json add_texture(const cv::Mat& image) {
    const auto [known, is_new] = textures.try_emplace(image.data, images.size());
    if (is_new) {
      images.push_back({{"bufferView", add_view(encode_png(image))}, {"mimeType", "image/png"}});
    }
    return {{"index", known->second}};
  }

  void add_maps(const SurfaceMaps& maps, ordered_json* surface, ordered_json* json) {
    if (!maps.metallic_roughness.image.empty())
      (*surface)["metallicRoughnessTexture"] = add_texture(maps.metallic_roughness.image);
    if (!maps.normals.image.empty()) {
      (*json)["normalTexture"] = add_texture(maps.normals.image);
      (*json)["normalTexture"]["scale"] = maps.normal_scale;
    }
    if (!maps.occlusion.image.empty()) {
      (*json)["occlusionTexture"] = add_texture(maps.occlusion.image);
      (*json)["occlusionTexture"]["strength"] = maps.occlusion_strength;
    }
    if (!maps.emission.image.empty()) (*json)["emissiveTexture"] = add_texture(maps.emission.image);
  }

  std::size_t add_material(const Material& material) {
    const Eigen::Vector3f& c = material.base_colour;
    ordered_json surface = {{"baseColorFactor", {c.x(), c.y(), c.z(), 1}},
                            {"metallicFactor", material.metallic},
                            {"roughnessFactor", material.roughness}};
    ordered_json json;
    if (has_textures && !material.texture.empty())
      surface["baseColorTexture"] = add_texture(material.texture);
    if (has_textures) add_maps(material.maps, &surface, &json);
    json["pbrMetallicRoughness"] = surface;
    if (has_textures && material.cut_below > 0) {
      json["alphaMode"] = "MASK";
      json["alphaCutoff"] = material.cut_below;
    }
    const Eigen::Vector3f& e = material.emitted;
    const bool glows_in_places = !material.maps.emission.image.empty();
    if (!e.isZero() && (has_textures || !glows_in_places)) json["emissiveFactor"] = {e.x(), e.y(), e.z()};
    if (material.unlit) json["extensions"] = {{"KHR_materials_unlit", ordered_json::object()}};
    is_unlit |= material.unlit;
    materials.push_back(json);
    return materials.size() - 1;
  }

  int add_mesh(const Mesh& mesh) {
    if (const auto known = numbers.find(&mesh); known != numbers.end()) return known->second;
    ordered_json attributes = {{"POSITION", add_vectors(mesh.positions, "VEC3", true)}};
    if (!mesh.normals.empty()) attributes["NORMAL"] = add_vectors(mesh.normals, "VEC3", false);
    if (!mesh.uvs.empty()) {
      std::vector<Eigen::Vector2f> flipped = mesh.uvs;  // glTF counts v from the top row
      for (Eigen::Vector2f& uv : flipped) uv.y() = 1 - uv.y();
      attributes["TEXCOORD_0"] = add_vectors(flipped, "VEC2", false);
    }
    if (!mesh.tangents.empty()) attributes["TANGENT"] = add_vectors(mesh.tangents, "VEC4", false);
    if (!mesh.colours.empty()) attributes["COLOR_0"] = add_vectors(mesh.colours, "VEC3", false);
    ordered_json primitives = ordered_json::array();
    for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
      const std::size_t material = add_material(mesh.materials[m]);
      const int indices = add_triangles(mesh, m);
      if (indices >= 0)
        primitives.push_back({{"attributes", attributes}, {"indices", indices}, {"material", material}});
    }
    meshes.push_back({{"primitives", primitives}});
    return numbers[&mesh] = static_cast<int>(meshes.size()) - 1;
  }

  std::string file() {
    while (bytes.size() % 4 != 0) bytes.push_back('\0');
    ordered_json roots = ordered_json::array();
    for (std::size_t i = 0; i < nodes.size(); ++i) roots.push_back(i);
    ordered_json json = {{"asset", {{"version", "2.0"}, {"generator", "limn"}}},
                         {"scene", 0},
                         {"scenes", ordered_json::array({{{"nodes", roots}}})},
                         {"nodes", nodes},
                         {"meshes", meshes},
                         {"materials", materials},
                         {"accessors", accessors},
                         {"bufferViews", views},
                         {"buffers", ordered_json::array({{{"byteLength", bytes.size()}}})}};
    if (is_unlit) json["extensionsUsed"] = {"KHR_materials_unlit"};
    if (!images.empty()) {
      json["images"] = images;
      json["textures"] = ordered_json::array();
      for (std::size_t i = 0; i < images.size(); ++i) json["textures"].push_back({{"source", i}});
    }
    const std::string body =
        chunk("JSON", json_text(json), ' ') + chunk(std::string("BIN\0", 4).data(), bytes, '\0');
    std::string head = "glTF";
    append(head, std::uint32_t{2});
    append(head, static_cast<std::uint32_t>(12 + body.size()));
    return head + body;
  }
};

}  // namespace

std::string encode_glb(std::span<const GlbNode> placed) {
  Document document;
  for (const GlbNode& mesh : placed) {
    const Eigen::Quaterniond& q = mesh.assembly_from_mesh.rotation;
    const Eigen::Vector3d& t = mesh.assembly_from_mesh.translation;
    document.nodes.push_back({{"name", mesh.name},
                              {"mesh", document.add_mesh(*mesh.mesh)},
                              {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                              {"translation", {t.x(), t.y(), t.z()}}});
  }
  return document.file();
}

std::string encode_glb(const Mesh& mesh) {
  Document document;
  document.has_textures = false;
  document.nodes.push_back({{"mesh", document.add_mesh(mesh)}});
  return document.file();
}

}  // namespace limn::scene
