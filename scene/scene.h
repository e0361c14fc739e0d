#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/constellation.h"
#include "core/gesture.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/result.h"
#include "scene/action_id.h"
#include "scene/finish.h"
#include "scene/lines/drape.h"
#include "scene/lines/line.h"
#include "scene/lines/outline.h"
#include "scene/meshes/mesh.h"
#include "scene/pen.h"
#include "scene/room_image.h"
#include "scene/room_light.h"
#include "scene/section.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// The physical object that is lit. Its coordinate frame is its mesh's.
struct Prototype {
  Mesh mesh;
  std::vector<BodyMarker> markers;                  ///< body_from_marker is prototype_from_marker.
  double albedo = 0.8;                              ///< Diffuse albedo, used without albedo_image.
  cv::Mat albedo_image;                             ///< 8-bit BGR sRGB in the mesh's uv; empty: none.
  std::optional<Constellation> constellation = {};  ///< Balls instead of markers, in the prototype's frame.
};

enum class Mode {
  view,    ///< Drawn as seen from the viewpoint, so that it can stand out from the surface.
  surface  ///< Drawn on the surface itself, the same for every viewer.
};

struct Variant {
  /// A mesh whose file people put into the slot's folder.
  struct AutoImported {
    std::optional<LengthUnit> units = LengthUnit::metre;  ///< Absent: the unit that the file states.
    bool is_guess = true;  ///< Whether the unit is a guess, neither a person's answer nor the file's.
  };
  std::string name;
  Mesh mesh;
  std::optional<AutoImported> auto_imported = {};
  /// Where it is the same file with other materials: the name of the variant with the file's default ones.
  std::string default_variant = {};
  /// The values that are shown where a plane cuts the part; then `mesh` is the box around them. Null: none.
  std::shared_ptr<const Volume> volume = {};
  std::optional<GreyWindow> window = {};  ///< How they are shown; absent: as their file says.
};

/// A place for one part, carried by one marker or constellation.
struct Slot {
  std::string name;
  MarkerName marker;  ///< `constellation:FILE` means balls.
  double size_m = 0;  ///< The marker's side; 0 for a constellation.
  Pose marker_from_part;
  Mode mode = Mode::view;
  bool stick_to_surface = false;
  std::vector<Variant> variants;
  std::optional<Constellation> constellation = {};  ///< The balls of `marker`, whose frame is their file's.
};

/// A marker that triggers an action when it is covered, turned or laid down.
struct Control {
  MarkerName marker;
  ActionId action = ActionId::next_variant;
  std::string slot;
  Gesture gesture = Gesture::cover;
  std::string value = {};  ///< The value that it sends; only of the control that a section's marker is.
};

/// A viewer that `view` parts are drawn for: a fixed imager, a person's eye relative to a marker (on glasses,
/// on a cap) or where another tracking system states it, or a guest's tablet.
struct Viewer {
  double weight = 1;  ///< Weight among several viewers.
  std::optional<Imager> fixed;
  std::optional<MarkerName> marker;
  double marker_size_m = 0;
  /// The viewer has no marker; another tracking system gives its pose (docs/trackers.md).
  bool is_tracked = false;
  /// The eye's position in the frame of the marker or of the tracked body.
  Eigen::Vector3d p_eye_marker = Eigen::Vector3d::Zero();
  /// The guest's name; empty: the tablet of every guest is a viewer.
  std::optional<std::string> tablet = {};
  std::optional<Constellation> constellation = {};  ///< The balls of `marker`.
};

/// The content of a project folder's scene.json (limn.scene/1), with all files that it names.
struct Scene {
  std::filesystem::path folder;
  std::optional<Prototype> prototype;  ///< Absent: parts are shown over a camera image only.
  std::vector<Slot> slots;
  std::vector<Control> controls;      ///< The last one is the section's marker, if there is a section.
  std::vector<Viewer> viewers;        ///< Several share one viewpoint (scene/viewpoint.h).
  std::vector<Finish> finishes = {};  ///< What the prototype can be painted with in light.
  std::vector<Line> lines = {};       ///< Lines of light on the prototype.
  /// Lays further lines on the prototype; null in a scene that was not loaded, or has no prototype.
  std::shared_ptr<const Drape> drape = {};
  std::shared_ptr<const Outlines> outlines = {};  ///< The parts' outlines on the prototype; likewise null.
  std::optional<RoomLight> light;            ///< Absent: soft light and a lamp that move with the viewer.
  std::optional<RoomImage> room_image = {};  ///< What RoomLight::image_strength is about.
  std::optional<Section> section = {};       ///< What cuts parts open.
  std::optional<Pen> pen = {};               ///< What draws lines on the prototype.

  const Slot* find_slot(const std::string& name) const;
  /// The viewer for a guest's tablet: the one with the guest's name, else the one for every guest. Null when
  /// the tablet is not a viewer.
  const Viewer* find_tablet(const std::string& guest) const;
};

std::vector<std::string> finish_names(const Scene& scene);
/// The lines that a session shows at first.
std::vector<std::string> first_lines(const Scene& scene);

/// What is left out of a scene, and why: a variant whose mesh cannot be loaded, or (named by its whole file
/// name) something in slots/ that is no variant.
struct SkippedVariant {
  std::string slot, variant, why;
  bool is_first = false;  ///< Whether the slot would show it at first.
};
/// "VARIANT of slot SLOT is left out: WHY"
std::string to_text(const SkippedVariant& skipped);

/// Whether slots of which no variant can be loaded stay in the scene.
enum class EmptySlots { left_out, kept };

/// Reads a scene; `path` is the scene.json or its folder. Meshes and volumes in slots/NAME/ of the folder
/// become variants of slot NAME, named after their files. The material variants of a file
/// (KHR_materials_variants) become variants, too, named "NAME VARIANT"; NAME itself has the file's default
/// materials. Their units are those of slots/NAME/units.json (limn.units/1), or those that the files state,
/// or are guessed, with a message. A variant that cannot be loaded is an error. With `skipped_variants` it is
/// instead left out and listed there; a slot without any variant is then left out with its controls. What is
/// no variant in slots/ is listed there, too, or else reported as a warning.
Result<Scene> load_scene(const std::filesystem::path& path,
                         std::vector<SkippedVariant>* skipped_variants = nullptr,
                         EmptySlots empty_slots = EmptySlots::left_out);

/// As load_scene; what is left out is reported as warnings.
Result<Scene> load_usable_scene(const std::filesystem::path& path);

/// Removes the slots without variants, and their controls.
void leave_out_empty_slots(Scene* scene);

/// Reads a viewer file (docs/formats.md): {"world_from_viewer": POSE, "size": [w,h], "fov_deg": 40}.
Result<Imager> load_viewer(const std::filesystem::path& path);

/// The bodies that carry square markers, for the tracker: "prototype", one body per slot, with the slot's
/// name, viewer_body(i) for each viewer i with a marker, section_body() for the section's marker, and
/// pen_body() for the pen's.
std::vector<Body> bodies(const Scene& scene);
/// The bodies that carry balls, with the same names, in their bodies' frames.
std::vector<Constellation> constellations(const Scene& scene);
/// The names of all bodies, those with markers first.
std::vector<std::string> body_names(const Scene& scene);
/// The side of the first slot's square marker, m; 0 when no slot has one.
double first_marker_size_m(const Scene& scene);
/// The body's name of a viewer's marker. It differs from every slot's name.
std::string viewer_body(std::size_t viewer);
/// The body's name of the section's marker. It differs from every slot's name.
const std::string& section_body();
/// The body's name of the pen's marker. It differs from every slot's name.
const std::string& pen_body();
/// The body's name of a marker that carries nothing in the scene. It differs from every slot's name.
std::string loose_body(const MarkerName& marker);
bool is_loose_body(const std::string& body);

}  // namespace limn::scene
