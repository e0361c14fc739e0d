#include "tracker/balls/ball_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace limn::tracker {
namespace {

constexpr std::size_t k_most_points = 64;  // points of a boundary that the cone is fitted to
// An ellipse's area over that of its box is pi / 4 when its axes are upright, and less when they are oblique.
// Small ones made of whole pixels fill more.
constexpr double k_least_fill = 0.55, k_most_fill = 0.82, k_fill_by_px = 0.9;
constexpr double k_most_elongation = 3;  // the box's; a sphere 70 degrees off the axis of a pinhole
// Boundaries run along pixels, which is an error of .3 px; shade on the sphere moves them, too.
constexpr double k_most_rms_px = 0.5, k_most_rms_share = 0.03;

// A boundary that may show parts of outlines: least share of its box, least area (of a square around the
// smallest sphere) and largest size (in largest spheres).
constexpr double k_least_part_fill = 0.3, k_least_part = 0.4, k_most_part = 3;
// Least area over the squared number of cracks along the boundary: .049 for a circle, .012 for four in a row.
constexpr double k_least_compactness = 0.011;
constexpr double k_beside_px = 5;  // what lies this close beside an outline disturbs its fit

bool is_round(const Contours::Extent& extent, const Contours::Box& box, const BallFinderOptions& options) {
  const double longer = std::max(box.width, box.height), shorter = std::min(box.width, box.height);
  const double fill = extent.area / (box.width * box.height);
  return shorter >= 0.8 * options.min_diameter_px && longer <= options.max_diameter_px * k_most_elongation &&
         longer <= k_most_elongation * shorter && fill > k_least_fill &&
         fill < k_most_fill + k_fill_by_px / shorter;
}

}  // namespace

BallFinder::BallFinder(BallFinderOptions options) : options_(options), fitter_(options.encoding) {}

// The cone through a boundary's rays: the ends of unit vectors on a cone lie in a plane. nullopt when they
// are not on one.
std::optional<BallOutline> BallFinder::outline(const Contours::Extent& extent, const Lens& lens) {
  if (!(extent.area > 0) || !is_round(extent, contours_.box(), options_)) return std::nullopt;
  contours_.find_corners(static_cast<double>(extent.count), 2);  // the points are readable after this
  const std::size_t count = contours_.size(), used = std::min(count, k_most_points);
  d_.clear();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < used; ++i) {
    const auto d = lens.unproject(contours_.point(i * count / used));
    if (!d) return std::nullopt;
    d_.push_back(*d);
    mean += *d / static_cast<double>(used);
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& d : d_) scatter += (d - mean) * (d - mean).transpose();
  Eigen::Vector3d axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0);
  if (axis.dot(mean) < 0) axis = -axis;
  double sum = 0, squares = 0;
  for (const Eigen::Vector3d& d : d_) {
    const double angle = std::atan2(axis.cross(d).norm(), axis.dot(d));
    sum += angle, squares += angle * angle;
  }
  const auto number = static_cast<double>(used);
  const double half_angle = sum / number;
  const auto centre = lens.project(axis);
  if (!centre || !(half_angle < 1.2)) return std::nullopt;
  // The radius of a circle with the same area in the image.
  const double radius_px = std::sqrt(extent.area / std::numbers::pi), px_per_radian = radius_px / half_angle;
  const double rms_px = px_per_radian * std::sqrt(std::max(0.0, squares / number - half_angle * half_angle));
  if (!(rms_px < k_most_rms_px + k_most_rms_share * radius_px)) return std::nullopt;
  return BallOutline{*centre, radius_px};
}

// Outlines that the boundary shows in part. They are nearly circles in a plane in which a step to any side is
// the same angle.
std::vector<BallOutline> BallFinder::partial_outlines(const Contours::Extent& extent, const Lens& lens) {
  const Contours::Box box = contours_.box();
  const auto cracks = static_cast<double>(extent.count);
  if (!(extent.area > k_least_part_fill * box.width * box.height) ||
      !(extent.area > k_least_compactness * cracks * cracks) ||
      !(extent.area > k_least_part * options_.min_diameter_px * options_.min_diameter_px) ||
      !(std::max(box.width, box.height) < k_most_part * options_.max_diameter_px))
    return {};
  contours_.find_corners(cracks, 2);  // the points are readable after this
  const std::size_t count = contours_.size(), used = std::min(count, k_most_points);
  const Eigen::Vector2d middle = 0.5 * (contours_.point(0) + contours_.point(count / 2));
  const auto d_middle = lens.unproject(middle);
  Eigen::Vector2d px;
  PixelByPoint by_d;
  if (!d_middle || !lens.model.project(lens.values, *d_middle, &px, by_d.data())) return {};
  // by_d leaves out the direction of d itself, so this is the sum over any two tangents.
  const Eigen::Matrix2d px2_by_angle2 = by_d * by_d.transpose();
  const double scale = std::sqrt(std::sqrt(px2_by_angle2.determinant()));
  const Eigen::Matrix2d flat_by_px =
      scale * Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(px2_by_angle2).operatorInverseSqrt();
  if (!flat_by_px.allFinite()) return {};
  flat_.clear();
  for (std::size_t i = 0; i < used; ++i)
    flat_.push_back(flat_by_px * (contours_.point(i * count / used) - middle));
  std::vector<BallOutline> outlines;
  for (const CircleArcs& circle :
       circles_along(flat_, 0.5 * options_.min_diameter_px, 0.5 * options_.max_diameter_px, k_beside_px))
    outlines.push_back({middle + flat_by_px.inverse() * circle.centre, circle.radius, circle.parts});
  return outlines;
}

void BallFinder::find_in(const cv::Mat& dark_balls,
                         const cv::Mat& grey,
                         const Lens& lens,
                         std::vector<Ball>* balls) {
  WorkerTeam alone(1);
  threshold_.apply(dark_balls, {.min_contrast = options_.min_contrast, .above_noise = true}, corners_, alone);
  const bool is_dark = dark_balls.data == grey.data;
  contours_.for_each(corners_, [&](const Contours::Extent& extent) {
    if (const auto whole = outline(extent, lens))
      add(*whole, is_dark, grey, lens, balls);
    else
      for (const BallOutline& part : partial_outlines(extent, lens)) add(part, is_dark, grey, lens, balls);
  });
}

void BallFinder::add(
    const BallOutline& start, bool is_dark, const cv::Mat& grey, const Lens& lens, std::vector<Ball>* balls) {
  const auto ball = fitter_.fit(grey, lens, start, options_.min_contrast);
  if (!ball || (ball->contrast < 0) != is_dark) return;
  const double diameter_px = 2 * ball->radius_px;
  if (diameter_px < options_.min_diameter_px || diameter_px > options_.max_diameter_px) return;
  const auto same = std::find_if(balls->begin(), balls->end(), [&](const Ball& other) {
    return (other.centre_px - ball->centre_px).norm() < std::max(other.radius_px, ball->radius_px);
  });
  if (same == balls->end())
    balls->push_back(*ball);
  else if (std::abs(same->contrast) < std::abs(ball->contrast))
    *same = *ball;
}

std::vector<Ball> BallFinder::find(const cv::Mat& grey, const Lens& lens) {
  std::vector<Ball> balls;
  if (grey.empty()) return balls;
  if (options_.shade != BallShade::dark) {
    cv::bitwise_not(grey, inverted_);
    find_in(inverted_, grey, lens, &balls);
  }
  if (options_.shade != BallShade::bright) find_in(grey, grey, lens, &balls);
  std::stable_sort(balls.begin(), balls.end(),
                   [](const Ball& a, const Ball& b) { return std::abs(a.contrast) > std::abs(b.contrast); });
  return balls;
}

}  // namespace limn::tracker
