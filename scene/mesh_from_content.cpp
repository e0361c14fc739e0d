#include "scene/mesh_from_content.h"

#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/log.h"
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
  Eigen::Vector2f uv, second_uv;
  Eigen::Vector3f colour;
};
static_assert(sizeof(Corner) == 13 * sizeof(float));

// A mesh as it comes from the file: three corners per triangle, no shared vertices.
struct Soup {
  std::vector<Corner> corners;
  std::vector<Eigen::Vector4f> tangents;  // per corner, as in Mesh; empty: the file has none
  std::vector<std::uint16_t> triangle_materials;
  bool has_uvs = false, has_second_uvs = false;
  bool has_colours = false;
  std::set<std::pair<std::size_t, int>> lacking;  // materials and the sets that pieces of theirs do not have
};

// Whether the texture's axes are parallel to its coordinates' axes, as a file's tangents assume.
bool is_upright(const TexturePlace& place) {
  const Eigen::Matrix2f m = place.moved.linear();
  return m(0, 0) > 0 && m(1, 1) > 0 && std::max(std::abs(m(0, 1)), std::abs(m(1, 0))) < 1e-6F;
}

// The texture coordinates of a piece's vertex in one mapping; zero where the piece has none.
Eigen::Vector2f uv_at(const MeshPiece& piece, const TexturePlace& place, std::uint32_t i) {
  const auto* uvs = piece.find_uvs(place.coordinates);
  return uvs ? place.moved * (*uvs)[i] : Eigen::Vector2f::Zero().eval();
}

// Adds a piece whose coordinates are `metres` long.
void append(const MeshPiece& piece, const MaterialSource& material, double metres, Soup* soup) {
  const std::vector<TexturePlace> places = texture_places(material);
  const bool has_second = places.size() > 1;
  soup->has_uvs |= piece.find_uvs(places[0].coordinates) != nullptr;
  soup->has_second_uvs |= has_second && piece.find_uvs(places[1].coordinates) != nullptr;
  if (!texture_uses(material).empty())
    for (const TexturePlace& place : places)
      if (!piece.find_uvs(place.coordinates)) soup->lacking.emplace(piece.material, place.coordinates);
  soup->has_colours |= !piece.colours.empty();
  const bool has_tangents =
      !piece.normals.empty() && !piece.tangents.empty() && is_upright(tangent_place(material));
  if (has_tangents) soup->tangents.resize(soup->corners.size(), Eigen::Vector4f::Zero());
  for (const auto& triangle : piece.triangles) {
    for (const std::uint32_t i : triangle) {
      Corner corner;
      corner.position = (piece.positions[i] * static_cast<float>(metres)).array() + 0.f;
      corner.normal = piece.normals.empty() ? Eigen::Vector3f::Zero().eval() : piece.normals[i];
      corner.uv = uv_at(piece, places[0], i);
      corner.second_uv = has_second ? uv_at(piece, places[1], i) : Eigen::Vector2f::Zero().eval();
      const bool has_colour = !piece.colours.empty() && piece.colours[i].allFinite();
      corner.colour = has_colour ? piece.colours[i] : Eigen::Vector3f::Ones().eval();
      soup->corners.push_back(corner);
      if (has_tangents) soup->tangents.push_back(piece.tangents[i]);
    }
    soup->triangle_materials.push_back(static_cast<std::uint16_t>(piece.material));
  }
  if (!soup->tangents.empty()) soup->tangents.resize(soup->corners.size(), Eigen::Vector4f::Zero());
}

Soup soup_of(const MeshContent& content, double metres) {
  Soup soup;
  for (const MeshPiece& piece : content.pieces)
    append(piece, content.materials[piece.material], metres, &soup);
  return soup;
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
  if (soup.has_second_uvs) mesh.second_uvs.resize(count);
  if (soup.has_colours) mesh.colours.resize(count);
  for (std::size_t c = 0; c < corner_count; ++c) {
    mesh.positions[remap[c]] = soup.corners[c].position;
    mesh.normals[remap[c]] = soup.corners[c].normal;
    if (soup.has_uvs) mesh.uvs[remap[c]] = soup.corners[c].uv;
    if (soup.has_second_uvs) mesh.second_uvs[remap[c]] = soup.corners[c].second_uv;
    if (soup.has_colours) mesh.colours[remap[c]] = soup.corners[c].colour;
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

// Removes the texture maps of a mesh without uvs. A material with an emission map then emits nothing, and one
// with a map of its clearcoat has none.
void leave_out_maps(const fs::path& path, Mesh* mesh) {
  bool has_textures = false;
  for (Material& material : mesh->materials) {
    Clearcoat& coat = material.coat;
    has_textures |= !material.texture.empty() || !material.maps.is_none() || coat.has_maps();
    if (!material.maps.emission.image.empty()) material.emitted.setZero();
    material.maps = {};
    coat = {.factor = coat.factor_map.image.empty() ? coat.factor : 0, .roughness = coat.roughness};
  }
  if (!has_textures) return;
  log_warning(
      "{}: expected texture coordinates because its materials have textures, found none. It is shown without "
      "textures. Export the mesh with texture coordinates.",
      path.string());
}

// Warns of pieces without the texture coordinates that a texture of their material lies in.
void note_lacking(const Soup& soup, const MeshContent& content, const fs::path& path) {
  if (!soup.has_uvs) return;  // leave_out_maps() warns
  for (const auto& [material, set] : soup.lacking) {
    const std::string& name = content.materials[material].name;
    log_warning(
        "{}: material {}: expected texture coordinates of set {} on all its triangles, because textures lie "
        "in "
        "them, found triangles without. These textures have one colour there. Export the mesh with all sets "
        "of "
        "texture coordinates.",
        path.string(), name.empty() ? std::to_string(material) : "'" + name + "'", set);
  }
}

Status check_mesh(const Soup& soup, const fs::path& path) {
  for (std::size_t c = 0; c < soup.corners.size(); ++c) {
    const Corner& corner = soup.corners[c];
    if (corner.position.allFinite() && corner.uv.allFinite() && corner.second_uv.allFinite()) continue;
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

// Gives the file's normals unit length and sets broken ones to zero; true: a normal has to be computed.
bool has_missing_normals(Soup* soup) {
  bool is_missing = false;
  for (Corner& corner : soup->corners) {
    Eigen::Vector3f& n = corner.normal;
    if (!n.allFinite() || n.squaredNorm() < 0.25F) n.setZero();
    if (std::abs(n.squaredNorm() - 1) > 1e-5F) n.stableNormalize();
    is_missing |= n.isZero();
  }
  return is_missing;
}

// Metres of the file's coordinates: in the unit that a person has given, or else in the file's own.
Result<double> metres_of(const MeshContent& content, const fs::path& path, std::optional<LengthUnit> units) {
  if (!units && !content.metres_per_unit)
    return error("{}: expected its unit (m, cm, mm, in or ft), because {} files state none, found none.",
                 path.string(), lower_extension(path));
  if (!units) return *content.metres_per_unit;
  const double given = metres_per_unit(*units);
  if (content.metres_per_unit && std::abs(*content.metres_per_unit / given - 1) > 1e-3)
    log_info("{}: is read in {} as given; the file itself says {:.4g} m for a unit", path.string(),
             to_text(*units), *content.metres_per_unit);
  return given;
}

// The materials of the pieces; those that none of them uses are empty.
std::vector<Material> used_materials(const MeshContent& content, const std::vector<Material>& all) {
  std::vector<Material> used(all.size());
  for (const MeshPiece& piece : content.pieces) used[piece.material] = all[piece.material];
  return used;
}

// The mesh of the pieces with their present materials.
Result<Mesh> mesh_from_content(const MeshContent& content,
                               const std::vector<Material>& materials,
                               const fs::path& path,
                               double metres) {
  Soup soup = soup_of(content, metres);
  if (soup.triangle_materials.empty()) return no_triangles(path);
  LIMN_TRY_STATUS(check_mesh(soup, path));
  note_lacking(soup, content, path);
  if (has_missing_normals(&soup)) make_normals(&soup);

  std::vector<Eigen::Vector4f> corner_tangents;
  Mesh mesh = joined(soup, &corner_tangents);
  if (mesh.triangles.empty()) return no_triangles(path);
  mesh.metres_per_unit = metres;
  mesh.materials = used_materials(content, materials);
  if (mesh.uvs.empty()) leave_out_maps(path, &mesh);
  const auto has_normal_map = [](const Material& m) {
    return !m.maps.normals.image.empty() || !m.coat.normals.image.empty();
  };
  if (std::any_of(mesh.materials.begin(), mesh.materials.end(), has_normal_map))
    add_tangents(&mesh, corner_tangents);
  return mesh;
}

}  // namespace

Result<MeshWithVariants> meshes_from_content(MeshContent content,
                                             const fs::path& path,
                                             std::optional<LengthUnit> units) {
  for (const std::string& warning : content.warnings) log_warning("{}", warning);
  if (content.pieces.empty()) return no_triangles(path);
  LIMN_TRY(const double metres, metres_of(content, path, units));
  LIMN_TRY(const std::vector<Material> materials, read_materials(content, path));
  MeshWithVariants out;
  LIMN_TRY(out.mesh, mesh_from_content(content, materials, path, metres));
  for (std::size_t i = 0; i < content.variants.size(); ++i) {
    for (MeshPiece& piece : content.pieces) piece.material = piece.variant_materials[i];
    LIMN_TRY(Mesh mesh, mesh_from_content(content, materials, path, metres));
    out.variants.push_back({content.variants[i], std::move(mesh)});
  }
  return out;
}

}  // namespace limn::scene
