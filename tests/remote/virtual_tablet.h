#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <random>
#include <vector>

#include "core/imager.h"
#include "sim/virtual_rig.h"

namespace limn::test {

/// What a tablet took, and with which camera from where in truth.
struct TabletShot {
  std::vector<std::uint8_t> jpeg;
  cv::Mat image;  ///< before it was compressed
  Imager camera;
};

/// A tablet of 65 degrees or so in a virtual world, with a lens that only it knows: another principal point,
/// some distortion; sRGB, noise, blur. Somebody looks round the prototype with it.
class VirtualTablet {
 public:
  /// `world` as its projectors light it with `shown`.
  VirtualTablet(sim::World world, std::vector<cv::Mat> shown, int width, int height, std::uint64_t seed);

  /// Where it is looked from at a moment (s): 0.55 to 0.85 m away, up to 45 degrees to the side.
  TabletShot shoot(double at_s);
  /// From anywhere.
  TabletShot shoot_from(const Pose& camera_from_world);

  sim::World& world() { return world_; }
  const Lens& lens() const { return world_.rig.cameras[0].lens; }

 private:
  sim::World world_;
  std::vector<cv::Mat> shown_;
  std::uint64_t shots_ = 0, seed_;
  double phases_[6];
};

}  // namespace limn::test
