#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "core/result.h"
#include "scene/mesh.h"
#include "scene/room_light.h"

namespace limn::scene {

/// The physical thing that is lit. Its frame is its mesh's.
struct Prototype {
  Mesh mesh;
  std::vector<BodyMarker> markers;  ///< body_from_marker is prototype_from_marker
  double albedo = 0.8;              ///< diffuse, when no image is given
  cv::Mat albedo_image;             ///< 8-bit BGR sRGB in the mesh's uv; empty: none
};

enum class Mode {
  view,    ///< drawn as seen from the viewer's eye (stands off the surface)
  surface  ///< drawn on the surface itself, the same for every viewer
};

struct Variant {
  /// A mesh that was dropped into the slot's folder.
  struct AutoImported {
    std::string units;
    bool is_guess = true;  ///< nobody has said that unit
  };
  std::string name;
  Mesh mesh;
  std::optional<AutoImported> auto_imported = {};
};

/// A place for one part, carried by one marker.
struct Slot {
  std::string name;
  MarkerName marker;
  double size_m = 0;
  Pose marker_from_part;
  Mode mode = Mode::view;
  bool stick_to_surface = false;
  std::vector<Variant> variants;
};

/// A marker that acts when covered, turned or laid down.
struct Control {
  MarkerName marker;
  std::string action;
  std::string slot;
  std::string gesture;
};

/// Whose eye `view` parts are drawn for: a fixed imager's, one that stands by a marker (on glasses, on a
/// cap), or a guest's tablet.
struct Viewer {
  double weight = 1;  ///< among several
  std::optional<Imager> fixed;
  std::optional<MarkerName> marker;
  double marker_size_m = 0;
  Eigen::Vector3d p_eye_marker = Eigen::Vector3d::Zero();  ///< the eye in the marker's frame
  /// The guest's name; empty: each guest's is a viewer.
  std::optional<std::string> tablet = {};
};

/// What is shown: a project folder's scene.json (limn.scene/1), read with everything that it names.
struct Scene {
  std::filesystem::path folder;
  std::optional<Prototype> prototype;  ///< absent: parts over a camera image only
  std::vector<Slot> slots;
  std::vector<Control> controls;
  std::vector<Viewer> viewers;     ///< several share one eye (scene/viewpoint.h)
  std::optional<RoomLight> light;  ///< absent: soft light and a lamp that stand with the viewer

  const Slot* find_slot(const std::string& name) const;
  /// The viewer that a guest's tablet is: the one of that name, else the one for all; null: it is none.
  const Viewer* find_tablet(const std::string& guest) const;
};

/// A variant whose mesh cannot be loaded, and why.
struct SkippedVariant {
  std::string slot, variant, why;
};

/// `path` is the scene.json or its folder. Meshes in its folder slots/NAME/ are variants of slot NAME, too,
/// called as their files; their units are those of slots/NAME/units.json (limn.units/1), else guessed and
/// told. A variant that cannot be loaded is an error; with `skipped_variants` it is named there and left out
/// instead, and a slot that has no other, with its controls, too.
Result<Scene> load_scene(const std::filesystem::path& path,
                         std::vector<SkippedVariant>* skipped_variants = nullptr);

/// A question for people about a dropped variant whose unit is a guess, and how to answer it; empty for
/// others.
std::string units_question(const Slot& slot, const Variant& variant);
/// slots/NAME/units.json with one more answer.
std::string units_json(const Slot& slot, const std::string& variant, const std::string& units);

/// A viewer file (docs/formats.md): {"world_from_viewer": POSE, "size": [w,h], "fov_deg": 40}.
Result<Imager> load_viewer(const std::filesystem::path& path);

/// What the tracker is to look for: the body "prototype", one body per slot, named as the slot, and
/// viewer_body(i) where a marker carries viewer i's eye.
std::vector<Body> bodies(const Scene& scene);
/// No slot's name.
std::string viewer_body(std::size_t viewer);
/// The body of a marker that carries nothing in the scene; no slot's name either.
std::string loose_body(const MarkerName& marker);
bool is_loose_body(const std::string& body);

}  // namespace limn::scene
