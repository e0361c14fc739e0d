#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "core/rig.h"

namespace limn::projector {

/// Which light falls on what, for square patches of a camera's image (Renderer::illuminated_patches).
struct IlluminatedPatches {
  int side_px = 0;
  Pose prototype_from_world;  ///< Transform from the world to the prototype's frame; identity where none is
                              ///< placed.
  /// CV_32FC4, one pixel for each patch: the prototype's point (its own frame, m) at the patch's centre; w is
  /// 0 where there is none.
  cv::Mat points;
  /// For each projector CV_32FC4, one pixel for each patch: the projector's pixel (x, y) that lights the
  /// patch's centre, and the irradiance of its white there (1/m², 1 at normal incidence at 1 m), 0 where it
  /// does not reach.
  std::vector<cv::Mat> by_projector;
};

struct ShadowDetectorOptions {
  int cell_px = 16;  ///< Side of the maps' cells, projector pixels. Finer cells follow outlines better, but
                     ///< average less light.
  /// Standard deviation of the prediction's error, as a share of the difference between the current light and
  /// the light in which the model was learned. Causes are overlapping colour filters, reflections and
  /// misplaced light. Raise it when shadows are reported that are not there; faint shadows are then missed.
  double unmodelled = 0.1;
};

/// Estimates from camera frames how much of each projector's light arrives on the prototype, for
/// Renderer::set_occlusion. A person's shadow must be filled by other projectors; a person in front of the
/// camera must not be mistaken for a shadow.
///
/// For each patch of each camera's image a linear model is learned: light = offset + sum over projectors of
/// gain x irradiance x projected light, for each colour channel, as a Gaussian with mean and covariance
/// (Kalman filter). No albedo is needed: the prior comes from geometry, with a wide variance for the albedo.
/// Each frame is then compared with the predictions for all light arriving, for one projector blocked and for
/// two projectors blocked. The prediction that fits best over a neighbourhood of patches wins. A patch that
/// fits none (a hand before the camera) has no vote, and the state stays. The votes of all cameras are added
/// in cells of the projectors' images.
///
/// Limits. Where two projectors give the same light and nothing else differs, it is unknown which one is
/// blocked: one is guessed, and the next frame corrects it. A thing before the camera may look just like the
/// shadow. This is harmless: the other projectors then give the light, and the sum is wrong by 7 % at most.
/// Shadows are not found where no camera sees them, where the hand hides them from all cameras, or where no
/// light is shown. Something that stood in the light from the start is learned as part of the scene.
class ShadowDetector {
 public:
  explicit ShadowDetector(const Rig& rig, const ShadowDetectorOptions& options = {});
  ShadowDetector(ShadowDetector&&) noexcept;
  ShadowDetector& operator=(ShadowDetector&&) noexcept;
  ~ShadowDetector();

  /// Sets what camera `camera` sees from now on. Learned models stay with the points of the prototype; new
  /// points start from the prior.
  void place(std::size_t camera, IlluminatedPatches patches);

  /// Processes a frame (8-bit grey or BGR of the camera's size). `shown` is what each projector showed during
  /// its exposure (8-bit BGR display values of its size; empty: black). Levels become light by the rig's
  /// measured responses, or without them by sRGB (cameras) and gamma 2.2 (projectors). Returns true when a
  /// map has changed. Nothing happens before place().
  bool update_maps(std::size_t camera, const cv::Mat& frame, std::span<const cv::Mat> shown);

  /// The share of a projector's light that arrives, over its image: CV_32FC1, 0 … 1, one pixel for each cell.
  /// It rises smoothly to 1 around blocked cells.
  const cv::Mat& map(std::size_t projector) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::projector
