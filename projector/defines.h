#pragma once

#include <array>
#include <initializer_list>

namespace limn::projector {

/// A name that shaders ask for with #ifdef.
enum class Define {
  by_measurement,  ///< light is balanced by the measured surface
  contact_shadow,  ///< parts darken the prototype around them
  known_shares,    ///< edges of a projector's image, whose shares of the light are kept
  listed,          ///< works through a list instead of rectangles
  surface_maps,    ///< materials have maps beyond their colour, or light of their own
  surface_parts,   ///< parts that lie on the prototype may be there
  view_parts       ///< parts that are drawn as the viewer sees them may be there
};

/// Each Define as shaders spell it, in the order of the enumeration.
inline constexpr std::array k_define_names = {"BY_MEASUREMENT", "CONTACT_SHADOW", "KNOWN_SHARES", "LISTED",
                                              "SURFACE_MAPS",   "SURFACE_PARTS",  "VIEW_PARTS"};

/// The names that a shader is compiled with.
class Defines {
 public:
  constexpr Defines() = default;
  constexpr Defines(std::initializer_list<Define> defines) {
    for (const Define define : defines) bits_ |= bit(define);
  }
  constexpr bool contains(Define define) const { return (bits_ & bit(define)) != 0; }
  constexpr Defines operator+(Defines other) const {
    other.bits_ |= bits_;
    return other;
  }

 private:
  static constexpr unsigned bit(Define define) { return 1U << static_cast<unsigned>(define); }
  unsigned bits_ = 0;
};

}  // namespace limn::projector
