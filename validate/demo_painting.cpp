#include "validate/demo_painting.h"

#include <algorithm>
#include <cmath>

namespace limn::validate {
namespace {

double eased(double share) {
  const double x = std::clamp(share, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

// 1 within `half` of the middle, falling to 0 over the width `edge`.
double between(double x, double middle, double half, double edge) {
  return eased((half - std::abs(x - middle)) / edge + 0.5);
}

// The light of a photographer's studio: dark, with a long soft box overhead, a window and a low strip of
// light. Degrees above the horizon, and to the right of the door's axis as seen from the door.
Eigen::Vector3d studio_light(double up_deg, double right_deg) {
  const Eigen::Vector3d floor(0.012, 0.012, 0.011), wall(0.1, 0.11, 0.125), ceiling(0.06, 0.065, 0.075);
  const Eigen::Vector3d soft_box(4.5, 4.5, 4.4), window(1.6, 1.9, 2.3), strip(0.5, 0.46, 0.4);
  const Eigen::Vector3d& far = up_deg < 0 ? floor : ceiling;
  const double far_share = up_deg < 0 ? eased(-up_deg / 12) : eased(up_deg / 50);
  return wall + far_share * (far - wall) +
         between(up_deg, 38, 9, 4) * between(right_deg, 0, 75, 20) * soft_box +
         between(up_deg, 12, 14, 3) * between(right_deg, 62, 16, 3) * window +
         between(up_deg, -22, 4, 3) * between(right_deg, 10, 60, 12) * strip;
}

}  // namespace

scene::RoomImage studio(const Pose& world_from_door) {
  scene::RoomImage image;
  image.light.create(256, 512, CV_32FC3);
  for (int row = 0; row < image.light.rows; ++row)
    for (int column = 0; column < image.light.cols; ++column) {
      const Eigen::Vector3d rgb = studio_light(90 - 180 * (row + 0.5) / image.light.rows,
                                               360 * (column + 0.5) / image.light.cols - 180);
      image.light.at<cv::Vec3f>(row, column) = cv::Vec3d(rgb.z(), rgb.y(), rgb.x());
    }
  // Seen from the door, its own right is on the left.
  const Eigen::Matrix3d image_from_door = Eigen::Vector3d(-1, 1, 1).asDiagonal();
  image.image_from_world = image_from_door * world_from_door.rotation.inverse().toRotationMatrix();
  return image;
}

std::vector<DemoImage> painted_images(const DemoSubject& subject, const DimRoom& room) {
  scene::PosedScene posed = subject.posed;
  posed.finish = subject.scene->finishes.at(0).name;
  posed.light.emplace();
  posed.light->image_strength = 1;
  return {
      {"dim", "A dim room", "The clay door without projected light, from the designer's viewpoint.",
       room.photograph({})},
      {"painted", "Painted in light",
       "The same door in blue lacquer, with the mirror and the trim line on it. For the designer's viewpoint "
       "the lacquer mirrors a photographer's studio.",
       room.photograph(painter_images(subject, posed))}};
}

}  // namespace limn::validate
