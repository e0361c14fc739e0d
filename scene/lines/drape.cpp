#include "scene/lines/drape.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "scene/lines/line_file.h"
#include "scene/lines/stroke_font.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::scene {
namespace {

constexpr double k_reach = 0.02;        // m; a point farther from the prototype is a mistake of frame or unit
constexpr double k_other_side = 0.002;  // m; shells up to this thickness are thin
constexpr double k_same_side_cos = 0.2;      // 78 degrees between the normals of one side's neighbours
constexpr double k_most_off = 0.05e-3;       // m; of a piece's middle from the surface
constexpr double k_longest_piece = 8e-3;     // m
constexpr double k_shortest_piece = 0.1e-3;  // m; is not divided further
constexpr double k_same_point = 1e-7;        // m
constexpr int k_most_depth = 12;
constexpr double k_text_reach = 0.1;           // m; a text's surface from the plane where it begins
constexpr double k_shortest_dimension = 1e-3;  // m

Eigen::Vector3d face_normal(const Mesh& mesh, std::size_t triangle) {
  const auto& corners = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.positions[corners[0]].cast<double>(),
                        b = mesh.positions[corners[1]].cast<double>(),
                        c = mesh.positions[corners[2]].cast<double>();
  return (b - a).cross(c - a).stableNormalized();
}

// For each position the index of the first one at the same place.
std::vector<std::uint32_t> places_of(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size()), place(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) {
    const Eigen::Vector3f& p = mesh.positions[i];
    return std::array<float, 3>{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t k) { return key(i) < key(k); });
  for (std::size_t i = 0; i < order.size(); ++i)
    place[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? place[order[i - 1]] : order[i];
  return place;
}

std::vector<Eigen::Vector3d> without_repeats(const exchange::NamedCurve& curve) {
  std::vector<Eigen::Vector3d> out;
  for (const Eigen::Vector3d& p : curve.points)
    if (out.empty() || (p - out.back()).norm() > k_same_point) out.push_back(p);
  while (curve.is_closed && out.size() > 1 && (out.back() - out.front()).norm() <= k_same_point)
    out.pop_back();
  return out;
}

}  // namespace

bool winds_consistently(const Mesh& mesh) {
  const std::vector<std::uint32_t> place = places_of(mesh);
  struct Side {
    std::uint32_t low, high;
    bool is_forward;
  };
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = place[triangle[k]], b = place[triangle[(k + 1) % 3]];
      if (a != b) sides.push_back({std::min(a, b), std::max(a, b), a < b});
    }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return std::pair(a.low, a.high) < std::pair(b.low, b.high); });
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high) ++end;
    if (end - i == 2 && sides[i].is_forward == sides[i + 1].is_forward) return false;
    i = end;
  }
  return true;
}

struct Drape::Tree {
  explicit Tree(const Mesh& mesh) : bvh(mesh), has_sides(winds_consistently(mesh)) {}
  MeshBvh bvh;
  bool has_sides;  // neighbouring triangles wind alike
};

Drape::Drape(const Mesh& mesh) {
  mesh_.positions = mesh.positions;
  mesh_.normals = mesh.normals;
  mesh_.triangles = mesh.triangles;
}

Drape::~Drape() = default;

const Drape::Tree& Drape::tree() const {
  std::call_once(once_, [this] { tree_ = std::make_unique<Tree>(mesh_); });
  return *tree_;
}

auto Drape::find(const Eigen::Vector3d& p, double max_distance, const Eigen::Vector3d& d_side) const
    -> std::optional<Found> {
  const bool is_any = d_side.isZero() || !tree().has_sides;
  const auto on_mesh = tree().bvh.nearest(p, max_distance, is_any ? nullptr : &d_side, k_same_side_cos);
  if (!on_mesh) return std::nullopt;
  Found found{{on_mesh->p, Eigen::Vector3d::Zero()}, on_mesh->distance};
  if (tree().has_sides) found.point.d_normal = face_normal(mesh_, on_mesh->triangle);
  return found;
}

std::optional<SurfacePoint> Drape::nearest(const Eigen::Vector3d& p,
                                           double max_distance,
                                           const Eigen::Vector3d& d_side) const {
  const auto found = find(p, max_distance, d_side);
  return found ? std::optional(found->point) : std::nullopt;
}

// The nearest place, on the side of the place before if the mesh is a thin shell.
auto Drape::find_beside(const Eigen::Vector3d& p, const SurfacePoint& before) const -> std::optional<Found> {
  const auto nearest = find(p, k_reach, Eigen::Vector3d::Zero());
  if (!nearest || before.d_normal.isZero()) return nearest;
  const auto on_side = find(p, nearest->distance + k_other_side, before.d_normal);
  return on_side ? on_side : nearest;
}

// Adds the points between a and b, without both.
void Drape::add_between(const SurfacePoint& a,
                        const SurfacePoint& b,
                        int depth,
                        std::vector<SurfacePoint>* to) const {
  const double length = (b.p - a.p).norm();
  if (length < k_shortest_piece || depth >= k_most_depth || to->size() > k_most_points_laid) return;
  const Eigen::Vector3d p_middle = (a.p + b.p) / 2, d_side = a.d_normal + b.d_normal;
  auto middle = find(p_middle, length, d_side.norm() > 0.5 ? d_side.normalized() : Eigen::Vector3d::Zero());
  if (!middle) middle = find(p_middle, length, Eigen::Vector3d::Zero());
  if (!middle || (middle->distance <= k_most_off && length <= k_longest_piece)) return;
  const Eigen::Vector3d& p = middle->point.p;
  if ((p - a.p).norm() < k_same_point || (p - b.p).norm() < k_same_point) return;
  // Across an edge the halves may be as long as the whole; dividing further would only add points there.
  if (std::max((p - a.p).norm(), (p - b.p).norm()) >= length) return;
  add_between(a, middle->point, depth + 1, to);
  to->push_back(middle->point);
  add_between(middle->point, b, depth + 1, to);
}

Result<SurfaceCurve> Drape::laid(const exchange::NamedCurve& curve, const std::string& where) const {
  for (std::size_t i = 0; i < curve.points.size(); ++i)
    if (!curve.points[i].allFinite())
      return error("{}: expected points of finite numbers, found another at point {}.", where, i);
  const std::vector<Eigen::Vector3d> points = without_repeats(curve);
  const std::size_t least = curve.is_closed ? 3 : 2;
  if (points.size() < least)
    return error("{}: expected at least {} different points, found {}.", where, least, points.size());
  // The point that is nearest to the mesh says on which side the curve is.
  std::vector<Found> on_mesh(points.size());
  std::size_t start = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto found = find(points[i], k_reach, Eigen::Vector3d::Zero());
    if (!found)
      return error(
          "{}: expected points within {:.0f} mm of the prototype, found ({:.1f}, {:.1f}, {:.1f}) mm farther "
          "away. Is the file in the prototype's frame, and its unit right?",
          where, 1e3 * k_reach, 1e3 * points[i].x(), 1e3 * points[i].y(), 1e3 * points[i].z());
    on_mesh[i] = *found;
    if (found->distance < on_mesh[start].distance) start = i;
  }
  for (std::size_t i = start + 1; i < points.size(); ++i)
    on_mesh[i] = find_beside(points[i], on_mesh[i - 1].point).value_or(on_mesh[i]);
  for (std::size_t i = start; i-- > 0;)
    on_mesh[i] = find_beside(points[i], on_mesh[i + 1].point).value_or(on_mesh[i]);
  SurfaceCurve out{.points = {}, .is_closed = curve.is_closed};
  for (std::size_t i = 0; i < on_mesh.size(); ++i) {
    out.points.push_back(on_mesh[i].point);
    if (i + 1 < on_mesh.size() || curve.is_closed)
      add_between(on_mesh[i].point, on_mesh[(i + 1) % on_mesh.size()].point, 0, &out.points);
  }
  if (out.points.size() > k_most_points_laid)
    return error("{}: expected a curve of at most {} points on the surface, found more. Give fewer points.",
                 where, k_most_points_laid);
  return out;
}

std::optional<SurfacePoint> Drape::hit(const Eigen::Vector3d& p_from,
                                       const Eigen::Vector3d& d,
                                       double max_distance) const {
  // The distance to the mesh is a step that passes nothing. Near the surface a step along its plane follows.
  constexpr double k_near = 1e-4, k_on = 1e-7;  // m
  constexpr int k_most_steps = 400;
  double t = 0;
  for (int step = 0; step < k_most_steps && t <= max_distance; ++step) {
    const Eigen::Vector3d p = p_from + t * d;
    const auto nearest = tree().bvh.nearest(p, max_distance - t + k_near);
    if (!nearest) return std::nullopt;
    const Eigen::Vector3d n = face_normal(mesh_, nearest->triangle);
    const double along = n.dot(d), to_plane = n.dot(nearest->p - p);
    if (nearest->distance < k_near && std::abs(along) > 1e-6) {
      const double t_hit = t + to_plane / along;
      const auto there = tree().bvh.nearest(p_from + t_hit * d, k_near);
      if (there && there->distance < 10 * k_on && t_hit >= -k_near)
        return SurfacePoint{there->p,
                            tree().has_sides ? face_normal(mesh_, there->triangle) : Eigen::Vector3d::Zero()};
    }
    t += std::max(nearest->distance, k_near / 4);
  }
  return std::nullopt;
}

Eigen::Vector3d Drape::smooth_normal(const Eigen::Vector3d& p) const {
  const auto nearest = tree().bvh.nearest(p, k_reach);
  return nearest ? nearest->d_normal : Eigen::Vector3d::Zero();
}

namespace {

// Where a text or a dimension's number stands: x along it, y up in it, as read from the side it is seen from.
Result<Eigen::Matrix3d> reading_axes(const Drape& drape,
                                     const Eigen::Vector3d& p,
                                     const Eigen::Vector3d& d_along,
                                     const std::optional<Eigen::Vector3d>& p_reader,
                                     const std::string& where) {
  Eigen::Vector3d z = drape.smooth_normal(p);
  if (z.isZero())
    return error("{}: expected a point within {:.0f} mm of the prototype, found one farther away.", where,
                 1e3 * k_reach);
  if (p_reader && z.dot(*p_reader - p) < 0) z = -z;
  const Eigen::Vector3d x = (d_along - z * z.dot(d_along)).stableNormalized();
  if (!(x.norm() > 0.5))
    return error("{}: expected a direction along the surface, found one across it.", where);
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return axes;
}

Status lay(const Drape& drape,
           const std::vector<Eigen::Vector3d>& points,
           bool is_closed,
           const std::string& where,
           std::vector<SurfaceCurve>* to) {
  LIMN_TRY(SurfaceCurve laid, drape.laid({"", points, is_closed}, where));
  to->push_back(std::move(laid));
  return {};
}

// A text with the middle of its foot at p.
Status lay_text(const Drape& drape,
                const StrokeText& text,
                double height_m,
                const Eigen::Vector3d& p,
                const Eigen::Matrix3d& axes,
                double from_x,
                const std::string& where,
                std::vector<SurfaceCurve>* to) {
  for (const auto& stroke : text.strokes) {
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector2d& at : stroke) {
      const Eigen::Vector3d in_plane =
          p + height_m * ((at.x() + from_x) * axes.col(0) + at.y() * axes.col(1));
      // A long text leaves the plane in which it begins; it is projected from the side from which it is read.
      const auto on_surface =
          drape.hit(in_plane + k_text_reach * axes.col(2), -axes.col(2), 2 * k_text_reach);
      points.push_back(on_surface ? on_surface->p : in_plane);
    }
    LIMN_TRY_STATUS(lay(drape, points, false, where, to));
  }
  return {};
}

Status lay_label(const Drape& drape,
                 const LineText& label,
                 const std::string& where,
                 std::vector<SurfaceCurve>* to) {
  LIMN_TRY(const Eigen::Matrix3d axes, reading_axes(drape, label.p_at, label.d_along, label.p_reader, where));
  return lay_text(drape, stroke_text(label.text), label.height_m, label.p_at, axes, 0, where, to);
}

// The line between both points, ticks at its ends, and the number beside its middle.
Status lay_dimension(const Drape& drape,
                     const LineDimension& dimension,
                     const std::string& where,
                     std::vector<SurfaceCurve>* to) {
  const auto a = drape.nearest(dimension.p_from, k_reach), b = drape.nearest(dimension.p_to, k_reach);
  if (!a || !b)
    return error("{}: expected two points within {:.0f} mm of the prototype, found one farther away.", where,
                 1e3 * k_reach);
  const double length = (b->p - a->p).norm();
  if (!(length > k_shortest_dimension))
    return error("{}: expected points at least {:.1f} mm apart, found {:.1f} mm.", where,
                 1e3 * k_shortest_dimension, 1e3 * length);
  LIMN_TRY_STATUS(lay(drape, {a->p, b->p}, false, where, to));
  const Eigen::Vector3d middle = (a->p + b->p) / 2,
                        on_surface = drape.nearest(middle, k_reach).value_or(*a).p;
  // Readable: its upper side is towards the prototype's y, else its z.
  LIMN_TRY(Eigen::Matrix3d axes, reading_axes(drape, on_surface, b->p - a->p, dimension.p_reader, where));
  const double up = std::abs(axes(1, 1)) > 0.05 ? axes(1, 1) : axes(2, 1);
  if (up < 0) axes.leftCols<2>() = -axes.leftCols<2>();
  for (const Eigen::Vector3d& end : {a->p, b->p}) {
    const Eigen::Vector3d tick = dimension.height_m / 2 * axes.col(1);
    LIMN_TRY_STATUS(lay(drape, {end - tick, end + tick}, false, where, to));
  }
  const StrokeText number = stroke_text(fmt::format("{:.1f}", 1e3 * length));
  const Eigen::Vector3d foot = on_surface + 0.4 * dimension.height_m * axes.col(1);
  return lay_text(drape, number, dimension.height_m, foot, axes, -number.width / 2, where, to);
}

}  // namespace

Status lay_lines(const Drape& prototype, std::vector<Line>* lines) {
  for (Line& line : *lines) {
    const std::string where = fmt::format("line '{}'", line.name);
    if (!line.file.empty()) {
      LIMN_TRY(line.to_lay, read_line_file(line.file));
    }
    for (const exchange::NamedCurve& curve : line.to_lay) {
      LIMN_TRY(SurfaceCurve laid, prototype.laid(curve, where));
      line.curves.push_back(std::move(laid));
    }
    line.to_lay.clear();
    if (line.text) LIMN_TRY_STATUS(lay_label(prototype, *line.text, where, &line.curves));
    if (line.dimension) LIMN_TRY_STATUS(lay_dimension(prototype, *line.dimension, where, &line.curves));
  }
  return {};
}

}  // namespace limn::scene
