#include "projector/changed_lines.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "projector/surface_lines.h"

namespace limn::projector {
namespace {

constexpr std::size_t k_most_boxes = 2000;
constexpr int k_smoothed_px = 2;  // smoothing changes pixels so far beside a changed one

// Adds the boxes of the pieces between the points `first` - 1 and `last`, which is beyond the last changed
// one.
void add_pieces(const scene::DrawnLine& line,
                std::size_t first,
                std::size_t last,
                std::vector<Eigen::AlignedBox3d>* boxes) {
  const std::vector<scene::SurfacePoint>& points = line.curve.points;
  const double reach = light_reach(line.style);
  const auto add = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    Eigen::AlignedBox3d box(a);
    box.extend(b);
    boxes->emplace_back(box.min().array() - reach, box.max().array() + reach);
  };
  for (std::size_t i = first > 0 ? first : 1; i < points.size() && i <= last; ++i)
    add(points[i - 1].p, points[i].p);
  if (line.curve.is_closed && points.size() > 1) add(points.back().p, points.front().p);
}

// Adds the boxes of what differs between two states of a line.
void add_changes(const scene::DrawnLine& before,
                 const scene::DrawnLine& now,
                 std::vector<Eigen::AlignedBox3d>* boxes) {
  const auto &a = before.curve.points, &b = now.curve.points;
  std::size_t same = 0;  // points at the beginning
  const bool is_same_kind = before.style == now.style && before.curve.is_closed == now.curve.is_closed;
  while (is_same_kind && same < std::min(a.size(), b.size()) && a[same] == b[same]) ++same;
  std::size_t same_end = 0;
  while (is_same_kind && same + same_end < std::min(a.size(), b.size()) &&
         a[a.size() - 1 - same_end] == b[b.size() - 1 - same_end])
    ++same_end;
  add_pieces(before, same, a.size() - same_end, boxes);
  add_pieces(now, same, b.size() - same_end, boxes);
}

// Curves by their names; the curves of an outline have one name and are numbered.
using Curves = std::map<std::pair<std::string_view, int>, const scene::DrawnLine*>;

Curves by_name(const std::vector<scene::DrawnLine>& lines) {
  Curves curves;
  std::map<std::string_view, int> count;
  for (const scene::DrawnLine& line : lines) curves[{line.name, count[line.name]++}] = &line;
  return curves;
}

}  // namespace

std::optional<std::vector<Eigen::AlignedBox3d>> changed_lines(const scene::PosedScene& before,
                                                              const scene::PosedScene& now) {
  if (before.lines != now.lines || !is_same_without_lines(before, now)) return std::nullopt;
  std::vector<Eigen::AlignedBox3d> boxes;
  const Curves old = by_name(before.drawn), all = by_name(now.drawn);
  for (const auto& [name, line] : all) {
    const auto found = old.find(name);
    if (found == old.end())
      add_pieces(*line, 0, line->curve.points.size(), &boxes);
    else if (*found->second != *line)
      add_changes(*found->second, *line, &boxes);
  }
  for (const auto& [name, line] : old)
    if (!all.contains(name)) add_pieces(*line, 0, line->curve.points.size(), &boxes);
  if (boxes.size() > k_most_boxes) return std::nullopt;
  return boxes;
}

std::optional<cv::Rect> rect_around(const std::vector<Eigen::AlignedBox3d>& boxes,
                                    const Pose& world_from_prototype,
                                    const Imager& projector) {
  Eigen::AlignedBox2d around;
  for (const Eigen::AlignedBox3d& box : boxes)
    for (int k = 0; k < 8; ++k) {
      const auto px = projector.project(world_from_prototype *
                                        box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)));
      if (!px) return std::nullopt;
      around.extend(*px);
    }
  if (around.isEmpty()) return cv::Rect();
  const Eigen::Vector2d most(projector.width, projector.height);
  const Eigen::Vector2d low = around.min().cwiseMax(-1.0).cwiseMin(most),
                        high = around.max().cwiseMax(-1.0).cwiseMin(most);
  const cv::Point first(static_cast<int>(std::floor(low.x())) - k_smoothed_px,
                        static_cast<int>(std::floor(low.y())) - k_smoothed_px),
      end(static_cast<int>(std::ceil(high.x())) + k_smoothed_px + 1,
          static_cast<int>(std::ceil(high.y())) + k_smoothed_px + 1);
  return cv::Rect(first, end) & cv::Rect(0, 0, projector.width, projector.height);
}

}  // namespace limn::projector
