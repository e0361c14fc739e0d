#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/enum_names.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn::calib {

/// How the images of a series name the projector's pixels; Patterns says what each code shows.
enum class PatternCode { gray, phase, exclusive_or };
inline constexpr EnumNames<PatternCode, 3> k_pattern_codes{{"gray", "phase", "xor"}};
inline std::string to_text(PatternCode code) { return k_pattern_codes.text(code); }

/// The axes of the projector that a series names.
enum class CodeAxes { both, columns };
inline constexpr EnumNames<CodeAxes, 2> k_code_axes{{"both", "columns"}};

/// Images that follow each other and together illuminate every pixel alike.
struct PatternGroup {
  int first = 0;
  int count = 2;
};

/// Light for display values evenly spaced from 0 to 255, for each channel, as in core/photometric_response.h.
struct DisplayCurves {
  std::vector<double> red, green, blue;
  bool operator==(const DisplayCurves&) const = default;
};

/// What a code's images depend on besides the projector's size.
struct CodeOptions {
  /// phase: length of a wave, whole projector pixels, 4 to 256. Shorter is more accurate until the lens blurs
  /// it.
  int period_px = 16;
  /// phase: number of images of a wave, 3 to 32. More images average noise and cancel more harmonics of a
  /// wrong response: N steps cancel harmonics up to N - 2.
  int steps = 6;
  /// phase: gamma of the projector (light = value ^ gamma); the waves are drawn so that their light is
  /// sinusoidal.
  double gamma = k_display_gamma;
  /// phase: the projector's measured curves, used instead of gamma: light is then sinusoidal in every
  /// channel.
  std::optional<DisplayCurves> response = {};
  /// xor: width of the widest stripe, projector pixels: 2, 4 or 8. Narrower stripes make the bits less
  /// sensitive to indirect light, wider stripes make them less sensitive to blur.
  int base_stripe_px = 4;
  /// gray, xor: false omits the inverses; the mean of white and black is then the threshold. That needs half
  /// as many images, for rigs that are almost known (rig check), but gives three times the noise variance,
  /// and light that changes during the capture is not detected.
  bool inverses = true;
  /// gray: width of the narrowest stripes, projector pixels, 1 to 16. Labels are that wide; more leaves out
  /// the finest bits, for projectors or cameras that do not resolve them.
  int step_px = 1;
  /// gray: `columns` leaves out the rows. A calibrated rig can scan with that; a solve needs both.
  CodeAxes axes = CodeAxes::both;
  bool operator==(const CodeOptions&) const = default;
};

/// Images for a projector that identify each of its pixels:
/// - gray: Gray code with inverses, in OpenCV's order: the columns' bits, then the rows', most significant
///   first, each image followed by its inverse; white and black last.
/// - xor: the same, but every bit with stripes wider than base_stripe_px is combined (XOR) with the bit of
///   that width (XOR-02 and XOR-04 of Gupta et al., "A practical approach to 3D scanning in the presence of
///   interreflections, subsurface scattering and defocus", IJCV 2013). No image has wide stripes, so that
///   light that arrives by another surface is the same in an image and its inverse.
/// - phase: bits with stripes of half a wave and more, as in gray, then the steps of a sinusoid along the
///   columns, then along the rows; white and black last. Step k of N is
///   0.5 + 0.5 cos(2 pi (x / period - k / N)) of white's light.
struct Patterns {
  PatternCode code = PatternCode::gray;
  int width = 0;
  int height = 0;
  CodeOptions options;  ///< options of other codes keep their defaults

  /// Patterns of a code for a size of 2 to 16384 pixels a side; options out of range are an error.
  static Result<Patterns> create(PatternCode code, int width, int height, const CodeOptions& options = {});

  /// Width of the labels that pairs alone give, projector pixels: 1, except for phase and for gray's step_px.
  int block_px() const;
  /// Number of finest bits that are not shown: floor(log2(block_px())).
  int lowest_bit() const;
  int column_bits() const;  ///< bits shown for the columns: ceil(log2(number of labels))
  int row_bits() const;     ///< bits shown for the rows; 0 where they are left out
  /// xor: the bit that all coarser ones are combined with; other codes: one more than the last bit.
  int base_bit() const;
  /// Width of the widest stripes of the pairs.
  int widest_stripe_px() const;
  /// Steps of each axis's sinusoid.
  int steps() const { return code == PatternCode::phase ? options.steps : 0; }
  int images_of_bit() const { return options.inverses ? 2 : 1; }
  int first_row_bit() const { return images_of_bit() * column_bits(); }  ///< index of its first image
  int first_step() const { return images_of_bit() * (column_bits() + row_bits()); }
  int count() const { return first_step() + 2 * steps() + 2; }
  int white() const { return count() - 2; }
  int black() const { return count() - 1; }
  /// Groups: each image with its inverse (where inverses are shown) and the steps of each sinusoid; white and
  /// black are the last group.
  std::vector<PatternGroup> groups() const;

  /// Image number `index`, 8 bits, of the projector's size; grey, except for the sinusoids of a measured
  /// response, which are BGR.
  cv::Mat image(int index) const;
  bool operator==(const Patterns&) const = default;
};

/// Patterns of the phase code whose waves are drawn with the response of the projector with that name; an
/// error where `responses` does not contain it. Other codes have no grey levels and are returned unchanged.
Result<Patterns> linearised(const Patterns& patterns,
                            const std::vector<ProjectorResponse>& responses,
                            const std::string& projector);

/// Reads a code's options, except "response", from a JSON object that people edit (patterns.json, a plan).
/// Absent keys keep their defaults. Patterns::create checks their range.
CodeOptions read_code_options(const ConfigNode& node);
/// The keys that a code has: phase "period_px", "steps", "gamma" or "response"; xor "base_stripe_px"; gray
/// and xor "inverses"; gray "step_px" and "axes".
std::set<std::string> code_option_keys(PatternCode code);

/// Number of bits that name `labels` labels.
int bits_for(int labels);
/// Number of labels of `block` pixels on an axis of `size` pixels.
int labels_on(int size, int block);

/// The name of an image's file: `000.png` and so on.
std::string image_name(int index);

/// Writes patterns.json: {"schema": "limn.patterns/1", "code": "gray", "size": [width, height], "pictures":
/// 44}; the images are 000.png … in the order above. phase adds "period_px", "steps" and "gamma" (or
/// "response": {"red", "green", "blue"}), xor "base_stripe_px", gray and xor "inverses", gray "step_px" and
/// "axes"; absent keys have their defaults.
Status save_patterns(const Patterns& patterns, const std::filesystem::path& path);
Result<Patterns> load_patterns(const std::filesystem::path& path);

}  // namespace limn::calib
