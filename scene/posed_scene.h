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

/// A slot's part in its place.
struct PosedPart {
  std::string slot;
  std::string variant;
  Pose world_from_part;
  MaterialOverride material = {};
};

/// A scene at a moment: where everything is and which variant each slot shows. A slot that is not seen, or
/// whose track is lost, is absent.
struct PosedScene {
  std::optional<Pose> world_from_prototype;
  std::vector<PosedPart> parts;
  std::vector<Viewpoint> viewpoints = {};  ///< of the viewers whose markers are seen and of fixed ones
  std::optional<RoomLight> light = {};     ///< absent: the scene's own
};

/// The scene as the tracks (bodies of `bodies(scene)`) place it; `variants[i]` is the chosen variant of slot
/// i (absent: its first). A part that sticks to the surface is laid onto the prototype's mesh: its marker's
/// centre at the likeliest point of the mesh, by the covariances of its track and the prototype's (a track
/// without one goes to the nearest point); its z axis along the inward normal there; turned as the marker is
/// turned.
PosedScene posed(const Scene& scene,
                 std::span<const Track> tracks,
                 std::span<const std::string> variants = {});

/// What viewers look at: the middle of the prototype, of the parts without one. nullopt: of nothing.
std::optional<Eigen::Vector3d> middle_of(const Scene& scene, const PosedScene& posed);

/// A viewer with its eye there, looking at the middle of the scene as posed, 1280 x 800 pixels and 40 degrees
/// wide, with `d_up_world` up; nullopt when there is nothing to look at.
std::optional<Imager> viewer_at(const Eigen::Vector3d& p_eye_world,
                                const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world);

/// The viewer of a scene as posed: its only one if that is fixed, else viewer_at the eye that the viewers
/// share once all is calm (for moments in a row: followed). nullopt when there is none, or none was seen.
std::optional<Imager> viewer_of(const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world);

/// POSES.json (docs/formats.md). An unknown slot or variant is an error; a missing variant is the first one.
Result<PosedScene> load_poses(const std::filesystem::path& path, const Scene& scene);

}  // namespace limn::scene
