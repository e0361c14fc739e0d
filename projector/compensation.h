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

/// What stands between a part's colour and what the projectors' light makes of it, and is divided out.
enum class Compensation {
  none,      ///< nothing: a colour is a share of each projector's full light
  geometry,  ///< distance, incidence, the projectors' vignetting, and the prototype's albedo as its scene
             ///< says
  measured   ///< as geometry, but albedo, colour mixing, ambient and black light as a camera measured them
};

/// How wanted colours become light. Everything may change from image to image.
struct LightOptions {
  Compensation compensation = Compensation::none;
  /// Where only some projectors reach, gives the black light of the others, too, so that overlaps do not show
  /// in the dark. Costs contrast; does nothing where no black level was measured.
  bool even_black = false;
  /// What a colour of 1 looks like: the surface of mean albedo at so much irradiance (1/m^2; 1 is full white
  /// head on at 1 m). Higher is brighter and clips more. Absent: what four fifths of the prototype can reach.
  std::optional<double> level = {};
};

/// The prototype as one camera measured it under each projector.
struct MeasuredSurface {
  Imager camera;
  Pose world_from_prototype;          ///< then; what was measured moves with the prototype
  std::vector<ColourMixing> mixings;  ///< one a projector, in the rig's order
};

/// Whether it is of this rig's projectors, and its maps of the camera's size; says which is not.
Status check_fits(const MeasuredSurface& surface, const Rig& rig);

/// What light does on a surface, freed of distance and incidence: in each pixel of the camera that measured.
struct SurfaceMixing {
  /// CV_32FC4. 3 i + c: what channel c (r, g, b) of projector i looks like (r, g, b) at an irradiance of 1;
  /// the fourth channel is 0 where that is unknown. The last: what is there without projectors.
  std::vector<cv::Mat> layers;
  Eigen::Matrix3f mean = Eigen::Matrix3f::Identity();  ///< columns: red, green, blue
  double level = 1;                                    ///< LightOptions::level
};

/// `irradiance[i]` (CV_32FC1, the camera's pixels): of projector i by geometry, 0 where it does not reach. A
/// grey camera's measurement counts for all colours alike. Error where no pixel saw any projector.
Result<SurfaceMixing> surface_mixing(const MeasuredSurface& surface, std::span<const cv::Mat> irradiance);

/// LightOptions::level by geometry: shadows are left out.
double geometric_level(const scene::Prototype& prototype, const Rig& rig, const Pose& world_from_prototype);

/// The prototype's albedo image as linear light over its mean, CV_32FC3 (r, g, b); one pixel without an
/// image.
cv::Mat relative_albedo(const scene::Prototype& prototype);
/// That mean, over r, g and b.
double mean_albedo_of(const scene::Prototype& prototype);

}  // namespace limn::projector
