#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/constellation.h"
#include "core/marker.h"
#include "core/marker_drawing.h"
#include "core/result.h"
#include "core/rig.h"
#include "scene/meshes/mesh.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::sim {

/// How a camera turns linear light into numbers. The defaults are an ideal sensor without noise: each effect
/// is off.
struct CameraEffects {
  bool colour = false;    ///< BGR frames instead of grey ones.
  double exposure = 1;    ///< Share of full scale for each unit of light (albedo x illuminance).
  double psf_px = 0;      ///< Standard deviation of the lens's Gaussian blur; 0: off.
  double vignetting = 0;  ///< Share of light lost in the image's corners, quadratic in radius; 0: off.
  /// Electrons at full scale; the variance of shot noise is signal / full_well_e; 0: off.
  double full_well_e = 0;
  double read_noise = 0;   ///< Standard deviation in 8-bit levels of linear signal; 0: off.
  double black_level = 0;  ///< 8-bit level without light.
  double shake_px = 0;     ///< Standard deviation of each frame's displacement, per axis; 0: off.
  double flicker = 0;      ///< Standard deviation of the factor on each frame's light, about 1; 0: off.
  bool srgb = false;       ///< Encodes by the sRGB curve instead of linearly.
  /// Colour mixing of a colour camera, whose filters overlap: the rows are the camera's blue, green and red,
  /// the columns blue, green and red light. Identity: off. Not used by a grey camera.
  Eigen::Matrix3d sensitivity = Eigen::Matrix3d::Identity();
};

/// How a projector turns display values into light. Each effect is off at its default.
struct ProjectorEffects {
  double illuminance_at_1m = 1;               ///< Illuminance of full white at 1 m and normal incidence.
  double gamma = 1;                           ///< light = value^gamma; 1: off.
  Eigen::Vector3d channel_gamma = {1, 1, 1};  ///< Factors on gamma for blue, green, red; 1: off.
  double s_curve = 0;      ///< Share of smoothstep(value) in the response, as with films and LCDs; 0: off.
  double black_level = 0;  ///< Light of black, as a share of white; 0: off.
  double vignetting = 0;   ///< Share of light lost in the panel's corners, quadratic in radius; 0: off.
  double focus_m = 1;      ///< Depth of sharp focus.
  double aperture_m = 0;   ///< Diameter of the exit pupil, for defocus; 0: off.
  bool falloff = true;     ///< Light falls with the square of the distance; false: as at 1 m.
  bool incidence = true;   ///< Light falls with the cosine of incidence; false: as at normal incidence.
};

/// A physical object. It is diffuse: it reflects albedo x illuminance.
struct Object {
  std::string name;
  std::shared_ptr<const scene::Mesh> mesh;
  Pose world_from_object;
  Eigen::Vector3d albedo = {0.8, 0.8, 0.8};  ///< Linear BGR reflectance where the texture is white.
  double ink_albedo = 0;                     ///< Reflectance where the texture is black.
  cv::Mat texture;                           ///< 8-bit sRGB, grey or BGR, in the mesh's uv; empty: plain.
  bool sharp_texture = false;                ///< Pixels are small squares (printed cells), not interpolated.
  /// Light that returns to a lamp beside the camera, as a multiple of what a white matt surface returns that
  /// faces the camera; it does not depend on the surface's tilt. 0: the object is diffuse only.
  double retroreflection = 0;
  bool by_material = false;  ///< Uses the mesh's own materials instead of albedo and texture.
  std::optional<Pose> prototype_from_object;  ///< When set, the object moves with the prototype.
};

/// A physical marker or constellation in the world. Its frame is that of its object.
struct PlacedMarker {
  MarkerName marker;
  double size_m = 0;  ///< the marker's side, or twice the constellation's reach
  std::string object;
};

/// A small lamp. Its illuminance is that at 1 m and normal incidence. `radius_m` softens its shadows.
struct Lamp {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  double illuminance_at_1m = 0;
  double radius_m = 0;
};

/// Light of the room other than from projectors, which are no infrared light: a camera with
/// Spectrum::infrared sees only what a lamp around its lens lights, of illuminance 1 at 1 m. The ambient part
/// reaches every surface, more from above.
struct Room {
  double ambient = 0;
  std::vector<Lamp> lamps;
};

/// The surface of balls.
struct BallPaint {
  double albedo = 0.85;
  double retroreflection = 0;  ///< as in Object
};

/// Everything that the virtual rig knows to be true. World frame: metres, z up, z = 0 is the table's top.
struct World {
  Rig rig;                                          ///< True lenses and poses.
  std::vector<CameraEffects> camera_effects;        ///< One for each of rig.cameras.
  std::vector<ProjectorEffects> projector_effects;  ///< One for each of rig.projectors.
  std::vector<Object> objects;
  std::vector<PlacedMarker> markers;
  Room room;
  BallPaint ball_paint;
  std::uint64_t seed = 1;

  std::optional<scene::Scene> scene;  ///< The virtual content. Its parts are NOT among the objects.
  Pose world_from_prototype;

  const Object* find(const std::string& object) const;
  Object* find(const std::string& object);
};

/// Makes the image of a marker without its white margin.
using MarkerImage = std::function<Result<MarkerDrawing>(const MarkerName&)>;

/// Reads a limn.world/1 file and the scene that it names; `marker_image` draws its markers. The prototype
/// becomes the object "prototype", its markers "marker-FAMILY:ID", the table "table".
/// `skipped_variants`: as scene::load_scene's; without it what is left out is a warning.
Result<World> load_world(const std::filesystem::path& path,
                         const MarkerImage& marker_image,
                         std::vector<scene::SkippedVariant>* skipped_variants = nullptr);

/// The same world with ideal devices: no blur, noise, vignetting, gamma or black level. The exposure is kept.
World without_effects(World world);

/// A flat sheet: frame at its centre, x right, y down, z away from the printed face (as a marker's).
/// `image` (8-bit sRGB; may be empty) covers it completely; its pixels are small squares. The back is plain.
Object sheet(const std::string& name,
             double width_m,
             double height_m,
             const cv::Mat& image,
             const Pose& world_from_sheet);

/// Adds a marker plate with a white margin; `attached_to_prototype` makes it move with the prototype.
Status add_marker(World& world,
                  const BodyMarker& marker,
                  bool attached_to_prototype,
                  const MarkerImage& marker_image);

/// Adds the balls of a constellation as one object, in the constellation's frame.
void add_balls(World& world,
               const MarkerName& name,
               const Constellation& balls,
               const Pose& pose,
               bool attached_to_prototype);

/// Moves the prototype and everything attached to it.
void move_prototype(World& world, const Pose& world_from_prototype);

/// The true poses of the parts, from the true poses of the slots' markers: what a perfect tracker would
/// report.
scene::PosedScene true_poses(const World& world, std::span<const std::string> variants = {});

/// world_from_marker of a placed marker; nullopt when there is none of that name.
std::optional<Pose> world_from_marker(const World& world, const MarkerName& marker);

}  // namespace limn::sim
