#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::calib {

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

/// A known point of a rigid body (the body's frame, m), seen at a pixel.
struct BodyPoint {
  Eigen::Vector3d p_body = Eigen::Vector3d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of px, px^2
};

/// What one image shows of one rigid body.
struct BodyView {
  Pose camera_from_body;  ///< about: where to start from
  std::vector<BodyPoint> points;
};

/// A lens as far as it is known: focal length, principal point (px), radial distortion k1 and k2 (as
/// LENSMODEL_OPENCV4's), in this order, with their covariance. The focal length is the same along x and y,
/// and there is no tangential distortion.
struct IntrinsicsEstimate {
  int width = 0, height = 0;
  Vector5d values = Vector5d::Zero();
  Matrix5d covariance = Matrix5d::Zero();
  int views = 0;  ///< that it was found in, of all uses

  /// LENSMODEL_OPENCV4.
  Lens lens() const;
  double focal_stddev_px() const;
  /// Whether numbers and covariance are those of a lens that can be.
  bool is_sound() const;
  /// The same lens read out at another resolution of the same aspect ratio (within 1 %); nullopt for others.
  std::optional<IntrinsicsEstimate> resized(int w, int h) const;
};

/// What may be believed of the lens of an unknown tablet or phone.
struct IntrinsicsPrior {
  double fov_deg = 65;         ///< horizontal
  double focal_share = 0.25;   ///< one standard deviation of the focal length: 50 to 85 degrees
  double centre_share = 0.02;  ///< of the principal point from the centre, as a share of the longer side
  double k1 = 0.1, k2 = 0.1;   ///< of these from 0: such cameras take most of their distortion out
};
IntrinsicsEstimate prior_intrinsics(int width, int height, const IntrinsicsPrior& expected = {});

struct OnlineIntrinsicsOptions {
  std::size_t most_views = 40;  ///< held; a solve's time grows with them
  /// Views nearer to each other than this count once: what a detector gets wrong in one it gets wrong in the
  /// other. Radians, and the camera's way as a share of its distance.
  double same_angle = 0.05, same_way = 0.05;
  double robust_at = 3;   ///< standard deviations from which on a point is down-weighted (Cauchy)
  int most_misfits = 10;  ///< views in a row that contradict the lens: it is another one
};

/// The lens of a camera that is carried about, from images of rigid bodies with known points, found while
/// it is in use: bundle adjustment over the lens and the camera's places (Triggs et al., "Bundle adjustment -
/// a modern synthesis", 2000; with flat bodies the problem of Zhang, "A flexible new technique for camera
/// calibration", 2000). Of the images those are held that tell most of the lens together: the information
/// that each leaves once its own place is eliminated is added up, and a new one takes the place of another
/// when the determinant of the sum grows (D-optimality: Fedorov, Theory of Optimal Experiments, 1972). Views
/// that cannot tell the focal length, flat ones from straight ahead, leave its deviation large. Points that
/// contradict the rest (a marker that was moved on its body) are down-weighted. The same views give the same
/// bits.
class OnlineIntrinsics {
 public:
  /// `before` is what was known: prior_intrinsics(), or the estimate of an earlier use.
  explicit OnlineIntrinsics(const IntrinsicsEstimate& before, const OnlineIntrinsicsOptions& options = {});

  /// Whether the view is held: improve() then has something to do. Not held are those that tell nothing new
  /// or do not fit. After most_misfits of the latter in a row all is forgotten: the camera has changed its
  /// lens.
  bool add(const BodyView& view);
  /// Solves anew with the views held. Some milliseconds.
  void improve();

  const IntrinsicsEstimate& estimate() const { return estimate_; }
  std::size_t views() const { return views_.size(); }
  /// What one coordinate is off by in the views held, as a multiple of what the points' covariances say.
  double noise() const { return noise_; }

 private:
  struct View {
    Pose camera_from_body;
    std::vector<BodyPoint> points;
    Matrix5d information = Matrix5d::Zero();  // on the lens
  };
  struct Blocks;
  struct Solved {
    Vector5d values;
    std::vector<Pose> poses;
    double noise = 1, cost = 0;
  };
  Blocks blocks(const Vector5d& values, const View& view, const Pose& pose, double noise) const;
  double noise_of(const Vector5d& values, std::span<const View> views, std::span<const Pose> poses) const;
  std::optional<Pose> find_pose(const Vector5d& values, const View& view, double* noise) const;
  std::optional<Solved> solve_views(Solved start) const;
  std::optional<Solved> solve_from_other_focal_lengths() const;
  void adopt(const Solved& solve_views);
  bool contradicts_before() const;
  void forget();

  IntrinsicsEstimate before_, estimate_;
  OnlineIntrinsicsOptions options_;
  std::vector<View> views_;
  double noise_ = 1;
  int misfits_ = 0;
};

}  // namespace limn::calib
