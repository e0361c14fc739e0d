#include "core/scale_resolution.h"

#include <cmath>

namespace limn {

Status scale_resolution(double share, Rig* rig) {
  if (!(share > 0 && share <= 1))
    return error("expected a share of the resolution, above 0 and at most 1, found {}.", share);
  for (std::vector<Imager>* imagers : {&rig->cameras, &rig->projectors}) {
    for (Imager& imager : *imagers) {
      const auto coarse = resized(imager, static_cast<int>(std::lround(share * imager.width)),
                                  static_cast<int>(std::lround(share * imager.height)));
      if (!coarse)
        return error("expected a share that keeps the aspect ratio of {} ({}x{}), found {}.", imager.name,
                     imager.width, imager.height, share);
      imager = *coarse;
    }
  }
  return {};
}

}  // namespace limn
