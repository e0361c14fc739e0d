#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "calib/board/board_finder.h"
#include "calib/capture_set.h"
#include "calib/code/decode.h"
#include "core/result.h"

namespace limn::calib {

/// A board corner in a camera's image.
struct CornerObservation {
  int camera = 0;
  int pose = 0;
  int corner = 0;  ///< its id on the board
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double stddev_px = 0;  ///< standard deviation of one coordinate
};

/// A small patch of the board (half a square wide): the mean of the camera pixels in it that have a label,
/// and the mean of their labels, so that whole-pixel codes average out.
struct Match {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
  Eigen::Vector2d px_projector = Eigen::Vector2d::Zero();
  /// Standard deviation of one projector coordinate, from the labels' scatter in the patch.
  double stddev_px = 0;
  int pixels = 0;
};

/// A tie point: a point of a scene, or of the room around a board, whose position the board does not give. It
/// is stored as a pixel of one camera; its depth is a parameter of the solve.
struct TiePoint {
  int pose = 0;
  int camera = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
};

/// Where a projector or another camera observes a tie point.
struct TiePointObservation {
  int point = 0;
  bool by_projector = true;
  int imager = 0;  ///< index of the projector or camera
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double stddev_px = 0;  ///< standard deviation of one coordinate
};

/// All measurements as flat arrays; the solve reads nothing else.
struct Observations {
  Board board;
  std::vector<CapturedDevice> cameras;
  std::vector<CapturedDevice> projectors;
  std::vector<std::string> poses;
  std::vector<CornerObservation> corners;
  std::vector<Match> matches;
  std::vector<TiePoint> points;
  std::vector<TiePointObservation> tie_observations;  ///< grouped by point
};

/// Decoding result of one series of images.
struct DecodeShare {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  int lit = 0;
  int decoded = 0;
  int outliers = 0;
  int contrasted = 0;  ///< pixels that white makes brighter, illuminated directly or by reflections (Decoded)
};

/// A camera pixel with its projector pixel, anywhere in the image, on the board or not. The epipolar residual
/// is measured on these pixels. The solve does not use them.
struct DensePixel {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  Eigen::Vector2f px_camera = Eigen::Vector2f::Zero();
  Eigen::Vector2f px_projector = Eigen::Vector2f::Zero();
  bool on_board = false;  ///< between the board's corners
};

struct Observed {
  Observations observations;
  std::vector<DecodeShare> decoded;
  std::vector<CaptureQuality> quality;  ///< parallel to decoded
  double seconds_board = 0;
  double seconds_decode = 0;
  std::vector<DensePixel> dense = {};  ///< on a coarse grid, about 5000 for each image; none on edges
};

/// Detects the corners and matches of all captures. Poses in which no camera sees the board are scene
/// captures: they give tie points (calib/tie_points.h). In a pose whose board is seen by other cameras only,
/// a camera gives nothing. An unreadable image is an error that names it. `should_continue` is called between
/// series of images, from any thread; when it returns false, observe() ends with an error.
Result<Observed> observe(const CaptureSet& captures,
                         const DecodeOptions& options = {},
                         const std::function<bool()>& should_continue = {});

/// Concatenates two results: the poses of `more`, captures of the same board and devices, come after those of
/// `first`. The result equals observe() on all poses at once, except for the order of observations.
Observed joined(Observed first, Observed more);

/// The matches on the board's squares for one camera, projector and pose. Squares are located by their
/// corners (a homography each; those at the board's rim by extrapolation), so that no lens is needed. In each
/// half square a plane is fitted robustly to the labels; the match is the mean of the inliers, less what
/// perspective and lenses bend the labels by.
std::vector<Match> matches_on_board(const Board& board,
                                    const std::vector<BoardCorner>& corners,
                                    const Decoded& decoded);

/// Writes observations.json (limn.observations/1): arrays of numbers in the order of the structs, for plots
/// and replays.
Status save_observations(const Observations& observations, const std::filesystem::path& path);

/// Removes one pose's corners and matches; the other poses keep their indices.
Observations without_pose(const Observations& observations, int pose);

}  // namespace limn::calib
