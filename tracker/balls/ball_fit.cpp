#include "tracker/balls/ball_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/least_squares.h"
#include "core/median.h"

namespace limn::tracker {

double distance_of(const Ball& ball, double radius) { return radius / std::sin(ball.half_angle); }

Eigen::Vector3d p_centre_of(const Ball& ball, double radius) {
  return distance_of(ball, radius) * ball.d_centre;
}

namespace {

// The unknowns: centre (2), radius and blur; then factors of the light's terms.
constexpr int k_shape_terms = 4, k_light_terms = 9, k_terms = k_shape_terms + k_light_terms;
using Row = Eigen::Matrix<double, k_terms, 1>;
using Normal = Eigen::Matrix<double, k_terms, k_terms>;

constexpr double k_first_blur_px = 0.8;
constexpr double k_least_blur_px = 0.25, k_most_blur_px = 8;  // that of a pixel's own area is .29
// How far pixels on both sides of the outline are used: in its blur, and beyond it.
constexpr double k_reach_blurs = 2.5, k_reach_px = 1.2;
constexpr double k_most_inside_share = 0.7;  // share of the radius: what lies deeper may be printed or shiny
constexpr std::size_t k_most_pixels = 600;   // only a part of a large sphere's is used
constexpr std::size_t k_least_pixels = 40;
constexpr int k_max_steps = 15;
constexpr double k_settled_px = 1e-3, k_roughly_settled_px = 0.02;  // rough: before the last round
constexpr double k_huber = 2;                                       // in robust standard deviations
constexpr int k_rounds = 3;                // the blur of each round sets the reach of the next
constexpr double k_same_blur_share = 0.1;  // a blur that changes by less needs no further round
constexpr std::size_t k_sectors = k_outline_parts / 2;
constexpr std::size_t k_least_sectors = 7;  // that must be shown, of these 16
constexpr double k_alike_by_chance = 2;  // variance of the sectors' sums over that of independent residuals
// The outline may deviate from a cone by this much (RMS over its sectors, beyond noise), as share of its
// radius.
constexpr double k_most_bumps_px = 0.06, k_most_bumps_share = 0.008;
constexpr double k_most_residual_share = 0.08;  // RMS residual over the contrast, beyond noise of 3 levels
constexpr double k_noise_levels = 3;
constexpr double k_least_sector_share = 0.15;  // contrast of the weaker sectors, as share of the mean
constexpr int k_most_weak_sectors = 3;
constexpr double k_partial_share = 0.35;  // these limits for an outline that is shown in part
constexpr double k_partial_variance = 2;  // an arc shows less of what disturbs it
constexpr double k_least_disturbed = 4;   // levels
constexpr int k_most_fits = 3;            // each leaves out the parts that disturbed the one before
constexpr std::size_t k_least_kept = 17;  // parts; fewer suit what is no sphere, too
constexpr int k_most_gaps = 1;            // what hides a part leaves one gap; what is no sphere has more
constexpr double k_most_disturbed = 2.5;  // a part's residual over the median of all parts
constexpr double k_most_stddev_px = 0.3;
// The radius is known to this at best: pixels and blur are not quite Gaussian.
constexpr double k_systematic_radius_px = 0.03;
constexpr double k_most_shift_share = 0.5;  // share of the radius, plus a pixel: from the start to the result
constexpr double k_smallest_radius_px = 2.5;

// sqrt(max(0, x)), blurred by a Gaussian of sigma 1.
class BlurredRoot {
 public:
  static const BlurredRoot& table() {
    static const BlurredRoot the_table;
    return the_table;
  }
  // The value, and its derivative.
  std::pair<double, double> at(double x) const {
    if (x <= k_from) return {0, 0};
    if (x >= k_to - 1) {
      const double root = std::sqrt(x), share = 1 / (8 * x * x);
      return {root * (1 - share), 0.5 / root};
    }
    const double place = (x - k_from) * k_per_unit;
    const auto i = static_cast<std::size_t>(place);
    const double t = place - static_cast<double>(i);
    return {values_[i] + t * (values_[i + 1] - values_[i]), (values_[i + 1] - values_[i]) * k_per_unit};
  }

 private:
  static constexpr double k_from = -5, k_to = 9;
  static constexpr int k_per_unit = 64;
  std::array<double, static_cast<std::size_t>((k_to - k_from) * k_per_unit) + 1> values_;

  BlurredRoot() {
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = blurred(k_from + static_cast<double>(i) / k_per_unit);
  }
  // The integral of 2 w^2 phi(x - w^2) over w > 0, by the midpoint rule.
  static double blurred(double x) {
    constexpr int k_steps = 600;
    const double most = std::sqrt(std::max(0.1, x + 6)), step = most / k_steps;
    double sum = 0;
    for (int k = 0; k < k_steps; ++k) {
      const double w = (k + 0.5) * step, t = x - w * w;
      sum += 2 * w * w * std::exp(-0.5 * t * t);
    }
    return sum * step / std::sqrt(2 * std::numbers::pi);
  }
};

double area_below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }
double density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); }

// Two unit vectors that are perpendicular to d and to each other.
std::pair<Eigen::Vector3d, Eigen::Vector3d> tangents(const Eigen::Vector3d& d) {
  const Eigen::Vector3d a = d.unitOrthogonal();
  return {a, d.cross(a)};
}

// Pixels for one radian at d: the derivative of the pixel by a step along the two tangents.
std::optional<Eigen::Matrix2d> px_by_angles(const Lens& lens, const Eigen::Vector3d& d) {
  Eigen::Vector2d px;
  PixelByPoint by_d;
  if (!lens.model.project(lens.values, d, &px, by_d.data())) return std::nullopt;
  const auto [a, b] = tangents(d);
  Eigen::Matrix2d by_angles;
  by_angles << by_d * a, by_d * b;
  if (!(std::abs(by_angles.determinant()) > 0) || !by_angles.allFinite()) return std::nullopt;
  return by_angles;
}

}  // namespace

struct BallFitter::State {
  Eigen::Vector2d centre_px;
  double radius_px, blur_px;
  Eigen::Matrix<double, k_light_terms, 1> light = Eigen::Matrix<double, k_light_terms, 1>::Zero();
  // What follows from the centre.
  Eigen::Vector3d d_centre = Eigen::Vector3d::UnitZ();
  Eigen::Matrix<double, 3, 2> d_by_px = Eigen::Matrix<double, 3, 2>::Zero();
  Eigen::Matrix2d px_by_angles = Eigen::Matrix2d::Identity();
  double px_per_radian = 1;  // at the start; it gives the radius its unit

  double half_angle() const { return radius_px / px_per_radian; }
  // Finds the direction of the centre's pixel. False when it has none.
  bool settle(const Lens& lens) {
    const auto d = lens.unproject(centre_px);
    if (!d) return false;
    const auto by_angles = tracker::px_by_angles(lens, *d);
    if (!by_angles) return false;
    d_centre = *d;
    px_by_angles = *by_angles;
    const auto [a, b] = tangents(*d);
    const Eigen::Matrix2d angles_by_px = by_angles->inverse();
    d_by_px = a * angles_by_px.row(0) + b * angles_by_px.row(1);
    return true;
  }
};

namespace {

// Where a pixel lies beside the outline.
struct Place {
  double inside_px = 0;  // distance from the outline, inwards
  Eigen::Vector2d by_centre;
  double by_radius = 0;
  double cos_phi = 1, sin_phi = 0;  // direction from the centre in the image
};

template <class Pixel, class State>
Place place_of(const Pixel& pixel, const State& state) {
  Place place;
  const double cosine = pixel.d.dot(state.d_centre);
  const Eigen::Vector3d across = state.d_centre.cross(pixel.d);  // its length is the sine
  const double sine = std::max(1e-12, across.norm());
  const double angle = std::atan2(sine, cosine);
  const Eigen::Vector3d b = across / sine, outwards = b.cross(pixel.d);
  // The angle grows by one over this per pixel, along the outline's normal in the image.
  const Eigen::Vector2d px_out = pixel.px_by_d * outwards, px_along = pixel.px_by_d * b;
  const double px_per_radian =
      std::abs(px_out.x() * px_along.y() - px_out.y() * px_along.x()) / std::max(1e-12, px_along.norm());
  place.inside_px = (state.half_angle() - angle) * px_per_radian;
  const Eigen::Vector3d angle_by_d =
      -(pixel.d - cosine * state.d_centre) / sine;  // by the centre's direction
  place.by_centre = -px_per_radian * state.d_by_px.transpose() * angle_by_d;
  place.by_radius = px_per_radian / state.px_per_radian;
  const Eigen::Vector2d from_centre = pixel.px - state.centre_px;
  const double length = std::max(1e-9, from_centre.norm());
  place.cos_phi = from_centre.x() / length;
  place.sin_phi = from_centre.y() / length;
  return place;
}

// Light outside (1, cos, sin), inside (1, cos, sin, cos 2, sin 2), and towards the viewer (1).
struct Model {
  double value = 0;
  Row by_terms;
  double inside_px = 0;
  double by_edge = 0;  // derivative by a shift of the edge outwards
  std::size_t sector = 0;
};

template <class Pixel, class State>
Model model_of(const Pixel& pixel, const State& state) {
  const Place place = place_of(pixel, state);
  const double sigma = state.blur_px, radius = state.radius_px;
  // A blurred edge that is curved lies further inside.
  const double s = place.inside_px - sigma * sigma / (2 * radius);
  const double x = s / sigma, covered = area_below(x), edge = density(x) / sigma;
  // The cosine at the limb is sqrt(2 s / r - (s / r)^2).
  const auto [root, root_by_x] = BlurredRoot::table().at(x);
  const double depth = std::clamp(s, 0.0, radius) / radius;
  const double limb_scale = std::sqrt((2 - depth) / radius), limb_root = std::sqrt(sigma) * root;
  const double limb = limb_scale * limb_root;
  const double limb_by_s = limb_scale * root_by_x / std::sqrt(sigma) -
                           (s > 0 && s < radius ? limb_root / (2 * limb_scale * radius * radius) : 0.0);
  const double cos_2 = place.cos_phi * place.cos_phi - place.sin_phi * place.sin_phi;
  const double sin_2 = 2 * place.cos_phi * place.sin_phi;
  const auto& light = state.light;
  const double outside = light[0] + light[1] * place.cos_phi + light[2] * place.sin_phi;
  const double inside =
      light[3] + light[4] * place.cos_phi + light[5] * place.sin_phi + light[6] * cos_2 + light[7] * sin_2;
  Model model;
  model.inside_px = place.inside_px;
  model.value = (1 - covered) * outside + covered * inside + limb * light[8];
  model.by_edge = (inside - outside) * edge + light[8] * limb_by_s;
  const double by_sigma =
      -(inside - outside) * edge * x +
      light[8] * limb_scale * (0.5 * root / std::sqrt(sigma) - root_by_x * x / std::sqrt(sigma)) -
      model.by_edge * sigma / radius;
  model.by_terms << model.by_edge * place.by_centre, model.by_edge * place.by_radius, by_sigma,
      (1 - covered) * Eigen::Vector3d(1, place.cos_phi, place.sin_phi),
      covered * Eigen::Vector3d(1, place.cos_phi, place.sin_phi), covered * cos_2, covered * sin_2, limb;
  model.sector = outline_part({place.cos_phi, place.sin_phi}) / 2;
  return model;
}

}  // namespace

// The problem for minimise().
struct BallFitter::Problem {
  const Lens& lens;
  const std::vector<Pixel>& pixels;
  HuberLoss loss;
  double scale = 1;  // standard deviation of a pixel
  double settled_px = k_settled_px;
  State state;
  State trial{};
  Row step = Row::Zero();
  Normal normal = Normal::Zero();
  Row gradient = Row::Zero();

  double cost_of(const State& at) const {
    double sum = 0;
    for (const Pixel& pixel : pixels) {
      const double r = (pixel.light - model_of(pixel, at).value) / scale;
      sum += loss.cost(r * r);
    }
    return sum;
  }
  double cost() const { return cost_of(state); }
  bool linearise() {
    normal.setZero();
    gradient.setZero();
    for (const Pixel& pixel : pixels) {
      const Model model = model_of(pixel, state);
      const double r = (pixel.light - model.value) / scale, w = loss.weight(r * r) / (scale * scale);
      normal.noalias() += w * model.by_terms * model.by_terms.transpose();
      gradient.noalias() += (w * scale * r) * model.by_terms;
    }
    // A term that nothing shows, for example the limb's of a flat white disc, has a small diagonal.
    normal.diagonal().array() += 1e-9 * normal.diagonal().maxCoeff();
    return normal.allFinite();
  }
  bool solve(double damping) {
    step = damped(normal, damping).ldlt().solve(gradient);
    return step.allFinite();
  }
  double evaluate_trial() {
    trial = state;
    trial.centre_px += step.head<2>();
    trial.radius_px += step[2];
    trial.blur_px += step[3];
    trial.light += step.tail<k_light_terms>();
    if (!(trial.radius_px > k_smallest_radius_px) || !(trial.blur_px > k_least_blur_px) ||
        !(trial.blur_px < k_most_blur_px) || !(trial.half_angle() < 1.4) || !trial.settle(lens))
      return std::numeric_limits<double>::infinity();
    return cost_of(trial);
  }
  void accept_trial() { state = trial; }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && step.head<3>().lpNorm<Eigen::Infinity>() < settled_px;
  }
  // Solves for the light alone, at the state's shape.
  bool fit_light() {
    if (!linearise()) return false;
    const Eigen::Matrix<double, k_light_terms, k_light_terms> lights =
        normal.bottomRightCorner<k_light_terms, k_light_terms>();
    state.light += lights.ldlt().solve(gradient.tail<k_light_terms>());
    return state.light.allFinite();
  }
  double robust_deviation() const {
    std::vector<double> sizes;
    sizes.reserve(pixels.size());
    for (const Pixel& pixel : pixels) sizes.push_back(std::abs(pixel.light - model_of(pixel, state).value));
    return std::max(0.3, 1.4826 * median(std::move(sizes)));  // .29 is the deviation of rounding to levels
  }
};

BallFitter::BallFitter(Encoding encoding) : encoding_(encoding) {}

// Collects the pixels on both sides of the outline. False when a part of it lies outside the image or has no
// direction.
bool BallFitter::collect(const cv::Mat& grey,
                         const Lens& lens,
                         const State& state,
                         const OutlineParts& shown) {
  const double reach = k_reach_blurs * state.blur_px + k_reach_px;
  const double reach_inside = std::min(reach, k_most_inside_share * state.radius_px);
  const Eigen::Matrix2d angles_by_px = state.px_by_angles.inverse();
  const Eigen::Vector2d half = state.half_angle() * state.px_by_angles.rowwise().norm() +
                               Eigen::Vector2d::Constant(reach + 1);  // the outline's ellipse
  const Eigen::Vector2d low = state.centre_px - half, high = state.centre_px + half;
  const Eigen::Vector2d image(grey.cols - 1, grey.rows - 1);
  if (!((low.array() + reach).minCoeff() > 0 && (image - high).minCoeff() > -reach)) return false;
  const int left = std::max(0, static_cast<int>(low.x())), top = std::max(0, static_cast<int>(low.y()));
  const int right = std::min(grey.cols - 1, static_cast<int>(std::ceil(high.x())));
  const int bottom = std::min(grey.rows - 1, static_cast<int>(std::ceil(high.y())));
  const double band = 2 * std::numbers::pi * state.radius_px * (reach + reach_inside);
  const int every = std::max(1, static_cast<int>(band / static_cast<double>(k_most_pixels)));
  pixels_.clear();
  int number = 0;
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const Eigen::Vector2d px(x, y);
      const double angle = (angles_by_px * (px - state.centre_px)).norm();
      const double roughly = state.radius_px * (1 - angle / state.half_angle());
      if (roughly > reach_inside + 1 || roughly < -reach - 1 || number++ % every != 0) continue;
      if (!shown[outline_part(px - state.centre_px)]) continue;
      Pixel pixel;
      pixel.px = px;
      const auto d = lens.unproject(px);
      if (!d) return false;
      pixel.d = *d;
      Eigen::Vector2d again;
      if (!lens.model.project(lens.values, *d, &again, pixel.px_by_d.data())) return false;
      const double inside = place_of(pixel, state).inside_px;
      if (inside > reach_inside || inside < -reach) continue;
      pixel.light = encoding_.light()[grey.at<std::uint8_t>(y, x)];
      pixels_.push_back(pixel);
    }
  return pixels_.size() >= k_least_pixels;
}

namespace {

// Shifts of the edge in each sector of the outline, which a sphere does not have, and what else tells a
// sphere.
struct Evidence {
  double bumps_px = 0;      // RMS shift beyond noise
  double agreement = 1;     // variance of the shifts over what independent pixels would give
  double contrast = 0;      // mean over the sectors
  int weak_sectors = 0;     // without an edge
  std::size_t sectors = 0;  // that are shown
  double residual = 0;      // RMS
};

template <class Pixels, class State>
Evidence evidence_of(const Pixels& pixels,
                     const State& state,
                     const OutlineParts& shown,
                     const HuberLoss& loss,
                     double scale) {
  struct Sector {
    double moment = 0, weight = 0, inside = 0, outside = 0, of_inside = 0, of_outside = 0;
    std::array<double, 2> residuals{}, count{};  // sums over the pixels inside and outside
  };
  std::array<Sector, k_sectors> sectors{};
  double squares = 0;
  for (const auto& pixel : pixels) {
    const Model model = model_of(pixel, state);
    const double r = pixel.light - model.value, w = loss.weight(r * r / (scale * scale));
    squares += w * r * r;
    Sector& sector = sectors[model.sector];
    const std::size_t side = model.inside_px > 0 ? 0 : 1;
    sector.residuals[side] += w * r, sector.count[side] += w * w;
    sector.moment += w * r * model.by_edge;
    sector.weight += w * model.by_edge * model.by_edge;
    if (model.inside_px > state.blur_px) sector.inside += pixel.light, sector.of_inside += 1;
    if (model.inside_px < -state.blur_px) sector.outside += pixel.light, sector.of_outside += 1;
  }
  Evidence evidence;
  evidence.residual = std::sqrt(squares / static_cast<double>(pixels.size()));
  const auto is_shown = [&](std::size_t sector) { return shown[2 * sector] && shown[2 * sector + 1]; };
  std::array<double, k_sectors> contrasts{};
  for (std::size_t i = 0; i < k_sectors; ++i) evidence.sectors += is_shown(i);
  double shifts = 0, noise = 0, normalised = 0, used = 0;
  for (std::size_t i = 0; i < sectors.size(); ++i) {
    const Sector& sector = sectors[i];
    if (sector.of_inside > 0 && sector.of_outside > 0)
      contrasts[i] = sector.inside / sector.of_inside - sector.outside / sector.of_outside;
    if (is_shown(i)) evidence.contrast += contrasts[i] / static_cast<double>(evidence.sectors);
    if (!(sector.weight > 0)) continue;
    const double shift = sector.moment / sector.weight, variance = scale * scale / sector.weight;
    if (variance > 0.25) continue;  // no edge there
    shifts += shift * shift, noise += variance, normalised += shift * shift / variance, used += 1;
  }
  for (std::size_t i = 0; i < k_sectors; ++i)
    if (const double contrast = contrasts[i];
        is_shown(i) &&
        !(contrast * evidence.contrast > k_least_sector_share * evidence.contrast * evidence.contrast))
      ++evidence.weak_sectors;
  if (used > 0) evidence.bumps_px = std::sqrt(std::max(0.0, (shifts - noise) / used));
  if (used > 0) evidence.agreement = std::max(1.0, normalised / used);
  // Where clutter lies beside the outline, neighbouring residuals are alike and do not average out.
  double sums = 0, cells = 0;
  for (const Sector& sector : sectors)
    for (std::size_t side = 0; side < 2; ++side)
      if (sector.count[side] > 1)
        sums += sector.residuals[side] * sector.residuals[side] / (sector.count[side] * scale * scale),
            ++cells;
  const double alike = sums / std::max(1.0, cells - k_light_terms);
  if (alike > k_alike_by_chance) evidence.agreement = std::max(evidence.agreement, alike);
  return evidence;
}

// Without the parts whose residuals are much larger than most: something lies beside the outline there.
template <class Pixels, class State>
OutlineParts undisturbed(const Pixels& pixels, const State& state, const OutlineParts& shown) {
  std::array<double, k_outline_parts> squares{}, count{};
  for (const auto& pixel : pixels) {
    const std::size_t part = outline_part(pixel.px - state.centre_px);
    const double r = pixel.light - model_of(pixel, state).value;
    squares[part] += r * r, ++count[part];
  }
  std::vector<double> sizes;
  for (std::size_t i = 0; i < k_outline_parts; ++i)
    if (shown[i] && count[i] > 0) sizes.push_back(std::sqrt(squares[i] / count[i]));
  if (sizes.empty()) return shown;
  const double most = std::max(k_least_disturbed, k_most_disturbed * median(std::move(sizes)));
  OutlineParts kept = shown;
  for (std::size_t i = 0; i < k_outline_parts; ++i)
    if (count[i] > 0 && std::sqrt(squares[i] / count[i]) > most) kept.reset(i);
  return kept;
}

// How many runs of parts are left out.
int gaps_in(const OutlineParts& shown) {
  int gaps = 0;
  for (std::size_t i = 0; i < k_outline_parts; ++i)
    gaps += !shown[i] && shown[(i + k_outline_parts - 1) % k_outline_parts];
  return gaps;
}

bool shows_sphere(const Evidence& evidence, double radius_px, double min_contrast) {
  const double contrast = std::abs(evidence.contrast);
  // An arc suits a sphere more easily than a whole outline does, so it must suit it better.
  const double strictness = evidence.sectors == k_sectors ? 1 : k_partial_share;
  return evidence.sectors >= k_least_sectors && contrast >= min_contrast &&
         evidence.weak_sectors * static_cast<int>(k_sectors) <=
             k_most_weak_sectors * static_cast<int>(evidence.sectors) &&
         evidence.bumps_px <= strictness * (k_most_bumps_px + k_most_bumps_share * radius_px) &&
         evidence.residual <= k_noise_levels + strictness * k_most_residual_share * contrast;
}

}  // namespace

std::optional<Ball> BallFitter::fit(const cv::Mat& grey,
                                    const Lens& lens,
                                    const BallOutline& start,
                                    double min_contrast) {
  std::optional<Ball> ball;
  BallOutline outline = start;
  for (int i = 0; i < k_most_fits; ++i) {
    OutlineParts kept = outline.shown;
    const auto better = fit_shown(grey, lens, outline, min_contrast, &kept);
    if (better) ball = better;
    if (kept == outline.shown || kept.count() < k_least_kept || gaps_in(kept) > k_most_gaps) break;
    outline.shown = kept;
  }
  return ball;
}

std::optional<Ball> BallFitter::fit_shown(const cv::Mat& grey,
                                          const Lens& lens,
                                          const BallOutline& start,
                                          double min_contrast,
                                          OutlineParts* undisturbed_parts) {
  State state{.centre_px = start.centre_px, .radius_px = start.radius_px, .blur_px = k_first_blur_px};
  if (!start.centre_px.allFinite() || !(start.radius_px > k_smallest_radius_px) || !state.settle(lens))
    return std::nullopt;
  state.px_per_radian = std::sqrt(std::abs(state.px_by_angles.determinant()));
  Normal information;
  double scale = 1;
  const HuberLoss loss{k_huber};
  for (int round = 0; round < k_rounds; ++round) {
    if (!collect(grey, lens, state, start.shown)) return std::nullopt;
    Problem problem{.lens = lens, .pixels = pixels_, .loss = {0}, .state = state};
    if (!problem.fit_light()) return std::nullopt;
    if (round > 0) {
      problem.scale = problem.robust_deviation();
      problem.loss = loss;
    } else {
      problem.settled_px = k_roughly_settled_px;
    }
    const LeastSquaresSummary found = minimise(&problem, {.max_steps = k_max_steps, .first_damping = 1e-3});
    if (found.end == LeastSquaresEnd::no_start || !problem.linearise()) return std::nullopt;
    const double blur_before = state.blur_px;
    state = problem.state;
    scale = problem.scale;
    information = problem.normal;
    if ((state.centre_px - start.centre_px).norm() > 1 + k_most_shift_share * start.radius_px)
      return std::nullopt;
    if (round > 0 && std::abs(state.blur_px - blur_before) < k_same_blur_share * state.blur_px) break;
  }
  *undisturbed_parts = undisturbed(pixels_, state, start.shown);
  const Evidence evidence = evidence_of(pixels_, state, start.shown, loss, scale);
  if (!shows_sphere(evidence, state.radius_px, min_contrast)) return std::nullopt;
  const double doubt = evidence.sectors == k_sectors ? 1 : k_partial_variance;
  const Normal covariance = doubt * evidence.agreement * information.ldlt().solve(Normal::Identity());
  const Eigen::Matrix2d centre = covariance.topLeftCorner<2, 2>();
  if (!centre.allFinite() || !(centre.trace() < 2 * k_most_stddev_px * k_most_stddev_px) ||
      !(centre.determinant() > 0) || !(covariance(2, 2) > 0))
    return std::nullopt;
  return Ball{.d_centre = state.d_centre,
              .half_angle = state.half_angle(),
              .centre_px = state.centre_px,
              .centre_covariance = centre,
              .radius_px = state.radius_px,
              .half_angle_stddev =
                  std::hypot(std::sqrt(covariance(2, 2)), k_systematic_radius_px) / state.px_per_radian,
              .contrast = evidence.contrast,
              .blur_px = state.blur_px};
}

}  // namespace limn::tracker
