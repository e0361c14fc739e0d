#include "tracker/camera_encoding.h"

#include "core/photometric_response.h"

namespace limn::tracker {

tracker::Encoding encoding_of(const Rig& rig, const Imager& camera) {
  for (const CameraResponse& response : rig.camera_responses) {
    if (response.camera != camera.name) continue;
    const double middle = lookup(response.light, 0.5);  // 0.5 for linear, 0.21 for sRGB
    return middle < 0.5 * (0.5 + linear_from_srgb(0.5)) ? tracker::Encoding::srgb : tracker::Encoding::linear;
  }
  return tracker::Encoding::linear;
}

}  // namespace limn::tracker
