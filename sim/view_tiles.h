#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <opencv2/core/types.hpp>
#include <span>
#include <vector>

#include "sim/directions.h"

namespace limn::sim {

/// A ball in the world frame, m. A negative radius: it is empty.
struct Ball {
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();
  float radius = -1;
};

/// Square tiles of a camera's image, each with what its pixels see. Says which tiles the change of an object
/// can affect: those through which the camera may see it, and those whose surfaces may lie in its shadow.
class ViewTiles {
 public:
  static constexpr int k_side = 8;  ///< px; tiles at the right and lower border may be smaller

  ViewTiles() = default;
  ViewTiles(cv::Size image, const Eigen::Vector3d& p_camera, const Directions& directions);

  std::size_t size() const { return tiles_.size(); }
  cv::Rect pixels(std::size_t tile) const;
  /// Sets what the pixels of a tile see, from the hit points of all pixels (row by row; NaN: nothing is hit).
  /// The pixels around the tile count, too, because a pixel's samples may hit what its neighbours see.
  template <class PointOf>
  void set_surfaces(std::size_t tile, const PointOf& p_world_of) {
    const cv::Rect r = pixels(tile);
    const cv::Rect around = cv::Rect(r.x - 1, r.y - 1, r.width + 2, r.height + 2) & cv::Rect({0, 0}, image_);
    std::vector<Eigen::Vector3f> points;
    for (int row = around.y; row < around.y + around.height; ++row)
      for (int column = around.x; column < around.x + around.width; ++column) {
        const Eigen::Vector3f p = p_world_of(row * image_.width + column);
        if (p.allFinite()) points.push_back(p);
      }
    set_surfaces(&tiles_[tile], points);
  }
  /// For each tile, whether an object within one of the balls can affect it. `lights`: balls that contain
  /// each light's source.
  std::vector<std::uint8_t> affected(std::span<const Ball> objects, std::span<const Ball> lights) const;
  /// For each tile, whether it or one of its neighbours is marked.
  std::vector<std::uint8_t> with_neighbours(std::span<const std::uint8_t> marked) const;

 private:
  struct Tile {
    Eigen::Vector3f d = Eigen::Vector3f::UnitZ();  // axis of the cone of its pixels' rays
    float half_angle = 4;                          // half the angle of that cone, rad; 4: any direction
    std::array<Ball, 2> surfaces;  // the nearer and the farther half of the depths that its pixels see
  };
  void set_surfaces(Tile* tile, std::span<const Eigen::Vector3f> p_world) const;
  bool is_seen_through(const Tile& tile, const Ball& object) const;

  cv::Size image_;
  int columns_ = 0, rows_ = 0;
  Eigen::Vector3f p_camera_ = Eigen::Vector3f::Zero();
  std::vector<Tile> tiles_;
};

}  // namespace limn::sim
