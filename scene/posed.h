#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/track.h"
#include "scene/scene.h"

namespace limn::scene {

/// A slot's part in its place.
struct PosedPart {
  std::string slot;
  std::string variant;
  Pose world_from_part;
};

/// A scene at a moment: where everything is and which variant each slot shows. A slot that is not seen, or
/// whose track is lost, is absent.
struct PosedScene {
  std::optional<Pose> world_from_prototype;
  std::vector<PosedPart> parts;
  std::optional<Eigen::Vector3d> p_eye_world = {};  ///< of the viewer, where a marker carries it
};

/// The scene as the tracks (bodies of `bodies(scene)`) place it; `variants[i]` is the chosen variant of slot
/// i (absent: its first). A part that sticks to the surface is laid onto the prototype's mesh: its marker's
/// centre at the likeliest point of the mesh, by the covariances of its track and the prototype's (a track
/// without one goes to the nearest point); its z axis along the inward normal there; turned as the marker is
/// turned.
PosedScene posed(const Scene& scene,
                 std::span<const Track> tracks,
                 std::span<const std::string> variants = {});

/// The viewer of a scene as posed: its fixed one, or one whose eye is where its marker says and that looks at
/// the middle of the prototype (of the parts without one), 1280 x 800 pixels and 40 degrees wide, with
/// `d_up_world` up. nullopt when there is none, or its marker was not seen.
std::optional<Imager> viewer_of(const Scene& scene,
                                const PosedScene& posed,
                                const Eigen::Vector3d& d_up_world);

/// POSES.json of interfaces.md. Unknown slots and variants are errors; a missing variant is the slot's first.
Result<PosedScene> load_poses(const std::filesystem::path& path, const Scene& scene);

}  // namespace limn::scene
