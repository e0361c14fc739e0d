#include "core/constellation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/config.h"
#include "core/linear_algebra.h"

namespace limn {
namespace {

constexpr double k_least_ball_mm = 1, k_most_ball_mm = 1000;

double alike_within(double distance) { return std::max(k_alike_m, k_alike_share * distance); }

// Balls of `from` and, in the same order, balls of `to` that lie in the same way.
struct Likeness {
  std::vector<std::size_t> from, to;
  double most_off = 0;  // largest difference of two distances
};

// Searches for `count` balls of one constellation that lie as balls of the other, by trying one more ball at
// a time.
class LikenessSearch {
 public:
  LikenessSearch(const Constellation& from, const Constellation& to, std::size_t count)
      : from_(from), to_(to), count_(count), is_own_(&from == &to) {}

  std::optional<Likeness> find() {
    if (from_.p_balls.size() < count_ || to_.p_balls.size() < count_ || !extend(0)) return std::nullopt;
    return found_;
  }

 private:
  bool extend(std::size_t next) {
    if (found_.from.size() == count_) return is_new() && is_rigid();
    for (std::size_t i = next; i < from_.p_balls.size(); ++i)
      for (std::size_t k = 0; k < to_.p_balls.size(); ++k) {
        const double before = found_.most_off;
        if (std::ranges::find(found_.to, k) != found_.to.end() || !suits(i, k)) continue;
        found_.from.push_back(i), found_.to.push_back(k);
        if (extend(i + 1)) return true;
        found_.from.pop_back(), found_.to.pop_back();
        found_.most_off = before;
      }
    return false;
  }
  bool suits(std::size_t i, std::size_t k) {
    double most = found_.most_off;
    for (std::size_t n = 0; n < found_.from.size(); ++n) {
      const double a = (from_.p_balls[i] - from_.p_balls[found_.from[n]]).norm();
      const double b = (to_.p_balls[k] - to_.p_balls[found_.to[n]]).norm();
      if (std::abs(a - b) > alike_within(std::max(a, b))) return false;
      most = std::max(most, std::abs(a - b));
    }
    found_.most_off = most;
    return true;
  }
  bool is_new() const { return !is_own_ || found_.from != found_.to; }
  // Mirror images have the same distances, but no rigid motion makes one of the other.
  bool is_rigid() const {
    std::vector<Eigen::Vector3d> a, b;
    for (std::size_t n = 0; n < count_; ++n)
      a.push_back(from_.p_balls[found_.from[n]]), b.push_back(to_.p_balls[found_.to[n]]);
    const Pose a_from_b = aligned(a, b);
    double size = 0, off = 0;
    for (std::size_t n = 0; n < count_; ++n) {
      size = std::max(size, (a[n] - a[0]).norm());
      off = std::max(off, (a[n] - a_from_b * b[n]).norm());
    }
    return off <= alike_within(size);
  }

  const Constellation& from_;
  const Constellation& to_;
  std::size_t count_;
  bool is_own_;
  Likeness found_;
};

struct Line {
  double length = 0, off = 0;  // off: largest distance from it
};

// The line through the two balls that are farthest apart.
Line longest_line(const std::vector<Eigen::Vector3d>& p) {
  Line line;
  std::size_t from = 0, to = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t k = i + 1; k < p.size(); ++k)
      if ((p[k] - p[i]).norm() > line.length) line.length = (p[k] - p[i]).norm(), from = i, to = k;
  if (!(line.length > 0)) return line;
  const Eigen::Vector3d d = (p[to] - p[from]) / line.length;
  for (const Eigen::Vector3d& one : p) line.off = std::max(line.off, d.cross(one - p[from]).norm());
  return line;
}

}  // namespace

std::size_t balls_needed(const Constellation& constellation) {
  return constellation.p_balls.size() <= 3 ? 3 : 4;
}

Status check_constellation(const Constellation& constellation) {
  const auto& p = constellation.p_balls;
  const std::string& name = constellation.name;
  if (p.size() < 3 || p.size() > k_most_balls)
    return error("constellation '{}': expected 3 to {} balls, found {}.", name, k_most_balls, p.size());
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t k = i + 1; k < p.size(); ++k)
      if (!((p[k] - p[i]).norm() >= 2 * constellation.radius_m))
        return error(
            "constellation '{}': expected balls beside each other, found the centres of balls {} and {} "
            "{:.1f} mm "
            "apart, less than their diameter of {:.1f} mm. Correct the balls' places or their diameter.",
            name, i, k, 1e3 * (p[k] - p[i]).norm(), 2e3 * constellation.radius_m);
  const Line line = longest_line(p);
  if (line.off < k_collinear_share * line.length)
    return error(
        "constellation '{}': expected balls that are not on a line, found all {} within {:.1f} mm of a line "
        "of "
        "{:.1f} mm (at least {:.0f} % of it are needed). Its turn about that line cannot be measured: move a "
        "ball "
        "away from the line.",
        name, p.size(), 1e3 * line.off, 1e3 * line.length, 100 * k_collinear_share);
  if (const auto found = LikenessSearch(constellation, constellation, balls_needed(constellation)).find())
    return error(
        "constellation '{}': expected balls that look different from each side, found that balls {} lie as "
        "balls {} "
        "do, within {:.1f} mm (distances must differ by {:.0f} %). Move a ball, so that all distances "
        "differ.",
        name, fmt::join(found->from, ", "), fmt::join(found->to, ", "), 1e3 * found->most_off,
        100 * k_alike_share);
  return {};
}

Status check_distinct(std::span<const Constellation> constellations) {
  for (std::size_t i = 0; i < constellations.size(); ++i)
    for (std::size_t k = i + 1; k < constellations.size(); ++k) {
      const Constellation &a = constellations[i], &b = constellations[k];
      if (a.name == b.name)
        return error("constellation '{}': expected each name once, found it twice. Rename one of them.",
                     a.name);
      const std::size_t count = std::min(balls_needed(a), balls_needed(b));
      if (const auto found = LikenessSearch(a, b, count).find())
        return error(
            "constellations '{}' and '{}': expected different ones, found that balls {} of '{}' lie as balls "
            "{} of "
            "'{}' do, within {:.1f} mm (distances must differ by {:.0f} %). Move a ball of one of them.",
            a.name, b.name, fmt::join(found->from, ", "), a.name, fmt::join(found->to, ", "), b.name,
            1e3 * found->most_off, 100 * k_alike_share);
    }
  return {};
}

bool is_constellation(const MarkerName& name) { return name.family == k_constellation_family; }

Constellation placed(const Constellation& constellation,
                     const std::string& name,
                     const Pose& body_from_balls) {
  Constellation out = constellation;
  out.name = name;
  for (Eigen::Vector3d& p : out.p_balls) p = body_from_balls * p;
  return out;
}

double reach_of(const Constellation& constellation) {
  double most = 0;
  for (const Eigen::Vector3d& p : constellation.p_balls) most = std::max(most, p.norm());
  return most + constellation.radius_m;
}

Result<Constellation> load_constellation(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.constellation/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "name", "ball_diameter_mm", "balls_mm", "stddev_mm", "pictures", "rms_px"});
  Constellation read;
  read.name = root.at("name").text();
  if (read.name.empty()) root.at("name").problem("expected a name, found an empty text.");
  const double diameter_mm = root.at("ball_diameter_mm").positive(k_most_ball_mm);
  if (diameter_mm < k_least_ball_mm)
    root.at("ball_diameter_mm")
        .problem(fmt::format("expected millimetres, {} to {}, found {}.", k_least_ball_mm, k_most_ball_mm,
                             diameter_mm));
  read.radius_m = 0.5e-3 * diameter_mm;
  for (const ConfigNode& node : root.at("balls_mm").items()) {
    const std::vector<double> p_mm = node.numbers(3);
    if (p_mm.size() == 3) read.p_balls.push_back(1e-3 * Eigen::Vector3d(p_mm[0], p_mm[1], p_mm[2]));
  }
  LIMN_TRY_STATUS(config.status());
  const Status status = check_constellation(read);
  if (!status) return error("{}: balls_mm: {}", path.string(), status.message());
  return read;
}

}  // namespace limn
