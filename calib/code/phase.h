#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/code/shake.h"
#include "calib/code/subpixel.h"

namespace limn::calib {

/// Accumulates the steps of a sinusoid along one axis as a camera saw them.
class PhaseReading {
 public:
  PhaseReading(int rows, int cols, int period_px, int steps);
  /// Adds step number `step`, 8-bit grey.
  void add_step(int step, const cv::Mat& image);

  int period_px() const { return period_px_; }
  int steps() const { return steps_; }
  /// Sums of intensity times cosine (and times sine) of the step's angle, CV_32F.
  const cv::Mat& cosines() const { return cosines_; }
  const cv::Mat& sines() const { return sines_; }

 private:
  int period_px_ = 0, steps_ = 0;
  cv::Mat cosines_, sines_;
};

/// Replaces the labels' coordinates by the phase's. The wave is the one whose coordinate is nearest to the
/// label, so that a label may be wrong by almost half a wave. The label and its variance stay where the noise
/// alone changes the phase by more than a tenth of a wave, and where label and phase are so far apart that
/// the next wave is about as near: the pixel is kept without the fine part. `shake`: by what the steps of the
/// first half, each with the one half a wave later (its inverse), differ from the mean image of the series;
/// its effect on the phase is taken out to first order; empty: none. Variance: the phase's by the noise of
/// the intensities, 2 var / (steps * amplitude^2) * (period / 2 pi)^2, plus floor_px^2.
void refine_by_phase(const PhaseReading& reading,
                     const DifferenceNoise& noise,
                     double floor_px,
                     const std::vector<PairShake>& shake,
                     AxisLabels* labels);

}  // namespace limn::calib
