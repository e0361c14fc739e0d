#include "scene/meshes/glb.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

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
  bool has_textures = true;
  std::set<std::string> extensions;  // those that are used

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
  ordered_json add_texture(const cv::Mat& image, bool in_second_uvs = false) {
    const auto [known, is_new] = textures.try_emplace(image.data, images.size());
    if (is_new) {
      images.push_back({{"bufferView", add_view(encode_png(image))}, {"mimeType", "image/png"}});
    }
    ordered_json use = {{"index", known->second}};
    if (in_second_uvs) use["texCoord"] = 1;
    return use;
  }

  ordered_json add_texture(const Texture& texture) {
    return add_texture(texture.image, texture.in_second_uvs);
  }

  void add_maps(const SurfaceMaps& maps, ordered_json* surface, ordered_json* json) {
    if (!maps.metallic_roughness.image.empty())
      (*surface)["metallicRoughnessTexture"] = add_texture(maps.metallic_roughness);
    if (!maps.normals.image.empty()) {
      (*json)["normalTexture"] = add_texture(maps.normals);
      (*json)["normalTexture"]["scale"] = maps.normal_scale;
    }
    if (!maps.occlusion.image.empty()) {
      (*json)["occlusionTexture"] = add_texture(maps.occlusion);
      (*json)["occlusionTexture"]["strength"] = maps.occlusion_strength;
    }
    if (!maps.emission.image.empty()) (*json)["emissiveTexture"] = add_texture(maps.emission);
  }

  // The extension of a clear layer. One with maps of its share has none without textures.
  void add_coat(const Clearcoat& coat, ordered_json* json) {
    if (coat.factor == 0 || (!has_textures && !coat.factor_map.image.empty())) return;
    ordered_json extension = {{"clearcoatFactor", coat.factor}, {"clearcoatRoughnessFactor", coat.roughness}};
    if (has_textures && !coat.factor_map.image.empty())
      extension["clearcoatTexture"] = add_texture(coat.factor_map);
    if (has_textures && !coat.roughness_map.image.empty())
      extension["clearcoatRoughnessTexture"] = add_texture(coat.roughness_map);
    if (has_textures && !coat.normals.image.empty()) {
      extension["clearcoatNormalTexture"] = add_texture(coat.normals);
      extension["clearcoatNormalTexture"]["scale"] = coat.normal_scale;
    }
    add_extension("KHR_materials_clearcoat", extension, json);
  }

  void add_extension(const std::string& name, const ordered_json& extension, ordered_json* json) {
    (*json)["extensions"][name] = extension;
    extensions.insert(name);
  }

  // The factor of glTF's emission is at most 1; more is written as its strength.
  void add_emission(const Eigen::Vector3f& emitted, ordered_json* json) {
    const float strength = std::max(1.F, emitted.maxCoeff());
    const Eigen::Vector3f e = emitted / strength;
    (*json)["emissiveFactor"] = {e.x(), e.y(), e.z()};
    if (strength > 1)
      add_extension("KHR_materials_emissive_strength", {{"emissiveStrength", strength}}, json);
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
    const bool glows_in_places = !material.maps.emission.image.empty();
    if (!material.emitted.isZero() && (has_textures || !glows_in_places))
      add_emission(material.emitted, &json);
    if (material.unlit) add_extension("KHR_materials_unlit", ordered_json::object(), &json);
    add_coat(material.coat, &json);
    materials.push_back(json);
    return materials.size() - 1;
  }

  int add_uvs(std::vector<Eigen::Vector2f> uvs) {
    for (Eigen::Vector2f& uv : uvs) uv.y() = 1 - uv.y();  // glTF counts v from the top row
    return add_vectors(uvs, "VEC2", false);
  }

  int add_mesh(const Mesh& mesh) {
    if (const auto known = numbers.find(&mesh); known != numbers.end()) return known->second;
    ordered_json attributes = {{"POSITION", add_vectors(mesh.positions, "VEC3", true)}};
    if (!mesh.normals.empty()) attributes["NORMAL"] = add_vectors(mesh.normals, "VEC3", false);
    if (!mesh.uvs.empty()) attributes["TEXCOORD_0"] = add_uvs(mesh.uvs);
    if (!mesh.second_uvs.empty()) attributes["TEXCOORD_1"] = add_uvs(mesh.second_uvs);
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
    if (!extensions.empty()) json["extensionsUsed"] = extensions;
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
    if (!mesh.extras.empty()) document.nodes.back()["extras"] = ordered_json::parse(mesh.extras);
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
