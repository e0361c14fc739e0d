#include "scene/meshes/tangents.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "core/result.h"

namespace limn::scene {
namespace {

using Eigen::Vector3f;
using Eigen::Vector4f;

Vector3f unit_or_zero(Vector3f v) {
  const float length = v.norm();
  if (length > 0) v /= length;
  return v;
}

// The tangent of a triangle's corner: direction of increasing u in the plane of its normal, handedness, and
// weight (0: unknown).
struct CornerTangent {
  Vector3f d_u = Vector3f::Zero();
  bool is_mirrored = false;
  float angle = 0;
};

// The texture coordinates of the normal map of a triangle's material.
const std::vector<Eigen::Vector2f>& normal_map_uvs(const Mesh& mesh, std::size_t triangle) {
  if (mesh.second_uvs.empty() || triangle >= mesh.triangle_materials.size()) return mesh.uvs;
  const Material& material = mesh.materials[mesh.triangle_materials[triangle]];
  const Texture& normals =
      material.maps.normals.image.empty() ? material.coat.normals : material.maps.normals;
  return normals.in_second_uvs ? mesh.second_uvs : mesh.uvs;
}

CornerTangent corner_tangent(const Mesh& mesh,
                             const std::vector<Eigen::Vector2f>& uvs,
                             const std::array<std::uint32_t, 3>& triangle,
                             std::size_t k) {
  const std::uint32_t a = triangle[k], b = triangle[(k + 1) % 3], c = triangle[(k + 2) % 3];
  const Vector3f ab = mesh.positions[b] - mesh.positions[a], ac = mesh.positions[c] - mesh.positions[a];
  const Eigen::Vector2f uv_ab = uvs[b] - uvs[a], uv_ac = uvs[c] - uvs[a];
  const float area = uv_ab.x() * uv_ac.y() - uv_ac.x() * uv_ab.y();
  if (!(std::abs(area) > 0)) return {};
  const float side = area > 0 ? 1.F : -1.F;
  const Vector3f to_u = side * (uv_ac.y() * ab - uv_ab.y() * ac);
  const Vector3f to_v = side * (uv_ab.x() * ac - uv_ac.x() * ab);
  const Vector3f& n = mesh.normals[a];
  CornerTangent tangent;
  tangent.d_u = unit_or_zero(to_u - n.dot(to_u) * n);
  tangent.is_mirrored = n.cross(to_u).dot(to_v) < 0;
  tangent.angle = std::acos(std::clamp(unit_or_zero(ab).dot(unit_or_zero(ac)), -1.F, 1.F));
  return tangent;
}

// Tangents from the uvs, one for each corner of each triangle.
std::vector<Vector4f> made_from_uvs(const Mesh& mesh) {
  using BothHands = std::array<Vector3f, 2>;
  std::vector<BothHands> sums(mesh.positions.size(), BothHands{Vector3f::Zero(), Vector3f::Zero()});
  std::vector<CornerTangent> corners;
  corners.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::vector<Eigen::Vector2f>& uvs = normal_map_uvs(mesh, t);
    for (std::size_t k = 0; k < 3; ++k) {
      const CornerTangent& tangent = corners.emplace_back(corner_tangent(mesh, uvs, mesh.triangles[t], k));
      sums[mesh.triangles[t][k]][tangent.is_mirrored ? 1 : 0] += tangent.angle * tangent.d_u;
    }
  }
  std::vector<Vector4f> tangents;
  tangents.reserve(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const std::uint32_t vertex = mesh.triangles[i / 3][i % 3];
    const bool is_mirrored = corners[i].is_mirrored;
    Vector3f t = unit_or_zero(sums[vertex][is_mirrored ? 1 : 0]);
    if (t.isZero()) t = mesh.normals[vertex].unitOrthogonal();
    tangents.emplace_back(t.x(), t.y(), t.z(), is_mirrored ? -1.F : 1.F);
  }
  return tangents;
}

bool is_usable(const Vector4f& tangent) {
  return tangent.allFinite() && tangent.head<3>().squaredNorm() > 0.25F;
}

}  // namespace

void add_tangents(Mesh* mesh, std::span<const Vector4f> of_corners) {
  LIMN_CHECK(mesh->uvs.size() == mesh->positions.size() && mesh->normals.size() == mesh->positions.size());
  LIMN_CHECK(of_corners.empty() || of_corners.size() == 3 * mesh->triangles.size());
  std::vector<Vector4f> wanted(of_corners.begin(), of_corners.end());
  if (wanted.empty() || !std::all_of(wanted.begin(), wanted.end(), is_usable)) {
    const std::vector<Vector4f> made = made_from_uvs(*mesh);
    wanted.resize(made.size(), Vector4f::Zero());
    for (std::size_t i = 0; i < made.size(); ++i)
      if (!is_usable(wanted[i])) wanted[i] = made[i];
  }
  mesh->tangents.assign(mesh->positions.size(), Vector4f::Zero());
  std::map<std::pair<std::uint32_t, std::array<float, 4>>, std::uint32_t> parted;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    std::uint32_t& vertex = mesh->triangles[i / 3][i % 3];
    const Vector4f& t = wanted[i];
    if (mesh->tangents[vertex].isZero()) mesh->tangents[vertex] = t;
    if (mesh->tangents[vertex] == t) continue;
    const auto next = static_cast<std::uint32_t>(mesh->positions.size());
    const auto [other, is_new] = parted.try_emplace({vertex, {t.x(), t.y(), t.z(), t.w()}}, next);
    if (is_new) {
      mesh->positions.push_back(Vector3f(mesh->positions[vertex]));
      mesh->normals.push_back(Vector3f(mesh->normals[vertex]));
      mesh->uvs.push_back(Eigen::Vector2f(mesh->uvs[vertex]));
      if (!mesh->second_uvs.empty()) mesh->second_uvs.push_back(Eigen::Vector2f(mesh->second_uvs[vertex]));
      if (!mesh->colours.empty()) mesh->colours.push_back(Eigen::Vector3f(mesh->colours[vertex]));
      mesh->tangents.push_back(t);
    }
    vertex = other->second;
  }
}

}  // namespace limn::scene
