#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <variant>

#include "core/marker.h"
#include "core/pose.h"
#include "core/result.h"
#include "scene/material_override.h"
#include "scene/room_light.h"
#include "scene/show_state.h"

namespace limn::scene {

/// One action of a person, as text: by control marker, key, script or another program.
struct Edit {
  std::string action;  ///< by its name in actions()
  std::string slot;    ///< of actions on a slot; of `screen`: the one that is meant, empty: all
  std::string value;   ///< as the action wants it; may be empty
};

/// What an action takes as its value, as text.
enum class ArgumentKind {
  nothing,
  text,         ///< required
  maybe_text,   ///< or nothing
  number,       ///< "12.5"
  millimetres,  ///< three numbers, "1 0 -2.5"
  pose,         ///< seven: x y z in mm and a quaternion w x y z, "120 0 -35.5 1 0 0 0"
  on_off        ///< "on", "off", "toggle"; nothing: toggle
};

/// Where a switch goes.
enum class Switch { off, on, toggle };

/// What a screen is to show.
struct ScreenChoice {
  std::string screen;           ///< of the devices file; empty: all
  std::optional<Screen> shows;  ///< absent: the next one
};

/// The unit of length of a part that was dropped in.
struct PartUnit {
  std::string words;  ///< as they were written
  std::string part, unit;
};

/// An action's value once it was read; which kind is the action's affair.
using ActionValue = std::variant<std::monostate,
                                 std::string,
                                 double,
                                 Eigen::Vector3d,
                                 Pose,
                                 Switch,
                                 ScreenChoice,
                                 PartUnit,
                                 std::optional<MarkerName>,
                                 MaterialOverride,
                                 std::optional<LightNumbers>>;

/// The value of an edit, once for each kind. Errors name the action, what it expects and what was found.
Result<std::monostate> read_nothing(const Edit& edit);  ///< whatever stands there
Result<std::string> read_text(const Edit& edit);
Result<double> read_millimetre(const Edit& edit);            ///< mm
Result<Eigen::Vector3d> read_millimetres(const Edit& edit);  ///< mm
Result<Pose> read_place(const Edit& edit);                   ///< m
Result<Switch> read_switch(const Edit& edit);
Result<ScreenChoice> read_screen(const Edit& edit);
Result<PartUnit> read_part_unit(const Edit& edit);
Result<std::optional<MarkerName>> read_marker(const Edit& edit);
Result<MaterialOverride> read_material(const Edit& edit);
Result<std::optional<LightNumbers>> read_light(const Edit& edit);

}  // namespace limn::scene
