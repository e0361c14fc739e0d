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

/// A known point of a rigid body (body frame, m) and the pixel where it was seen.
struct BodyPoint {
  Eigen::Vector3d p_body = Eigen::Vector3d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< covariance of px, px^2
};

/// What one image shows of one rigid body.
struct BodyView {
  Pose camera_from_body;  ///< initial estimate
  std::vector<BodyPoint> points;
};

/// An estimate of a lens: focal length, principal point (px), radial distortion k1 and k2 (as in
/// LENSMODEL_OPENCV4), in this order, with their covariance. The focal length is the same along x and y,
/// and there is no tangential distortion.
struct IntrinsicsEstimate {
  int width = 0, height = 0;
  Vector5d values = Vector5d::Zero();
  Matrix5d covariance = Matrix5d::Zero();
  int views = 0;  ///< number of views used for the estimate, over all sessions

  /// The estimate as LENSMODEL_OPENCV4.
  Lens lens() const;
  double focal_stddev_px() const;
  /// Whether the values and the covariance are physically possible.
  bool is_sound() const;
  /// The same lens at another resolution with the same aspect ratio (within 1 %); nullopt for other ratios.
  std::optional<IntrinsicsEstimate> resized(int w, int h) const;
};

/// Prior knowledge about the lens of an unknown tablet or phone.
struct IntrinsicsPrior {
  double fov_deg = 65;        ///< horizontal
  double focal_share = 0.25;  ///< standard deviation of the focal length as a share of it: 50 to 85 degrees
  /// Standard deviation of the principal point from the centre, as a share of the longer side.
  double centre_share = 0.02;
  /// Standard deviations of k1 and k2 from 0: such cameras remove most distortion themselves.
  double k1 = 0.1, k2 = 0.1;
};
IntrinsicsEstimate prior_intrinsics(int width, int height, const IntrinsicsPrior& expected = {});

struct OnlineIntrinsicsOptions {
  std::size_t most_views = 40;  ///< maximum number of views kept; the time of a solve grows with it
  /// Views that are nearer to each other than this count as one, because detection errors are the same in
  /// both. Radians, and the camera's movement as a share of its distance.
  double same_angle = 0.05, same_way = 0.05;
  double robust_at = 3;  ///< points beyond this many standard deviations are down-weighted (Cauchy)
  /// After this many contradicting views in a row, the lens is taken to be another one.
  int most_misfits = 10;
};

/// Estimates the intrinsics of a moving camera (a tablet) during use, from images of rigid bodies with known
/// points: bundle adjustment over the lens and the camera's poses (Triggs et al., "Bundle adjustment - a
/// modern synthesis", 2000; with flat bodies the problem of Zhang, "A flexible new technique for camera
/// calibration", 2000). It keeps the set of views that is most informative about the lens: the information
/// matrices of the views, with each view's own pose eliminated, are summed, and a new view replaces another
/// one when the determinant of the sum grows (D-optimality: Fedorov, Theory of Optimal Experiments, 1972).
/// Views that do not determine the focal length, such as flat bodies seen from straight ahead, leave its
/// standard deviation large. Points that contradict the rest (a marker that was moved on its body) are
/// down-weighted. The same views give the same bits.
class OnlineIntrinsics {
 public:
  /// `before`: the estimate to start from, prior_intrinsics() or that of an earlier session.
  explicit OnlineIntrinsics(const IntrinsicsEstimate& before, const OnlineIntrinsicsOptions& options = {});

  /// Adds a view; true when it is kept, so that improve() has new data. Views that add no information or do
  /// not fit are not kept. After most_misfits views in a row that do not fit, the estimate is reset: the
  /// camera has changed its lens.
  bool add(const BodyView& view);
  /// Solves again with the views kept. Takes some milliseconds.
  void improve();

  const IntrinsicsEstimate& estimate() const { return estimate_; }
  std::size_t views() const { return views_.size(); }
  /// Scatter of one coordinate in the views kept, as a multiple of the points' stated standard deviations.
  double noise() const { return noise_; }

 private:
  struct View {
    Pose camera_from_body;
    std::vector<BodyPoint> points;
    Matrix5d information = Matrix5d::Zero();  // information matrix of the lens values
  };
  struct Blocks;
  struct Solved {
    Vector5d values;
    std::vector<Pose> poses;
    double noise = 1, cost = 0;
  };
  struct PlaceProblem;  // what minimise() works on: one view's place,
  struct LensProblem;   // or the lens with all places
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
