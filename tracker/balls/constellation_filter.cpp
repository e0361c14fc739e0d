#include "tracker/balls/constellation_filter.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "tracker/balls/three_point_pose.h"
#include "tracker/triangle_pose.h"

namespace limn::tracker {
namespace {

// Three balls in one camera are reported when this many images agree: those of two bodies that move do not
// stay as far apart.
constexpr int k_images_to_confirm = 10;
// So many suffice where the same balls were reported a moment before: they are found only where they are
// expected.
constexpr int k_images_to_confirm_again = 2;
// How far a body may be from where its motion leads to: a part for the prediction's error, and one for what a
// hand does while the body is not seen.
constexpr double k_spread_m = 0.01, k_spread_m_per_s = 0.6, k_spread_turn = 0.05, k_spread_turn_per_s = 3;
// For so long the filter's motion still leads to the right place: the spread grows with the square of the
// time.
constexpr double k_predicted_s = 0.15;

ExpectedPoses expected_of(const BodyFilter* known, Stamp at, const MotionModel& model) {
  if (!known) return {};
  const double unseen = std::max(0.0, seconds_between(known->measured_at, at));
  const double unforeseen = unseen * std::min(1.0, unseen / k_predicted_s);
  return {expected_poses(*known, at, model), k_spread_m + k_spread_m_per_s * unforeseen,
          k_spread_turn + k_spread_turn_per_s * unforeseen};
}

// After a step: a body that has just been found among three balls, or again after a while, must be confirmed;
// each image that agrees does.
int images_to_confirm(const BodyFilter* before,
                      const BodyFilter& after,
                      const ExpectedPoses& expected,
                      std::span<const ConstellationFit> fits) {
  if (before && after.measured_at == before->measured_at) return before->images_to_confirm;
  if (!is_weak(fits.front())) return 0;
  if (!before || after.fixes.size() == 1) return k_images_to_confirm;
  if (is_firm(expected)) return std::max(0, before->images_to_confirm - 1);
  return before->images_to_confirm > 0 ? k_images_to_confirm : k_images_to_confirm_again;
}

// The explanations of one constellation as evidence for its pose. A minimum's chi-square includes the sizes
// of the balls, because only they tell the poses of three balls apart.
class BallEvidence : public BodyEvidence {
 public:
  BallEvidence(const Constellation& constellation,
               std::span<const BallView> views,
               std::span<const ConstellationFit> fits)
      : constellation_(constellation), views_(views), fits_(fits) {}

  ChosenCorners points_at(const Pose& world_from_body) const override {
    return chosen_at(world_from_body).points;
  }

  double further_cost(const Pose& world_from_body) const override {
    const ConstellationFit* fit = chosen_at(world_from_body).fit;
    return fit ? size_cost(fit->matches, constellation_, views_, world_from_body) : 0;
  }

  std::vector<PoseFit> minima(std::span<const Pose>, Minima) const override {
    std::vector<PoseFit> minima;
    for (const ConstellationFit& fit : fits_) {
      minima.push_back(fit.fit);
      minima.back().chi_square += fit.size_cost;
    }
    std::ranges::stable_sort(minima, {}, &PoseFit::chi_square);
    return minima;
  }

 private:
  struct Chosen {
    const ConstellationFit* fit = nullptr;
    ChosenCorners points;
  };
  // The explanation that agrees best with a pose.
  Chosen chosen_at(const Pose& world_from_body) const {
    Chosen best;
    double least = std::numeric_limits<double>::infinity();
    for (const ConstellationFit& fit : fits_) {
      std::vector<PointObservation> observations = observations_of(fit, constellation_, views_);
      const double value = cost(observations, world_from_body, k_huber);
      if (best.fit && !(value < least)) continue;
      best = {&fit, {std::move(observations), static_cast<int>(fit.matches.size())}};
      least = value;
    }
    return best;
  }

  const Constellation& constellation_;
  std::span<const BallView> views_;
  std::span<const ConstellationFit> fits_;
};

// The pose of three balls by the paper's triangle: the balls' places in the camera's frame are where the rays
// of their centres come nearest to the balls of the pose that the image suits.
std::optional<Pose> triangle_fix(const Constellation& constellation,
                                 std::span<const BallView> views,
                                 std::span<const ConstellationFit> fits,
                                 const Pose& world_from_body) {
  const auto nearest = std::ranges::min_element(fits, {}, [&](const ConstellationFit& fit) {
    return angle_between(fit.fit.world_from_body.rotation, world_from_body.rotation);
  });
  if (constellation.p_balls.size() != 3 || !is_weak(*nearest)) return std::nullopt;
  const BallView& view = views[nearest->matches.front().view];
  std::array<Eigen::Vector3d, 3> p_body, d_camera;
  for (std::size_t i = 0; i < 3; ++i) {
    p_body[i] = constellation.p_balls[nearest->matches[i].in_constellation];
    d_camera[i] = view.balls[nearest->matches[i].ball].d_centre;
  }
  const Pose camera_from_body = view.camera->imager_from_world * nearest->fit.world_from_body;
  const std::vector<Pose> poses = three_point_poses(p_body, d_camera);
  if (poses.empty()) return std::nullopt;
  const Pose solution = *std::ranges::min_element(
      poses, {}, [&](const Pose& pose) { return angle_between(pose.rotation, camera_from_body.rotation); });
  Triangle in_camera;
  for (std::size_t i = 0; i < 3; ++i) in_camera[i] = (solution * p_body[i]).dot(d_camera[i]) * d_camera[i];
  const auto camera_from_triangle = pose_from_triangles(p_body, in_camera);
  if (!camera_from_triangle) return std::nullopt;
  return view.camera->imager_from_world.inverse() * *camera_from_triangle;
}

}  // namespace

std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Constellation> constellations,
                                 std::span<const BallView> views,
                                 Stamp captured_at,
                                 const MotionModel& model,
                                 TriplePose triple_pose) {
  std::vector<const BodyFilter*> before;
  std::vector<ExpectedPoses> expected;
  for (const Constellation& constellation : constellations) {
    const auto at = std::ranges::find(known, constellation.name, &BodyFilter::body);
    before.push_back(at == known.end() ? nullptr : &*at);
    expected.push_back(expected_of(before.back(), captured_at, model));
  }
  const std::vector<std::vector<ConstellationFit>> fits = identified(constellations, views, expected);
  std::vector<BodyFilter> motions;
  for (std::size_t i = 0; i < constellations.size(); ++i) {
    const BallEvidence seen(constellations[i], views, fits[i]);
    auto after = advanced(before[i], constellations[i].name, seen, captured_at, model);
    if (!after) continue;
    after->images_to_confirm = images_to_confirm(before[i], *after, expected[i], fits[i]);
    if (triple_pose == TriplePose::triangle && after->measured_at == captured_at && !fits[i].empty()) {
      Fix& fix = after->fixes.back();
      fix.world_from_body =
          triangle_fix(constellations[i], views, fits[i], fix.world_from_body).value_or(fix.world_from_body);
    }
    motions.push_back(std::move(*after));
  }
  return motions;
}

}  // namespace limn::tracker
