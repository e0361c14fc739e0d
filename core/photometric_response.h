#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"

namespace limn {

/// A number that was measured, and its standard deviation.
struct Measurement {
  double value = 0;
  double stddev = 0;
};

/// Brightness relative to the image's middle: gain = 1 + tilt . q + r2 |q|^2 + r4 |q|^4, where q is the
/// pixel's offset from the middle in half diagonals (|q| = 1 in the corners).
struct Vignetting {
  Eigen::Vector2d tilt =
      Eigen::Vector2d::Zero();  ///< Nonzero for a projector with a shifted lens; zero for a camera.
  double r2 = 0, r4 = 0;
  double corner_stddev = 0;  ///< Standard deviation of the gain in a corner.

  double gain(const Eigen::Vector2d& px, int width, int height) const;
};

/// How a projector turns display values into light. Each channel has shares of full light (linear, 0 … 1) at
/// display values that are evenly spaced from 0 to 255. If the light of black is known, it is the first value
/// of the curves.
struct ProjectorResponse {
  std::string projector;
  std::vector<double> red, green, blue;

  // Evidence; absent in files that people write by hand.
  std::optional<Measurement> black_level = {};  ///< Light of black as a share of white.
  std::optional<Vignetting> vignetting = {};    ///< Without the falloff by distance and incidence.
  std::optional<double> white_over_sum =
      {};  ///< Light of white divided by red + green + blue; 1 when the channels simply add.
  /// Largest difference between an image's mean and the model's, as a share of full light.
  std::optional<double> worst_residual = {};
  std::optional<double> drift = {};  ///< Relative change of white from the first image to the last.
  int captures = 0;                  ///< Number of images used, over all cameras.
};

/// What describes within noise how a camera encodes light.
enum class CameraEncoding {
  linear,
  srgb,      ///< IEC 61966-2-1
  gamma,     ///< light = level^gamma
  measured,  ///< Only the table.
  unknown    ///< The images cannot decide; the table is then linear.
};
inline constexpr EnumNames<CameraEncoding, 5> k_camera_encodings{
    {"linear", "srgb", "gamma", "measured", "unknown"}};

/// How a camera turns light into 8-bit levels. The zero of light is arbitrary: only differences have a
/// meaning.
struct CameraResponse {
  std::string camera;
  CameraEncoding encoding = CameraEncoding::linear;
  double gamma = 1;  ///< For `gamma`.
  /// Standard deviation of an additional exponent on top of the encoding: how well the images determine it.
  double gamma_stddev = 0;
  double pedestal = 0;                      ///< Level without light, for `srgb` and `gamma`.
  std::vector<double> light;                ///< Light at levels 0 … 255, share of full scale; never falls.
  double noise_dark = 0, noise_bright = 0;  ///< Standard deviation of a pixel at black and white, in levels.
  std::optional<Vignetting> vignetting;
};

/// What each camera pixel sees of each channel of a projector: light = offset + red * r + green * g + blue
/// * b, where r, g, b are the projector's light above black (ProjectorResponse) and light is in
/// CameraResponse's scale. Maps are CV_32FC1 for a grey camera or CV_32FC3 (BGR) for a colour one; they are
/// NaN where the pixel could not be measured (clipped). All that changes the light on its way is included:
/// albedo, distance, reflections.
struct ColourMixing {
  std::string projector, camera;
  cv::Mat red, green, blue, offset;
  double held_out_levels = 0;  ///< RMS error of predicted photographs that the fit did not use, in levels.
};

/// The content of a rig folder's response.json (limn.response/1), without the maps of the colour mixing.
struct RigResponses {
  std::vector<ProjectorResponse> projectors;
  std::vector<CameraResponse> cameras;
};

Result<RigResponses> load_responses(const std::filesystem::path& response_json);

/// Writes response.json and, in response/ beside it, the mixings' maps as 16-bit PNGs in steps of 1/4096.
/// response.json is written last, and each file replaces its old version only when complete.
Status save_responses(const RigResponses& responses,
                      const std::vector<ColourMixing>& mixings,
                      const std::filesystem::path& folder);

/// Reads the maps of one projector and camera; an error if response.json lists none.
Result<ColourMixing> load_mixing(const std::filesystem::path& response_json,
                                 const std::string& projector,
                                 const std::string& camera);

/// Assumed gamma of a display whose response was not measured: light = value^2.2. This is close to sRGB's
/// curve (IEC 61966-2-1) and the factory setting of projectors.
constexpr double k_display_gamma = 2.2;

/// Linear light of an sRGB value, both 0 … 1 (IEC 61966-2-1), and back.
double linear_from_srgb(double encoded);
double srgb_from_linear(double light);

/// Interpolated value at `at` (0 … 1) of a table that is evenly spaced from 0 to 1; `at` is clamped.
double lookup(const std::vector<double>& table, double at);
/// The position (0 … 1) where a non-decreasing table reaches `value`; clamped to the ends.
double inverse_lookup(const std::vector<double>& table, double value);

}  // namespace limn
