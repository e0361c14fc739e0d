#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn::apps {

struct MountOptions {
  double size_mm = 40;        ///< side of the black square
  double margin_mm = 5;       ///< white paper around it, as `limn markers` draws the frame to cut along
  double paper_mm = 0.1;      ///< thickness of paper and glue: plain paper of 80 g/m2 is 0.1 mm
  std::filesystem::path out;  ///< .stl; the pose goes beside it, .json
};

/// A holder for one printed marker. Holder frame: origin at the centre of the flat back, x right and y up as
/// one looks at the marker, z out of the face; it is printed lying on its back. The paper lies between guides
/// at the corners; the one at the marker's top-left corner has a shorter arm along the top.
struct Mount {
  std::vector<Eigen::Vector3f> points_mm;
  std::vector<std::array<std::uint32_t, 3>>
      triangles;                              ///< counter-clockwise from outside; one closed surface
  Pose holder_from_marker;                    ///< m
  double paper_side_mm = 0;                   ///< to cut to: black square and margins
  double side_mm = 0, plate_mm = 0;           ///< outer square; back to face
  double guide_mm = 0;                        ///< height of the guides above the face
  double socket_mm = 0, socket_depth_mm = 0;  ///< bore in the back: diameter, straight part
};

/// The guides are so low that a camera 75 degrees off the marker's axis still sees half of the white margin
/// behind them; the plate is a twentieth of its paper thick, or what the bore needs. Nothing hangs over by
/// more than 45 degrees.
Mount marker_mount(const MountOptions& options);

/// Writes the holder as binary STL (mm) and its JSON (limn.mount/1, config/README.md), prints the pose. Wrong
/// usage: a size outside 3..152 mm (what A4 holds), paper outside 0..2 mm, another ending than .stl.
Status run_mount(const MountOptions& options);

}  // namespace limn::apps
