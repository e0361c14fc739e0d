#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <variant>

#include "core/marker.h"
#include "core/pose.h"
#include "core/result.h"
#include "scene/deviation_request.h"
#include "scene/material_override.h"
#include "scene/meshes/mesh.h"
#include "scene/room_light.h"
#include "scene/section.h"
#include "scene/show_state.h"

namespace limn::scene {

/// A request for an action, as text. It comes from a control marker, a key, a script or another program.
struct Edit {
  std::string action;  ///< Its name in actions().
  std::string slot;    ///< The slot of an action on a slot; for `screen` the screen's name (empty: all).
  std::string value;   ///< The value that the action takes; may be empty.
};

/// What an action takes as its value, as text.
enum class ArgumentKind {
  nothing,
  text,         ///< Required text.
  maybe_text,   ///< Text or nothing.
  number,       ///< "12.5"
  millimetres,  ///< Three numbers, "1 0 -2.5".
  pose,         ///< Seven numbers: x y z in mm and a quaternion w x y z, "120 0 -35.5 1 0 0 0".
  on_off        ///< "on", "off" or "toggle"; nothing means toggle.
};

/// How a switch is set.
enum class Switch { off, on, toggle };

/// A choice of what a screen shows.
struct ScreenChoice {
  std::string screen;           ///< A screen of the devices file; empty: all screens.
  std::optional<Screen> shows;  ///< Absent: the content after the present one.
};

/// Which line of light is switched, and how.
struct LineSwitch {
  std::string line;  ///< A line of the scene or a drawn one; empty: all.
  Switch wanted = Switch::toggle;
};

/// A change of a drawn line.
struct LineStroke {
  std::string line;  ///< Its name; empty: the line drawn last, or for draw_line a new one.
  Stroke stroke;
};
struct LineName {
  std::string line;  ///< As above.
  std::string new_name;
};

/// The unit of length of a part whose file was put into a slot's folder.
struct PartUnit {
  std::string words;  ///< The whole text as it was written.
  std::string part;
  LengthUnit unit = LengthUnit::metre;
};

/// An action's value after reading; the action determines its type.
using ActionValue = std::variant<std::monostate,
                                 std::string,
                                 double,
                                 Eigen::Vector3d,
                                 Pose,
                                 Switch,
                                 SectionChange,
                                 ScreenChoice,
                                 LineSwitch,
                                 LineStroke,
                                 LineName,
                                 PartUnit,
                                 std::optional<MarkerName>,
                                 MaterialOverride,
                                 DeviationRequest,
                                 std::optional<GreyWindow>,
                                 std::optional<LightNumbers>>;

// Readers of an edit's value, one for each type. Errors name the action, what it expects and what was found.
Result<std::monostate> read_nothing(const Edit& edit);  ///< Ignores the value.
Result<std::string> read_text(const Edit& edit);
Result<double> read_millimetre(const Edit& edit);            ///< mm
Result<Eigen::Vector3d> read_millimetres(const Edit& edit);  ///< mm
Result<Pose> read_place(const Edit& edit);                   ///< m
Result<Switch> read_switch(const Edit& edit);
Result<SectionChange> read_section_change(const Edit& edit);
Result<ScreenChoice> read_screen(const Edit& edit);
Result<LineSwitch> read_line_switch(const Edit& edit);
Result<LineStroke> read_line_stroke(const Edit& edit);  ///< m
Result<LineName> read_line_name(const Edit& edit);
Result<PartUnit> read_part_unit(const Edit& edit);
Result<std::optional<MarkerName>> read_marker(const Edit& edit);
Result<MaterialOverride> read_material(const Edit& edit);
Result<DeviationRequest> read_deviation(const Edit& edit);
Result<std::optional<GreyWindow>> read_window(const Edit& edit);
Result<std::optional<LightNumbers>> read_light(const Edit& edit);

}  // namespace limn::scene
