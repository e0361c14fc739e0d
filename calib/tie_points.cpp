#include "calib/tie_points.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_least_share = 0.6;  // share of a window's pixels with a label
constexpr double k_stddev_floor_px = 0.02;
constexpr double k_still_px = 0.5;  // a mark's corners stay within this where nothing moved
constexpr int k_bin_px = 4;  // bin size in a projector's image, for finding which cameras see its pixel

// The projector pixel at the centre of a window of a camera's image, and its derivative.
struct Patch {
  Vector2d label;
  Eigen::Matrix2d slope;  // d label / d camera pixel
  double stddev_px = 0;
};

std::optional<Patch> patch_at(const cv::Mat& labels, int x, int y, const TiePointOptions& options) {
  const int half = options.half_window;
  if (x < half || y < half || x + half >= labels.cols || y + half >= labels.rows) return std::nullopt;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> product = Eigen::Matrix<double, 3, 2>::Zero();
  double squares = 0;
  int count = 0;
  for (int dy = -half; dy <= half; ++dy) {
    for (int dx = -half; dx <= half; ++dx) {
      const auto& label = labels.at<cv::Vec2f>(y + dy, x + dx);
      if (std::isnan(label[0])) continue;
      const Eigen::Vector3d at(1, dx, dy);
      const Vector2d value(label[0], label[1]);
      normal += at * at.transpose();
      product += at * value.transpose();
      squares += value.squaredNorm();
      ++count;
    }
  }
  const int side = 2 * half + 1;
  if (count < k_least_share * side * side) return std::nullopt;
  const Eigen::Matrix3d inverse = normal.inverse();
  const Eigen::Matrix<double, 3, 2> plane = inverse * product;
  const double left = std::max(0.0, squares - plane.cwiseProduct(product).sum());
  const double residual = std::sqrt(left / (2 * (count - 3)));
  if (!(residual < options.max_residual_px)) return std::nullopt;
  Patch patch;
  patch.label = plane.row(0).transpose();
  patch.slope = plane.bottomRows<2>().transpose();
  patch.stddev_px = std::hypot(residual * std::sqrt(inverse(0, 0)), k_stddev_floor_px);
  return patch;
}

// For each bin of a projector's image, a camera pixel that it illuminates; -1: none.
class Reverse {
 public:
  Reverse(const cv::Mat& labels, const CapturedDevice& projector)
      : across_(projector.width / k_bin_px + 1),
        bins_(static_cast<size_t>(across_ * (projector.height / k_bin_px + 1)), -1) {
    for (int y = 0; y < labels.rows; ++y) {
      for (int x = 0; x < labels.cols; ++x) {
        const auto& label = labels.at<cv::Vec2f>(y, x);
        if (const auto bin = bin_of(Vector2d(label[0], label[1]))) bins_[*bin] = y * labels.cols + x;
      }
    }
  }
  int pixel_of(const Vector2d& label) const {
    const auto bin = bin_of(label);
    return bin ? bins_[*bin] : -1;
  }

 private:
  std::optional<size_t> bin_of(const Vector2d& label) const {
    if (!(label.x() >= 0 && label.y() >= 0 && label.x() < across_ * k_bin_px)) return std::nullopt;
    const size_t bin = static_cast<size_t>(static_cast<int>(label.y()) / k_bin_px * across_ +
                                           static_cast<int>(label.x()) / k_bin_px);
    return bin < bins_.size() ? std::optional(bin) : std::nullopt;
  }
  int across_;
  std::vector<int> bins_;
};

// The pixel of another camera that a projector's pixel illuminates: from a pixel near it along the plane
// there.
std::optional<TiePointObservation> tie_observation_by(const cv::Mat& labels,
                                                      const Reverse& reverse,
                                                      const Vector2d& label,
                                                      double label_stddev,
                                                      const TiePointOptions& options) {
  const int start = reverse.pixel_of(label);
  if (start < 0) return std::nullopt;
  Vector2d px(start % labels.cols, start / labels.cols);
  for (int step = 0; step < 4; ++step) {
    const Vector2d middle = px.array().round();
    const auto patch = patch_at(labels, static_cast<int>(middle.x()), static_cast<int>(middle.y()), options);
    if (!patch || !(std::abs(patch->slope.determinant()) > 1e-3)) return std::nullopt;
    const Eigen::Matrix2d inverse = patch->slope.inverse();
    px = middle + inverse * (label - patch->label);
    if (!px.allFinite() || !((px - middle).norm() < 4 * k_bin_px)) return std::nullopt;
    if ((px - middle).cwiseAbs().maxCoeff() <= 1) {
      TiePointObservation tie_observation;
      tie_observation.by_projector = false;
      tie_observation.px = px;
      tie_observation.stddev_px =
          std::hypot(patch->stddev_px, label_stddev) * inverse.norm() / std::sqrt(2.0);
      return tie_observation;
    }
  }
  return std::nullopt;
}

// The pixel of a field that most projectors reach, nearest to the field's centre.
struct Choice {
  int x = 0, y = 0, seen = 0;
  std::vector<std::optional<Patch>> patches;
};

// `hull`: a region to leave out, camera pixels; may be empty.
Choice best_in(const std::vector<Decoded>& decoded,
               const std::vector<cv::Point2f>& hull,
               const cv::Rect& field,
               const TiePointOptions& options) {
  Choice best;
  constexpr int k_tries = 3;  // along each axis
  for (int i = 0; i < k_tries * k_tries; ++i) {
    const int order[] = {4, 1, 3, 5, 7, 0, 2, 6, 8};  // the centre first
    Choice tried;
    tried.x = field.x + field.width * (2 * (order[i] % k_tries) + 1) / (2 * k_tries);
    tried.y = field.y + field.height * (2 * (order[i] / k_tries) + 1) / (2 * k_tries);
    const cv::Point2f px(static_cast<float>(tried.x), static_cast<float>(tried.y));
    if (!hull.empty() && cv::pointPolygonTest(hull, px, true) > -2 * options.half_window) continue;
    for (const Decoded& by : decoded) {
      tried.patches.push_back(patch_at(by.px_projector, tried.x, tried.y, options));
      tried.seen += tried.patches.back() ? 1 : 0;
    }
    if (tried.seen > best.seen) best = std::move(tried);
    if (best.seen == static_cast<int>(decoded.size())) break;
  }
  return best;
}

cv::Rect field_of(const CapturedDevice& camera, int field, const TiePointOptions& options) {
  const int column = field % options.columns, row = field / options.columns;
  return {camera.width * column / options.columns, camera.height * row / options.rows,
          camera.width / options.columns, camera.height / options.rows};
}

// Adds a tie point with its observations by the projectors; returns its index.
int add_point(const Choice& choice, int camera, int pose, Observations* into) {
  const int point = static_cast<int>(into->points.size());
  into->points.push_back({pose, camera, Vector2d(choice.x, choice.y)});
  for (size_t p = 0; p < choice.patches.size(); ++p) {
    if (!choice.patches[p]) continue;
    const Patch& patch = *choice.patches[p];
    into->tie_observations.push_back({point, true, static_cast<int>(p), patch.label, patch.stddev_px});
  }
  return point;
}

// A mark as one camera sees it: the mean over poses.
struct SeenMark {
  std::array<Vector2d, 4> corners_px;
  double stddev_px = 0;
  int poses = 0;
};

// A mark at one place.
struct StandingMark {
  int pose = 0;  // the first that shows it
  std::map<int, SeenMark> cameras;
};

double farthest_corner(const std::array<Vector2d, 4>& a, const std::array<Vector2d, 4>& b) {
  double far = 0;
  for (size_t i = 0; i < a.size(); ++i) far = std::max(far, (a[i] - b[i]).norm());
  return far;
}

bool disagrees(const StandingMark& standing, const DetectedMark& mark) {
  const auto seen = standing.cameras.find(mark.camera);
  return seen != standing.cameras.end() &&
         farthest_corner(seen->second.corners_px, mark.corners_px) > k_still_px;
}

void add_sight(const DetectedMark& mark, StandingMark* standing) {
  if (standing->cameras.empty()) standing->pose = mark.pose;
  SeenMark& seen = standing->cameras[mark.camera];
  ++seen.poses;
  seen.stddev_px = std::max(seen.stddev_px, std::max(mark.stddev_px, k_stddev_floor_px));
  for (size_t i = 0; i < mark.corners_px.size(); ++i) {
    if (seen.poses == 1) seen.corners_px[i].setZero();
    seen.corners_px[i] += (mark.corners_px[i] - seen.corners_px[i]) / seen.poses;
  }
}

// The places of one mark: one where it stands still, else one in each pose.
std::vector<StandingMark> places_of(const std::vector<const DetectedMark*>& marks) {
  StandingMark still;
  std::map<int, StandingMark> by_pose;
  bool stands = true;
  for (const DetectedMark* mark : marks) {
    stands = stands && !disagrees(still, *mark);
    add_sight(*mark, &still);
    add_sight(*mark, &by_pose[mark->pose]);
  }
  if (stands) return {still};
  std::vector<StandingMark> places;
  for (auto& [pose, standing] : by_pose) places.push_back(std::move(standing));
  return places;
}

// The corners of a mark at one place, as pixels of the camera that sees it best.
void add_corners(const StandingMark& standing, Observations* into) {
  const auto first =
      std::min_element(standing.cameras.begin(), standing.cameras.end(),
                       [](const auto& a, const auto& b) { return a.second.stddev_px < b.second.stddev_px; });
  for (size_t corner = 0; corner < first->second.corners_px.size(); ++corner) {
    const int point = static_cast<int>(into->points.size());
    into->points.push_back({standing.pose, first->first, first->second.corners_px[corner]});
    for (const auto& [camera, seen] : standing.cameras) {
      if (camera == first->first) continue;
      into->tie_observations.push_back({point, false, camera, seen.corners_px[corner],
                                        std::hypot(seen.stddev_px, first->second.stddev_px)});
    }
  }
}

}  // namespace

std::vector<std::string> add_marker_points(const std::vector<DetectedMark>& marks, Observations* into) {
  std::map<std::string, std::vector<const DetectedMark*>> by_name;
  for (const DetectedMark& mark : marks) by_name[mark.name].push_back(&mark);
  std::vector<std::string> names;
  for (const auto& [name, sights] : by_name) {
    bool is_used = false;
    for (const StandingMark& standing : places_of(sights)) {
      if (standing.cameras.size() < 2) continue;
      add_corners(standing, into);
      is_used = true;
    }
    if (is_used) names.push_back(name);
  }
  return names;
}

void add_tie_points(const std::vector<std::vector<Decoded>>& decoded,
                    int pose,
                    const TiePointOptions& options,
                    Observations* into) {
  std::vector<std::vector<Reverse>> reverse;  // only needed where cameras share the view
  for (size_t camera = 0; decoded.size() > 1 && camera < decoded.size(); ++camera) {
    reverse.emplace_back();
    for (size_t p = 0; p < decoded[camera].size(); ++p)
      reverse.back().emplace_back(decoded[camera][p].px_projector, into->projectors[p]);
  }
  for (size_t camera = 0; camera < decoded.size(); ++camera) {
    for (int field = 0; field < options.columns * options.rows; ++field) {
      const Choice choice =
          best_in(decoded[camera], {}, field_of(into->cameras[camera], field, options), options);
      if (choice.seen == 0) continue;
      const int point = add_point(choice, static_cast<int>(camera), pose, into);
      for (size_t other = 0; other < decoded.size(); ++other) {
        if (other == camera) continue;
        for (size_t p = 0; p < choice.patches.size(); ++p) {
          if (!choice.patches[p]) continue;
          auto seen = tie_observation_by(decoded[other][p].px_projector, reverse[other][p],
                                         choice.patches[p]->label, choice.patches[p]->stddev_px, options);
          if (!seen) continue;
          seen->point = point;
          seen->imager = static_cast<int>(other);
          into->tie_observations.push_back(*seen);
          break;  // one projector is enough to find it
        }
      }
    }
  }
}

void add_room_points(const std::vector<Decoded>& decoded,
                     const std::vector<BoardCorner>& board,
                     int camera,
                     int pose,
                     const TiePointOptions& options,
                     Observations* into) {
  std::vector<cv::Point2f> corners, hull;
  for (const BoardCorner& corner : board)
    corners.emplace_back(static_cast<float>(corner.px.x()), static_cast<float>(corner.px.y()));
  cv::convexHull(corners, hull);
  const CapturedDevice& device = into->cameras[static_cast<size_t>(camera)];
  for (int field = 0; field < options.columns * options.rows; ++field) {
    const Choice choice = best_in(decoded, hull, field_of(device, field, options), options);
    if (choice.seen > 0) add_point(choice, camera, pose, into);
  }
}

}  // namespace limn::calib
