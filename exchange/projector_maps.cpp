#include "exchange/projector_maps.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace limn::exchange {

ProjectorMaps projector_maps(projector::Renderer* renderer,
                             std::size_t index,
                             const scene::PosedScene& posed) {
  ProjectorMaps maps{renderer->surface_points(index, posed), renderer->blend(index, posed)};
  for (int row = 0; row < maps.points.rows; ++row) {
    for (int column = 0; column < maps.points.cols; ++column) {
      const auto& [share, lift] = maps.blend.at<cv::Vec2f>(row, column).val;
      maps.lit += std::isfinite(maps.points.at<cv::Vec3f>(row, column)[0]);
      maps.shared += share > 0 && share < 1;
      maps.most_lift = std::max<double>(maps.most_lift, lift);
    }
  }
  return maps;
}

}  // namespace limn::exchange
