#include "tracker/balls/constellation_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <set>

#include "tracker/balls/three_point_pose.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {
namespace {

// Standard deviation of a centre besides what the image shows: lens, rig, and how round the ball is.
constexpr double k_centre_px = 0.03;
// Relative standard deviations of angular sizes: of each ball, and of all alike (their stated diameter, the
// camera's encoding, overexposure).
constexpr double k_ball_size = 0.004, k_all_sizes = 0.015;
constexpr double k_gate = 4;                         // in standard deviations
constexpr double k_distance_m = 2e-3;                // two distances may differ by this besides
constexpr double k_near_px = 3, k_near_share = 0.5;  // gate of a first match, px and share of the radius
constexpr double k_tight_px = 1, k_tight_deviations = 5;
constexpr double k_most_size_ratio = 1.15;
constexpr double k_most_rms_px = 1;
constexpr double k_most_size_cost = 16;      // chi-square of three sizes: one in 900 exceeds it
constexpr double k_most_size_cost_each = 5;  // for each further ball
constexpr double k_most_contrast_ratio = 3;  // balls of one kind, in one image
constexpr std::size_t k_most_balls_in_view = 30, k_most_explanations = 400;
constexpr double k_same_turn = 0.01, k_same_place_m = 1e-3;  // poses nearer than this are one
constexpr double k_ball_value = 40;  // an explanation may cost this more for each ball that it explains
constexpr double k_alternative_cost = 25;
constexpr std::size_t k_most_alternatives = 4;
constexpr double k_firm_turn = 0.25;     // radians; largest spread of a firm expectation
constexpr double k_most_unexpected = 9;  // squared deviations from the expected pose
// Balls of about the same size within this many lengths of the constellation lie beside it.
constexpr double k_beside = 1.5, k_same_size_ratio = 1.25;

double relative_deviation(const Ball& ball) {
  return std::hypot(ball.half_angle_stddev / std::tan(ball.half_angle), k_ball_size);
}

PointObservation observation_of(const Ball& ball, const Imager& camera, const Eigen::Vector3d& p_body) {
  const Eigen::Matrix2d covariance =
      ball.centre_covariance + k_centre_px * k_centre_px * Eigen::Matrix2d::Identity();
  return {&camera.lens, camera.imager_from_world, p_body, ball.centre_px, covariance.inverse()};
}

std::size_t distinct_balls(const std::vector<BallMatch>& matches) {
  std::set<std::size_t> which;
  for (const BallMatch& match : matches) which.insert(match.in_constellation);
  return which.size();
}

bool is_near(const Pose& a, const Pose& b) {
  return angle_between(a.rotation, b.rotation) < k_same_turn &&
         (a.translation - b.translation).norm() < k_same_place_m;
}

bool conflict(const ConstellationFit& a, const ConstellationFit& b) {
  return std::ranges::any_of(a.matches, [&](const BallMatch& match) {
    return std::ranges::any_of(b.matches, [&](const BallMatch& other) {
      return match.view == other.view && match.ball == other.ball;
    });
  });
}

// Whether both explain the same detected balls.
bool have_same_balls(const ConstellationFit& a, const ConstellationFit& b) {
  return std::ranges::equal(a.matches, b.matches, [](const BallMatch& one, const BallMatch& other) {
    return one.view == other.view && one.ball == other.ball;
  });
}

double cost_of(const ConstellationFit& fit) { return fit.fit.chi_square + fit.size_cost; }

// Squared deviations from the nearest expected pose; 0 where nothing is expected.
double unexpected(const Pose& pose, const ExpectedPoses& expected) {
  double least = expected.world_from_body.empty() ? 0 : std::numeric_limits<double>::infinity();
  for (const Pose& other : expected.world_from_body)
    least =
        std::min(least, std::pow((pose.translation - other.translation).norm() / expected.spread_m, 2) +
                            std::pow(angle_between(pose.rotation, other.rotation) / expected.spread_turn, 2));
  return least;
}

// Finds all explanations of the balls by one constellation.
class ExplanationSearch {
 public:
  ExplanationSearch(const Constellation& constellation, std::span<const BallView> views)
      : constellation_(constellation), views_(views) {}

  std::vector<ConstellationFit> find(const ExpectedPoses& expected) {
    for (const Pose& pose : expected.world_from_body) add(pose);
    for (std::size_t view = 0; view < views_.size(); ++view) search(view);
    // The other poses of the same matches stay: each is a branch of the ambiguity.
    const auto is_expected = [&](const ConstellationFit& fit) {
      return std::ranges::any_of(found_, [&](const ConstellationFit& other) {
        return other.matches == fit.matches &&
               unexpected(other.fit.world_from_body, expected) <= k_most_unexpected;
      });
    };
    std::vector<ConstellationFit> kept;
    std::ranges::copy_if(found_, std::back_inserter(kept), is_expected);
    return kept;
  }

 private:
  struct Coarse {
    Eigen::Vector3d p, d;
    double deviation;  // along the ray
  };

  void search(std::size_t view) {
    const auto& balls = views_[view].balls;
    coarse_.clear();
    for (std::size_t i = 0; i < std::min(balls.size(), k_most_balls_in_view); ++i) {
      const Eigen::Vector3d p = p_centre_of(balls[i], constellation_.radius_m);
      coarse_.push_back({p, balls[i].d_centre, p.norm() * relative_deviation(balls[i])});
    }
    const std::size_t count = constellation_.p_balls.size();
    for (std::size_t i = 0; i < coarse_.size(); ++i)
      for (std::size_t k = i + 1; k < coarse_.size(); ++k)
        for (std::size_t a = 0; a < count; ++a)
          for (std::size_t b = 0; b < count; ++b)
            if (a != b && suits(i, k, a, b)) search_third(view, {i, k}, {a, b});
  }

  void search_third(std::size_t view, std::array<std::size_t, 2> balls, std::array<std::size_t, 2> as) {
    for (std::size_t n = balls[1] + 1; n < coarse_.size(); ++n)
      for (std::size_t c = 0; c < constellation_.p_balls.size(); ++c) {
        if (c == as[0] || c == as[1] || !suits(balls[0], n, as[0], c) || !suits(balls[1], n, as[1], c))
          continue;
        if (found_.size() < k_most_explanations) propose(view, {balls[0], balls[1], n}, {as[0], as[1], c});
      }
  }

  // Whether two balls can be as far apart as two of the constellation are, along their rays and across them.
  bool suits(std::size_t i, std::size_t k, std::size_t a, std::size_t b) const {
    const double distance = (constellation_.p_balls[a] - constellation_.p_balls[b]).norm();
    const Eigen::Vector3d apart = coarse_[k].p - coarse_[i].p, d = (coarse_[i].d + coarse_[k].d).normalized();
    const double along = std::abs(apart.dot(d)), across = d.cross(apart).norm();
    const double reach = k_gate * std::hypot(coarse_[i].deviation, coarse_[k].deviation);
    const double least = std::hypot(across, std::max(0.0, along - reach)),
                 most = std::hypot(across, along + reach);
    return distance > (1 - k_gate * k_all_sizes) * least - k_distance_m &&
           distance < (1 + k_gate * k_all_sizes) * most + k_distance_m;
  }

  void propose(std::size_t view,
               const std::array<std::size_t, 3>& balls,
               const std::array<std::size_t, 3>& as) {
    const auto has = [&](const ConstellationFit& fit, std::size_t n) {
      return std::ranges::find(fit.matches, BallMatch{view, balls[n], as[n]}) != fit.matches.end();
    };
    // What four or more balls explain needs no second proposal.
    const bool is_known = std::ranges::any_of(found_, [&](const ConstellationFit& fit) {
      return distinct_balls(fit.matches) > 3 && has(fit, 0) && has(fit, 1) && has(fit, 2);
    });
    if (is_known) return;
    std::array<Eigen::Vector3d, 3> p, d;
    for (std::size_t n = 0; n < 3; ++n)
      p[n] = constellation_.p_balls[as[n]], d[n] = views_[view].balls[balls[n]].d_centre;
    const Pose world_from_camera = views_[view].camera->imager_from_world.inverse();
    for (const Pose& pose : three_point_poses(p, d)) add(world_from_camera * pose);
  }

  // The detected balls near the constellation's in all cameras; each is used once.
  std::vector<BallMatch> matches_at(const Pose& world_from_body, bool is_refined) const {
    std::vector<BallMatch> matches;
    for (std::size_t view = 0; view < views_.size(); ++view) {
      const Imager& camera = *views_[view].camera;
      std::vector<std::pair<double, BallMatch>> near;
      for (std::size_t i = 0; i < constellation_.p_balls.size(); ++i) {
        const Eigen::Vector3d p = camera.imager_from_world * (world_from_body * constellation_.p_balls[i]);
        if (!(p.z() > 0) || !(p.norm() > constellation_.radius_m)) continue;
        const auto px = camera.lens.project(p);
        if (!px) continue;
        const double half_angle = std::asin(constellation_.radius_m / p.norm());
        for (std::size_t k = 0; k < views_[view].balls.size(); ++k) {
          const Ball& ball = views_[view].balls[k];
          const double off = (ball.centre_px - *px).norm(), ratio = ball.half_angle / half_angle;
          const double tight = k_tight_px + k_tight_deviations * std::sqrt(ball.centre_covariance.trace());
          const double gate = is_refined ? tight : std::max(k_near_px, k_near_share * ball.radius_px);
          if (off < gate && ratio < k_most_size_ratio && ratio > 1 / k_most_size_ratio)
            near.push_back({off, {view, k, i}});
        }
      }
      std::ranges::sort(near);
      for (const auto& [off, match] : near)
        if (std::ranges::none_of(matches, [view, match = match](const BallMatch& other) {
              return other.view == view &&
                     (other.ball == match.ball || other.in_constellation == match.in_constellation);
            }))
          matches.push_back(match);
    }
    std::ranges::sort(matches);
    return matches;
  }

  std::optional<ConstellationFit> fitted(const Pose& start, bool is_refined) const {
    ConstellationFit fit;
    fit.matches = matches_at(start, is_refined);
    if (distinct_balls(fit.matches) < balls_needed(constellation_)) return std::nullopt;
    const auto pose = fit_pose(observations_of(fit, constellation_, views_), start, k_huber);
    if (!pose) return std::nullopt;
    fit.fit = *pose;
    return fit;
  }

  void add(const Pose& start) {
    auto fit = fitted(start, false);
    if (fit) fit = fitted(fit->fit.world_from_body, true);
    if (!fit || !(fit->fit.rms_px < k_most_rms_px) || !settle_sizes(&*fit) || !are_alike(*fit)) return;
    for (const ConstellationFit& other : found_)
      if (other.matches == fit->matches && is_near(other.fit.world_from_body, fit->fit.world_from_body))
        return;
    found_.push_back(std::move(*fit));
  }

  // Computes the cost of the sizes; false when it is too large.
  bool settle_sizes(ConstellationFit* fit) const {
    fit->size_cost = size_cost(fit->matches, constellation_, views_, fit->fit.world_from_body);
    return fit->size_cost <
           k_most_size_cost + k_most_size_cost_each * (static_cast<double>(fit->matches.size()) - 3);
  }

  bool are_alike(const ConstellationFit& fit) const {
    for (const BallMatch& a : fit.matches)
      for (const BallMatch& b : fit.matches) {
        const double first = views_[a.view].balls[a.ball].contrast,
                     second = views_[b.view].balls[b.ball].contrast;
        if (a.view == b.view && !(first / second > 0 && first / second < k_most_contrast_ratio)) return false;
      }
    return true;
  }

  const Constellation& constellation_;
  std::span<const BallView> views_;
  std::vector<Coarse> coarse_;
  std::vector<ConstellationFit> found_;
};

// An explanation with its value: what it explains, minus what it costs.
struct Valued {
  const ConstellationFit* fit;
  double value;
};

// The best explanation for each set of matches, at most `most`, highest value first.
std::vector<Valued> best_of(const std::vector<ConstellationFit>& fits,
                            const ExpectedPoses& expected,
                            std::size_t most) {
  std::vector<Valued> all;
  for (const ConstellationFit& fit : fits)
    all.push_back({&fit, k_ball_value * static_cast<double>(fit.matches.size()) - cost_of(fit) -
                             unexpected(fit.fit.world_from_body, expected)});
  std::ranges::stable_sort(all, [](const Valued& a, const Valued& b) { return a.value > b.value; });
  std::vector<Valued> best;
  for (const Valued& one : all) {
    if (best.size() == most) break;
    if (std::ranges::none_of(best, [&](const Valued& b) { return b.fit->matches == one.fit->matches; }))
      best.push_back(one);
  }
  return best;
}

// Chooses at most one explanation for each constellation, none of which share a ball, of the highest value.
class JointChoice {
 public:
  explicit JointChoice(std::vector<std::vector<Valued>> options)
      : options_(std::move(options)), now_(options_.size(), nullptr), best_(now_) {}

  std::vector<const ConstellationFit*> choose() {
    extend(0, 0);
    return best_;
  }

 private:
  void extend(std::size_t next, double value) {
    if (next == options_.size()) {
      if (value > best_value_) best_value_ = value, best_ = now_;
      return;
    }
    for (const Valued& option : options_[next]) {
      if (std::any_of(now_.begin(), now_.begin() + static_cast<std::ptrdiff_t>(next),
                      [&](const ConstellationFit* other) { return other && conflict(*other, *option.fit); }))
        continue;
      now_[next] = option.fit;
      extend(next + 1, value + option.value);
    }
    now_[next] = nullptr;
    extend(next + 1, value);
  }

  std::vector<std::vector<Valued>> options_;
  std::vector<const ConstellationFit*> now_, best_;
  double best_value_ = -1;
};

// The chosen explanation and those of the same balls that are nearly as good.
std::vector<ConstellationFit> alternatives(const std::vector<ConstellationFit>& fits,
                                           const ConstellationFit* chosen) {
  std::vector<ConstellationFit> kept;
  if (!chosen) return kept;
  for (const ConstellationFit& fit : fits)
    if (have_same_balls(fit, *chosen) && cost_of(fit) <= cost_of(*chosen) + k_alternative_cost)
      kept.push_back(fit);
  // Laplace's approximation of the likelihood's integral over each minimum.
  double highest = -std::numeric_limits<double>::infinity(), sum = 0;
  for (ConstellationFit& fit : kept) {
    fit.weight = 0.5 * (std::log(fit.fit.covariance.determinant()) - cost_of(fit));
    highest = std::max(highest, fit.weight);
  }
  std::ranges::stable_sort(kept, [](const auto& a, const auto& b) { return a.weight > b.weight; });
  kept.resize(std::min(kept.size(), k_most_alternatives));
  for (ConstellationFit& fit : kept) sum += fit.weight = std::exp(fit.weight - highest);
  for (ConstellationFit& fit : kept) fit.weight /= sum;
  return kept;
}

// Whether balls that no constellation explains lie beside the three of a weak explanation.
bool is_crowded(const ConstellationFit& fit,
                std::span<const BallView> views,
                std::span<const ConstellationFit* const> chosen) {
  const std::size_t view = fit.matches.front().view;
  const auto& balls = views[view].balls;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double half_angle = 0, length = 0;
  for (const BallMatch& match : fit.matches) {
    mean += balls[match.ball].d_centre / 3;
    half_angle += balls[match.ball].half_angle / 3;
    for (const BallMatch& other : fit.matches)
      length = std::max(length, (balls[match.ball].d_centre - balls[other.ball].d_centre).norm());
  }
  for (std::size_t k = 0; k < balls.size(); ++k) {
    const auto has = [&](const ConstellationFit* one) {
      return one && std::ranges::any_of(one->matches, [&](const BallMatch& match) {
               return match.view == view && match.ball == k;
             });
    };
    const double ratio = balls[k].half_angle / half_angle;
    if (std::ranges::none_of(chosen, has) && ratio < k_same_size_ratio && ratio > 1 / k_same_size_ratio &&
        (balls[k].d_centre - mean).norm() < k_beside * length)
      return true;
  }
  return false;
}

}  // namespace

// Logarithms of ratios of sizes, with a deviation of their own each and one that all share.
double size_cost(std::span<const BallMatch> matches,
                 const Constellation& constellation,
                 std::span<const BallView> views,
                 const Pose& world_from_body) {
  double squares = 0, sum = 0, weights = 1 / (k_all_sizes * k_all_sizes);
  for (const BallMatch& match : matches) {
    const Ball& ball = views[match.view].balls[match.ball];
    const Eigen::Vector3d p = views[match.view].camera->imager_from_world *
                              (world_from_body * constellation.p_balls[match.in_constellation]);
    const double ratio = std::log(std::sin(ball.half_angle) * p.norm() / constellation.radius_m);
    const double weight = 1 / std::pow(relative_deviation(ball), 2);
    squares += weight * ratio * ratio, sum += weight * ratio, weights += weight;
  }
  return squares - sum * sum / weights;
}

bool is_firm(const ExpectedPoses& expected) {
  return !expected.world_from_body.empty() && expected.spread_turn < k_firm_turn;
}

bool is_weak(const ConstellationFit& fit) {
  return fit.matches.size() == 3 && fit.matches.front().view == fit.matches.back().view;
}

std::vector<PointObservation> observations_of(const ConstellationFit& fit,
                                              const Constellation& constellation,
                                              std::span<const BallView> views) {
  std::vector<PointObservation> observations;
  for (const BallMatch& match : fit.matches)
    observations.push_back(observation_of(views[match.view].balls[match.ball], *views[match.view].camera,
                                          constellation.p_balls[match.in_constellation]));
  return observations;
}

std::vector<std::vector<ConstellationFit>> identified(std::span<const Constellation> constellations,
                                                      std::span<const BallView> views,
                                                      std::span<const ExpectedPoses> expected) {
  const std::size_t count = constellations.size();
  const std::size_t most = count <= 5 ? 8 : count <= 8 ? 3 : 2;  // so that all combinations can be tried
  const ExpectedPoses anywhere;
  const auto expected_of = [&](std::size_t i) { return expected.empty() ? anywhere : expected[i]; };
  std::vector<std::vector<ConstellationFit>> fits;
  std::vector<std::vector<Valued>> options;
  for (std::size_t i = 0; i < count; ++i) {
    fits.push_back(ExplanationSearch(constellations[i], views).find(expected_of(i)));
    options.push_back(best_of(fits.back(), expected_of(i), most));
  }
  const std::vector<const ConstellationFit*> chosen = JointChoice(std::move(options)).choose();
  std::vector<std::vector<ConstellationFit>> result;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_lone = chosen[i] && is_weak(*chosen[i]) && !is_firm(expected_of(i));
    result.push_back(is_lone && is_crowded(*chosen[i], views, chosen) ? std::vector<ConstellationFit>()
                                                                      : alternatives(fits[i], chosen[i]));
  }
  return result;
}

std::vector<Track> observed(std::span<const Constellation> constellations,
                            std::span<const BallView> views,
                            Stamp captured_at) {
  constexpr double k_sure = 0.95;
  const auto found = identified(constellations, views);
  std::vector<Track> tracks;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].empty() || found[i].front().weight < k_sure) continue;
    const ConstellationFit& fit = found[i].front();
    Track track;
    track.body = constellations[i].name;
    track.world_from_body = fit.fit.world_from_body;
    track.covariance = fit.fit.covariance;
    track.captured_at = captured_at;
    track.marker_count = static_cast<int>(fit.matches.size());
    track.rms_px = fit.fit.rms_px;
    tracks.push_back(std::move(track));
  }
  return tracks;
}

}  // namespace limn::tracker
