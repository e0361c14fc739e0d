#include "scene/mesh.h"

#include <assimp/scene.h>
#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cctype>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/log.h"
#include "scene/mesh_trial.h"
#include "scene/read_materials.h"
#include "scene/tangents.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// When normals are computed, faces whose normals differ by more keep a sharp edge between them.
constexpr float k_crease_cos = 0.7660444f;  // 40 degrees: a bevel stays sharp, a coarse curve is smoothed

// A vertex while a mesh is read. Vertices with equal bytes are merged.
struct Corner {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;
  Eigen::Vector2f uv;
};
static_assert(sizeof(Corner) == 8 * sizeof(float));

// A mesh as it comes from the file: three corners per triangle, no shared vertices.
struct Soup {
  std::vector<Corner> corners;
  std::vector<Eigen::Vector4f> tangents;  // per corner, as in Mesh; empty: the file has none
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

// A vertex's tangent in the file's frame. If `turn` mirrors, the handedness changes.
Eigen::Vector4f tangent_of(const aiMesh& mesh, unsigned i, const Eigen::Matrix3f& turn) {
  const Eigen::Vector3f t = to_eigen(mesh.mTangents[i]), b = to_eigen(mesh.mBitangents[i]);
  const float hand = to_eigen(mesh.mNormals[i]).cross(t).dot(b) * turn.determinant();
  const Eigen::Vector3f turned = (turn * t).normalized();
  return {turned.x(), turned.y(), turned.z(), hand < 0 ? -1.F : 1.F};
}

// Whether the texture's axes are parallel to its coordinates' axes, as a file's tangents assume.
bool is_upright(const TexturePlace& place) {
  const Eigen::Matrix2f m = place.moved.linear();
  return m(0, 0) > 0 && m(1, 1) > 0 && std::max(std::abs(m(0, 1)), std::abs(m(1, 0))) < 1e-6F;
}

void append(const aiMesh& mesh,
            const TexturePlace& place,
            const Eigen::Matrix4f& file_from_node,
            float metres,
            Soup* soup) {
  const Eigen::Matrix3f turn = file_from_node.topLeftCorner<3, 3>();
  const Eigen::Matrix3f normal_turn = turn.inverse().transpose();
  const bool mirrored = turn.determinant() < 0;  // a mirroring transform turns the triangles inside out
  const bool has_normals = mesh.HasNormals();
  soup->needs_normals |= !has_normals;
  const auto coordinates = static_cast<unsigned>(place.coordinates);
  const aiVector3D* uvs = mesh.HasTextureCoords(coordinates) ? mesh.mTextureCoords[coordinates] : nullptr;
  soup->has_uvs |= uvs != nullptr;
  const bool has_tangents = has_normals && mesh.HasTangentsAndBitangents() && is_upright(place);
  if (has_tangents) soup->tangents.resize(soup->corners.size(), Eigen::Vector4f::Zero());
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
      corner.uv = uvs ? place.moved * Eigen::Vector2f(uvs[i].x, uvs[i].y) : Eigen::Vector2f::Zero().eval();
      soup->corners.push_back(corner);
      if (has_tangents) soup->tangents.push_back(tangent_of(mesh, i, turn));
    }
    soup->triangle_materials.push_back(static_cast<std::uint16_t>(mesh.mMaterialIndex));
  }
  if (!soup->tangents.empty()) soup->tangents.resize(soup->corners.size(), Eigen::Vector4f::Zero());
}

void append(const aiScene& scene,
            const aiNode& node,
            const Eigen::Matrix4f& file_from_parent,
            float metres,
            Soup* soup) {
  const Eigen::Matrix4f file_from_node = file_from_parent * to_eigen(node.mTransformation);
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& mesh = *scene.mMeshes[node.mMeshes[i]];
    const bool has_material = mesh.mMaterialIndex < scene.mNumMaterials;
    append(mesh, has_material ? texture_place(*scene.mMaterials[mesh.mMaterialIndex]) : TexturePlace{},
           file_from_node, metres, soup);
  }
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

// For each corner, the index of its distinct position.
std::vector<unsigned> joined_positions(const Soup& soup, std::size_t* count) {
  std::vector<Eigen::Vector3f> positions;
  positions.reserve(soup.corners.size());
  for (const Corner& corner : soup.corners) positions.push_back(corner.position);
  std::vector<unsigned> remap(positions.size());
  *count = meshopt_generateVertexRemap(remap.data(), nullptr, positions.size(), positions.data(),
                                       positions.size(), sizeof(Eigen::Vector3f));
  return remap;
}

// Computes missing normals from the faces around each corner, weighted by their angle there. Edges sharper
// than the crease angle are kept.
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
    if (soup->corners[c].normal.squaredNorm() > 0.25f) continue;  // the file gave a normal
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (unsigned k = begin[position_of[c]]; k < begin[position_of[c] + 1]; ++k) {
      const unsigned other = around[k];
      if (d_face[other / 3].dot(d_face[c / 3]) > k_crease_cos)
        sum += angle_at(*soup, other) * d_face[other / 3];
    }
    soup->corners[c].normal = sum.squaredNorm() > 0 ? sum.normalized() : Eigen::Vector3f(0, 0, 1);
  }
}

// Merges equal vertices and drops triangles without area. `corner_tangents` gets the remaining corners'
// tangents.
Mesh joined(const Soup& soup, std::vector<Eigen::Vector4f>* corner_tangents) {
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
    if (soup.tangents.empty()) continue;
    for (std::size_t k = 0; k < 3; ++k) corner_tangents->push_back(soup.tangents[3 * t + k]);
  }
  return mesh;
}

// Removes the texture maps of a mesh without uvs. A material with an emission map then emits nothing.
void leave_out_maps(const fs::path& path, Mesh* mesh) {
  bool has_textures = false;
  for (Material& material : mesh->materials) {
    has_textures |= !material.texture.empty() || !material.maps.is_none();
    if (!material.maps.emission.image.empty()) material.emitted.setZero();
    material.maps = {};
  }
  if (!has_textures) return;
  log_warning(
      "{}: expected texture coordinates because its materials have textures, found none. It is shown without "
      "textures. Export the mesh with texture coordinates.",
      path.string());
}

Status check_mesh(const Soup& soup, const fs::path& path) {
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

// Assimp's STL reader gives each triangle its own normal. These are dropped, so that curved surfaces are
// smooth.
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

// Collects assimp's warnings while it exists: assimp drops bad triangles with only a warning. It must be used
// by one thread at a time, because assimp's logger is global.
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

// On a PLY file whose header has no end assimp searches for ever.
Status check_ply_header(const fs::path& path) {
  constexpr int k_most_lines = 10000;
  std::error_code ignored;
  const auto bytes = fs::file_size(path, ignored);
  std::ifstream in(path, std::ios::binary);
  std::string line, word, name;
  for (int i = 0; i < k_most_lines && std::getline(in, line); ++i) {
    if (line.ends_with('\r')) line.pop_back();
    if (i == 0 && line != "ply") break;
    if (line == "end_header") return {};
    std::uintmax_t count = 0;
    if (std::istringstream(line) >> word >> name >> count && word == "element" && count > bytes)
      return error(
          "{}: expected a whole ply mesh, found {} bytes that are to hold {} elements '{}'. Export it again.",
          path.string(), bytes, count, name);
  }
  return error("{}: expected a whole ply mesh, found no header from 'ply' to 'end_header'. Export it again.",
               path.string());
}

}  // namespace

double metres_per_unit(LengthUnit units) {
  switch (units) {
    case LengthUnit::metre:
      return 1;
    case LengthUnit::centimetre:
      return 0.01;
    case LengthUnit::millimetre:
      return 0.001;
    case LengthUnit::inch:
      return 0.0254;
    case LengthUnit::foot:
      break;
  }
  return 0.3048;
}

Result<Mesh> load_mesh(const fs::path& path, LengthUnit units) {
  LIMN_TRY_STATUS(known_format(path));
  if (std::error_code code; !fs::is_regular_file(path, code)) {
    return error("{}: expected a mesh file, found no file. Check the name.", path.string());
  }
  if (extension(path) == ".ply") {
    LIMN_TRY_STATUS(check_ply_header(path));
  }
  LIMN_TRY_STATUS(try_mesh_reader(path));
  Assimp::Importer importer;
  Complaints complaints;
  const aiScene* scene = read_with_assimp(path, &importer);
  if (complaints.text().find("out-of-range indices") != std::string::npos) {
    return error(
        "{}: expected triangles of the mesh's own vertices, found indices beyond their number. Export it "
        "again.",
        path.string());
  }
  const std::string problem = importer.GetErrorString();
  const bool without_faces =
      problem.find("no faces") != std::string::npos ||
      problem.find("No meshes remaining") != std::string::npos;  // the file has only points and lines
  if (!scene && without_faces) return no_triangles(path);
  if (!scene) {
    return error("{}: expected a complete {} mesh, found one that cannot be read ({}). Export it again.",
                 path.string(), extension(path).substr(1), problem);
  }
  if (!scene->mRootNode) return no_triangles(path);
  Soup soup;
  append(*scene, *scene->mRootNode, Eigen::Matrix4f::Identity(), static_cast<float>(metres_per_unit(units)),
         &soup);
  if (soup.triangle_materials.empty()) return no_triangles(path);
  LIMN_TRY_STATUS(check_mesh(soup, path));
  if (extension(path) == ".stl") drop_normals(&soup);
  const bool broken_normal = std::any_of(soup.corners.begin(), soup.corners.end(), [](Corner& corner) {
    if (!corner.normal.allFinite()) corner.normal.setZero();
    return corner.normal.squaredNorm() < 0.25f;
  });
  if (soup.needs_normals || broken_normal) make_normals(&soup);

  std::vector<Eigen::Vector4f> corner_tangents;
  Mesh mesh = joined(soup, &corner_tangents);
  if (mesh.triangles.empty()) return no_triangles(path);
  LIMN_TRY(mesh.materials,
           read_materials(*scene, path, extension(path) == ".glb" || extension(path) == ".gltf"));
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  for (std::uint16_t& index : mesh.triangle_materials) {
    if (index >= mesh.materials.size()) index = 0;
  }
  if (mesh.uvs.empty()) leave_out_maps(path, &mesh);
  const auto has_normal_map = [](const Material& m) { return !m.maps.normals.image.empty(); };
  if (std::any_of(mesh.materials.begin(), mesh.materials.end(), has_normal_map))
    add_tangents(&mesh, corner_tangents);
  return mesh;
}

}  // namespace limn::scene
