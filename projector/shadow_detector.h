#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "core/rig.h"

namespace limn::projector {

/// What light falls on in a camera's image, in square patches (Renderer::illuminated_patches).
struct IlluminatedPatches {
  int side_px = 0;
  Pose prototype_from_world;  ///< where the prototype stood; the world's own where none is placed
  /// CV_32FC4, a pixel a patch: the prototype's point (its own frame, m) at the patch's middle; w is 0 where
  /// there is none.
  cv::Mat points;
  /// For each projector CV_32FC4, a pixel a patch: the projector's pixel that lights the patch's middle and
  /// its irradiance there (1/m², white head on at 1 m is 1), 0 where it does not reach.
  std::vector<cv::Mat> by_projector;
};

struct ShadowDetectorOptions {
  int cell_px = 16;  ///< side of the maps' cells, projector pixels: finer follows outlines, sees less light
  /// How far what is predicted errs, as a share of how far the light differs from that it was learned in,
  /// standard deviation: colour filters that overlap, reflections, light that lands beside its place. Raise
  /// it where shadows are seen that are not there; costs sight of faint ones.
  double unmodelled = 0.1;
};

/// Estimates from camera frames how much of each projector's light arrives on the prototype, for
/// Renderer::set_occlusion: somebody's shadow must be refilled, somebody before the camera must not.
///
/// Each patch of each camera's image learns what it looks like: light = offset + sum over projectors of
/// gain x irradiance x what the projector shows there, per colour channel, as a Gaussian belief (Kalman
/// filter). No albedo is needed: the belief starts from geometry with the albedo unknown, and knows what it
/// does not know. Each frame is then explained by what was shown: with all light arriving, without one
/// projector's, without two; the best over a neighbourhood of patches counts. What nothing explains (a hand
/// before the camera) has no vote, and the state stays. Votes of all cameras meet in the projectors'
/// images, in cells.
///
/// Cannot tell: which of two projectors is blocked where both give the same light and nothing else differs
/// (one is guessed, the next frame corrects it); a thing before the camera that looks just like the shadow
/// (harmless: the others give the light then, and the sum stays right but for 7 %); shadows where no camera
/// looks, or that the hand hides from all cameras; anything where no light is shown. What stood in the light
/// from the start is learned as it looks.
class ShadowDetector {
 public:
  explicit ShadowDetector(const Rig& rig, const ShadowDetectorOptions& options = {});
  ShadowDetector(ShadowDetector&&) noexcept;
  ShadowDetector& operator=(ShadowDetector&&) noexcept;
  ~ShadowDetector();

  /// What camera `camera` sees from now on. Beliefs stay with the prototype's points; what has no place yet
  /// is learned afresh.
  void place(std::size_t camera, IlluminatedPatches patches);

  /// Takes in a frame (8-bit grey or BGR of the camera's size) and what each projector showed while it was
  /// exposed (8-bit BGR display values of its size; empty: black). Light comes by the rig's measured
  /// responses; without, sRGB of cameras and gamma 2.2 of projectors. True when a map has changed. Nothing
  /// happens before place().
  bool see(std::size_t camera, const cv::Mat& frame, std::span<const cv::Mat> shown);

  /// How much of a projector's light arrives over its image: CV_32FC1, 0 … 1, a pixel a cell. Softly 1
  /// around what is blocked.
  const cv::Mat& map(std::size_t projector) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::projector
