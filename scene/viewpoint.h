#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace limn::scene {

/// An eye of somebody who looks at the prototype.
struct Viewpoint {
  std::string viewer;  ///< whose, not empty; the same from moment to moment
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  double weight = 1;  ///< a viewer of weight 2 counts as two; > 0
};

struct SharedViewpointOptions {
  double fade_s = 0.8;  ///< for the whole image to pass from one viewer to another; longer: calmer, later
  double takeover_ratio =
      1.5;  ///< the leader changes when another counts this many times more (1: flips to and fro)
  double full_weight_deg = 35;  ///< viewers within this of the leader, seen from the middle, count fully,
  double zero_weight_deg = 80;  ///< and beyond this not at all
};

/// The one eye that view parts are drawn for when several people look: the light of a part falls in one place
/// of the surface only, so people who stand apart cannot all see it right. The compromise: everybody on the
/// leader's side counts by 1 / distance, which makes the misplacement of light on the surface least in the
/// mean square (near the surface a part is misplaced by its height times the eye's offset over its distance).
/// The leader is who counts most: the nearest; somebody on another side sees parts as the leader does, off by
/// parallax. Nobody's coming, going or taking over moves the eye at once.
struct SharedViewpoint {
  struct Share {
    std::string viewer;  ///< empty: of those who are gone, where they were
    Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
    double share = 0;  ///< all sum to 1
  };
  std::vector<Share> shares;
  std::string leader;

  /// nullopt before anybody was seen.
  std::optional<Eigen::Vector3d> p_world() const;
};

/// The shared eye `seconds` later, by the eyes seen then. `p_middle_world` is what they look at. It jumps for
/// the first eye alone; later, besides following the viewers' own moves, it moves by at most
/// seconds / fade_s of the distance between the farthest two. While nobody is seen it stays. Somebody who
/// comes back counts as somebody new.
SharedViewpoint updated_viewpoint(const SharedViewpoint& before,
                                  std::span<const Viewpoint> viewpoints,
                                  const Eigen::Vector3d& p_middle_world,
                                  double seconds,
                                  const SharedViewpointOptions& options = {});

}  // namespace limn::scene
