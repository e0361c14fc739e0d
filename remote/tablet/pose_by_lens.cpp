#include "remote/tablet/pose_by_lens.h"

namespace limn::remote {

Eigen::Matrix<double, 6, 3> pose_by_lens(std::span<const tracker::PointObservation> observations,
                                         const tracker::PoseFit& fit) {
  Eigen::Matrix<double, 6, 3> sum = Eigen::Matrix<double, 6, 3>::Zero();
  for (const tracker::PointObservation& observation : observations) {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 6> d_r;
    if (!tracker::residual(observation, fit.world_from_body, &r, &d_r)) continue;
    const double focal = observation.lens->fx();
    const Eigen::Vector2d centre(observation.lens->values[2], observation.lens->values[3]);
    Eigen::Matrix<double, 2, 3> px_by_lens;
    px_by_lens << observation.px - centre, focal * Eigen::Matrix2d::Identity();
    sum -= d_r.transpose() * observation.information * px_by_lens;
  }
  return fit.covariance * sum;
}

}  // namespace limn::remote
