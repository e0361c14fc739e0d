#include "sim/reference_lines.h"

#include <algorithm>
#include <cmath>

#include "core/names.h"

namespace limn::sim {
namespace {

constexpr std::size_t k_group = 32;  // pieces that are skipped together

double distance_to_multiple(double at, double spacing) { return std::abs(std::remainder(at, spacing)); }

bool is_on_repeated(const scene::RepeatedLines& lines,
                    double width_m,
                    const Eigen::Vector3d& p,
                    const Eigen::Vector3d& d_face) {
  using Form = scene::RepeatedLines::Form;
  const Pose from_prototype = lines.prototype_from_lines.inverse();
  const Eigen::Vector3d q = from_prototype * p, n = from_prototype.rotation * d_face;
  const double half = width_m / 2;
  if (std::abs(q.x()) > lines.half_size_m.x() + half || std::abs(q.y()) > lines.half_size_m.y() + half)
    return false;
  // A step along the surface changes a coordinate by at most the tangential part of its gradient.
  const auto along_surface = [&](int axis) {
    const double tangential = std::sqrt(std::max(0.0, 1 - n[axis] * n[axis]));
    return distance_to_multiple(q[axis], lines.spacing_m) / std::max(1e-3, tangential);
  };
  const double from_x = along_surface(0);
  if (lines.form == Form::stripes) return from_x <= half;
  const double from_y = along_surface(1);
  return lines.form == Form::grid ? std::min(from_x, from_y) <= half : std::hypot(from_x, from_y) <= half;
}

}  // namespace

ReferenceLines::ReferenceLines(const scene::Scene& scene, const scene::PosedScene& posed) {
  for (const scene::Line& line : scene.lines) {
    if (std::find(posed.lines.begin(), posed.lines.end(), line.name) == posed.lines.end()) continue;
    if (line.repeated) repeated_.push_back({*line.repeated, line.style});
    for (const scene::SurfaceCurve& curve : line.curves) add(curve, line.style);
  }
  for (const scene::DrawnLine& line : posed.drawn) add(line.curve, line.style);
}

void ReferenceLines::add(const scene::SurfaceCurve& curve, const scene::LineStyle& style) {
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const bool is_last = i + 1 == curve.points.size();
    if (is_last && !curve.is_closed) break;
    const scene::SurfacePoint &a = curve.points[i], &b = curve.points[is_last ? 0 : i + 1];
    if (a.p == b.p) continue;
    Piece piece{a.p, b.p, a.d_normal, style, {}};
    if (b.d_normal.isZero()) piece.d_side.setZero();
    if (!piece.d_side.isZero()) piece.d_side += b.d_normal;
    piece.box.extend(a.p).extend(b.p);
    piece.box.min().array() -= style.width_m / 2;
    piece.box.max().array() += style.width_m / 2;
    if (groups_.empty() || groups_.back().end - groups_.back().first >= k_group)
      groups_.push_back({pieces_.size(), pieces_.size(), {}});
    groups_.back().box.extend(piece.box);
    ++groups_.back().end;
    pieces_.push_back(piece);
  }
}

std::optional<Eigen::Vector3d> ReferenceLines::colour_at(const Eigen::Vector3d& p,
                                                         const Eigen::Vector3d& d_face) const {
  const Piece* best = nullptr;
  double nearest = 1;
  for (const Group& group : groups_) {
    if (!group.box.contains(p)) continue;
    for (std::size_t i = group.first; i < group.end; ++i) {
      const Piece& piece = pieces_[i];
      if (!piece.box.contains(p) || piece.d_side.dot(d_face) < 0) continue;
      const Eigen::ParametrizedLine<double, 3> line =
          Eigen::ParametrizedLine<double, 3>::Through(piece.a, piece.b);
      const double t = std::clamp((p - piece.a).dot(line.direction()), 0.0, (piece.b - piece.a).norm());
      const double share = (p - line.pointAt(t)).norm() / (piece.style.width_m / 2);
      if (share <= nearest) best = &piece;
      nearest = std::min(nearest, share);
    }
  }
  if (best != nullptr) return best->style.colour;
  for (auto repeated = repeated_.rbegin(); repeated != repeated_.rend(); ++repeated)
    if (is_on_repeated(repeated->lines, repeated->style.width_m, p, d_face)) return repeated->style.colour;
  return std::nullopt;
}

}  // namespace limn::sim
