#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/photometric_response.h"
#include "core/rig.h"
#include "scene/scene.h"

namespace limn::projector {

/// Which influences on the projected colour are divided out.
enum class Compensation {
  none,      ///< None: a colour is a share of each projector's full light.
  geometry,  ///< Distance, incidence, the projectors' vignetting, and the prototype's albedo as given in the
             ///< scene.
  measured   ///< As geometry, but albedo, colour mixing, ambient light and black level are measured by a
             ///< camera.
};

/// How wanted colours become light. All values may change from image to image.
struct LightOptions {
  Compensation compensation = Compensation::none;
  /// Where only some projectors reach, adds light equal to the black level of the others, so that the edges
  /// of overlaps are invisible in dark scenes. Costs contrast; does nothing where no black level was
  /// measured.
  bool even_black = false;
  /// The light that a colour of 1 stands for: a surface of mean albedo at this irradiance (1/m^2; 1 is full
  /// white at normal incidence at 1 m). A higher value is brighter and clips more. Absent: a level that four
  /// fifths of the prototype can reach.
  std::optional<double> level = {};
};

/// The prototype as one camera measured it under each projector.
struct MeasuredSurface {
  Imager camera;
  Pose world_from_prototype;          ///< Its pose during the measurement. The measured values move with the
                                      ///< prototype.
  std::vector<ColourMixing> mixings;  ///< One for each projector, in the rig's order.
};

/// Checks that the surface was measured with this rig's projectors and that its maps have the camera's size.
/// The error names the map that does not fit.
Status check_fits(const MeasuredSurface& surface, const Rig& rig);

/// The colour response of a surface without distance and incidence, for each pixel of the camera that
/// measured it.
struct SurfaceMixing {
  /// CV_32FC4. Layer 3 i + c: the colour (r, g, b) that the camera sees when channel c (r, g, b) of projector
  /// i gives an irradiance of 1; the fourth channel is 0 where that is unknown. The last layer: the colour
  /// without projectors.
  std::vector<cv::Mat> layers;
  /// Mean over pixels and projectors; columns: red, green, blue.
  Eigen::Matrix3f mean = Eigen::Matrix3f::Identity();
  double level = 1;  ///< As LightOptions::level.
};

/// `irradiance[i]` (CV_32FC1, one value for each camera pixel) is the irradiance from projector i computed
/// from geometry, 0 where it does not reach. A grey camera's measurement is used for all three colours.
/// Error: no pixel saw any projector's light.
Result<SurfaceMixing> surface_mixing(const MeasuredSurface& surface, std::span<const cv::Mat> irradiance);

/// Default of LightOptions::level, computed from geometry without shadows.
double geometric_level(const scene::Prototype& prototype, const Rig& rig, const Pose& world_from_prototype);

/// The prototype's albedo image in linear light, divided by its mean, CV_32FC3 (r, g, b); a single pixel when
/// there is no image.
cv::Mat relative_albedo(const scene::Prototype& prototype);
/// Mean albedo of the prototype over all pixels and over r, g and b.
double mean_albedo_of(const scene::Prototype& prototype);

}  // namespace limn::projector
