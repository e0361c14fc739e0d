#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/track.h"
#include "scene/deviation_layer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::scene {

/// What a large screen shows.
enum class Screen {
  rest,    ///< The camera image and what projected light cannot show.
  full,    ///< The camera image and whole parts.
  camera,  ///< The camera image alone.
  view,    ///< The prototype and parts from the viewpoint.
  stereo,  ///< As `view`, for two eyes, side by side.
  off
};
const std::vector<std::string>& screen_names();  ///< In the order of Screen.

/// A saved arrangement: which variants, where on the prototype, of which materials and in which light.
struct Look {
  struct Part {
    std::string slot;
    std::string variant;
    Pose prototype_from_part;  ///< In a scene without a prototype: world_from_part.
    MaterialOverride material = {};
    std::optional<GreyWindow> window = {};  ///< How a volume is shown; absent: as the scene or its file says.
  };
  std::string name;
  std::vector<Part> parts;
  std::optional<RoomLight> light = {};  ///< Absent: the scene's own light.
  std::string finish = {};              ///< The prototype's finish; empty: none.
  /// The plane that cuts parts, in the prototype's frame, as the poses; absent: all is whole.
  std::optional<CutPlane> cut = {};
  /// The names of the lines that it shows; absent in older files: those that the scene shows at first.
  std::optional<std::vector<std::string>> lines = {};
  std::vector<DrawnLine> drawn = {};  ///< The drawn ones among these lines.
};

/// A part's pose that is held until its marker is moved.
struct Pin {
  Pose prototype_from_part;
  /// The marker's pose when it was first seen under the pin; absent until then.
  std::optional<Pose> prototype_from_marker;
};

/// A screen of the session's devices, and what it shows.
struct Output {
  std::string name;
  Screen shows = Screen::rest;
};

/// How the prototype is compared with its CAD, and whether the result is shown (action `deviation`).
struct DeviationChoice {
  std::shared_ptr<const DeviationLayer> layer;  ///< The newest result; null: there is none.
  bool is_shown = false;                        ///< Only with a result.
  bool is_held = false;                         ///< Later scans keep the alignment of the newest result.
  /// The alignment is refined on the scan inside this box (prototype's frame, m).
  std::optional<Eigen::AlignedBox3d> fit_box = {};
  double tolerance_m = 0.5e-3;
};

/// What people have chosen during a session, in addition to the project's files.
struct ShowState {
  struct Slot {
    std::string variant;
    Eigen::Vector3d nudge = Eigen::Vector3d::Zero();  ///< Shift along the part's own axes, m.
    std::optional<Pin> pin;
    std::optional<MarkerName> marker;       ///< Marker that carries the part instead of the scene's own.
    MaterialOverride material = {};         ///< Applies to all variants of the slot.
    std::optional<GreyWindow> window = {};  ///< Applies to all volumes of the slot; absent: each has its own.
  };
  std::vector<Slot> slots;  ///< In the scene's order.
  std::vector<Look> looks;
  std::string look;                  ///< The look last saved or restored; empty: none.
  std::string other_look;            ///< The look before it, to which `flip` returns.
  std::optional<Look> deleted_look;  ///< The last deleted look, which can be restored.
  bool blackout = false;             ///< Projectors give no light: the bare prototype.
  bool frozen = false;               ///< What is shown does not change.
  bool marker_states = false;        ///< Rings around markers show how they are tracked.
  bool grid = false;                 ///< Lines on the prototype, every 10 mm.
  bool split = false;            ///< Compare: the other look on the left of a line, the present one right.
  double split_mm = 0;           ///< Position of the line along the prototype's x, from its middle.
  Screen screen = Screen::rest;  ///< The last choice for all screens.
  std::vector<Output> screens = {};  ///< The session's screens, in the order of its devices file.
  std::optional<RoomLight> light;    ///< Light instead of the scene's own.
  std::string finish;                ///< The prototype's finish, of Scene::finishes; empty: none.
  SectionState section = {};
  std::vector<std::string> lines;  ///< The lines that are shown: names in Scene::lines and `drawn`.
  std::vector<DrawnLine> drawn;    ///< Lines that were drawn in the session, or came with a look.
  DeviationChoice deviation = {};  ///< Not part of looks.
  Eigen::Vector3d d_up_world = Eigen::Vector3d::UnitZ();      ///< Up for `light` if the scene has no light.
  Eigen::Vector3d d_front_world = -Eigen::Vector3d::UnitY();  ///< Towards the viewers, for `light`.
  /// A guest for whose tablet `view` parts are drawn; empty: the scene's own viewers.
  std::string viewer;
};

/// The show state at the start: each slot's first variant, no looks.
ShowState initial_show_state(const Scene& scene);

/// The names of the looks, in their order.
std::vector<std::string> look_names(const ShowState& show_state);
/// Whether a look may have this name, which is also used as a file name.
bool is_look_name(const std::string& name);
/// The look of that name; null when there is none.
const Look* find_look(const ShowState& show_state, const std::string& name);
/// The drawn lines that are shown.
std::vector<DrawnLine> shown_drawn_lines(const ShowState& show_state);
/// The show state with the look's variants, poses, materials, finish, lines, light and cut, which is held.
/// The look becomes the one last shown.
ShowState with_look(const Scene& scene, ShowState show_state, const Look& look);
/// Makes it the look last shown; the former one becomes `other_look`.
void remember_look(const std::string& name, ShowState* show_state);

/// What a screen shows; for an unknown screen, the last choice for all screens.
Screen screen_content(const ShowState& show_state, const std::string& screen);

/// The marker that carries a slot's part.
const MarkerName& slot_marker(const Scene& scene, const ShowState& show_state, std::size_t slot);

/// Whether a marker may carry a slot's part. Error: the scene does not use its family, or the marker already
/// carries or controls something else.
Status check_carrier(const Scene& scene,
                     const ShowState& show_state,
                     const MarkerName& marker,
                     std::size_t slot);

/// Renames tracks by what their marker carries: the track of the marker that carries a slot gets the slot's
/// name. Tracks of other bodies and of loose markers keep their names. The track of a slot's own marker is
/// dropped when that marker carries nothing.
std::vector<Track> assign_tracks(const Scene& scene,
                                 const ShowState& show_state,
                                 std::span<const Track> tracks);

/// The show state without the pins of parts whose marker was moved on the prototype by more than 10 mm or
/// 5 degrees since it was first seen under the pin. `tracks` come from assign_tracks().
ShowState without_moved_pins(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks);

/// The show state with the plane of the section where its marker is measured, unless the plane is held.
/// `tracks` are those at the newest image.
ShowState with_section_seen(const Scene& scene, ShowState show_state, std::span<const Track> tracks);

/// The scene at a moment, from tracks (of assign_tracks()) and the show state: posed() with the chosen
/// variants, nudges, pins, materials, finish, lines and light. The cut follows the section's marker while it
/// is seen and was within k_section_follows_s; else it is the plane that is held or was seen last.
PosedScene compose_scene(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks);

/// Seconds after its newest image for which the section's marker is predicted; later its plane stays.
constexpr double k_section_follows_s = 0.2;

/// The show state that is drawn on the left of the split line: this one with the other look. Nullopt without
/// a split or another look.
std::optional<ShowState> left_of_split(const Scene& scene, const ShowState& show_state);

/// The text of a limn.pairings/1 file: the slots that are carried by other markers than the scene's; empty
/// when there are none. with_pairings() reads the file into a show state. Errors: unknown slots, families
/// that the scene does not use, a marker used twice.
std::string pairings_json(const Scene& scene, const ShowState& show_state);
Result<ShowState> with_pairings(const std::filesystem::path& path, const Scene& scene, ShowState show_state);

/// The text of a limn.look/1 file; load_look() reads it. A look without materials or light uses those of the
/// project's files. Error: unknown slots, variants or finishes, points that are no line, or
/// numbers that are not a pose, material or light.
std::string look_json(const Look& look);
Result<Look> load_look(const std::filesystem::path& path, const Scene& scene);

}  // namespace limn::scene
