#include "remote/glasses/part_cut.h"

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>

namespace limn::remote {
namespace {

constexpr double k_steps = 1e5;  // in 1 and in a metre

nlohmann::ordered_json rounded(const Eigen::Vector3d& v, double steps) {
  return {std::round(v.x() * steps) / steps, std::round(v.y() * steps) / steps,
          std::round(v.z() * steps) / steps};
}

}  // namespace

nlohmann::ordered_json part_cut_json(const scene::Section& section,
                                     const scene::CutPlane& plane_part,
                                     int owner) {
  const Eigen::Vector3d across = scene::across_hatch(plane_part.normal, owner) / section.hatch_m;
  return {{"normal", rounded(plane_part.normal, k_steps)},
          {"offset_m", std::round(plane_part.offset_m * k_steps) / k_steps},
          {"hatch", rounded(across, 10)},
          {"line", {scene::k_hatch_line, scene::k_hatch_colour}},
          {"colour", rounded(section.cap_colour, 1000)}};
}

}  // namespace limn::remote
