#pragma once

// Cameras, projectors and rigs: their lenses and places, and the files that hold them.
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limn/export.h"
#include "limn/pose.h"

namespace limn::LIMN_VERSIONED {

/// A half-line.
struct Ray {
  Point3 p_origin = {0, 0, 0};
  /// Unit direction.
  Point3 d = {0, 0, 1};
};

/// What an imager is made of.
struct ImagerParts {
  std::string name = {};
  /// Pixels, at most 16384; 0: not known.
  int width = 0, height = 0;
  /// One of mrcal's models: LENSMODEL_PINHOLE, LENSMODEL_OPENCV4, …5, …8, …12,
  /// LENSMODEL_SPLINED_STEREOGRAPHIC_order=… and so on.
  std::string lens_model = "LENSMODEL_PINHOLE";
  /// fx, fy, cx, cy (pixels), then the model's own, in mrcal's order, which is also OpenCV's.
  std::vector<double> lens_values = {1, 1, 0, 0};
  Pose imager_from_world = {};
  /// A camera behind a filter that blocks projected light.
  bool sees_infrared = false;
};

/// The files of cameras that Imager::save() writes.
enum class CameraFile {
  /// .cameramodel: any lens, with the pose.
  mrcal,
  /// YAML of cv::FileStorage, with the pose.
  opencv,
  /// YAML of ROS's camera_info, without the pose.
  ros
};

/// A camera or a projector: both have the same geometry; only the direction of light differs. Frame: x right,
/// y down, z forward; pixel (0, 0) is the centre of the top-left pixel. It does not change, a copy costs
/// nothing, and several threads may use it.
///
///     const limn::Imager camera = limn::Imager::load("camera0.cameramodel");
///     if (const auto px = camera.project({0.1, 0, 1.5})) …
class LIMN_API Imager {
 public:
  /// Error: an unknown lens model, a wrong number of values, values or a size that no imager has.
  explicit Imager(const ImagerParts& parts);
  /// Reads a camera file: .cameramodel and .cahvor of mrcal; OpenCV (YAML, XML, JSON), ROS camera_info,
  /// Kalibr, PhotonVision, ORB-SLAM; ARToolKit camera_para.dat. `path` may be FILE:NAME for one of several
  /// cameras in a file. Without a pose in the file it stands at the world's origin. Error: the message names
  /// what is not understood.
  static Imager load(const std::filesystem::path& path);
  /// Without distortion, with this horizontal field of view (degrees, between 0 and 180) and the principal
  /// point in the middle.
  static Imager pinhole(
      const std::string& name, int width, int height, double fov_deg, const Pose& imager_from_world);

  /// Writes a camera file. Error: a lens that the format cannot hold within 0.1 px, or a file that cannot be
  /// written, whose old content stays.
  void save(const std::filesystem::path& path, CameraFile format = CameraFile::mrcal) const;

  const std::string& name() const;
  /// Pixels; 0: not known.
  int width() const;
  int height() const;
  ImagerParts parts() const;
  Pose imager_from_world() const;
  /// The same imager in another place.
  Imager placed(const Pose& imager_from_world) const;

  /// Pixel of a point (m, world), which may lie outside the image; none for a point without one (behind).
  std::optional<Point2> project(const Point3& p_world) const;
  /// The ray of a pixel in the world; none for a pixel outside the lens's domain.
  std::optional<Ray> unproject(const Point2& px) const;
  /// The same for many, into the caller's memory: `px[i]` is NaN where there is none. Error: different
  /// lengths.
  void project(std::span<const Point3> p_world, std::span<Point2> px) const;
  /// Unit directions in the world from the imager's position; NaN where there is none. Error: different
  /// lengths.
  void unproject(std::span<const Point2> px, std::span<Point3> d_world) const;

  struct Impl;
  explicit Imager(std::shared_ptr<const Impl> impl);  ///< for the library itself
  const Impl& impl() const { return *impl_; }         ///< for the library itself

 private:
  std::shared_ptr<const Impl> impl_;
};

/// Writes a camchain.yaml of Kalibr: the cameras as cam0, cam1 … in this order, each with its pose relative
/// to the one before. Error: as of Imager::save.
LIMN_API void save_kalibr(std::span<const Imager> cameras, const std::filesystem::path& path);

/// Calibrated cameras and projectors in one world frame, with what was measured of their light. The world is
/// camera 0, until the rig is put on the table. It does not change, and a copy costs nothing.
///
///     const limn::Rig rig = limn::Rig::load("rig");
///     const limn::Imager projector = rig.find("projector0");
class LIMN_API Rig {
 public:
  /// Error: a device without a name, or two of one name.
  Rig(std::span<const Imager> cameras, std::span<const Imager> projectors);
  /// Reads a rig folder (rig.json, response.json), a rig.json, or a folder of .cameramodel files, of which
  /// those whose names begin with "projector" are projectors. Error: files that cannot be read.
  static Rig load(const std::filesystem::path& path);
  /// Writes rig.json and one NAME.cameramodel for each device; each replaces its old version when it is
  /// complete. What was measured of the light is not written. Error: a folder that cannot be written.
  void save(const std::filesystem::path& folder) const;

  std::vector<Imager> cameras() const;
  std::vector<Imager> projectors() const;
  /// A camera or projector by its name. Error: there is none; the message lists the names.
  Imager find(const std::string& name) const;

  struct Impl;
  explicit Rig(std::shared_ptr<const Impl> impl);  ///< for the library itself
  const Impl& impl() const { return *impl_; }      ///< for the library itself

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace limn::LIMN_VERSIONED
