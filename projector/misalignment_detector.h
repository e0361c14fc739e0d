#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.h"
#include "core/rig.h"
#include "projector/shadow_detector.h"

namespace limn::projector {

/// The shift between the light seen in a camera's images and the light predicted from the rig.
struct Displacement {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Found minus predicted, camera pixels.
  double correlation = 0;  ///< Correlation of the frames with the light shifted by `px`, up to 1.
  /// Correlation of the frames with the light as predicted, without a shift.
  double unshifted_correlation = 0;
  /// Weight of the evidence: the sum over the cells of the last seconds of the standard deviation of their
  /// light, as a share of white. Each cell is weighted by the share of the light in question in its contrast.
  /// 0: no light with edges was shown.
  double contrast = 0;
  /// How much better the shift explains the light: the sum over all cells of the standard deviation of their
  /// light times the gain in correlation.
  double gain = 0;
};

/// The displacements of light that one camera found in its last seconds.
struct LightDisplacements {
  std::vector<Displacement> projectors;  ///< Best shift when only the light of this projector moves.
  Displacement all;      ///< Best shift when all light moves, as it does when the camera has moved.
  double mm_per_px = 0;  ///< On the prototype, at the median depth of what is seen.
};

/// Compares a camera's frames with what the projectors showed, to find devices that have moved: their light
/// is shifted from its predicted place. Works cell by cell. Only cells are used that lie wholly on the
/// prototype and whose light has edges and has not changed recently. The measure is the zero-mean normalised
/// cross-correlation of the frame with the predicted light, with the light of one projector (or all light)
/// shifted. No albedo is needed; a print on the prototype only lowers the correlation. The results of some
/// seconds are summed with exponential forgetting.
///
/// Cannot detect: shifts along the edges, where all edges have one direction; shifts larger than the search
/// range (24 pixels of the reduced image); anything where no light with edges is shown.
class MisalignmentDetector {
 public:
  MisalignmentDetector(const Rig& rig, std::size_t camera);

  /// Side of the patches that place() expects, camera pixels.
  int side_px() const { return side_px_; }
  /// Sets where the light falls from now on. The sums so far are kept.
  void place(IlluminatedPatches patches);

  bool is_comparing() const { return !cells_.empty(); }
  /// Begins the comparison with a frame (8-bit grey or BGR of the camera's size). `shown` and `before` are
  /// the images that each projector showed during the exposure and shortly before it (8-bit BGR; empty:
  /// black). `avoid` (CV_8U, of the camera's size): not 0 where the frame is left out (markers, because paper
  /// has edges of its own). Nothing happens before place().
  void begin(const Frame& frame,
             std::span<const cv::Mat> shown,
             std::span<const cv::Mat> before,
             const cv::Mat& avoid);
  /// Compares some cells; returns true when the frame is finished.
  bool compare(int cells);

  LightDisplacements displacements() const;

 private:
  struct Light {
    cv::Mat table;      // CV_32FC3, 1 x 256: light of each display value
    cv::Mat predicted;  // CV_32F: predicted light of this projector in the camera's image
  };
  cv::Mat predicted_light(std::size_t projector, const cv::Mat& image) const;
  void compare_cell(const cv::Rect& cell);

  Imager imager_;
  int side_px_ = 1;
  cv::Mat light_of_levels_;
  IlluminatedPatches patches_;
  double mm_per_px_ = 0;
  cv::Mat usable_;               // CV_8U: on the prototype, illuminated, and not in `avoid`
  cv::Mat frame_;                // CV_32F
  std::vector<Light> lights_;    // one for each projector
  std::vector<cv::Rect> cells_;  // still to be compared, the best last
  double white_ = 0;             // mean irradiance of white on the usable pixels
  Stamp compared_at_;
  // Sums over cells: one for each projector, and the last one for all light.
  struct Sum {
    cv::Mat map;          // CV_32F, a pixel for each shift: contrast x share x correlation
    cv::Mat gains;        // CV_32F, likewise: contrast x gain in correlation
    double contrast = 0;  // sum of the weights contrast x share
  };
  static Sum empty_sum();
  std::vector<Sum> current_, total_;  // the current frame; all frames, with forgetting
};

}  // namespace limn::projector
