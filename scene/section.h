#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/enum_names.h"
#include "core/marker.h"
#include "core/pose.h"

namespace limn::scene {

/// A plane that cuts parts open, in a frame that the member's name states: p is on it if normal · p is
/// offset_m. What lies on the side to which the normal points is removed.
struct CutPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< Unit length.
  double offset_m = 0;
  bool operator==(const CutPlane&) const = default;
};

/// The plane z = 0 of a frame; what lies at z < 0 is removed. For a marker, whose z points into the paper,
/// this is what lies in front of it.
CutPlane cut_plane(const Pose& a_from_plane);
/// The same plane in frame a.
CutPlane transformed(const Pose& a_from_b, const CutPlane& in_b);
/// The same plane, with the other side removed.
CutPlane flipped(const CutPlane& plane);
/// Distance of a point from the plane, m; positive where parts are removed.
double height_over(const CutPlane& plane, const Eigen::Vector3d& p);
/// Whether it is a plane: all numbers are finite, and the normal has unit length.
bool is_plane(const CutPlane& plane);

/// A marker whose plane cuts parts open (`section` of a scene.json, config/README.md).
struct Section {
  MarkerName marker;
  double size_m = 0;               ///< The marker's side.
  Pose marker_from_plane = {};     ///< The plane is z = 0 of this frame, as in cut_plane().
  std::vector<std::string> slots;  ///< The slots whose parts it cuts.
  bool cuts_prototype = true;      ///< In views, which draw the prototype; never in projected light.
  double hatch_m = 0.006;          ///< Distance between the lines on a cap.
  Eigen::Vector3d cap_colour = {0.72, 0.62, 0.42};  ///< Linear red, green and blue; not shaded.

  /// Width and height of a white card on which the marker is: the slices of volumes are painted on it in
  /// light. Its middle is the origin of the plane's frame, x right, y down. Absent: there is none.
  std::optional<Eigen::Vector2d> card_size_m = {};

  bool cuts(const std::string& slot) const;
};

/// Width of a line on a cap, as a share of the lines' distance, and its colour, as a share of the cap's.
constexpr double k_hatch_line = 0.2, k_hatch_colour = 0.35;

/// The unit direction across the lines on the cap of a part, in the part's frame: the lines are where its
/// product with p, divided by hatch_m, has a fractional part below k_hatch_line. It depends on nothing but
/// the plane's normal in the part's frame, so that the lines stay where they are in the part while the plane
/// is shifted. `owner`: 0 the prototype, else the slot's index + 1; neighbours have other directions.
Eigen::Vector3d across_hatch(const Eigen::Vector3d& normal_part, int owner);

/// Reads `section` of a scene except its marker and slots. Problems are recorded at the node.
Section read_section(const ConfigNode& node);

/// A cut plane in JSON: {"normal": [0, 0, 1], "offset_mm": 12}. Any length of the normal except 0 is
/// accepted.
CutPlane read_cut_plane(const ConfigNode& node);

/// What people have chosen about the scene's section.
struct SectionState {
  bool is_on = false;
  bool is_held = false;     ///< The plane stays in the prototype; else it follows its marker.
  bool is_flipped = false;  ///< The side behind the marker is removed.
  /// The plane that is held or was seen last, in the prototype's frame (in the world if the scene has no
  /// prototype). Absent: its marker has not been seen yet.
  std::optional<CutPlane> plane;
};

/// How `section` changes.
enum class SectionChange {
  toggle,
  on,
  off,
  hold,
  release,
  flip,
  cover  ///< As covering its marker: holds the plane, or releases it; turns the section on if it is off.
};
inline constexpr EnumNames<SectionChange, 7> k_section_changes{
    {"toggle", "on", "off", "hold", "release", "flip", "cover"}};
/// The state after a change.
SectionState changed(SectionState state, SectionChange change);

}  // namespace limn::scene
