#pragma once

#include "core/enum_names.h"

namespace limn {

/// What a person does with a control marker.
enum class Gesture {
  cover,  ///< A hand rests on it.
  turn,   ///< It is turned about its own axis, step by step; clockwise is forwards.
  lay     ///< It is tipped over, or out of sight.
};
inline constexpr EnumNames<Gesture, 3> k_gestures{{"cover", "turn", "lay"}};

}  // namespace limn
