#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace limn::scene {

/// The position of one viewer's eye at a moment.
struct Viewpoint {
  std::string viewer;  ///< The viewer's name, not empty; it stays the same over time.
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  double weight = 1;  ///< A viewer of weight 2 counts as two; > 0.
};

struct SharedViewpointOptions {
  double fade_s = 0.8;  ///< Time to move from one viewer to another; longer is calmer but later.
  double takeover_ratio =
      1.5;  ///< The leader changes when another counts this many times more (1: changes back and forth).
  double full_weight_deg =
      35;  ///< Up to this angle from the leader, seen from the middle, viewers count fully.
  double zero_weight_deg = 80;  ///< Beyond this angle viewers do not count.
};

/// The one position that view parts are drawn for when several people look. A part's light falls on one place
/// of the surface, so people at different places cannot all see it correctly. The compromise: everybody on
/// the leader's side counts by weight / distance, which minimises the mean square misplacement of light on
/// the surface (near the surface a part is misplaced by its height times the eye's offset over its distance).
/// The leader is the viewer who counts most, so at equal weights the nearest. Somebody on another side sees
/// the parts with an error by parallax. The viewpoint never jumps when viewers come, go or take over.
struct SharedViewpoint {
  struct Share {
    std::string viewer;  ///< Empty: the share of viewers who are gone, at their last position.
    Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
    double share = 0;  ///< All shares add up to 1.
  };
  std::vector<Share> shares;
  std::string leader;

  /// The shared position; nullopt before anybody was seen.
  std::optional<Eigen::Vector3d> p_world() const;
};

/// The shared viewpoint `seconds` later, from the viewpoints seen then. `p_middle_world` is what they look
/// at. The result jumps only when the first viewer is seen. Later it follows the viewers' own motion and in
/// addition moves by at most seconds / fade_s of the distance between the two farthest viewers. While nobody
/// is seen it stays. A viewer who comes back counts as new.
SharedViewpoint updated_viewpoint(const SharedViewpoint& before,
                                  std::span<const Viewpoint> viewpoints,
                                  const Eigen::Vector3d& p_middle_world,
                                  double seconds,
                                  const SharedViewpointOptions& options = {});

}  // namespace limn::scene
