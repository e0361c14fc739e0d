#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/track.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::scene {

/// What a large screen shows.
enum class Screen {
  rest,    ///< camera image and what light cannot show
  full,    ///< camera image and whole parts
  camera,  ///< camera image alone
  view,    ///< prototype and parts from the viewer's eye
  stereo,  ///< the same for two eyes, side by side
  off
};
const std::vector<std::string>& screen_names();  ///< in the order of Screen

/// An arrangement to come back to: which variants, where they stood on the prototype, of which materials and
/// in which light.
struct Look {
  struct Part {
    std::string slot;
    std::string variant;
    Pose prototype_from_part;  ///< world_from_part in a scene without a prototype
    MaterialOverride material = {};
  };
  std::string name;
  std::vector<Part> parts;
  std::optional<RoomLight> light = {};  ///< absent: the scene's own
};

/// A part held where a look had it, until its marker is moved.
struct Pin {
  Pose prototype_from_part;
  std::optional<Pose> prototype_from_marker;  ///< where the marker stood then; absent until it is seen
};

/// A screen of the session's devices, and what it shows.
struct Output {
  std::string name;
  Screen shows = Screen::rest;
};

/// What the people around the prototype have chosen, on top of what the project's files say.
struct ShowState {
  struct Slot {
    std::string variant;
    Eigen::Vector3d nudge = Eigen::Vector3d::Zero();  ///< along the part's own axes, m
    std::optional<Pin> pin;
    std::optional<MarkerName> marker;  ///< carries the part instead of the scene's own
    MaterialOverride material = {};    ///< of whichever variant is shown
  };
  std::vector<Slot> slots;  ///< in the scene's order
  std::vector<Look> looks;
  std::string look;                  ///< the one last saved or restored; empty: none
  std::string other_look;            ///< the one before it, which flip comes back to
  std::optional<Look> deleted_look;  ///< the last one deleted, which can come back
  bool blackout = false;             ///< bare model: projectors give no light
  bool frozen = false;               ///< what is shown stays as it is
  bool marker_states = false;        ///< rings around markers say how they are tracked
  bool grid = false;                 ///< lines on the prototype, every 10 mm
  bool split = false;                ///< left of a line the other look, right of it what is shown else
  double split_mm = 0;               ///< where the line is, along the prototype's x, from its middle
  Screen screen = Screen::rest;      ///< what was last chosen for all screens
  std::vector<Output> screens = {};  ///< the session's, in the order of its devices file
  std::optional<RoomLight> light;    ///< instead of the scene's own
  Eigen::Vector3d d_up_world = Eigen::Vector3d::UnitZ();      ///< for `light` in a scene that has none
  Eigen::Vector3d d_front_world = -Eigen::Vector3d::UnitY();  ///< towards those who look, for `light`
  std::string viewer;  ///< a guest, for whose tablet `view` parts are drawn; empty: the scene's own viewers
};

/// Each slot's first variant, no looks.
ShowState initial_show_state(const Scene& scene);

/// The names of the looks, in their order.
std::vector<std::string> look_names(const ShowState& show_state);
/// Whether a look may have the name: it is also a file's.
bool is_look_name(const std::string& name);
/// The look of that name; nullptr: there is none.
const Look* find_look(const ShowState& show_state, const std::string& name);
/// The show state with a look's parts where the look has them, in its light; it is then the look last shown.
ShowState with_look(const Scene& scene, ShowState show_state, const Look& look);
/// Makes it the look last shown; the one before it is the other one.
void remember_look(const std::string& name, ShowState* show_state);

/// What a screen shows; one that the show state does not know: what was chosen for all.
Screen screen_content(const ShowState& show_state, const std::string& screen);

/// The marker that carries a slot's part.
const MarkerName& slot_marker(const Scene& scene, const ShowState& show_state, std::size_t slot);

/// Whether a marker may carry a slot's part. Error: it is of no family that the scene uses, or carries or
/// does something else.
Status check_carrier(const Scene& scene,
                     const ShowState& show_state,
                     const MarkerName& marker,
                     std::size_t slot);

/// Tracks by what they carry: a slot's is its carrier's, under the slot's name; loose markers keep theirs.
std::vector<Track> assign_tracks(const Scene& scene,
                                 const ShowState& show_state,
                                 std::span<const Track> tracks);

/// The show state once pins have gone of parts whose marker was moved on the prototype by more than 10 mm or
/// 5 degrees since it was first seen under the pin. Tracks as of carried().
ShowState without_moved_pins(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks);

/// The scene as tracks (carried()) and people place it: posed() with the chosen variants, nudged, pinned
/// parts where their look had them, in the materials and the light that people chose.
PosedScene compose_scene(const Scene& scene, const ShowState& show_state, std::span<const Track> tracks);

/// What is left of a line shows the other look: the same show state as it. Nothing without one.
std::optional<ShowState> left_of_split(const Scene& scene, const ShowState& show_state);

/// limn.pairings/1: the slots that other markers than the scene's carry. As text, empty when there are none;
/// and into a staging. Errors: unknown slots, families that the scene does not use, a marker used twice.
std::string pairings_json(const Scene& scene, const ShowState& show_state);
Result<ShowState> with_pairings(const std::filesystem::path& path, const Scene& scene, ShowState show_state);

/// limn.look/1 as text, and back. A look without materials or light has the files' own. Error: unknown slots
/// or variants, numbers that are no pose, material or light.
std::string look_json(const Look& look);
Result<Look> load_look(const std::filesystem::path& path, const Scene& scene);

}  // namespace limn::scene
