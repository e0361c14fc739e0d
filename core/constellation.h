#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/pose.h"
#include "core/result.h"

namespace limn {

/// Balls of one size that are fixed rigidly to each other: what a marker's pattern is to a square.
struct Constellation {
  std::string name;
  double radius_m = 0.02;
  std::vector<Eigen::Vector3d> p_balls;  ///< centres in the body's frame
};

inline constexpr std::size_t k_most_balls = 12;
/// Two distances are alike when they differ by less than this share of the longer one, or by 2 mm: one camera
/// alone does not tell three balls with such distances apart for sure.
inline constexpr double k_alike_share = 0.05, k_alike_m = 0.002;
/// A constellation is collinear when all its balls lie nearer to a line than this share of its length.
inline constexpr double k_collinear_share = 0.1;

/// Number of balls that must be seen to say which constellation it is: three of three, four of more.
std::size_t balls_needed(const Constellation& constellation);

/// Error when the balls are too few or too many, overlap, are collinear, or look the same in another order
/// (balls_needed() of them can be exchanged for others by a rigid motion, within the tolerance). It names the
/// balls, counted from 0.
Status check_constellation(const Constellation& constellation);

/// Error when two have one name, or when balls_needed() balls of one lie as balls of another do.
Status check_distinct(std::span<const Constellation> constellations);

/// The family of the marker names that mean constellations: in `constellation:FILE`, FILE is a
/// limn.constellation/1.
inline constexpr const char* k_constellation_family = "constellation";
bool is_constellation(const MarkerName& name);

/// The same balls in the coordinate frame of what they are fixed to, under its name.
Constellation placed(const Constellation& constellation,
                     const std::string& name,
                     const Pose& body_from_balls);

/// The distance from the origin to the farthest point of a ball, m.
double reach_of(const Constellation& constellation);

/// Reads limn.constellation/1 (config/README.md) and checks it. Errors name the file and the key.
Result<Constellation> load_constellation(const std::filesystem::path& path);

}  // namespace limn
