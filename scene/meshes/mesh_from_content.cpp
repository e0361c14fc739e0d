#include "scene/meshes/mesh_from_content.h"

#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/log.h"
#include "core/names.h"
#include "core/utf8.h"
#include "scene/meshes/read_materials.h"
#include "scene/meshes/tangents.h"

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
  std::vector<Eigen::Vector4f> tangents;       // per corner, as in Mesh; empty: the file has none
  std::vector<std::uint32_t> triangle_pieces;  // per triangle, index into MeshContent::pieces
  bool has_uvs = false, has_second_uvs = false;
  bool has_colours = false;
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

// Adds a piece, with its number, whose coordinates are `metres` long.
void append(
    const MeshPiece& piece, std::size_t number, const MaterialSource& material, double metres, Soup* soup) {
  const std::vector<TexturePlace> places = texture_places(material);
  const bool has_second = places.size() > 1;
  soup->has_uvs |= piece.find_uvs(places[0].coordinates) != nullptr;
  soup->has_second_uvs |= has_second && piece.find_uvs(places[1].coordinates) != nullptr;
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
    soup->triangle_pieces.push_back(static_cast<std::uint32_t>(number));
  }
  if (!soup->tangents.empty()) soup->tangents.resize(soup->corners.size(), Eigen::Vector4f::Zero());
}

Soup soup_of(const MeshContent& content, double metres) {
  Soup soup;
  for (std::size_t i = 0; i < content.pieces.size(); ++i)
    append(content.pieces[i], i, content.materials[content.pieces[i].material], metres, &soup);
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

  std::vector<Eigen::Vector3f> d_face(soup->triangle_pieces.size());
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

// Merges equal vertices and drops triangles without area. `pieces` gets the pieces of the remaining
// triangles, and `corner_tangents` the tangents of their corners.
Mesh joined(const Soup& soup,
            std::vector<std::uint32_t>* pieces,
            std::vector<Eigen::Vector4f>* corner_tangents) {
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
  for (std::size_t t = 0; t < soup.triangle_pieces.size(); ++t) {
    if (!(face_normal(soup, t).squaredNorm() > 0)) continue;  // without area
    mesh.triangles.push_back({remap[3 * t], remap[3 * t + 1], remap[3 * t + 2]});
    pieces->push_back(soup.triangle_pieces[t]);
    if (soup.tangents.empty()) continue;
    for (std::size_t k = 0; k < 3; ++k) corner_tangents->push_back(soup.tangents[3 * t + k]);
  }
  return mesh;
}

// Removes the texture maps of a mesh without uvs. A material with an emission map then emits nothing, and one
// with a map of its clearcoat has none. Returns whether there were any.
bool leave_out_maps(Mesh* mesh) {
  bool has_textures = false;
  for (Material& material : mesh->materials) {
    Clearcoat& coat = material.coat;
    has_textures |= !material.texture.empty() || !material.maps.is_none() || coat.has_maps();
    if (!material.maps.emission.image.empty()) material.emitted.setZero();
    material.maps = {};
    coat = {.factor = coat.factor_map.image.empty() ? coat.factor : 0, .roughness = coat.roughness};
  }
  return has_textures;
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

// Which texture coordinates a material's normal maps have: 0 without one, else 1 or 2.
int normal_set(const Material& material) {
  const Texture& normals =
      material.maps.normals.image.empty() ? material.coat.normals : material.maps.normals;
  return normals.image.empty() ? 0 : normals.in_second_uvs ? 2 : 1;
}

// Makes the meshes of a file and of its variants. Where the materials of a variant need the same coordinates
// and tangents as those of a mesh that is made already, its mesh is a copy of that one with other materials.
class MeshMaker {
 public:
  MeshMaker(MeshContent content, std::vector<Material> materials, fs::path path, double metres)
      : content_(std::move(content)),
        materials_(std::move(materials)),
        path_(std::move(path)),
        metres_(metres) {}

  Result<MeshWithVariants> make() {
    MeshWithVariants out;
    out.variants.reserve(content_.variants.size());  // made_ points to the meshes
    LIMN_TRY_STATUS(make(&out.mesh));
    for (std::size_t i = 0; i < content_.variants.size(); ++i) {
      for (MeshPiece& piece : content_.pieces) piece.material = piece.variant_materials[i];
      out.variants.push_back({content_.variants[i], {}});
      LIMN_TRY_STATUS(make(&out.variants.back().mesh));
    }
    return out;
  }

 private:
  struct Made {
    const Mesh* mesh;
    std::vector<std::uint32_t> pieces;   // per triangle
    std::vector<std::size_t> materials;  // per piece
  };

  // The mesh of the pieces with their present materials.
  Status make(Mesh* mesh) {
    const auto made = std::find_if(made_.begin(), made_.end(), [&](const Made& one) { return is_like(one); });
    if (made != made_.end()) {
      *mesh = *made->mesh;
      give_materials(made->pieces, mesh);
      return {};
    }
    Soup soup = soup_of(content_, metres_);
    if (soup.triangle_pieces.empty()) return no_triangles(path_);
    LIMN_TRY_STATUS(check_mesh(soup, path_));
    if (has_missing_normals(&soup)) make_normals(&soup);
    Made now{mesh, {}, {}};
    for (const MeshPiece& piece : content_.pieces) now.materials.push_back(piece.material);
    std::vector<Eigen::Vector4f> corner_tangents;
    *mesh = joined(soup, &now.pieces, &corner_tangents);
    if (mesh->triangles.empty()) return no_triangles(path_);
    mesh->metres_per_unit = metres_;
    give_materials(now.pieces, mesh);
    if (std::any_of(mesh->materials.begin(), mesh->materials.end(),
                    [](const Material& material) { return normal_set(material) > 0; }))
      add_tangents(mesh, corner_tangents);
    made_.push_back(std::move(now));
    return {};
  }

  // Whether the pieces' present materials need the same mesh as those of another one.
  bool is_like(const Made& made) const {
    for (std::size_t i = 0; i < made.materials.size(); ++i) {
      const std::size_t before = made.materials[i], now = content_.pieces[i].material;
      if (before != now && !need_the_same(before, now)) return false;
    }
    return true;
  }

  bool need_the_same(std::size_t a, std::size_t b) const {
    if (normal_set(materials_[a]) != normal_set(materials_[b])) return false;
    if (texture_uses(content_.materials[b]).empty()) return true;  // it reads no coordinates
    const auto one = texture_places(content_.materials[a]), other = texture_places(content_.materials[b]);
    return std::equal(one.begin(), one.end(), other.begin(), other.end(), is_same_place);
  }

  // Gives a mesh the pieces' present materials. `pieces`: per triangle.
  void give_materials(const std::vector<std::uint32_t>& pieces, Mesh* mesh) {
    mesh->triangle_materials.resize(pieces.size());
    for (std::size_t t = 0; t < pieces.size(); ++t)
      mesh->triangle_materials[t] = static_cast<std::uint16_t>(content_.pieces[pieces[t]].material);
    mesh->materials = used_materials(content_, materials_);
    if (!mesh->uvs.empty()) return note_lacking();
    if (!leave_out_maps(mesh) || std::exchange(is_lack_reported_, true)) return;
    log_warning(
        "{}: expected texture coordinates because its materials have textures, found none. It is shown "
        "without textures. Export the mesh with texture coordinates.",
        path_.string());
  }

  // Warns of pieces without the texture coordinates that a texture of their material lies in, once for each.
  void note_lacking() {
    for (const MeshPiece& piece : content_.pieces) {
      const MaterialSource& material = content_.materials[piece.material];
      if (texture_uses(material).empty()) continue;
      for (const TexturePlace& place : texture_places(material)) {
        if (piece.find_uvs(place.coordinates)) continue;
        if (!reported_.emplace(piece.material, place.coordinates).second) continue;
        log_warning(
            "{}: material {}: expected texture coordinates of set {} on all its triangles, because textures "
            "lie in them, found triangles without. These textures have one colour there. Export the mesh "
            "with "
            "all sets of texture coordinates.",
            path_.string(),
            material.name.empty() ? std::to_string(piece.material) : "'" + material.name + "'",
            place.coordinates);
      }
    }
  }

  MeshContent content_;
  std::vector<Material> materials_;
  fs::path path_;
  double metres_;
  std::vector<Made> made_;  // those that are no copies
  std::set<std::pair<std::size_t, int>>
      reported_;  // materials and the sets that pieces of theirs do not have
  bool is_lack_reported_ = false;
};

// Refuses a file whose variants together would not fit into memory.
Status check_count(const MeshContent& content, const fs::path& path) {
  constexpr std::size_t k_most_triangles = 20'000'000;  // about 2 GB
  std::size_t count = 0;
  for (const MeshPiece& piece : content.pieces) count += piece.triangles.size();
  const std::size_t meshes = content.variants.size() + 1;
  if (meshes == 1 || count <= k_most_triangles / meshes) return {};
  std::string names = joined_names(content.variants);
  if (names.size() > 200) names = as_utf8(names.substr(0, 200)) + "...";
  return error(
      "{}: expected at most {} triangles in its meshes together, because each material variant is a mesh, "
      "found {} in each of {}. Simplify the mesh, or export it with fewer material variants ({}).",
      path.string(), k_most_triangles, count, meshes, names);
}

}  // namespace

Result<MeshWithVariants> meshes_from_content(MeshContent content,
                                             const fs::path& path,
                                             std::optional<LengthUnit> units) {
  for (const std::string& warning : content.warnings) log_warning("{}", warning);
  if (content.pieces.empty()) return no_triangles(path);
  LIMN_TRY_STATUS(check_count(content, path));
  LIMN_TRY(const double metres, metres_of(content, path, units));
  LIMN_TRY(std::vector<Material> materials, read_materials(content, path));
  return MeshMaker(std::move(content), std::move(materials), path, metres).make();
}

}  // namespace limn::scene
