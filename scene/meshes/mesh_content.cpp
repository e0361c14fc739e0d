#include "scene/meshes/mesh_content.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// A normal of a polygon that need not be flat or convex (Newell), not of unit length.
Eigen::Vector3d newell_normal(const std::vector<Eigen::Vector3f>& corners) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d a = (corners[i] - corners[0]).cast<double>(),
                          b = (corners[(i + 1) % corners.size()] - corners[0]).cast<double>();
    sum += a.cross(b);
  }
  return sum;
}

double signed_area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
}

// The corners of a polygon in its plane, counter-clockwise.
std::vector<Eigen::Vector2d> flattened(const std::vector<Eigen::Vector3f>& corners) {
  Eigen::Vector3d d_z = newell_normal(corners);
  if (!(d_z.norm() > 0)) d_z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d d_x = d_z.unitOrthogonal(), d_y = d_z.normalized().cross(d_x);
  std::vector<Eigen::Vector2d> out;
  for (const Eigen::Vector3f& p : corners) {
    const Eigen::Vector3d from_first = (p - corners[0]).cast<double>();
    out.emplace_back(d_x.dot(from_first), d_y.dot(from_first));
  }
  return out;
}

// Whether the corner `at` of the remaining polygon can be cut off: it is convex and no other corner is
// inside.
bool is_ear(const std::vector<Eigen::Vector2d>& px, const std::vector<std::uint32_t>& left, std::size_t at) {
  const std::size_t n = left.size();
  const std::uint32_t ia = left[(at + n - 1) % n], ib = left[at], ic = left[(at + 1) % n];
  if (!(signed_area(px[ia], px[ib], px[ic]) > 0)) return false;
  return std::none_of(left.begin(), left.end(), [&](std::uint32_t i) {
    if (i == ia || i == ib || i == ic || px[i] == px[ia] || px[i] == px[ib] || px[i] == px[ic]) return false;
    return signed_area(px[ia], px[ib], px[i]) >= 0 && signed_area(px[ib], px[ic], px[i]) >= 0 &&
           signed_area(px[ic], px[ia], px[i]) >= 0;
  });
}

}  // namespace

std::string lower_extension(const fs::path& path) {
  std::string text = path.extension().string();
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

const std::vector<Eigen::Vector2f>* MeshPiece::find_uvs(int set) const {
  if (set == 0) return uvs.empty() ? nullptr : &uvs;
  const auto found = more_uvs.find(set);
  return found == more_uvs.end() || found->second.empty() ? nullptr : &found->second;
}

void move_vertex(const Eigen::Matrix4d& m, std::size_t vertex, MeshPiece* piece) {
  const Eigen::Matrix3d turn = m.topLeftCorner<3, 3>();
  piece->positions[vertex] =
      (turn * piece->positions[vertex].cast<double>() + m.topRightCorner<3, 1>()).cast<float>();
  if (!piece->normals.empty())
    piece->normals[vertex] =
        (turn.inverse().transpose() * piece->normals[vertex].cast<double>()).normalized().cast<float>();
  if (!piece->tangents.empty())
    piece->tangents[vertex].head<3>() =
        (turn * piece->tangents[vertex].head<3>().cast<double>()).normalized().cast<float>();
}

Error damaged_mesh(const fs::path& path, const std::string& why) {
  return error("{}: expected a complete {} mesh, found one that cannot be read ({}). Export it again.",
               path.string(), lower_extension(path).substr(1), why);
}

MeshPiece moved(const MeshPiece& piece, const Eigen::Matrix4d& to_from_piece) {
  const Eigen::Matrix3d turn = to_from_piece.topLeftCorner<3, 3>();
  const Eigen::Matrix3d normal_turn = turn.inverse().transpose();
  const bool is_mirrored = turn.determinant() < 0;
  MeshPiece out = piece;
  for (Eigen::Vector3f& p : out.positions)
    p = (turn * p.cast<double>() + to_from_piece.topRightCorner<3, 1>()).cast<float>();
  for (Eigen::Vector3f& n : out.normals) n = (normal_turn * n.cast<double>()).normalized().cast<float>();
  for (Eigen::Vector4f& t : out.tangents) {
    const Eigen::Vector3d d = turn * t.head<3>().cast<double>();
    t.head<3>() = d.normalized().cast<float>();
    if (is_mirrored) t.w() = -t.w();
  }
  if (is_mirrored)
    for (auto& triangle : out.triangles) std::swap(triangle[0], triangle[2]);
  return out;
}

std::vector<std::array<std::uint32_t, 3>> polygon_triangles(const std::vector<Eigen::Vector3f>& corners) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  if (corners.size() == 3) return {{0, 1, 2}};
  if (corners.size() < 3) return triangles;
  const std::vector<Eigen::Vector2d> px = flattened(corners);
  std::vector<std::uint32_t> left(corners.size());
  std::iota(left.begin(), left.end(), 0U);
  std::size_t at = left.size() == 4 ? 1 : 0;  // a convex quad is cut from its first to its third corner
  for (std::size_t tried = 0; left.size() > 3;) {
    const std::size_t n = left.size();
    // A polygon that crosses itself has no ear; any corner is then cut off.
    if (!is_ear(px, left, at % n) && ++tried <= n) {
      ++at;
      continue;
    }
    at %= n;
    triangles.push_back({left[(at + n - 1) % n], left[at], left[(at + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
    tried = 0;
  }
  triangles.push_back({left[0], left[1], left[2]});
  return triangles;
}

float linear_from_srgb(float value) {
  const float v = std::clamp(value, 0.F, 1.F);
  return v <= 0.04045F ? v / 12.92F : std::pow((v + 0.055F) / 1.055F, 2.4F);
}

}  // namespace limn::scene
