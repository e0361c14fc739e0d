#include "tracker/balls/ball_arcs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>

namespace limn::tracker {
namespace {

constexpr std::size_t k_most_circles = 4;
// Boundaries run along pixels, which is an error of .3 px; shade on the sphere moves them, too.
constexpr double k_off_px = 0.6, k_off_share = 0.025;
// Shares of a circle that the boundary must run along: a refined one, and a first proposal.
constexpr double k_least_shown = 0.56, k_proposed_share = 0.4;
// Lengths of the arcs that propose circles, as shares of the boundary.
constexpr std::array<double, 2> k_arcs = {0.2, 0.34};
constexpr int k_refinements = 3;

struct Circle {
  Eigen::Vector2d centre;
  double radius;

  double off(const Eigen::Vector2d& p) const { return (p - centre).norm() - radius; }
  bool suits(const Eigen::Vector2d& p) const { return std::abs(off(p)) < k_off_px + k_off_share * radius; }
};

// The circle that minimises the sum of the squares of |p - centre|² - radius² (Kasa 1976).
std::optional<Circle> fitted(std::span<const Eigen::Vector2d> points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d product = Eigen::Vector3d::Zero();
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector3d row(p.x() - mean.x(), p.y() - mean.y(), 1);
    normal += row * row.transpose();
    product += row.head<2>().squaredNorm() * row;
  }
  const Eigen::Vector3d x = normal.ldlt().solve(product);
  const Eigen::Vector2d centre = 0.5 * x.head<2>();
  const double square = x.z() + centre.squaredNorm();
  if (!x.allFinite() || !(square > 0)) return std::nullopt;
  return Circle{mean + centre, std::sqrt(square)};
}

class CircleSearch {
 public:
  CircleSearch(std::span<const Eigen::Vector2d> boundary, double min_radius, double max_radius, double beside)
      : boundary_(boundary),
        is_used_(boundary.size(), false),
        min_radius_(min_radius),
        max_radius_(max_radius),
        beside_(beside) {}

  std::vector<CircleArcs> find() {
    std::vector<CircleArcs> found;
    while (found.size() < k_most_circles) {
      const auto circle = best();
      if (!circle) break;
      const OutlineParts parts = parts_of(*circle);
      if (static_cast<double>(parts.count()) < k_least_shown * k_outline_parts) break;
      found.push_back({circle->centre, circle->radius, without_neighbours(*circle, parts)});
      for (std::size_t i = 0; i < boundary_.size(); ++i)
        is_used_[i] = is_used_[i] || circle->suits(boundary_[i]);
    }
    std::vector<CircleArcs> explained;
    std::ranges::copy_if(found, std::back_inserter(explained),
                         [&](const CircleArcs& one) { return !sticks_out(one, found); });
    return explained;
  }

 private:
  // Whether the boundary has points outside a circle that no other circle explains: what hides a part of a
  // sphere only takes away.
  bool sticks_out(const CircleArcs& one, std::span<const CircleArcs> all) const {
    constexpr std::ptrdiff_t k_by_chance = 2;
    const Circle circle{one.centre, one.radius};
    const auto is_strange = [&](const Eigen::Vector2d& p) {
      return circle.off(p) > 2 * (k_off_px + k_off_share * circle.radius) &&
             std::ranges::none_of(all, [&](const CircleArcs& other) {
               return Circle{other.centre, other.radius}.suits(p);
             });
    };
    return std::ranges::count_if(boundary_, is_strange) > k_by_chance;
  }

  bool is_possible(const Circle& circle) const {
    return circle.radius >= min_radius_ && circle.radius <= max_radius_;
  }

  std::optional<Circle> best() const {
    std::optional<Circle> best;
    double most = 0;
    const std::size_t count = boundary_.size();
    for (const double share : k_arcs) {
      const auto step = static_cast<std::size_t>(0.5 * share * static_cast<double>(count));
      for (std::size_t i = 0; step > 0 && i < count; i += 2) {
        const std::size_t k = (i + step) % count, n = (i + 2 * step) % count;
        if (is_used_[i] || is_used_[k] || is_used_[n]) continue;
        const auto circle = fitted(std::array{boundary_[i], boundary_[k], boundary_[n]});
        if (!circle || !is_possible(*circle)) continue;
        const double shown = roughly_shown(*circle);
        if (shown > most) most = shown, best = circle;
      }
    }
    if (most < k_proposed_share) return std::nullopt;
    for (int i = 0; best && i < k_refinements; ++i) best = refined(*best);
    return best && is_possible(*best) ? best : std::nullopt;
  }

  std::optional<Circle> refined(const Circle& circle) const {
    std::vector<Eigen::Vector2d> along;
    for (std::size_t i = 0; i < boundary_.size(); ++i)
      if (!is_used_[i] && circle.suits(boundary_[i])) along.push_back(boundary_[i]);
    return along.size() < 5 ? std::nullopt : fitted(along);
  }

  // The share of a circle that pieces of the boundary run along.
  double roughly_shown(const Circle& circle) const {
    double length = 0;
    bool was_along = !is_used_.back() && circle.suits(boundary_.back());
    for (std::size_t i = 0; i < boundary_.size(); ++i) {
      const bool is_along = !is_used_[i] && circle.suits(boundary_[i]);
      if (is_along && was_along)
        length += (boundary_[i] - boundary_[i > 0 ? i - 1 : boundary_.size() - 1]).norm();
      was_along = is_along;
    }
    return length / (2 * std::numbers::pi * circle.radius);
  }

  // The parts that a piece of the boundary between two neighbouring points lies in.
  OutlineParts parts_of(const Circle& circle) const {
    OutlineParts parts;
    constexpr int k_between = 4;
    for (std::size_t i = 0; i < boundary_.size(); ++i) {
      const std::size_t k = (i + 1) % boundary_.size();
      if (is_used_[i] || is_used_[k] || !circle.suits(boundary_[i]) || !circle.suits(boundary_[k])) continue;
      for (int n = 0; n <= k_between; ++n) {
        const double t = static_cast<double>(n) / k_between;
        parts.set(outline_part((1 - t) * boundary_[i] + t * boundary_[k] - circle.centre));
      }
    }
    return parts;
  }

  // Without those where the boundary leaves the circle, and where something else lies close to it.
  OutlineParts without_neighbours(const Circle& circle, const OutlineParts& shown) const {
    OutlineParts parts = shown;
    for (const Eigen::Vector2d& p : boundary_) {
      const double off = circle.off(p);
      if (circle.suits(p) || off < -0.5 * circle.radius || off > beside_) continue;
      const std::size_t at = outline_part(p - circle.centre);
      for (const std::size_t part : {at + k_outline_parts - 1, at, at + 1})
        parts.reset(part % k_outline_parts);
    }
    for (std::size_t part = 0; part < k_outline_parts; ++part)
      if (!shown[part])
        for (const std::size_t other : {part + k_outline_parts - 1, part + 1})
          parts.reset(other % k_outline_parts);
    return parts;
  }

  std::span<const Eigen::Vector2d> boundary_;
  std::vector<bool> is_used_;  // points that a circle found earlier runs along
  double min_radius_, max_radius_, beside_;
};

}  // namespace

std::size_t outline_part(const Eigen::Vector2d& from_centre) {
  const double turn = std::atan2(from_centre.y(), from_centre.x()) / (2 * std::numbers::pi) + 0.5;
  return std::min(k_outline_parts - 1, static_cast<std::size_t>(turn * k_outline_parts));
}

std::vector<CircleArcs> circles_along(std::span<const Eigen::Vector2d> boundary,
                                      double min_radius,
                                      double max_radius,
                                      double beside) {
  return CircleSearch(boundary, min_radius, max_radius, beside).find();
}

}  // namespace limn::tracker
