#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn {

/// A number that was measured, and its standard deviation.
struct Measurement {
  double value = 0;
  double stddev = 0;
};

/// How an image's brightness leaves that of its middle: 1 + tilt . q + r2 |q|^2 + r4 |q|^4, where q is the
/// pixel's place from the image's middle in half diagonals (|q| = 1 in the corners).
struct Vignetting {
  Eigen::Vector2d tilt =
      Eigen::Vector2d::Zero();  ///< of a projector whose lens is shifted; a camera has none
  double r2 = 0, r4 = 0;
  double corner_stddev = 0;  ///< of the gain in a corner

  double gain(const Eigen::Vector2d& px, int width, int height) const;
};

/// How a projector turns display values into light, per channel: shares of full light (linear, 0 … 1) at
/// display values that are evenly spaced from 0 to 255. Where black's light is known the curves begin with
/// it.
struct ProjectorResponse {
  std::string projector;
  std::vector<double> red, green, blue;

  // Evidence; absent in files that people write by hand.
  std::optional<Measurement> black_level = {};  ///< light of black as a share of white
  std::optional<Vignetting> vignetting = {};    ///< geometry's falloff (distance, incidence) taken out
  std::optional<double> white_over_sum =
      {};  ///< light of white over red + green + blue; 1: channels just add
  std::optional<double> worst_residual = {};  ///< of an image's mean from the model, share of full light
  std::optional<double> drift = {};           ///< relative change of white from the first image to the last
  int captures = 0;                           ///< images that this is made of, of all cameras
};

/// How a camera turns light into 8-bit levels. Light has no zero of its own: only differences mean something.
struct CameraResponse {
  std::string camera;
  /// What describes it within noise: `linear`, `srgb` (IEC 61966-2-1), `gamma`, or `measured` (only the
  /// table); `unknown` when the images do not tell, then the table is linear.
  std::string encoding = "linear";
  double gamma = 1;                         ///< light = level^gamma for `gamma`
  double gamma_stddev = 0;                  ///< of a power on top of the encoding: how well the images tell
  double pedestal = 0;                      ///< level of no light, for `srgb` and `gamma`
  std::vector<double> light;                ///< of levels 0 … 255, share of full scale; rises
  double noise_dark = 0, noise_bright = 0;  ///< standard deviation of a pixel, levels, at black and white
  std::optional<Vignetting> vignetting;
};

/// What a camera's pixel sees of a lit surface, per camera pixel: light = offset + red * r + green * g + blue
/// * b, where r, g, b are the projector's light (its black apart; Response) and light is in CameraResponse's
/// scale. Maps are CV_32FC1 of a grey camera or CV_32FC3 (BGR) of a colour one; NaN where the pixel saw too
/// little (clipped). Everything that reaches the pixel on the way counts: albedo, distance, reflections.
struct ColourMixing {
  std::string projector, camera;
  cv::Mat red, green, blue, offset;
  double held_out_levels = 0;  ///< RMS of photographs predicted by it and not used for it, levels
};

/// All that response.json (limn.response/1) of a rig folder says, but the mixing's maps.
struct RigResponses {
  std::vector<ProjectorResponse> projectors;
  std::vector<CameraResponse> cameras;
};

Result<RigResponses> load_responses(const std::filesystem::path& response_json);

/// Writes response.json and, under response/ beside it, the mixing's maps as 16-bit PNGs; response.json comes
/// last, and each file replaces its predecessor only when complete. Maps keep 12 bits below 1.
Status save_responses(const RigResponses& responses,
                      const std::vector<ColourMixing>& mixings,
                      const std::filesystem::path& folder);

/// The maps of one projector and camera; an error where response.json lists none.
Result<ColourMixing> load_mixing(const std::filesystem::path& response_json,
                                 const std::string& projector,
                                 const std::string& camera);

/// Of a display whose response was not measured: light = value^2.2. Close to sRGB's curve (IEC 61966-2-1) and
/// what projectors are set to when they leave the factory.
constexpr double k_display_gamma = 2.2;

/// Linear light of an sRGB value, both 0 … 1 (IEC 61966-2-1), and back.
double linear_from_srgb(double encoded);
double srgb_from_linear(double light);

/// Value at `at` (0 … 1) of a table that is evenly spaced from 0 to 1; ends are held.
double lookup(const std::vector<double>& table, double at);
/// The place 0 … 1 where a table that never falls reaches `value`; ends are held.
double inverse_lookup(const std::vector<double>& table, double value);

}  // namespace limn
