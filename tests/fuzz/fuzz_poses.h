#pragma once

#include <vector>

#include "core/foreign_pose.h"
#include "exchange/poses/posi_stage_net.h"
#include "tests/fuzz/fuzz_file.h"

namespace limn::test {

/// Checks what every decoder of poses promises: finite poses with unit quaternions.
inline void check_poses(const ForeignPose& pose) {
  LIMN_CHECK(pose.feed_from_sensor.is_finite());
  LIMN_CHECK(std::abs(pose.feed_from_sensor.rotation.norm() - 1) < 1e-6);
  LIMN_CHECK(!pose.stddev_m || *pose.stddev_m > 0);
  LIMN_CHECK(!pose.time_s || std::isfinite(*pose.time_s));
}
inline void check_poses(const std::vector<ForeignPose>& poses) {
  for (const ForeignPose& pose : poses) check_poses(pose);
}
inline void check_poses(const exchange::PsnPacket& packet) { check_poses(packet.poses); }

/// Checks what a decoder answers: such poses, or a message.
template <class Poses>
void check_decoded(const Result<Poses>& read) {
  if (read)
    check_poses(*read);
  else
    check_message(read.message());
}

}  // namespace limn::test
