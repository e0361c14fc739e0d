#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/track.h"
#include "scene/scene.h"

namespace limn::session {

/// The stroke that a pen (scene/pen.h) draws while its tip is at the prototype: the track of the tip,
/// smoothed against the jitter of the poses and laid on the surface. It begins where the tip comes within
/// k_begins_m of the surface, and ends where it is farther than k_ends_m, is not measured for k_gone_s (the
/// marker is covered), or jumps.
class PenStroke {
 public:
  static constexpr double k_begins_m = 5e-3, k_ends_m = 8e-3, k_gone_s = 0.2;

  /// What a moment adds.
  struct Addition {
    bool begins = false;                       ///< The points begin a stroke; else they continue it.
    std::vector<Eigen::Vector3d> points = {};  ///< On the surface, in the prototype's frame, m.
  };
  /// Notes the tracks at the newest image, at `now`. A stroke of less than 2 mm adds nothing: it is a touch.
  /// A point comes about k_delay_s after the tip was there, the last ones when the stroke ends.
  Addition note(const scene::Scene& scene, std::span<const Track> tracks, Stamp now);
  /// Whether the tip is at the surface.
  bool is_on() const { return is_on_; }

 private:
  struct Sample {
    Stamp at;
    Eigen::Vector3d p;       // the tip in the prototype's frame, m
    Eigen::Vector3d d_side;  // unit direction from the surface towards the pen
  };
  void add(const scene::Drape& drape, const Sample& sample);
  void smooth_until(const scene::Drape& drape, Stamp last);
  Eigen::Vector3d smoothed(std::size_t index) const;
  void end(const scene::Drape& drape);
  Addition taken();

  bool is_on_ = false, has_begun_ = false;  // has_begun_: points of this stroke were handed over
  std::optional<Stamp> seen_at_;            // the newest sample, also one in the air
  std::deque<Sample> samples_;              // this stroke's, as far back as smoothing needs them
  std::size_t next_ = 0;                    // the first sample that is not smoothed yet
  std::optional<Eigen::Vector3d> p_last_;   // the point added last
  Eigen::Vector3d p_first_ = Eigen::Vector3d::Zero();
  bool is_long_ = false;  // the stroke is more than a touch
  std::vector<Eigen::Vector3d> waiting_;
};

}  // namespace limn::session
