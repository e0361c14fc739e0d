#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/track.h"
#include "scene/material_override.h"
#include "scene/scene.h"
#include "scene/viewpoint.h"

namespace limn::scene {

/// A slot's part with its pose.
struct PosedPart {
  std::string slot;
  std::string variant;
  Pose world_from_part;
  MaterialOverride material = {};
  std::optional<GreyWindow> window = {};  ///< How its volume is shown; absent: as the scene or its file says.
};

/// The deviation from its CAD that paints the prototype (scene/deviation_layer.h).
struct PaintedDeviation {
  int layer = 0;           ///< DeviationLayer::number; 0: none.
  double tolerance_m = 0;  ///< The colours change at 1, 2 and 4 times it.
  bool operator==(const PaintedDeviation&) const = default;
};

/// A scene at a moment: where everything is and which variant each slot shows. A slot that is not seen, or
/// whose track is lost, is absent.
struct PosedScene {
  std::optional<Pose> world_from_prototype;
  std::vector<PosedPart> parts;
  std::vector<Viewpoint> viewpoints = {};  ///< Those of fixed viewers and of viewers whose marker is seen.
  std::optional<RoomLight> light = {};     ///< Absent: the scene's own light.
  std::string finish = {};                 ///< The prototype's finish, of Scene::finishes; empty: none.
  /// The plane that cuts what the scene's section names, in the world; absent: all is whole.
  std::optional<CutPlane> cut = {};
  std::vector<std::string> lines = {};  ///< The lines that are shown, of Scene::lines.
  std::vector<DrawnLine> drawn = {};    ///< Further lines that are shown, and outlines (add_outlines).
  PaintedDeviation deviation = {};      ///< Instead of the finish.
};

/// The scene with the poses of the tracks (of `bodies(scene)`). `variants[i]` is the chosen variant of slot i
/// (absent: its first). With stick_to_surface a marker's pose is moved onto the prototype's mesh: the centre
/// to the most likely point of the mesh, by the covariances of its track and the prototype's (without
/// covariances the nearest point); the z axis along the inward normal there; the rotation about z stays.
PosedScene posed(const Scene& scene,
                 std::span<const Track> tracks,
                 std::span<const std::string> variants = {});

/// Adds the outlines of posed parts among the scene's lines to `drawn`, because they move with their parts.
/// At most k_most_points_shown points are drawn in all.
void add_outlines(const Scene& scene, PosedScene* posed);

/// The tracks of the bodies that carry what is posed, without covariances: posed() of them gives these poses
/// again, unless parts stick to the surface.
std::vector<Track> tracks_of(const Scene& scene, const PosedScene& posed);

/// Whether both look the same: the same poses, variants, materials, finish, lines, light, cut and deviation,
/// to the last bit.
bool is_same(const PosedScene& a, const PosedScene& b);
/// Whether both look the same but for their lines (`lines` and `drawn`).
bool is_same_without_lines(const PosedScene& a, const PosedScene& b);
/// Whether the prototype is at the same pose in both.
bool is_same_prototype(const PosedScene& a, const PosedScene& b);

/// The point that viewers look at: the middle of the prototype, or of the parts if there is no prototype.
/// Nullopt when there are no parts either.
std::optional<Eigen::Vector3d> middle_of(const Scene& scene, const PosedScene& posed);

/// A viewer at `p_eye_world` that looks at the middle of the posed scene, with `d_up_world` up, 1280 x 800
/// pixels and a field of view of 40 degrees. Nullopt when there is nothing to look at.
std::optional<Imager> viewer_at(const Eigen::Vector3d& p_eye_world,
                                const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world);

/// The viewer of a posed scene: its only viewer if that is fixed, else viewer_at() the shared viewpoint to
/// which updated_viewpoint() converges (call that function for a series of moments). Nullopt when there is no
/// viewer, none was seen, or there is nothing to look at.
std::optional<Imager> viewer_of(const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world);

/// Reads POSES.json (docs/formats.md). An unknown slot or variant is an error; a missing variant means the
/// slot's first one.
Result<PosedScene> load_poses(const std::filesystem::path& path, const Scene& scene);

}  // namespace limn::scene
