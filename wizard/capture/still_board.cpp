#include "wizard/capture/still_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace limn::wizard {
namespace {

constexpr std::size_t k_least_corners = 8;
constexpr double k_still_px = 0.7;  // px; more movement blurs the patterns' edges
constexpr double k_still_s = 0.8;   // seconds that the board must be still
// Share of the board's diagonal in the image: in a new place, at least one corner has moved by more.
constexpr double k_elsewhere = 0.08;

using Corners = std::map<int, Eigen::Vector2d>;

// The largest movement of a corner, px; infinite if fewer than half of a's corners are in both.
double most_moved(const Corners& a, const Corners& b) {
  double most = 0;
  std::size_t common = 0;
  for (const auto& [id, px] : a) {
    const auto other = b.find(id);
    if (other == b.end()) continue;
    ++common;
    most = std::max(most, (px - other->second).norm());
  }
  return 2 * common < a.size() ? std::numeric_limits<double>::infinity() : most;
}

double diagonal(const Corners& corners) {
  Eigen::AlignedBox2d box;
  for (const auto& [id, px] : corners) box.extend(px);
  return box.diagonal().norm();
}

}  // namespace

StillBoard::State StillBoard::add_corners(const std::vector<calib::BoardCorner>& corners, Stamp at) {
  last_.clear();
  for (const calib::BoardCorner& corner : corners) last_[corner.id] = corner.px;
  if (last_.size() < k_least_corners) {
    still_.clear();
    return State::unseen;
  }
  if (still_.empty() || most_moved(last_, still_) > k_still_px) {
    still_ = last_;
    since_ = at;
  }
  if (seconds_between(since_, at) < k_still_s) return State::moving;
  const bool is_elsewhere = captured_.empty() || most_moved(last_, captured_) > k_elsewhere * diagonal(last_);
  return is_elsewhere ? State::still : State::known;
}

}  // namespace limn::wizard
