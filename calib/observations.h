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
  double stddev_px = 0;  ///< of one coordinate
};

/// A small patch of the board (half a square wide): the mean of the camera pixels in it that have a label and
/// the mean of their labels, so that whole-pixel codes average out.
struct Match {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
  Eigen::Vector2d px_projector = Eigen::Vector2d::Zero();
  double stddev_px = 0;  ///< of one projector coordinate, from the labels' scatter in the patch
  int pixels = 0;
};

/// A point of a scene, or of the room around a board, that no board tells the place of: a camera's pixel. Its
/// distance is an unknown.
struct TiePoint {
  int pose = 0;
  int camera = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
};

/// Where a projector or another camera sees a tie point.
struct TiePointObservation {
  int point = 0;
  bool by_projector = true;
  int imager = 0;  ///< which projector or camera
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double stddev_px = 0;  ///< of one coordinate
};

/// Everything measured, as flat arrays; all that the solve sees.
struct Observations {
  Board board;
  std::vector<CapturedDevice> cameras;
  std::vector<CapturedDevice> projectors;
  std::vector<std::string> poses;
  std::vector<CornerObservation> corners;
  std::vector<Match> matches;
  std::vector<TiePoint> points;
  std::vector<TiePointObservation> tie_observations;  ///< those of a point stand together
};

/// What became of one series of images.
struct DecodeShare {
  int camera = 0;
  int projector = 0;
  int pose = 0;
  int lit = 0;
  int decoded = 0;
  int outliers = 0;
  int contrasted = 0;  ///< pixels that white alone makes brighter, lit by reflections or not (Decoded)
};

/// A camera pixel with its projector pixel, anywhere in the image, on the board or off it: what the
/// epipolar residual is measured on. The solve does not see them.
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
  std::vector<DensePixel> dense = {};  ///< on a coarse grid, some 5000 of an image; none on edges
};

/// The corners and matches of all captures. Poses in which no camera sees the board are scene captures: they
/// give tie points (calib/tie_points.h). A camera that does not see the board that another sees gives
/// nothing. An unreadable image is an error that names it.
/// `should_continue` is asked between series of images, from any thread; false ends it with an error.
Result<Observed> observe(const CaptureSet& captures,
                         const DecodeOptions& options = {},
                         const std::function<bool()>& should_continue = {});

/// Both together: the poses of `more`, captures of the same board and devices, come after those of `first`.
/// The same as observe() on all their poses at once, but for the order of observations.
Observed joined(Observed first, Observed more);

/// The matches on the board's squares of one camera, projector and pose. Squares are placed by their corners
/// (a homography each; those at the board's rim by extrapolation), so that no lens is needed. In each half
/// square a plane is fitted to the labels, robustly, and the means of what fits are the match.
std::vector<Match> matches_on_board(const Board& board,
                                    const std::vector<BoardCorner>& corners,
                                    const Decoded& decoded);

/// observations.json: limn.observations/1, arrays of numbers in the order of the structs; for plots and
/// replays.
Status save_observations(const Observations& observations, const std::filesystem::path& path);

/// Without one pose: its corners and matches are gone, numbers of poses stay as they were.
Observations without_pose(const Observations& observations, int pose);

}  // namespace limn::calib
