#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/code/patterns.h"
#include "calib/code/shot_order.h"
#include "core/result.h"

namespace limn::calib {

/// The wave of another program's phase-shift images: step k of N shows mean + amplitude * wave(2 pi (x /
/// period - k / N)), or + k / N where the steps run backward.
enum class WaveForm { cosine, sine, minus_cosine, minus_sine };
inline constexpr EnumNames<WaveForm, 4> k_wave_forms{{"cos", "sin", "-cos", "-sin"}};

/// Phase-shift images of another program. Each axis has, one after the other: the images of a Gray code that
/// numbers the waves of the first period, widest stripes first (`is_cued`); then, for each period, its steps.
/// White and black are optional.
struct PhaseSeries {
  int steps = 4;                                   ///< images of one wave, 3 to 32
  std::vector<double> column_periods;              ///< projector pixels, longest first
  std::vector<double> row_periods;                 ///< empty: as the columns'
  bool is_cued = false;                            ///< without it the first period must cover its axis
  InversePlace cue_inverses = InversePlace::none;  ///< none, second or first
  AxisOrder axes = AxisOrder::columns_rows;        ///< columns_rows or rows_columns
  WhitePlace white = WhitePlace::absent;
  WaveForm wave = WaveForm::cosine;
  bool is_backward = false;

  /// Number of images of one series for a projector of that size.
  int count(int projector_width, int projector_height) const;
};

/// Checks a description. Error: steps or periods out of range, a first period that does not cover its axis
/// and has no cue, a period that is too short for the one before it to number its waves.
Status check(const PhaseSeries& series, int projector_width, int projector_height);

/// The patterns that recoded() writes: Limn's phase code for that projector.
Patterns recoded_patterns(int projector_width, int projector_height);

/// Decodes a series (`images`: as stored) and writes what a camera would have photographed of
/// recoded_patterns() with the same white, black and coordinates, as PNGs in `folder`; returns their paths in
/// the order of the patterns. So everything behind the import reads one kind of phase code. Pixels without a
/// wave are dark. Errors: an image that cannot be read or has another size; a description that does not fit:
/// the waves of one period do not continue those of the one before (then the forms that do fit are named).
Result<std::vector<std::filesystem::path>> recoded(const PhaseSeries& series,
                                                   const std::vector<std::filesystem::path>& images,
                                                   int projector_width,
                                                   int projector_height,
                                                   const std::filesystem::path& folder);

}  // namespace limn::calib
