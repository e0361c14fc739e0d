#include "scene/viewpoint.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/result.h"

namespace limn::scene {
namespace {

constexpr double k_nearest = 0.05;  // m; a nearer eye counts as if it had this distance from the middle

double count_of(const Viewpoint& eye, const Eigen::Vector3d& p_middle) {
  return eye.weight / std::max(k_nearest, (eye.p_world - p_middle).norm());
}

// Weight by direction: 1 within `full_weight_deg` of the leader's, falling smoothly to 0 at
// `zero_weight_deg`.
double beside(const Eigen::Vector3d& d,
              const Eigen::Vector3d& d_leader,
              const SharedViewpointOptions& options) {
  const double angle = std::atan2(d.cross(d_leader).norm(), d.dot(d_leader)) * 180 / std::numbers::pi;
  const double t = std::clamp(
      (options.zero_weight_deg - angle) / (options.zero_weight_deg - options.full_weight_deg), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// The leader: the previous one, unless it is gone or another counts `takeover_ratio` times more.
const Viewpoint& leader_of(std::span<const Viewpoint> viewpoints,
                           const std::string& before,
                           const Eigen::Vector3d& p_middle,
                           double takeover_ratio) {
  const auto counts_less = [&](const Viewpoint& a, const Viewpoint& b) {
    return count_of(a, p_middle) < count_of(b, p_middle);
  };
  const Viewpoint& most = *std::max_element(viewpoints.begin(), viewpoints.end(), counts_less);
  const auto known = std::find_if(viewpoints.begin(), viewpoints.end(),
                                  [&](const Viewpoint& eye) { return eye.viewer == before; });
  if (known == viewpoints.end()) return most;
  return count_of(most, p_middle) > takeover_ratio * count_of(*known, p_middle) ? most : *known;
}

// Joins the shares of all viewers who are gone into one; the shared position does not change.
void join_gone(std::span<const Viewpoint> viewpoints, std::vector<SharedViewpoint::Share>* shares) {
  SharedViewpoint::Share gone;
  const auto is_gone = [&](const SharedViewpoint::Share& share) {
    return std::none_of(viewpoints.begin(), viewpoints.end(),
                        [&](const Viewpoint& eye) { return eye.viewer == share.viewer; });
  };
  for (const SharedViewpoint::Share& share : *shares) {
    if (!is_gone(share)) continue;
    gone.share += share.share;
    gone.p_world += share.share * share.p_world;
  }
  std::erase_if(*shares, is_gone);
  if (gone.share <= 0) return;
  gone.p_world /= gone.share;
  shares->push_back(gone);
}

}  // namespace

std::optional<Eigen::Vector3d> SharedViewpoint::p_world() const {
  if (shares.empty()) return std::nullopt;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (const Share& share : shares) p += share.share * share.p_world;
  return p;
}

SharedViewpoint updated_viewpoint(const SharedViewpoint& before,
                                  std::span<const Viewpoint> viewpoints,
                                  const Eigen::Vector3d& p_middle_world,
                                  double seconds,
                                  const SharedViewpointOptions& options) {
  LIMN_CHECK(options.fade_s > 0 && options.takeover_ratio >= 1 &&
             options.zero_weight_deg > options.full_weight_deg);
  SharedViewpoint after = before;
  join_gone(viewpoints, &after.shares);
  if (viewpoints.empty()) return after;
  const Viewpoint& leader = leader_of(viewpoints, before.leader, p_middle_world, options.takeover_ratio);
  after.leader = leader.viewer;
  std::vector<double> wanted(after.shares.size(), 0);  // final shares; 0 for viewers who are gone
  double sum = 0;
  for (const Viewpoint& eye : viewpoints) {
    const auto known = std::find_if(after.shares.begin(), after.shares.end(),
                                    [&](const SharedViewpoint::Share& s) { return s.viewer == eye.viewer; });
    const auto at = static_cast<std::size_t>(known - after.shares.begin());
    if (known == after.shares.end()) {
      after.shares.push_back({eye.viewer, {}, 0});
      wanted.push_back(0);
    }
    after.shares[at].p_world = eye.p_world;
    wanted[at] = count_of(eye, p_middle_world) *
                 beside(eye.p_world - p_middle_world, leader.p_world - p_middle_world, options);
    sum += wanted[at];
  }
  double passing = 0;  // total share that has to move between viewers
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i] /= sum;
    passing += 0.5 * std::abs(wanted[i] - after.shares[i].share);
  }
  const bool is_first = before.shares.empty();
  const double may_pass = std::max(0.0, seconds) / options.fade_s;
  const double step = is_first || passing <= may_pass ? 1 : may_pass / passing;
  for (std::size_t i = 0; i < wanted.size(); ++i)
    after.shares[i].share += step * (wanted[i] - after.shares[i].share);
  std::erase_if(after.shares, [](const auto& share) { return share.viewer.empty() && share.share <= 0; });
  return after;
}

}  // namespace limn::scene
