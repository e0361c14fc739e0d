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

/// Where light is found that may lie elsewhere than the rig says, in a camera's images.
struct Displacement {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< found minus predicted, camera pixels
  double likeness = 0;     ///< of the frames with light so displaced: correlation, up to 1
  double as_foretold = 0;  ///< of the frames with all light where the rig says
  /// What these rest upon: the sum over the cells of some seconds of their light's standard deviation, as a
  /// share of white; cells count by how much of the light there is such as may be displaced. 0: nothing with
  /// edges was lit.
  double contrast = 0;
  /// By how much more of all the light that was seen is explained so: the sum over all cells of their light's
  /// standard deviation times the likeness gained.
  double gain = 0;
};

/// What one camera's last seconds say of where the light lies.
struct LightDisplacements {
  std::vector<Displacement> projectors;  ///< best when one projector's light alone lies elsewhere
  Displacement all;                      ///< best when all light does, as when the camera itself has moved
  double mm_per_px = 0;                  ///< on the prototype, in the middle of what was seen
};

/// Compares a camera's frames with what the projectors showed, cell by cell, to find light that lies beside
/// its place: a device has been nudged. Judged are cells that lie wholly on the prototype, whose light has
/// edges and did not change lately, by zero-mean normalized cross-correlation of the frame with the light
/// predicted, one projector's part (or all) shifted. No albedo is needed; a print on the prototype only
/// lowers the likeness. Looks of some seconds are summed (their mean, that forgets).
///
/// Cannot tell: shifts along all edges there are; displacements over reach_px; anything where no light with
/// edges is shown.
class MisalignmentDetector {
 public:
  MisalignmentDetector(const Rig& rig, std::size_t camera);

  /// Side of the patches that place() wants, camera pixels.
  int side_px() const { return side_px_; }
  /// Where the light falls from now on. What was found before stays.
  void place(IlluminatedPatches patches);

  bool is_looking() const { return !cells_.empty(); }
  /// Begins a look at a frame (8-bit grey or BGR of the camera's size). `shown`: what each projector showed
  /// while it was exposed (8-bit BGR; empty: black), and shortly `before`. `avoid`: quadrilaterals of the
  /// frame that are left out (markers: paper has edges of its own). Nothing happens before place().
  void begin(const Frame& frame,
             std::span<const cv::Mat> shown,
             std::span<const cv::Mat> before,
             std::span<const std::vector<cv::Point>> avoid);
  /// Compares some cells; true when that ends a look.
  bool compare(int cells);

  LightDisplacements places() const;

 private:
  struct Light {
    cv::Mat table;  // CV_32FC3, 1 x 256: of display values
    cv::Mat given;  // CV_32F: by one projector, where predicted
  };
  cv::Mat given(std::size_t projector, const cv::Mat& image) const;
  void compare_cell(const cv::Rect& cell);

  Imager imager_;
  int side_px_ = 1;
  cv::Mat light_of_levels_;
  IlluminatedPatches patches_;
  double mm_per_px_ = 0;
  cv::Mat usable_;               // CV_8U: on the prototype, lit, not to be avoided
  cv::Mat frame_;                // CV_32F
  std::vector<Light> lights_;    // one a projector
  std::vector<cv::Rect> cells_;  // still to be compared, the best last
  double white_ = 0;             // mean irradiance
  Stamp looked_at_;
  // Sums over cells, for each projector and, last, for all light.
  struct Sum {
    cv::Mat map;          // CV_32F, a pixel a shift: contrast x share x likeness
    cv::Mat gains;        // likewise: contrast x likeness gained
    double contrast = 0;  // what it rests upon
  };
  static Sum nothing();
  std::vector<Sum> look_, all_;  // of the look that goes on; of all, those that are past forgotten
};

}  // namespace limn::projector
