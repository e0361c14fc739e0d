#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn::calib {

/// Images that follow each other and together light every pixel alike.
struct PatternGroup {
  int first = 0;
  int count = 2;
};

/// Light of display values evenly spaced from 0 to 255, per channel, as in core/photometric_response.h.
struct DisplayCurves {
  std::vector<double> red, green, blue;
  bool operator==(const DisplayCurves&) const = default;
};

/// What a code's images depend on besides the projector's size.
struct CodeOptions {
  /// phase: length of a wave, whole projector pixels, 4 to 256. Shorter is finer until the lens blurs it.
  int period_px = 16;
  /// phase: images of a wave, 3 to 32. More average noise and cancel more of a wrong response: N steps
  /// stand its harmonics up to N - 2.
  int steps = 6;
  /// phase: of the projector (light = value ^ gamma); the waves are drawn so that their light is sinusoidal.
  double gamma = 2.2;
  /// phase: the projector's measured curves, instead of gamma: light is then sinusoidal in every channel.
  std::optional<DisplayCurves> response = {};
  /// xor: width of the widest stripe, projector pixels: 2, 4 or 8. Narrower keeps light from elsewhere out of
  /// the bits better, wider stands more blur.
  int base_stripe_px = 4;
  /// gray, xor: false leaves the inverses out; white and black then tell what is dark. Half as many images,
  /// for rigs that are all but known (recheck): three times the noise's variance, and light that changes in
  /// the meantime is not noticed.
  bool inverses = true;
  bool operator==(const CodeOptions&) const = default;
};

/// Images for a projector from which each of its pixels can be told apart:
/// - gray: Gray code with inverses, in OpenCV's order: the columns' bits, then the rows', most significant
///   first, each image followed by its inverse; white and black last.
/// - xor: the same, but every bit with stripes wider than base_stripe_px is exchanged with the bit of that
///   width (XOR; XOR-02 and XOR-04 of Gupta et al., "A practical approach to 3D scanning in the presence of
///   interreflections, subsurface scattering and defocus", IJCV 2013): no image has wide stripes, so that
///   light that comes by way of another surface is the same in an image and its inverse.
/// - phase: bits with stripes of half a wave and more, as in gray, then the steps of a sinusoid along the
///   columns, then along the rows; white and black last. Step k of N is 0.5 + 0.5 cos(2 pi (x / period - k /
///   N)) of white's light.
struct Patterns {
  std::string code = "gray";
  int width = 0;
  int height = 0;
  CodeOptions options;  ///< those of other codes stay at their defaults

  /// Of a known code for a size of 2 to 16384 pixels a side; options out of their range are an error.
  static Result<Patterns> create(const std::string& code,
                                 int width,
                                 int height,
                                 const CodeOptions& options = {});

  /// How many of the finest bits are not shown: labels from pairs alone are 2^this pixels wide. 0 but for
  /// phase.
  int lowest_bit() const;
  int column_bits() const;  ///< bits shown for the columns: ceil(log2(width)) - lowest_bit()
  int row_bits() const;     ///< and for the rows
  /// xor: the bit that all coarser ones are exchanged with; else one beyond all bits.
  int base_bit() const;
  /// Width of the widest stripes of its pairs.
  int widest_stripe_px() const;
  int steps() const { return code == "phase" ? options.steps : 0; }  ///< of each axis' sinusoid
  int images_of_bit() const { return options.inverses ? 2 : 1; }
  int first_row_bit() const { return images_of_bit() * column_bits(); }  ///< index of its first image
  int first_step() const { return images_of_bit() * (column_bits() + row_bits()); }
  int count() const { return first_step() + 2 * steps() + 2; }
  int white() const { return count() - 2; }
  int black() const { return count() - 1; }
  /// Each image with its inverse (where they are shown), the steps of the sinusoids; white and black are
  /// the last group.
  std::vector<PatternGroup> groups() const;

  /// Image number `index`, 8 bits, of the projector's size; grey, but for the sinusoids of a measured
  /// response, which are BGR.
  cv::Mat image(int index) const;
  bool operator==(const Patterns&) const = default;
};

/// Patterns of the phase code whose waves are drawn by the response of the projector with that name; an error
/// where it is not among them. Other codes have no grey levels: they stay as they are.
Result<Patterns> linearised(const Patterns& patterns,
                            const std::vector<ProjectorResponse>& responses,
                            const std::string& projector);

/// The codes that exist, for messages: "gray", "phase", "xor".
std::vector<std::string> pattern_codes();

/// A code's options, but for "response", from a JSON object that people edit (patterns.json, a plan); absent
/// keys stay at their defaults. Their range is Patterns::create's business.
CodeOptions read_code_options(const ConfigNode& node);
/// The keys of it that a code has: phase "period_px", "steps", "gamma" or "response"; xor "base_stripe_px";
/// "inverses" of gray and xor.
std::set<std::string> code_option_keys(const std::string& code);

/// `000.png` and so on: the name of an image's file.
std::string image_name(int index);

/// patterns.json: {"schema": "limn.patterns/1", "code": "gray", "size": [width, height], "pictures": 44}; the
/// images are 000.png … in the order above. phase adds "period_px", "steps" and "gamma" (or
/// "response": {"red", "green", "blue"}), xor "base_stripe_px", gray and xor "inverses"; where they are
/// absent their defaults hold.
Status save_patterns(const Patterns& patterns, const std::filesystem::path& path);
Result<Patterns> load_patterns(const std::filesystem::path& path);

}  // namespace limn::calib
