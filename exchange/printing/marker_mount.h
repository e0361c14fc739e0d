#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn::exchange {

struct MountOptions {
  double size_mm = 40;    ///< Side of the black square.
  double margin_mm = 5;   ///< White paper around it, up to the frame that `limn markers` draws to cut along.
  double paper_mm = 0.1;  ///< Thickness of paper and glue: plain paper of 80 g/m2 is 0.1 mm.
  std::filesystem::path out;  ///< .stl; the pose is written beside it as .json.
};

/// A holder for one printed marker. Holder frame: origin at the centre of the flat back; seen from the front,
/// x is right and y is up; z points out of the face. It is printed lying on its back. The paper lies between
/// guides at the corners; the guide at the marker's top-left corner has a shorter arm along the top.
struct Mount {
  std::vector<Eigen::Vector3f> points_mm;
  /// Counter-clockwise seen from outside; one closed surface.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Pose holder_from_marker;                    ///< Translation in metres.
  double paper_side_mm = 0;                   ///< Side of the paper to cut: black square and margins.
  double side_mm = 0, plate_mm = 0;           ///< Side of the holder; distance from back to face.
  double guide_mm = 0;                        ///< Height of the guides above the face.
  double socket_mm = 0, socket_depth_mm = 0;  ///< Bore in the back: diameter, length of the straight part.
};

/// The guides are so low that a camera 75 degrees off the marker's axis still sees half of the white margin
/// behind them. The plate's thickness is a twentieth of the paper's side, or more if the bore needs it. No
/// overhang is steeper than 45 degrees.
Mount marker_mount(const MountOptions& options);

/// Writes the holder as binary STL (mm) and its JSON (limn.mount/1, config/README.md), and prints the pose.
/// Wrong usage: a size outside 3..152 mm (what fits on A4), paper outside 0..2 mm, another file extension
/// than .stl.
Status run_mount(const MountOptions& options);

}  // namespace limn::exchange
