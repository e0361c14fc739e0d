#include "scene/mesh.h"

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cctype>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/log.h"
#include "core/picture.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// Faces that meet at a sharper angle keep an edge between them when normals are made.
constexpr float k_crease_cos = 0.7660444f;  // 40 degrees: a bevel stays crisp, a coarse curve is smoothed

// What a vertex is while a mesh is read; joined by equality of its bytes.
struct Corner {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;
  Eigen::Vector2f uv;
};
static_assert(sizeof(Corner) == 8 * sizeof(float));

// A mesh as it comes from the file: three corners a triangle, nothing shared.
struct Soup {
  std::vector<Corner> corners;
  std::vector<std::uint16_t> triangle_materials;
  bool has_uvs = false;
  bool needs_normals = false;
};

std::string extension(const fs::path& path) {
  std::string text = path.extension().string();
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

Eigen::Matrix4f to_eigen(const aiMatrix4x4& m) {
  Eigen::Matrix4f out;
  out << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, m.d1, m.d2, m.d3, m.d4;
  return out;
}

Eigen::Vector3f to_eigen(const aiVector3D& v) { return {v.x, v.y, v.z}; }

Result<cv::Mat> embedded_texture(const aiTexture& texture, const fs::path& path, bool with_alpha) {
  if (texture.mHeight > 0) {
    static_assert(sizeof(aiTexel) == 4);  // b, g, r, a
    const cv::Mat bgra(static_cast<int>(texture.mHeight), static_cast<int>(texture.mWidth), CV_8UC4,
                       texture.pcData);
    if (with_alpha) return bgra.clone();
    cv::Mat bgr(bgra.size(), CV_8UC3);
    const int from_to[] = {0, 0, 1, 1, 2, 2};
    cv::mixChannels(&bgra, 1, &bgr, 1, from_to, 3);
    return bgr;
  }
  const cv::Mat bytes(1, static_cast<int>(texture.mWidth), CV_8U, texture.pcData);
  cv::Mat picture = cv::imdecode(bytes, with_alpha ? cv::IMREAD_UNCHANGED : cv::IMREAD_COLOR);
  if (picture.empty()) {
    return error(
        "{}: expected a PNG or JPEG as its embedded texture, found {} bytes that are neither. "
        "Export the mesh again.",
        path.string(), texture.mWidth);
  }
  if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257);
  return picture;
}

// Where a texture named by a mesh is: as written there, else by its bare name beside the mesh.
fs::path texture_path(const std::string& name, const fs::path& mesh_path) {
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const fs::path folder = mesh_path.parent_path();
  const fs::path inside =
      fs::path(slashes).is_relative() ? folder / slashes : folder / fs::path(slashes).filename();
  return fs::exists(inside) ? inside : folder / fs::path(slashes).filename();
}

Result<cv::Mat> texture_beside(const fs::path& path, const fs::path& mesh_path, bool with_alpha) {
  auto picture = with_alpha ? read_picture_with_alpha(path) : read_picture(path);
  if (!picture) return error("{}: its texture cannot be read: {}", mesh_path.string(), picture.message());
  return picture;
}

// The alpha under which a glTF material has nothing; 0: it has no such places. What is half transparent
// (alphaMode BLEND) is whole from a half on: light cannot be seen through.
float cut_below(const aiMaterial& source) {
  aiString mode;
  if (source.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != AI_SUCCESS || mode == aiString("OPAQUE")) return 0;
  float cutoff = 0.5F;
  if (mode == aiString("MASK")) source.Get(AI_MATKEY_GLTF_ALPHACUTOFF, cutoff);
  return cutoff;
}

// What is cut out takes the colour of what is next to it, which filtering mixes with it. False: nothing is
// left.
bool spread_into_holes(float below, cv::Mat* bgra) {
  cv::Mat alpha, labels, distances;
  cv::extractChannel(*bgra, alpha, 3);
  const cv::Mat is_hole = alpha < 255 * below;
  if (cv::countNonZero(is_hole) == is_hole.rows * is_hole.cols) return false;
  cv::distanceTransform(is_hole, distances, labels, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  std::vector<cv::Vec4b> colours(static_cast<std::size_t>(bgra->total()) + 1);
  const auto label = [&](int row, int column) {
    return static_cast<std::size_t>(labels.at<int>(row, column));
  };
  for (const bool holes_now : {false, true})
    for (int row = 0; row < bgra->rows; ++row)
      for (int column = 0; column < bgra->cols; ++column) {
        if ((is_hole.at<std::uint8_t>(row, column) != 0) != holes_now) continue;
        cv::Vec4b& texel = bgra->at<cv::Vec4b>(row, column);
        cv::Vec4b& nearest = colours[label(row, column)];
        if (!holes_now)
          nearest = texel;
        else
          texel = {nearest[0], nearest[1], nearest[2], texel[3]};
      }
  return true;
}

Result<Material> read_material(const aiMaterial& source, const aiScene& scene, const fs::path& path) {
  Material material;
  aiColor4D colour;
  if (source.Get(AI_MATKEY_BASE_COLOR, colour) == AI_SUCCESS ||
      source.Get(AI_MATKEY_COLOR_DIFFUSE, colour) == AI_SUCCESS) {
    material.base_colour = {colour.r, colour.g, colour.b};
  }
  int shading = 0;
  material.unlit =
      source.Get(AI_MATKEY_SHADING_MODEL, shading) == AI_SUCCESS && shading == aiShadingMode_Unlit;
  source.Get(AI_MATKEY_METALLIC_FACTOR, material.metallic);
  source.Get(AI_MATKEY_ROUGHNESS_FACTOR, material.roughness);
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
    aiString name;
    if (source.GetTexture(type, 0, &name) != AI_SUCCESS || name.length == 0) continue;
    const aiTexture* embedded = scene.GetEmbeddedTexture(name.C_Str());
    const fs::path file = embedded ? path : texture_path(name.C_Str(), path);
    const float below = cut_below(source);
    LIMN_TRY(material.texture,
             embedded ? embedded_texture(*embedded, path, below > 0) : texture_beside(file, path, below > 0));
    if (material.texture.channels() == 1)
      cv::cvtColor(material.texture, material.texture, cv::COLOR_GRAY2BGR);
    material.texture_file = file.string();
    if (material.texture.channels() != 4) break;
    if (spread_into_holes(below, &material.texture)) {
      material.cut_below = below;
    } else {
      cv::cvtColor(material.texture, material.texture, cv::COLOR_BGRA2BGR);
      log_warning(
          "{}: expected a texture with an alpha of {} or more somewhere, found less all over; it is shown as "
          "if it were opaque. Raise its alpha where the part is to be seen.",
          file.string(), below);
    }
    break;
  }
  return material;
}

void append(const aiMesh& mesh, const Eigen::Matrix4f& file_from_node, float metres, Soup* soup) {
  const Eigen::Matrix3f turn = file_from_node.topLeftCorner<3, 3>();
  const Eigen::Matrix3f normal_turn = turn.inverse().transpose();
  const bool mirrored = turn.determinant() < 0;  // a mirroring transform turns the triangles inside out
  const bool has_normals = mesh.HasNormals();
  soup->needs_normals |= !has_normals;
  soup->has_uvs |= mesh.HasTextureCoords(0);
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) continue;
    for (unsigned k = 0; k < 3; ++k) {
      const unsigned i = face.mIndices[mirrored ? 2 - k : k];
      Corner corner;
      corner.position =
          ((turn * to_eigen(mesh.mVertices[i]) + file_from_node.topRightCorner<3, 1>()) * metres).array() +
          0.f;
      corner.normal = has_normals ? Eigen::Vector3f((normal_turn * to_eigen(mesh.mNormals[i])).normalized())
                                  : Eigen::Vector3f::Zero().eval();
      corner.uv = mesh.HasTextureCoords(0)
                      ? Eigen::Vector2f(mesh.mTextureCoords[0][i].x, mesh.mTextureCoords[0][i].y)
                      : Eigen::Vector2f::Zero().eval();
      soup->corners.push_back(corner);
    }
    soup->triangle_materials.push_back(static_cast<std::uint16_t>(mesh.mMaterialIndex));
  }
}

void append(const aiScene& scene,
            const aiNode& node,
            const Eigen::Matrix4f& file_from_parent,
            float metres,
            Soup* soup) {
  const Eigen::Matrix4f file_from_node = file_from_parent * to_eigen(node.mTransformation);
  for (unsigned i = 0; i < node.mNumMeshes; ++i)
    append(*scene.mMeshes[node.mMeshes[i]], file_from_node, metres, soup);
  for (unsigned i = 0; i < node.mNumChildren; ++i)
    append(scene, *node.mChildren[i], file_from_node, metres, soup);
}

Eigen::Vector3f face_normal(const Soup& soup, std::size_t triangle) {
  const Corner* c = &soup.corners[3 * triangle];
  return (c[1].position - c[0].position).cross(c[2].position - c[0].position);
}

float angle_at(const Soup& soup, std::size_t corner) {
  const std::size_t first = corner / 3 * 3;
  const Eigen::Vector3f& p = soup.corners[corner].position;
  const Eigen::Vector3f a = (soup.corners[first + (corner + 1 - first) % 3].position - p).normalized();
  const Eigen::Vector3f b = (soup.corners[first + (corner + 2 - first) % 3].position - p).normalized();
  return std::acos(std::clamp(a.dot(b), -1.f, 1.f));
}

// Index of the distinct position of every corner.
std::vector<unsigned> joined_positions(const Soup& soup, std::size_t* count) {
  std::vector<Eigen::Vector3f> positions;
  positions.reserve(soup.corners.size());
  for (const Corner& corner : soup.corners) positions.push_back(corner.position);
  std::vector<unsigned> remap(positions.size());
  *count = meshopt_generateVertexRemap(remap.data(), nullptr, positions.size(), positions.data(),
                                       positions.size(), sizeof(Eigen::Vector3f));
  return remap;
}

// Normals from the faces around each corner, weighted by their angle there; edges sharper than the crease
// stay.
void make_normals(Soup* soup) {
  std::size_t count = 0;
  const std::vector<unsigned> position_of = joined_positions(*soup, &count);
  std::vector<unsigned> begin(count + 1, 0);
  for (const unsigned p : position_of) ++begin[p + 1];
  for (std::size_t p = 0; p < count; ++p) begin[p + 1] += begin[p];
  std::vector<unsigned> around(position_of.size());
  std::vector<unsigned> fill(begin.begin(), begin.end() - 1);
  for (unsigned c = 0; c < position_of.size(); ++c) around[fill[position_of[c]]++] = c;

  std::vector<Eigen::Vector3f> d_face(soup->triangle_materials.size());
  for (std::size_t t = 0; t < d_face.size(); ++t) d_face[t] = face_normal(*soup, t).normalized();
  for (unsigned c = 0; c < position_of.size(); ++c) {
    if (soup->corners[c].normal.squaredNorm() > 0.25f) continue;  // the file has one
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (unsigned k = begin[position_of[c]]; k < begin[position_of[c] + 1]; ++k) {
      const unsigned other = around[k];
      if (d_face[other / 3].dot(d_face[c / 3]) > k_crease_cos)
        sum += angle_at(*soup, other) * d_face[other / 3];
    }
    soup->corners[c].normal = sum.squaredNorm() > 0 ? sum.normalized() : Eigen::Vector3f(0, 0, 1);
  }
}

Mesh joined(const Soup& soup) {
  const std::size_t corner_count = soup.corners.size();
  std::vector<unsigned> remap(corner_count);
  const std::size_t count = meshopt_generateVertexRemap(remap.data(), nullptr, corner_count,
                                                        soup.corners.data(), corner_count, sizeof(Corner));
  Mesh mesh;
  mesh.positions.resize(count);
  mesh.normals.resize(count);
  if (soup.has_uvs) mesh.uvs.resize(count);
  for (std::size_t c = 0; c < corner_count; ++c) {
    mesh.positions[remap[c]] = soup.corners[c].position;
    mesh.normals[remap[c]] = soup.corners[c].normal;
    if (soup.has_uvs) mesh.uvs[remap[c]] = soup.corners[c].uv;
  }
  for (std::size_t t = 0; t < soup.triangle_materials.size(); ++t) {
    if (!(face_normal(soup, t).squaredNorm() > 0)) continue;  // without area
    mesh.triangles.push_back({remap[3 * t], remap[3 * t + 1], remap[3 * t + 2]});
    mesh.triangle_materials.push_back(soup.triangle_materials[t]);
  }
  return mesh;
}

Status checked(const Soup& soup, const fs::path& path) {
  for (std::size_t c = 0; c < soup.corners.size(); ++c) {
    const Corner& corner = soup.corners[c];
    if (corner.position.allFinite() && corner.uv.allFinite()) continue;
    return error(
        "{}: triangle {}: expected finite coordinates, found NaN or infinity. Repair or export the mesh "
        "again.",
        path.string(), c / 3);
  }
  return {};
}

Error no_triangles(const fs::path& path) {
  return error("{}: expected triangles, found none. Export the mesh with its faces.", path.string());
}

// Assimp's STL reader gives each triangle its own normal; it goes, so that curved surfaces are smooth.
void drop_normals(Soup* soup) {
  for (Corner& corner : soup->corners) corner.normal.setZero();
  soup->needs_normals = true;
}

Status known_format(const fs::path& path) {
  const std::string format = extension(path);
  for (const char* known : {".glb", ".gltf", ".obj", ".stl", ".ply"}) {
    if (format == known) return {};
  }
  return error(
      "{}: expected a mesh file (.glb, .gltf, .obj, .stl or .ply), found '{}'. Export it as one of these.",
      path.string(), format);
}

// What assimp warns of while this lives: it drops triangles with a warning and calls the rest a success. One
// thread at a time, for its logger is global.
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

}  // namespace

Result<double> metres_per_unit(const std::string& units) {
  static const std::map<std::string, double> k_units = {
      {"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}};
  const auto found = k_units.find(units);
  if (found == k_units.end()) {
    return error(
        "expected a unit of length (m, cm, mm, in or ft), found '{}'. Say in which unit the mesh was drawn.",
        units);
  }
  return found->second;
}

Result<Mesh> load_mesh(const fs::path& path, const std::string& units) {
  const auto metres = metres_per_unit(units);
  if (!metres) return error("{}: {}", path.string(), metres.message());
  LIMN_TRY_STATUS(known_format(path));
  if (std::error_code code; !fs::is_regular_file(path, code)) {
    return error("{}: expected a mesh file, found none. Check the name.", path.string());
  }
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  Complaints complaints;
  const aiScene* scene = importer.ReadFile(
      path.string(), aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_ValidateDataStructure);
  if (complaints.text().find("out-of-range indices") != std::string::npos) {
    return error(
        "{}: expected triangles of the mesh's own vertices, found indices beyond them. Export it again.",
        path.string());
  }
  const std::string problem = importer.GetErrorString();
  const bool without_faces =
      problem.find("no faces") != std::string::npos ||
      problem.find("No meshes remaining") != std::string::npos;  // points and lines only
  if (!scene && without_faces) return no_triangles(path);
  if (!scene) {
    return error("{}: expected a whole {} mesh, found one that cannot be read ({}). Export it again.",
                 path.string(), extension(path).substr(1), problem);
  }
  if (!scene->mRootNode) return no_triangles(path);
  Soup soup;
  append(*scene, *scene->mRootNode, Eigen::Matrix4f::Identity(), static_cast<float>(*metres), &soup);
  if (soup.triangle_materials.empty()) return no_triangles(path);
  LIMN_TRY_STATUS(checked(soup, path));
  if (extension(path) == ".stl") drop_normals(&soup);
  const bool broken_normal = std::any_of(soup.corners.begin(), soup.corners.end(), [](Corner& corner) {
    if (!corner.normal.allFinite()) corner.normal.setZero();
    return corner.normal.squaredNorm() < 0.25f;
  });
  if (soup.needs_normals || broken_normal) make_normals(&soup);

  Mesh mesh = joined(soup);
  if (mesh.triangles.empty()) return no_triangles(path);
  mesh.materials.clear();
  for (unsigned i = 0; i < scene->mNumMaterials; ++i) {
    LIMN_TRY(Material material, read_material(*scene->mMaterials[i], *scene, path));
    mesh.materials.push_back(std::move(material));
  }
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  for (std::uint16_t& index : mesh.triangle_materials) {
    if (index >= mesh.materials.size()) index = 0;
  }
  return mesh;
}

}  // namespace limn::scene
