#include "exchange/cad/cad_glb.h"

#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "core/json_text.h"

namespace limn::cad {
namespace {

using nlohmann::ordered_json;

constexpr int k_float = 5126, k_unsigned_int = 5125;                   // glTF component types
constexpr int k_array_buffer = 34962, k_element_array_buffer = 34963;  // and targets

template <class T>
void append(std::string* bytes, const T& value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));  // glTF is little endian, like every machine that Limn supports
  bytes->append(raw, sizeof(T));
}

class Document {
 public:
  explicit Document(const CadModel& model) : model_(model) {}

  void add(const CadNode& node) {
    ordered_json json = {{"name", node.name}, {"mesh", mesh_of(node.mesh)}};
    if (!node.file_from_mesh.isIdentity(0)) {
      const Eigen::Matrix4d& m = node.file_from_mesh;  // column by column, as in glTF
      json["matrix"] = std::vector<double>(m.data(), m.data() + m.size());
    }
    nodes_.push_back(std::move(json));
  }

  std::string file(const ordered_json& extras) {
    ordered_json roots = ordered_json::array();
    for (std::size_t i = 0; i < nodes_.size(); ++i) roots.push_back(i);
    const ordered_json json = {{"asset", {{"version", "2.0"}, {"generator", "limn-cad"}, {"extras", extras}}},
                               {"scene", 0},
                               {"scenes", ordered_json::array({{{"nodes", roots}}})},
                               {"nodes", nodes_},
                               {"meshes", meshes_},
                               {"materials", materials_},
                               {"accessors", accessors_},
                               {"bufferViews", views_},
                               {"buffers", ordered_json::array({{{"byteLength", bytes_.size()}}})}};
    std::string text = json_text(json);
    while (text.size() % 4 != 0) text.push_back(' ');
    std::string file = "glTF";
    file.reserve(28 + text.size() + bytes_.size());
    append(&file, std::uint32_t{2});
    append(&file, static_cast<std::uint32_t>(28 + text.size() + bytes_.size()));
    append(&file, static_cast<std::uint32_t>(text.size()));
    file += "JSON" + text;
    append(&file, static_cast<std::uint32_t>(bytes_.size()));
    file.append("BIN\0", 4);
    return file += bytes_;
  }

 private:
  std::size_t mesh_of(std::size_t mesh) {
    const auto [known, is_new] = meshes_written_.try_emplace(mesh, meshes_.size());
    if (!is_new) return known->second;
    ordered_json primitives = ordered_json::array();
    for (const CadPiece& piece : model_.meshes[mesh].pieces)
      primitives.push_back(
          {{"attributes",
            {{"POSITION", vectors(piece.positions, true)}, {"NORMAL", vectors(piece.normals, false)}}},
           {"indices", indices(piece)},
           {"material", material_of(piece.colour)}});
    meshes_.push_back({{"primitives", primitives}});
    return known->second;
  }

  std::size_t material_of(const Colour& colour) {
    const auto [known, is_new] = materials_written_.try_emplace(colour, materials_.size());
    if (!is_new) return known->second;
    ordered_json json = {{"pbrMetallicRoughness",
                          {{"baseColorFactor", colour}, {"metallicFactor", 0}, {"roughnessFactor", 1}}}};
    if (colour[3] < 1) json["alphaMode"] = "BLEND";
    materials_.push_back(std::move(json));
    return known->second;
  }

  std::size_t vectors(const std::vector<Eigen::Vector3f>& values, bool with_bounds) {
    ordered_json accessor = {{"componentType", k_float}, {"count", values.size()}, {"type", "VEC3"}};
    Eigen::Vector3f low = values.front(), high = values.front();
    const std::size_t begin = bytes_.size();
    for (const Eigen::Vector3f& v : values) {
      low = low.cwiseMin(v);
      high = high.cwiseMax(v);
      for (Eigen::Index i = 0; i < 3; ++i) append(&bytes_, v[i]);
    }
    if (with_bounds) {
      accessor["min"] = std::vector<float>(low.data(), low.data() + 3);
      accessor["max"] = std::vector<float>(high.data(), high.data() + 3);
    }
    return add_accessor(std::move(accessor), begin, k_array_buffer);
  }

  std::size_t indices(const CadPiece& piece) {
    const std::size_t begin = bytes_.size();
    for (const auto& triangle : piece.triangles)
      for (const std::uint32_t corner : triangle) append(&bytes_, corner);
    return add_accessor(
        {{"componentType", k_unsigned_int}, {"count", 3 * piece.triangles.size()}, {"type", "SCALAR"}}, begin,
        k_element_array_buffer);
  }

  std::size_t add_accessor(ordered_json accessor, std::size_t begin, int target) {
    views_.push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", bytes_.size() - begin}, {"target", target}});
    accessor["bufferView"] = views_.size() - 1;
    accessors_.push_back(std::move(accessor));
    return accessors_.size() - 1;
  }

  const CadModel& model_;
  std::string bytes_;
  ordered_json nodes_ = ordered_json::array(), meshes_ = ordered_json::array(),
               materials_ = ordered_json::array(), accessors_ = ordered_json::array(),
               views_ = ordered_json::array();
  std::map<std::size_t, std::size_t> meshes_written_;
  std::map<Colour, std::size_t> materials_written_;
};

}  // namespace

std::string encode_cad_glb(const CadModel& model,
                           std::span<const CadNode> nodes,
                           const ordered_json& extras) {
  Document document(model);
  for (const CadNode& node : nodes) document.add(node);
  return document.file(extras);
}

}  // namespace limn::cad
