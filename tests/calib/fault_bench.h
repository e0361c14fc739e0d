#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/capture_set.h"
#include "core/result.h"
#include "sim/world.h"

namespace limn::test {

/// Something moves while a pose is captured.
struct Nudge {
  int pose = 0;
  int shot = 0;  ///< index of the first image after the move, in the series of every projector
  bool camera = false;
  Pose world_moved;  ///< world_from_world: motion of the board, or of the camera
};

/// A calibration captured in a world of config/ whose devices have 3/8 of their pixels, with a coarser board
/// of the same size, held as that world's plan says. Everything is correct until a member is set; calib only
/// gets capture.json and images.
struct FaultBench {
  sim::World world;
  calib::Board board;  ///< as described in capture.json
  std::vector<Pose> world_from_board;
  std::uint64_t seed = 1;  ///< seed of the noise
  calib::PatternCode code = calib::PatternCode::gray;
  calib::CodeOptions code_options = {};

  /// The display's mode, if it is not the projector's own size.
  std::optional<cv::Size> mode;
  /// What the projector's panel shows of an image (of the mode's size).
  std::function<cv::Mat(const cv::Mat& image)> on_panel;
  /// The projector that shows an image meant for `projector`; -1: none in the room.
  std::function<int(int projector)> display_of;
  /// Changes light or sensor before an image is taken; geometry stays.
  std::function<void(int pose, int shot, sim::World* world)> before_shot;
  /// Changes the camera's image before it is stored.
  std::function<cv::Mat(const cv::Mat& photo)> on_photo;
  /// The true position of a point (x, y) of the sheet, metres from its centre.
  std::function<Eigen::Vector3d(const Eigen::Vector2d& p)> sheet;
  std::optional<Nudge> nudge;

  /// `name`: "bench" or "studio".
  static FaultBench create(const std::string& name, int poses);
  Result<calib::CaptureSet> capture(const std::filesystem::path& folder) const;
};

}  // namespace limn::test
