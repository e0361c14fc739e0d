#include "scene/drawn_lines.h"

#include <fmt/format.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/json_text.h"
#include "core/names.h"
#include "scene/lines/drape.h"

namespace limn::scene {
namespace {

constexpr double k_near = 0.02;           // m; of a stroke's points from the surface
constexpr double k_farthest_ray = 20;     // m
constexpr double k_grip = 0.015;          // m; a place of a line is taken hold of from here
constexpr double k_pull_reach = 0.02;     // m along the line
constexpr double k_smooth_length = 0.01;  // m; waves that are shorter vanish
constexpr double k_even_step = 2e-3;      // m between the points of a smooth or pulled line
constexpr double k_simple = 0.03e-3;      // m; points that are nearer to their neighbours' line are left out
constexpr double k_least_step = 0.2e-3;   // m between the points of a stroke

Result<DrawnLine*> drawn_line(const std::string& name, ShowState* show_state) {
  std::vector<DrawnLine>& drawn = show_state->drawn;
  if (drawn.empty()) return error("expected a drawn line, found none. Draw one.");
  DrawnLine* line = name.empty() ? &drawn.back() : find_named(drawn, name);
  if (!line) return error("expected a drawn line ({}), found '{}'.", joined_names(drawn), name);
  return line;
}

Result<const Drape*> surface_of(const Scene& scene) {
  if (!scene.drape) return error("expected a prototype to draw on, found a scene without.");
  return scene.drape.get();
}

std::vector<SurfacePoint> on_surface(const Drape& drape, const Stroke& stroke) {
  std::vector<SurfacePoint> points;
  for (const Eigen::Vector3d& at : stroke.points)
    if (const auto point =
            stroke.p_camera ? drape.hit(*stroke.p_camera, at, k_farthest_ray) : drape.nearest(at, k_near))
      points.push_back(*point);
  return points;
}

std::vector<Eigen::Vector3d> positions_of(const SurfaceCurve& curve) {
  std::vector<Eigen::Vector3d> points;
  for (const SurfacePoint& point : curve.points) points.push_back(point.p);
  return points;
}

// Leaves out points that change the curve by less than k_simple (Douglas and Peucker), so that drawn lines
// stay small.
void simplify(std::vector<SurfacePoint>* points, std::size_t first) {
  std::vector<bool> is_kept(points->size(), false);
  if (first >= points->size()) return;
  std::fill(is_kept.begin(), is_kept.begin() + static_cast<std::ptrdiff_t>(first) + 1, true);
  is_kept.back() = true;
  std::vector<std::pair<std::size_t, std::size_t>> spans = {{first, points->size() - 1}};
  while (!spans.empty()) {
    const auto [a, b] = spans.back();
    spans.pop_back();
    const Eigen::Vector3d &p = (*points)[a].p, d = (*points)[b].p - p;
    double farthest = k_simple;
    std::size_t at = 0;
    for (std::size_t i = a + 1; i < b; ++i) {
      const Eigen::Vector3d q = (*points)[i].p - p;
      const double along = d.squaredNorm() > 0 ? std::clamp(q.dot(d) / d.squaredNorm(), 0.0, 1.0) : 0;
      const double off = (q - along * d).norm();
      if (off > farthest) at = i;
      farthest = std::max(farthest, off);
    }
    if (at == 0) continue;
    is_kept[at] = true;
    spans.emplace_back(a, at);
    spans.emplace_back(at, b);
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points->size(); ++i)
    if (is_kept[i]) (*points)[kept++] = (*points)[i];
  points->resize(kept);
}

// The curve at equal steps of about k_even_step, with its ends.
std::vector<Eigen::Vector3d> at_even_steps(const std::vector<Eigen::Vector3d>& points, bool is_closed) {
  std::vector<double> at = {0};
  std::vector<Eigen::Vector3d> ring = points;
  if (is_closed) ring.push_back(points.front());
  for (std::size_t i = 1; i < ring.size(); ++i) at.push_back(at.back() + (ring[i] - ring[i - 1]).norm());
  const auto count = static_cast<std::size_t>(std::clamp(
      std::ceil(at.back() / k_even_step), is_closed ? 3.0 : 2.0, static_cast<double>(k_most_points_drawn)));
  std::vector<Eigen::Vector3d> out;
  std::size_t piece = 1;
  for (std::size_t k = 0; k <= count; ++k) {
    const double along = at.back() * static_cast<double>(k) / static_cast<double>(count);
    while (piece + 1 < ring.size() && at[piece] < along) ++piece;
    const double length = at[piece] - at[piece - 1];
    const double share = length > 0 ? std::clamp((along - at[piece - 1]) / length, 0.0, 1.0) : 0;
    out.push_back(ring[piece - 1] + share * (ring[piece] - ring[piece - 1]));
  }
  if (is_closed) out.pop_back();
  return out;
}

// Minimises the squared distances from the points plus `weight` times the squared second differences.
std::vector<Eigen::Vector3d> smoothed(const std::vector<Eigen::Vector3d>& points,
                                      bool is_closed,
                                      double weight) {
  const auto count = static_cast<Eigen::Index>(points.size());
  constexpr double k_fixed = 1e6;  // weight of an end, which stays
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixX3d right(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const bool is_end = !is_closed && (i == 0 || i + 1 == count);
    const double own = is_end ? k_fixed : 1;
    entries.emplace_back(i, i, own);
    right.row(i) = own * points[static_cast<std::size_t>(i)].transpose();
    if (is_end) continue;
    const Eigen::Index beside[3] = {(i + count - 1) % count, i, (i + 1) % count};
    constexpr double k_second[3] = {1, -2, 1};
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        entries.emplace_back(beside[a], beside[b], weight * k_second[a] * k_second[b]);
  }
  Eigen::SparseMatrix<double> normal(count, count);
  normal.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(normal);
  const Eigen::MatrixX3d solved = solver.solve(right);
  std::vector<Eigen::Vector3d> out;
  for (Eigen::Index i = 0; i < count; ++i) out.emplace_back(solved.row(i).transpose());
  return out;
}

std::size_t points_of(const ShowState& show_state) {
  std::size_t count = 0;
  for (const DrawnLine& line : show_state.drawn) count += line.curve.points.size();
  return count;
}

Status check_count(const ShowState& show_state) {
  if (const std::size_t count = points_of(show_state); count > k_most_points_drawn)
    return error(
        "expected at most {} points of drawn lines, found {}. Erase a line, or draw it in the scene.",
        k_most_points_drawn, count);
  return {};
}

Status replace_curve(const Drape& drape,
                     const std::vector<Eigen::Vector3d>& points,
                     DrawnLine* line,
                     const ShowState& show_state) {
  LIMN_TRY(SurfaceCurve laid, drape.laid({line->name, points, line->curve.is_closed}, "line"));
  simplify(&laid.points, 0);
  line->curve = std::move(laid);
  return check_count(show_state);
}

std::string unused_line_name(const Scene& scene, const ShowState& show_state) {
  for (int i = 1;; ++i)
    if (std::string name = fmt::format("line-{:02}", i);
        !find_named(scene.lines, name) && !find_named(show_state.drawn, name))
      return name;
}

Status check_new_name(const Scene& scene, const ShowState& show_state, const std::string& name) {
  if (!is_line_name(name))
    return error("expected a name of 1 to {} bytes, found '{}'.", k_longest_line_name, name);
  if (find_named(scene.lines, name) || find_named(show_state.drawn, name))
    return error("expected a name that no other line has, found '{}'.", name);
  return {};
}

}  // namespace

std::string drawn_lines_json(const std::vector<DrawnLine>& drawn, const std::vector<std::string>& shown) {
  nlohmann::ordered_json lines = nlohmann::ordered_json::array(), names = nlohmann::ordered_json::array();
  for (const DrawnLine& line : drawn) {
    if (line.curve.points.size() < 2) continue;  // a touch
    lines.push_back(to_json(line));
    if (std::find(shown.begin(), shown.end(), line.name) != shown.end()) names.push_back(line.name);
  }
  if (lines.empty()) return {};
  return json_text(nlohmann::ordered_json({{"schema", "limn.drawn/1"}, {"lines", lines}, {"shown", names}})) +
         "\n";
}

Result<ShowState> with_drawn_lines(const std::filesystem::path& path,
                                   const Scene& scene,
                                   ShowState show_state) {
  LIMN_TRY(const Config config, Config::load(path, "limn.drawn/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "lines", "shown"});
  std::vector<std::string> shown;
  for (const ConfigNode& name : root.at("shown").items()) shown.push_back(name.text());
  for (const ConfigNode& node : root.at("lines").items()) {
    DrawnLine line = read_drawn_line(node);
    const bool is_shown = std::find(shown.begin(), shown.end(), line.name) != shown.end();
    if (find_named(scene.lines, line.name) || find_named(show_state.drawn, line.name))
      line.name = unused_line_name(scene, show_state);
    if (is_shown) show_state.lines.push_back(line.name);
    show_state.drawn.push_back(std::move(line));
  }
  LIMN_TRY_STATUS(config.status());
  if (show_state.drawn.size() > k_most_lines)
    return error("{}: expected at most {} drawn lines, found more.", path.string(), k_most_lines);
  if (const Status count = check_count(show_state); !count)
    return error("{}: {}", path.string(), count.message());
  return show_state;
}

std::vector<exchange::NamedCurve> shown_curves(const Scene& scene, const PosedScene& posed) {
  std::vector<exchange::NamedCurve> curves;
  const auto add = [&](const std::string& name, const SurfaceCurve& curve) {
    if (curve.points.size() >= 2) curves.push_back({name, positions_of(curve), curve.is_closed});
  };
  for (const Line& line : scene.lines)
    if (std::find(posed.lines.begin(), posed.lines.end(), line.name) != posed.lines.end())
      for (const SurfaceCurve& curve : line.curves) add(line.name, curve);
  for (const DrawnLine& line : posed.drawn) add(line.name, line.curve);
  return curves;
}

Status draw_line(const Scene& scene, const std::string& name, const Stroke& stroke, ShowState* show_state) {
  LIMN_TRY(const Drape* drape, surface_of(scene));
  const std::vector<SurfacePoint> found = on_surface(*drape, stroke);
  if (found.empty()) return error("expected a stroke on the prototype, found none of its points there.");
  DrawnLine* line = name.empty() ? nullptr : find_named(show_state->drawn, name);
  if (!line) {
    const std::string new_name = name.empty() ? unused_line_name(scene, *show_state) : name;
    LIMN_TRY_STATUS(check_new_name(scene, *show_state, new_name));
    if (show_state->drawn.size() >= k_most_lines)
      return error("expected at most {} drawn lines, found more. Erase one.", k_most_lines);
    show_state->drawn.push_back({new_name, {}, {}});
    show_state->lines.push_back(new_name);
    line = &show_state->drawn.back();
  }
  std::vector<SurfacePoint>& points = line->curve.points;
  const std::size_t first = points.empty() ? 0 : points.size() - 1;
  for (const SurfacePoint& point : found) {
    if (points.empty()) {
      points.push_back(point);
    } else if ((point.p - points.back().p).norm() >= k_least_step) {
      // Between two points the line follows the surface.
      const auto laid = drape->laid({line->name, {points.back().p, point.p}, false}, "line");
      if (laid) points.insert(points.end(), laid->points.begin() + 1, laid->points.end());
    }
  }
  simplify(&points, first);
  return check_count(*show_state);
}

Status erase_line(const std::string& name, ShowState* show_state) {
  LIMN_TRY(const DrawnLine* line, drawn_line(name, show_state));
  std::erase(show_state->lines, line->name);
  show_state->drawn.erase(show_state->drawn.begin() + (line - show_state->drawn.data()));
  return {};
}

Status smooth_line(const Scene& scene, const std::string& name, ShowState* show_state) {
  LIMN_TRY(const Drape* drape, surface_of(scene));
  LIMN_TRY(DrawnLine * line, drawn_line(name, show_state));
  const bool is_closed = line->curve.is_closed;
  if (line->curve.points.size() < 3) return {};
  const std::vector<Eigen::Vector3d> even = at_even_steps(positions_of(line->curve), is_closed);
  // A wave of length L becomes smaller by 1 / (1 + weight (2 pi step / L)^4): by half at k_smooth_length.
  const double weight = std::pow(k_smooth_length / (2 * M_PI * k_even_step), 4) * 16;
  return replace_curve(*drape, smoothed(even, is_closed, weight), line, *show_state);
}

Status move_line(const Scene& scene, const std::string& name, const Stroke& stroke, ShowState* show_state) {
  LIMN_TRY(const Drape* drape, surface_of(scene));
  LIMN_TRY(DrawnLine * line, drawn_line(name, show_state));
  const std::vector<SurfacePoint> ends = on_surface(*drape, stroke);
  if (ends.size() < 2 || ends.size() != stroke.points.size())
    return error("expected two places on the prototype, found {}.", ends.size());
  if (line->curve.points.size() < 2) return error("expected a line of several points, found one.");
  std::vector<Eigen::Vector3d> even = at_even_steps(positions_of(line->curve), line->curve.is_closed);
  std::size_t held = 0;
  for (std::size_t i = 1; i < even.size(); ++i)
    if ((even[i] - ends.front().p).norm() < (even[held] - ends.front().p).norm()) held = i;
  if ((even[held] - ends.front().p).norm() > k_grip)
    return error("expected a place within {:.0f} mm of line '{}', found one {:.0f} mm away.", 1e3 * k_grip,
                 line->name, 1e3 * (even[held] - ends.front().p).norm());
  const Eigen::Vector3d by = ends.back().p - even[held];
  std::vector<double> along(even.size(), 0);
  for (std::size_t i = held + 1; i < even.size(); ++i)
    along[i] = along[i - 1] + (even[i] - even[i - 1]).norm();
  for (std::size_t i = held; i-- > 0;) along[i] = along[i + 1] + (even[i] - even[i + 1]).norm();
  for (std::size_t i = 0; i < even.size(); ++i) {
    const double share = std::max(0.0, 1 - along[i] / k_pull_reach);
    even[i] += share * share * (3 - 2 * share) * by;
  }
  return replace_curve(*drape, even, line, *show_state);
}

Status rename_line(const Scene& scene,
                   const std::string& name,
                   const std::string& new_name,
                   ShowState* show_state) {
  LIMN_TRY(DrawnLine * line, drawn_line(name, show_state));
  if (line->name == new_name) return {};
  LIMN_TRY_STATUS(check_new_name(scene, *show_state, new_name));
  std::replace(show_state->lines.begin(), show_state->lines.end(), line->name, new_name);
  line->name = new_name;
  return {};
}

}  // namespace limn::scene
