#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "calib/board/board.h"
#include "core/imager.h"

namespace limn::test {

/// A photograph of a flat board by a camera with any lens: `samples` x `samples` rays for each pixel, normal
/// noise.
inline cv::Mat photographed_board(const calib::Board& board,
                                  const Imager& camera,
                                  const Pose& camera_from_board,
                                  double noise,
                                  std::mt19937_64* rng,
                                  int samples = 4) {
  const calib::BoardSheet sheet = calib::draw_board(board, {.square_px = 64});
  const Pose board_from_camera = camera_from_board.inverse();
  std::normal_distribution<double> scatter(0, 1);
  cv::Mat photo(camera.height, camera.width, CV_8U);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (int i = 0; i < samples * samples; ++i) {
        const int column = i % samples, row = i / samples;
        const Eigen::Vector2d px(x + (column + 0.5) / samples - 0.5, y + (row + 0.5) / samples - 0.5);
        const auto ray = camera.lens.unproject(px);
        if (!ray) continue;
        const Eigen::Vector3d d = board_from_camera.rotation * *ray;
        const Eigen::Vector3d p =
            board_from_camera.translation - board_from_camera.translation.z() / d.z() * d;
        const Eigen::Vector2d at = sheet.px_board_origin + sheet.pixels_per_metre * p.head<2>();
        const int u = static_cast<int>(std::lround(at.x())), v = static_cast<int>(std::lround(at.y()));
        const bool inside = u >= 0 && v >= 0 && u < sheet.image.cols && v < sheet.image.rows;
        sum += inside ? 20 + 180 * sheet.image.at<uchar>(v, u) / 255.0 : 120;
      }
      photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(sum / (samples * samples) + noise * scatter(*rng));
    }
  }
  return photo;
}

/// The `index`th of several tilted places of a board in front of a camera, `distance` m away, its middle on
/// the axis or beside it.
inline Pose tilted_board(const calib::Board& board, int index, double distance) {
  const double around = 2.4 * index, tilt = index == 0 ? 0.0 : 0.5;
  const Eigen::Vector3d middle(0.12 * distance * std::cos(1.7 * index),
                               0.08 * distance * std::sin(2.3 * index), distance * (1 + 0.05 * (index % 4)));
  return Pose(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.15 * std::sin(3.0 * index)}),
              middle) *
         Pose(Eigen::Quaterniond::Identity(),
              Eigen::Vector3d(-board.width_m() / 2, -board.height_m() / 2, 0));
}

}  // namespace limn::test
