#include "scene/viewers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/result.h"

namespace limn::scene {
namespace {

constexpr double k_nearest = 0.05;  // m; an eye nearer to the middle counts as this far

double count_of(const Eye& eye, const Eigen::Vector3d& p_middle) {
  return eye.weight / std::max(k_nearest, (eye.p_world - p_middle).norm());
}

// 1 within `one_side_deg` of the leader's direction, falling smoothly to 0 at `apart_deg`.
double beside(const Eigen::Vector3d& d, const Eigen::Vector3d& d_leader, const SharedEyeOptions& options) {
  const double angle = std::atan2(d.cross(d_leader).norm(), d.dot(d_leader)) * 180 / std::numbers::pi;
  const double t =
      std::clamp((options.apart_deg - angle) / (options.apart_deg - options.one_side_deg), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Who leads: the one before, unless gone or outdone.
const Eye& leader_of(std::span<const Eye> eyes,
                     const std::string& before,
                     const Eigen::Vector3d& p_middle,
                     double take_over) {
  const auto counts_less = [&](const Eye& a, const Eye& b) {
    return count_of(a, p_middle) < count_of(b, p_middle);
  };
  const Eye& most = *std::max_element(eyes.begin(), eyes.end(), counts_less);
  const auto known =
      std::find_if(eyes.begin(), eyes.end(), [&](const Eye& eye) { return eye.viewer == before; });
  if (known == eyes.end()) return most;
  return count_of(most, p_middle) > take_over * count_of(*known, p_middle) ? most : *known;
}

// The shares of all who are gone as one, which leaves the eye where it is.
void join_gone(std::span<const Eye> eyes, std::vector<SharedEye::Share>* shares) {
  SharedEye::Share gone;
  const auto is_gone = [&](const SharedEye::Share& share) {
    return std::none_of(eyes.begin(), eyes.end(), [&](const Eye& eye) { return eye.viewer == share.viewer; });
  };
  for (const SharedEye::Share& share : *shares) {
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

std::optional<Eigen::Vector3d> SharedEye::p_world() const {
  if (shares.empty()) return std::nullopt;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (const Share& share : shares) p += share.share * share.p_world;
  return p;
}

SharedEye followed(const SharedEye& before,
                   std::span<const Eye> eyes,
                   const Eigen::Vector3d& p_middle_world,
                   double seconds,
                   const SharedEyeOptions& options) {
  LIMN_CHECK(options.fade_s > 0 && options.take_over >= 1 && options.apart_deg > options.one_side_deg);
  SharedEye after = before;
  join_gone(eyes, &after.shares);
  if (eyes.empty()) return after;
  const Eye& leader = leader_of(eyes, before.leader, p_middle_world, options.take_over);
  after.leader = leader.viewer;
  std::vector<double> wanted(after.shares.size(), 0);  // of those that are gone
  double sum = 0;
  for (const Eye& eye : eyes) {
    const auto known = std::find_if(after.shares.begin(), after.shares.end(),
                                    [&](const SharedEye::Share& s) { return s.viewer == eye.viewer; });
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
  double passing = 0;  // share that is to change hands
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
