#pragma once

#include <array>
#include <initializer_list>

namespace limn::projector {

/// A name that shaders test with #ifdef.
enum class Define {
  by_measurement,  ///< Light is compensated by the measured surface (Compensation::measured).
  contact_shadow,  ///< Parts cast contact shadows on the prototype.
  cached_shares,   ///< The image is a projector's: its blending shares are in the hit cache.
  work_list,       ///< The shader processes a pixel list instead of rectangles.
  surface_maps,    ///< Materials have maps besides their colour, or emit light.
  finish,          ///< The prototype has a finish or lines.
  clearcoat,       ///< Materials have a clear layer.
  second_uvs,      ///< Textures lie in second texture coordinates.
  vertex_colours,  ///< Meshes have colours at their corners.
  room_image,      ///< A picture of the room lights parts.
  section,         ///< A plane may cut what is seen.
  volumes,         ///< Caps may show slices of volumes.
  count_cap,       ///< The program counts surfaces for caps.
  surface_parts,   ///< Surface parts (lying on the prototype) may be visible.
  view_parts       ///< View parts (drawn for the viewer's position) may be visible.
};

/// Each Define as shaders spell it, in the order of the enumeration.
inline constexpr std::array k_define_names = {
    "BY_MEASUREMENT", "CONTACT_SHADOW", "CACHED_SHARES", "WORK_LIST",      "SURFACE_MAPS",
    "FINISH",         "CLEARCOAT",      "SECOND_UVS",    "VERTEX_COLOURS", "ROOM_IMAGE",
    "SECTION",        "VOLUMES",        "COUNT_CAP",     "SURFACE_PARTS",  "VIEW_PARTS"};

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
