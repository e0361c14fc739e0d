#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <map>
#include <regex>

#include "core/file.h"
#include "core/program_library.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// Collects assimp's warnings while it exists: assimp drops bad triangles with only a warning.
class Complaints {
 public:
  Complaints() {
    Assimp::DefaultLogger::create(nullptr, Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(&stream_, k_severities);
  }
  ~Complaints() {
    Assimp::DefaultLogger::get()->detachStream(&stream_, k_severities);
    Assimp::DefaultLogger::kill();
  }
  Complaints(const Complaints&) = delete;
  Complaints& operator=(const Complaints&) = delete;
  const std::string& text() const { return stream_.text; }

 private:
  static constexpr unsigned k_severities = Assimp::Logger::Err | Assimp::Logger::Warn;
  struct Stream : Assimp::LogStream {
    void write(const char* message) override { text += message; }
    std::string text;
  };
  Stream stream_;
};

Eigen::Matrix4d to_eigen(const aiMatrix4x4& m) {
  Eigen::Matrix4d out;
  out << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
  return out;
}

Eigen::Vector3f to_eigen(const aiVector3D& v) { return {v.x, v.y, v.z}; }

// The first group of a pattern in the text of a file; nullopt: it is not there.
std::optional<std::string> found_in(const fs::path& path, const std::string& pattern) {
  const auto text = read_file(path);
  constexpr std::size_t k_header = 65536;  // units stand at the beginning
  std::smatch match;
  const std::string begin = text ? text->substr(0, k_header) : std::string();
  if (!std::regex_search(begin, match, std::regex(pattern, std::regex::icase))) return std::nullopt;
  return match[1].str();
}

double positive_or(double value, double otherwise) { return value > 0 && value < 1e6 ? value : otherwise; }

double collada_unit(const fs::path& path) {
  const auto text = found_in(path, "<unit\\b[^>]*\\bmeter\\s*=\\s*[\"']([^\"']+)");
  return text ? positive_or(std::atof(text->c_str()), 1) : 1;
}

double amf_unit(const fs::path& path) {
  static const std::map<std::string, double> k_units = {
      {"millimeter", 1e-3}, {"meter", 1}, {"inch", 0.0254}, {"feet", 0.3048}, {"micron", 1e-6}};
  const auto known =
      k_units.find(found_in(path, "<amf\\b[^>]*\\bunit\\s*=\\s*[\"'](\\w+)").value_or("millimeter"));
  return known == k_units.end() ? 1e-3 : known->second;
}

double fbx_unit(const aiScene& scene) {
  float centimetres = 1;
  if (scene.mMetaData) scene.mMetaData->Get("UnitScaleFactor", centimetres);
  return 0.01 * positive_or(static_cast<double>(centimetres), 1);
}

class AssimpReader {
 public:
  AssimpReader(const aiScene& scene, const fs::path& path) : scene_(scene), path_(path) {}

  MeshContent read() {
    read_materials();
    const std::string format = lower_extension(path_);
    Eigen::Matrix4d file_from_root = to_eigen(scene_.mRootNode->mTransformation);
    if (format == ".fbx") {
      content_.metres_per_unit = fbx_unit(scene_);
      file_from_root.setIdentity();  // since version 5.4 assimp turns an FBX's root to axes of its own
    }
    if (format == ".amf") content_.metres_per_unit = amf_unit(path_);
    if (format == ".gltf" || format == ".glb") content_.metres_per_unit = 1;
    if (format == ".dae") {
      content_.metres_per_unit = collada_unit(path_);
      file_from_root.topRows<3>() /= *content_.metres_per_unit;  // assimp has scaled the root to metres
    }
    place(*scene_.mRootNode, file_from_root);
    add(*scene_.mRootNode);
    if (has_morphs_)
      content_.warnings.push_back(fmt::format(
          "{}: its morph targets (blend shapes) are not applied; the basic shape is shown. Apply them "
          "before the export, or export glTF.",
          path_.string()));
    return std::move(content_);
  }

 private:
  void place(const aiNode& node, const Eigen::Matrix4d& file_from_node) {
    file_from_node_[&node] = file_from_node;
    for (unsigned i = 0; i < node.mNumChildren; ++i) {
      const aiNode& child = *node.mChildren[i];
      place(child, file_from_node * to_eigen(child.mTransformation));
    }
  }

  void add(const aiNode& node) {
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      const aiMesh& mesh = *scene_.mMeshes[node.mMeshes[i]];
      MeshPiece piece = piece_of(mesh);
      has_morphs_ |= mesh.mNumAnimMeshes > 0;
      if (!pose(mesh, file_from_node_.at(&node), &piece)) piece = moved(piece, file_from_node_.at(&node));
      content_.pieces.push_back(std::move(piece));
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) add(*node.mChildren[i]);
  }

  MeshPiece piece_of(const aiMesh& mesh) const {
    MeshPiece piece;
    piece.material = std::min<std::size_t>(mesh.mMaterialIndex, content_.materials.size() - 1);
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      piece.positions.push_back(to_eigen(mesh.mVertices[i]));
      if (mesh.HasNormals()) piece.normals.push_back(to_eigen(mesh.mNormals[i]));
      if (mesh.HasVertexColors(0)) {
        const aiColor4D& c = mesh.mColors[0][i];
        piece.colours.emplace_back(linear_from_srgb(c.r), linear_from_srgb(c.g), linear_from_srgb(c.b));
      }
    }
    const auto set = static_cast<unsigned>(content_.materials[piece.material].base.place.coordinates);
    auto& uvs = set == 0 ? piece.uvs : piece.more_uvs[static_cast<int>(set)];
    for (unsigned i = 0; mesh.HasTextureCoords(set) && i < mesh.mNumVertices; ++i)
      uvs.emplace_back(mesh.mTextureCoords[set][i].x, mesh.mTextureCoords[set][i].y);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f)
      if (const aiFace& face = mesh.mFaces[f]; face.mNumIndices == 3)
        piece.triangles.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
    return piece;
  }

  // Moves a skinned mesh into the pose of its bones' nodes. False: it has no skin, or its bones are not in
  // the file.
  bool pose(const aiMesh& mesh, const Eigen::Matrix4d& file_from_node, MeshPiece* piece) const {
    std::vector<Eigen::Matrix4d> sums(mesh.mNumVertices, Eigen::Matrix4d::Zero());
    std::vector<double> totals(mesh.mNumVertices, 0);
    for (unsigned b = 0; b < mesh.mNumBones; ++b) {
      const aiBone& bone = *mesh.mBones[b];
      const aiNode* node = scene_.mRootNode->FindNode(bone.mName);
      if (!node) return false;
      const Eigen::Matrix4d file_from_mesh = file_from_node_.at(node) * to_eigen(bone.mOffsetMatrix);
      for (unsigned w = 0; w < bone.mNumWeights; ++w) {
        const aiVertexWeight& weight = bone.mWeights[w];
        if (weight.mVertexId >= mesh.mNumVertices) continue;
        sums[weight.mVertexId] += static_cast<double>(weight.mWeight) * file_from_mesh;
        totals[weight.mVertexId] += static_cast<double>(weight.mWeight);
      }
    }
    for (std::size_t i = 0; i < sums.size() && mesh.mNumBones > 0; ++i) {
      const Eigen::Matrix4d m = totals[i] > 0 ? Eigen::Matrix4d(sums[i] / totals[i]) : file_from_node;
      move_vertex(m, i, piece);
    }
    return mesh.mNumBones > 0;
  }

  void read_materials() {
    for (unsigned i = 0; i < scene_.mNumTextures; ++i) {
      const aiTexture& texture = *scene_.mTextures[i];
      EmbeddedImage image;
      static_assert(sizeof(aiTexel) == 4);  // b, g, r, a
      if (texture.mHeight > 0)
        image.pixels = cv::Mat(static_cast<int>(texture.mHeight), static_cast<int>(texture.mWidth), CV_8UC4,
                               texture.pcData)
                           .clone();
      else
        image.bytes.assign(reinterpret_cast<const char*>(texture.pcData), texture.mWidth);
      content_.images.push_back(std::move(image));
    }
    for (unsigned i = 0; i < scene_.mNumMaterials; ++i)
      content_.materials.push_back(material_of(*scene_.mMaterials[i]));
    if (content_.materials.empty())
      content_.materials.push_back({.base_colour = Eigen::Vector3f::Constant(k_no_colour)});
  }

  MaterialSource material_of(const aiMaterial& source) const {
    MaterialSource material;
    material.name = source.GetName().C_Str();
    aiColor4D colour(1, 1, 1, 1);
    if (source.Get(AI_MATKEY_BASE_COLOR, colour) != AI_SUCCESS) source.Get(AI_MATKEY_COLOR_DIFFUSE, colour);
    material.base_colour = {colour.r, colour.g, colour.b};
    source.Get(AI_MATKEY_METALLIC_FACTOR, material.metallic);
    source.Get(AI_MATKEY_ROUGHNESS_FACTOR, material.roughness);
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      aiString name;
      if (source.GetTexture(type, 0, &name) != AI_SUCCESS || name.length == 0) continue;
      material.base.name = name.C_Str();
      const auto [embedded, number] = scene_.GetEmbeddedTextureAndIndex(name.C_Str());
      if (embedded) material.base.embedded = number;
      source.Get(AI_MATKEY_UVWSRC(type, 0), material.base.place.coordinates);
      material.base.place.coordinates =
          std::clamp(material.base.place.coordinates, 0, AI_MAX_NUMBER_OF_TEXTURECOORDS - 1);
      break;
    }
    // Some programs write a black colour beside a texture and mean the texture.
    if (material.base.is_there() && material.base_colour.isZero()) material.base_colour.setOnes();
    return material;
  }

  const aiScene& scene_;
  const fs::path& path_;
  MeshContent content_;
  std::map<const aiNode*, Eigen::Matrix4d> file_from_node_;
  bool has_morphs_ = false;
};

Result<MeshContent> read_with_assimp(const fs::path& path) {
  Assimp::Importer importer;
  Complaints complaints;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyInteger(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, 1);
  const aiScene* scene = importer.ReadFile(
      path.string(), aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_ValidateDataStructure);
  if (complaints.text().find("out-of-range indices") != std::string::npos)
    return error(
        "{}: expected triangles of the mesh's own vertices, found indices beyond their number. Export it "
        "again.",
        path.string());
  const std::string problem = importer.GetErrorString();
  const bool is_without_faces =
      problem.find("no faces") != std::string::npos ||
      problem.find("No meshes remaining") != std::string::npos;  // only points and lines
  if (problem.find("old format version") != std::string::npos)
    return error("{}: expected FBX 2011 or newer, found an older one. Export it as a newer FBX, or as glTF.",
                 path.string());
  if (!scene && !is_without_faces) return damaged_mesh(path, problem);
  if (!scene || !scene->mRootNode) return MeshContent{};
  return AssimpReader(*scene, path).read();
}

}  // namespace
}  // namespace limn::scene

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) void limn_read_with_assimp(
    const std::filesystem::path& path, limn::Result<limn::scene::MeshContent>* content) {
  *content = limn::scene::read_with_assimp(path);
}
