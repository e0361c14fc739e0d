#include "scene/meshes/read_gltf.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "scene/files/gltf_file.h"
#include "scene/meshes/draco_mesh.h"
#include "scene/meshes/gltf_materials.h"
#include "scene/meshes/gltf_variants.h"
#include "scene/meshes/read_materials.h"
#include "scene/meshes/read_with_assimp.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Extensions that may be required: they are read, or do not change what is shown.
const std::set<std::string>& known_extensions() {
  static const std::set<std::string> k_known = {"KHR_mesh_quantization",   "KHR_draco_mesh_compression",
                                                "EXT_meshopt_compression", "KHR_meshopt_compression",
                                                "EXT_mesh_gpu_instancing", "EXT_texture_webp",
                                                "KHR_texture_transform",
                                                "KHR_texture_basisu",  // its images are refused by name
                                                "KHR_lights_punctual",     "KHR_animation_pointer",
                                                "KHR_materials_variants",  "KHR_xmp",
                                                "KHR_xmp_json_ld"};
  return k_known;
}

Status check_extensions(const GltfFile& file) {
  for (const json& item : file.root().value("extensionsRequired", json::array())) {
    const auto name = item.get<std::string>();
    // Without an extension of a material, the material has its base colour; a warning says so.
    if (known_extensions().count(name) > 0 || name.starts_with("KHR_materials_") ||
        name.starts_with("EXT_materials_"))
      continue;
    return error(
        "{}: expected a glTF file that needs no other extensions than Limn reads, found {}. Switch {} off "
        "when "
        "you export it.",
        file.path().string(), name, name);
  }
  return {};
}

// A primitive of a mesh, with the skin's joints of each vertex.
struct Primitive {
  MeshPiece piece;
  std::vector<Eigen::Vector4f> joints, weights;  // one entry for each vertex and set of four
  std::size_t sets = 0;
};

template <int N>
std::vector<Eigen::Matrix<float, N, 1>> as_vectors(const std::vector<float>& numbers) {
  std::vector<Eigen::Matrix<float, N, 1>> out;
  out.reserve(numbers.size() / N);
  for (std::size_t i = 0; i + N <= numbers.size(); i += N)
    out.emplace_back(Eigen::Map<const Eigen::Matrix<float, N, 1>>(&numbers[i]));
  return out;
}

Eigen::Matrix4d matrix_of(const json& node) {
  if (const auto found = node.find("matrix"); found != node.end()) {
    Eigen::Matrix4d m;
    for (Eigen::Index i = 0; i < 16; ++i)
      m(i % 4, i / 4) = found->at(static_cast<std::size_t>(i)).get<double>();
    return m;
  }
  const auto read = [&](const char* key, const std::vector<double>& otherwise) {
    std::vector<double> values = node.value(key, otherwise);
    values.resize(std::max(values.size(), otherwise.size()), 0);
    return values;
  };
  const std::vector<double> t = read("translation", {0, 0, 0}), q = read("rotation", {0, 0, 0, 1}),
                            s = read("scale", {1, 1, 1});
  const Eigen::Affine3d affine = Eigen::Translation3d(t[0], t[1], t[2]) *
                                 Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized() *
                                 Eigen::Scaling(s[0], s[1], s[2]);
  return affine.matrix();
}

// Triangles of a list, a strip (mode 5) or a fan (mode 6) of indices.
std::vector<std::array<std::uint32_t, 3>> triangles_of(const std::vector<std::uint32_t>& indices,
                                                       std::size_t mode) {
  std::vector<std::array<std::uint32_t, 3>> out;
  const std::size_t n = indices.size();
  if (mode == 4)
    for (std::size_t i = 0; i + 3 <= n; i += 3) out.push_back({indices[i], indices[i + 1], indices[i + 2]});
  if (mode == 5)
    for (std::size_t i = 0; i + 3 <= n; ++i)
      out.push_back({indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]});
  if (mode == 6)
    for (std::size_t i = 1; i + 1 < n; ++i) out.push_back({indices[i], indices[i + 1], indices[0]});
  return out;
}

class GltfReader {
 public:
  explicit GltfReader(GltfFile* file) : file_(*file), root_(file->root()) {}

  Result<MeshContent> read() {
    LIMN_TRY_STATUS(check_extensions(file_));
    LIMN_TRY_STATUS(read_gltf_materials(&file_, &content_));
    for (const MaterialSource& material : content_.materials)
      for (const TextureUse* use : texture_uses(material)) sets_.insert(use->place.coordinates);
    LIMN_TRY(content_.variants, read_variant_names(file_));
    LIMN_TRY_STATUS(place_nodes());
    for (const std::size_t node : shown_) LIMN_TRY_STATUS(add_node(node));
    content_.metres_per_unit = 1;
    return std::move(content_);
  }

 private:
  const json& nodes() const {
    static const json k_none = json::array();
    const auto found = root_.find("nodes");
    return found == root_.end() ? k_none : *found;
  }

  // The nodes at the top of the scene; without a scene, those that are no children.
  std::vector<std::size_t> roots() const {
    std::vector<std::size_t> out;
    if (const auto scenes = root_.find("scenes"); scenes != root_.end() && !scenes->empty()) {
      const json& scene = scenes->at(whole_number(root_, "scene", 0));
      for (const json& node : scene.value("nodes", json::array())) out.push_back(whole_number(node));
      return out;
    }
    std::set<std::size_t> children;
    for (const json& node : nodes())
      for (const json& child : node.value("children", json::array())) children.insert(whole_number(child));
    for (std::size_t i = 0; i < nodes().size(); ++i)
      if (children.count(i) == 0) out.push_back(i);
    return out;
  }

  // Computes the transforms of all nodes and lists those of the scene, parents first.
  Status place_nodes() {
    file_from_node_.assign(nodes().size(), std::nullopt);
    std::vector<std::pair<std::size_t, Eigen::Matrix4d>> left;
    for (const std::size_t root : roots()) left.emplace_back(root, Eigen::Matrix4d::Identity());
    std::reverse(left.begin(), left.end());
    while (!left.empty()) {
      const auto [index, file_from_parent] = left.back();
      left.pop_back();
      if (index >= nodes().size() || file_from_node_[index])
        return file_.problem(fmt::format(
            "node {}: expected a tree of nodes, found one that is absent or its own child", index));
      file_from_node_[index] = file_from_parent * matrix_of(nodes().at(index));
      shown_.push_back(index);
      const json children = nodes().at(index).value("children", json::array());
      for (auto child = children.rbegin(); child != children.rend(); ++child)
        left.emplace_back(whole_number(*child), *file_from_node_[index]);
    }
    return {};
  }

  Status add_node(std::size_t index) {
    const json& node = nodes().at(index);
    if (!node.contains("mesh")) return {};
    const json& mesh = root_.at("meshes").at(whole_number(node, "mesh", 0));
    const auto weights = node.value("weights", mesh.value("weights", std::vector<float>()));
    LIMN_TRY(const std::vector<Eigen::Matrix4d> instances, instances_of(index, node));
    for (const json& source : mesh.value("primitives", json::array())) {
      const std::size_t mode = whole_number(source, "mode", 4);
      if (mode < 4 || mode > 6) continue;  // points and lines
      LIMN_TRY(Primitive primitive, read_primitive(source, mode, weights));
      const bool is_skinned = node.contains("skin") && primitive.sets > 0;
      if (is_skinned) LIMN_TRY_STATUS(skin(root_.at("skins").at(whole_number(node, "skin", 0)), &primitive));
      if (is_skinned) {
        content_.pieces.push_back(std::move(primitive.piece));
        continue;
      }
      for (const Eigen::Matrix4d& file_from_mesh : instances)
        content_.pieces.push_back(moved(primitive.piece, file_from_mesh));
    }
    return {};
  }

  // Transforms of the node's mesh: one, or those of EXT_mesh_gpu_instancing.
  Result<std::vector<Eigen::Matrix4d>> instances_of(std::size_t index, const json& node) {
    const Eigen::Matrix4d& file_from_node = *file_from_node_[index];
    const json extensions = node.value("extensions", json::object());
    if (!extensions.contains("EXT_mesh_gpu_instancing")) return std::vector{file_from_node};
    const json attributes = extensions.at("EXT_mesh_gpu_instancing").value("attributes", json::object());
    std::vector<float> t, q, s;
    if (attributes.contains("TRANSLATION")) LIMN_TRY_STATUS(read_into(attributes, "TRANSLATION", 3, &t));
    if (attributes.contains("ROTATION")) LIMN_TRY_STATUS(read_into(attributes, "ROTATION", 4, &q));
    if (attributes.contains("SCALE")) LIMN_TRY_STATUS(read_into(attributes, "SCALE", 3, &s));
    const std::size_t count = std::max({t.size() / 3, q.size() / 4, s.size() / 3});
    for (std::size_t i = q.size() / 4; i < count; ++i) q.insert(q.end(), {0, 0, 0, 1});
    t.resize(3 * count, 0);
    s.resize(3 * count, 1);
    std::vector<Eigen::Matrix4d> out;
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Affine3f in_node =
          Eigen::Translation3f(t[3 * i], t[3 * i + 1], t[3 * i + 2]) *
          Eigen::Quaternionf(q[4 * i + 3], q[4 * i], q[4 * i + 1], q[4 * i + 2]).normalized() *
          Eigen::Scaling(s[3 * i], s[3 * i + 1], s[3 * i + 2]);
      out.emplace_back(file_from_node * in_node.matrix().cast<double>());
    }
    return out;
  }

  Status read_into(const json& attributes,
                   const std::string& name,
                   std::size_t components,
                   std::vector<float>* to) {
    LIMN_TRY(*to, file_.numbers(whole_number(attributes, name.c_str(), 0), components));
    return {};
  }

  Result<Primitive> read_primitive(const json& source, std::size_t mode, const std::vector<float>& weights) {
    const json& attributes = source.at("attributes");
    Primitive out;
    out.piece.material = std::min(whole_number(source, "material", content_.materials.size() - 1),
                                  content_.materials.size() - 1);
    DracoMesh draco;
    const json extensions = source.value("extensions", json::object());
    out.piece.variant_materials.assign(content_.variants.size(), out.piece.material);
    LIMN_TRY_STATUS(read_variant_materials(file_, source, content_.materials.size() - 1, &out.piece));
    if (extensions.contains("KHR_draco_mesh_compression")) {
      LIMN_TRY(draco, read_draco(extensions.at("KHR_draco_mesh_compression")));
    }
    LIMN_TRY_STATUS(read_attributes(attributes, draco, &out));
    LIMN_TRY_STATUS(morph(source, weights, &out.piece));
    std::vector<std::uint32_t> indices = std::move(draco.indices);
    if (!indices.empty()) {
      mode = 4;
    } else if (source.contains("indices")) {
      LIMN_TRY(indices, file_.indices(whole_number(source, "indices", 0)));
    } else {
      indices.resize(out.piece.positions.size());
      for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<std::uint32_t>(i);
    }
    for (const std::uint32_t i : indices)
      if (i >= out.piece.positions.size())
        return error(
            "{}: expected triangles of the mesh's own vertices, found indices beyond their number. Export it "
            "again.",
            file_.path().string());
    out.piece.triangles = triangles_of(indices, mode);
    return out;
  }

  Result<DracoMesh> read_draco(const json& extension) {
    std::map<std::string, std::size_t> ids;
    for (const auto& [name, id] : extension.at("attributes").items()) ids[name] = whole_number(id);
    LIMN_TRY(const std::string_view bytes, file_.view(whole_number(extension, "bufferView", 0)));
    auto mesh = decode_draco(bytes, ids);
    if (!mesh)
      return file_.problem(
          fmt::format("expected a whole mesh in Draco's compression, found one that cannot be read ({})",
                      mesh.message()));
    return mesh;
  }

  // The numbers of an attribute; empty when the primitive has none.
  Result<std::vector<float>> attribute(const json& attributes,
                                       const DracoMesh& draco,
                                       const std::string& name,
                                       std::size_t components,
                                       bool may_be_more = false) {
    if (const auto found = draco.attributes.find(name); found != draco.attributes.end())
      return unpacked(*found, attributes, draco, components);
    if (!attributes.contains(name)) return std::vector<float>();
    const json& accessor = root_.at("accessors").at(whole_number(attributes, name.c_str(), 0));
    if (!draco.indices.empty() && !accessor.contains("bufferView")) return std::vector<float>();
    return file_.numbers(whole_number(attributes, name.c_str(), 0), components, may_be_more);
  }

  Result<std::vector<float>> unpacked(const std::pair<const std::string, std::vector<float>>& packed,
                                      const json& attributes,
                                      const DracoMesh& draco,
                                      std::size_t components) const {
    const std::size_t there = draco.components.at(packed.first);
    if (there < components)
      return file_.problem("expected " + packed.first + " with more numbers in Draco's data");
    // Draco's data do not always say that whole numbers stand for 0 to 1; the accessor does.
    float most = 1;
    for (const float value : packed.second) most = std::max(most, value);
    const json& accessor = root_.at("accessors").at(whole_number(attributes, packed.first.c_str(), 0));
    const std::size_t type = whole_number(accessor, "componentType", 5126);
    const bool is_scaled = accessor.value("normalized", false) && most > 1.5F;
    const float full = !is_scaled     ? 1.F
                       : type == 5120 ? 127.F
                       : type == 5121 ? 255.F
                       : type == 5122 ? 32767.F
                                      : 65535.F;
    std::vector<float> out;
    for (std::size_t i = 0; i + there <= packed.second.size(); i += there)
      for (std::size_t k = 0; k < components; ++k) out.push_back(packed.second[i + k] / full);
    return out;
  }

  Status read_attributes(const json& attributes, const DracoMesh& draco, Primitive* out) {
    MeshPiece& piece = out->piece;
    LIMN_TRY(const auto positions, attribute(attributes, draco, "POSITION", 3));
    LIMN_TRY(const auto normals, attribute(attributes, draco, "NORMAL", 3));
    LIMN_TRY(const auto tangents, attribute(attributes, draco, "TANGENT", 4));
    LIMN_TRY(auto colours, attribute(attributes, draco, "COLOR_0", 3, true));
    piece.positions = as_vectors<3>(positions);
    piece.normals = as_vectors<3>(normals);
    piece.tangents = as_vectors<4>(tangents);
    float most = 1;
    for (const float value : colours) most = std::max(most, value);
    const float full = most <= 1.001F ? 1.F
                       : most <= 255  ? 255.F
                                      : 65535.F;  // some files forget "normalized"
    for (float& value : colours) value = std::max(value / full, 0.F);
    piece.colours = as_vectors<3>(colours);
    for (std::size_t i = 0; attributes.contains(fmt::format("JOINTS_{}", i)); ++i) {
      LIMN_TRY(const auto joints, attribute(attributes, draco, fmt::format("JOINTS_{}", i), 4));
      LIMN_TRY(const auto weights, attribute(attributes, draco, fmt::format("WEIGHTS_{}", i), 4));
      for (const Eigen::Vector4f& v : as_vectors<4>(joints)) out->joints.push_back(v);
      for (const Eigen::Vector4f& v : as_vectors<4>(weights)) out->weights.push_back(v);
      ++out->sets;
    }
    const std::size_t count = piece.positions.size();
    const auto fits = [&](std::size_t size, std::size_t times = 1) {
      return size == 0 || size == count * times;
    };
    bool is_whole = true;
    for (const int set : sets_) {
      LIMN_TRY(const auto numbers, attribute(attributes, draco, fmt::format("TEXCOORD_{}", set), 2));
      auto& uvs = set == 0 ? piece.uvs : piece.more_uvs[set];
      uvs = as_vectors<2>(numbers);
      for (Eigen::Vector2f& uv : uvs) uv.y() = 1 - uv.y();  // glTF counts v from the top row
      is_whole &= fits(uvs.size());
    }
    if (is_whole && fits(piece.normals.size()) && fits(piece.tangents.size()) && fits(piece.colours.size()) &&
        fits(out->joints.size(), out->sets) && out->weights.size() == out->joints.size())
      return {};
    return file_.problem(
        fmt::format("expected attributes of {} vertices, found other numbers of entries", count));
  }

  // Adds the morph targets in their default weights.
  Status morph(const json& source, const std::vector<float>& weights, MeshPiece* piece) {
    const json targets = source.value("targets", json::array());
    for (std::size_t i = 0; i < std::min(targets.size(), weights.size()); ++i) {
      if (weights[i] == 0) continue;
      const auto add = [&](const char* name, auto* to) -> Status {
        if (!targets.at(i).contains(name) || to->empty()) return {};
        LIMN_TRY(const auto numbers, file_.numbers(whole_number(targets.at(i), name, 0), 3));
        const auto steps = as_vectors<3>(numbers);
        if (steps.size() != to->size())
          return file_.problem("expected a morph target of all vertices, found another number");
        for (std::size_t k = 0; k < steps.size(); ++k) (*to)[k].template head<3>() += weights[i] * steps[k];
        return {};
      };
      LIMN_TRY_STATUS(add("POSITION", &piece->positions));
      LIMN_TRY_STATUS(add("NORMAL", &piece->normals));
      LIMN_TRY_STATUS(add("TANGENT", &piece->tangents));
      for (Eigen::Vector3f& n : piece->normals) n.normalize();
    }
    return {};
  }

  // Moves the vertices with the joints of a skin, in the pose that the nodes have.
  Status skin(const json& skin, Primitive* primitive) {
    std::vector<Eigen::Matrix4d> file_from_mesh;
    std::vector<float> inverse;
    if (skin.contains("inverseBindMatrices"))
      LIMN_TRY_STATUS(read_into(skin, "inverseBindMatrices", 16, &inverse));
    for (const json& joint : skin.at("joints")) {
      const auto node = whole_number(joint);
      const std::size_t at = 16 * file_from_mesh.size();
      if (node >= file_from_node_.size() || !file_from_node_[node] ||
          (!inverse.empty() && at + 16 > inverse.size()))
        return file_.problem("expected a skin whose joints are nodes of the scene, found others");
      const Eigen::Matrix4d joint_from_mesh =
          inverse.empty() ? Eigen::Matrix4d::Identity().eval()
                          : Eigen::Matrix4d(Eigen::Map<const Eigen::Matrix4f>(&inverse[at]).cast<double>());
      file_from_mesh.push_back(*file_from_node_[node] * joint_from_mesh);
    }
    MeshPiece& piece = primitive->piece;
    const std::size_t count = piece.positions.size();
    for (std::size_t i = 0; i < count; ++i) {
      Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
      double total = 0;
      for (std::size_t set = 0; set < primitive->sets; ++set)
        for (Eigen::Index k = 0; k < 4; ++k) {
          const auto weight = static_cast<double>(primitive->weights[set * count + i][k]);
          const auto joint = static_cast<double>(primitive->joints[set * count + i][k]);
          if (!(weight > 0)) continue;
          if (!(joint >= 0 && joint < static_cast<double>(file_from_mesh.size())))
            return file_.problem(
                "expected vertices that follow joints of their skin, found numbers beyond them");
          sum += weight * file_from_mesh[static_cast<std::size_t>(joint)];
          total += weight;
        }
      if (total > 0) move_vertex(sum / total, i, &piece);
    }
    return {};
  }

  GltfFile& file_;
  const json& root_;
  MeshContent content_;
  std::set<int> sets_ = {0};  // texture coordinates that materials use, and the first ones
  std::vector<std::optional<Eigen::Matrix4d>> file_from_node_;
  std::vector<std::size_t> shown_;
};

}  // namespace

Result<MeshContent> read_gltf(const fs::path& path) {
  try {
    LIMN_TRY(GltfFile file, GltfFile::open(path));
    if (file.version() == 1) return read_with_assimp(path);
    return GltfReader(&file).read();
  } catch (const json::exception& problem) {
    return error("{}: expected a file in the form of glTF 2.0, found another ({}). Export it again.",
                 path.string(), problem.what());
  }
}

}  // namespace limn::scene
