#pragma once

#include <span>
#include <vector>

#include "core/constellation.h"
#include "core/frame.h"
#include "core/imager.h"
#include "core/track.h"
#include "tracker/balls/ball.h"
#include "tracker/pose_fit.h"

namespace limn::tracker {

/// The balls that one camera detected at one moment. The camera is placed by its imager_from_world.
struct BallView {
  const Imager* camera = nullptr;
  std::span<const Ball> balls;
};

/// Says which ball of a constellation a detected ball is.
struct BallMatch {
  std::size_t view = 0, ball = 0;  ///< indices into the views and the view's balls
  std::size_t in_constellation = 0;

  auto operator<=>(const BallMatch&) const = default;
};

/// One explanation of detected balls by a constellation.
struct ConstellationFit {
  PoseFit fit;  ///< world_from_body with covariance, from the balls' centres
  std::vector<BallMatch> matches;
  double size_cost = 0;  ///< squared normalised differences of the balls' angular sizes
  double weight = 1;     ///< likelihood relative to the other explanations; they add up to 1
};

/// Where a constellation is expected to be from earlier images.
struct ExpectedPoses {
  std::vector<Pose> world_from_body;     ///< one for each branch; none: it may be anywhere
  double spread_m = 0, spread_turn = 0;  ///< standard deviations of the place and of the turn (radians)
};

/// Whether only three balls in one camera were seen: their centres suit up to four poses exactly.
bool is_weak(const ConstellationFit& fit);

/// Whether the expectation is firm enough to tell three balls of a constellation from others beside them.
bool is_firm(const ExpectedPoses& expected);

/// The observations of a fit's centres, for fit_pose. Borrows the views' lenses.
std::vector<PointObservation> observations_of(const ConstellationFit& fit,
                                              const Constellation& constellation,
                                              std::span<const BallView> views);

/// The size_cost of these matches at a pose.
double size_cost(std::span<const BallMatch> matches,
                 const Constellation& constellation,
                 std::span<const BallView> views,
                 const Pose& world_from_body);

/// The poses of constellations from one moment's images, without history. One whose balls suit several poses,
/// of which none is far likelier than the others, is absent: only later images tell which is right.
std::vector<Track> observed(std::span<const Constellation> constellations,
                            std::span<const BallView> views,
                            Stamp captured_at);

/// Finds each constellation in the images of one moment: the result has, for each constellation, its
/// explanations, likeliest first; none where balls_needed() balls are not seen, or do not lie as it does.
/// Three balls in one camera that agree in distances (from their angular sizes) propose the poses of the
/// three-point problem; a pose is verified by the balls in all cameras and refined on their centres. Three
/// balls in one camera
/// can have up to four explanations, otherwise there is one. A detected ball belongs to one constellation
/// only: what explains most balls, and these best, is chosen over all constellations together. Three balls in
/// one camera lie like some constellation by chance so often that they are refused where other balls lie
/// beside them, unless they are where they are expected. `expected`: one for each constellation, or empty. A
/// constellation that is expected somewhere is not found elsewhere.
std::vector<std::vector<ConstellationFit>> identified(std::span<const Constellation> constellations,
                                                      std::span<const BallView> views,
                                                      std::span<const ExpectedPoses> expected = {});

}  // namespace limn::tracker
