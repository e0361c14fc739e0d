#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct SimulateOptions {
  std::filesystem::path world;  ///< limn.world/1
  std::filesystem::path out;
  std::vector<std::string> show;  ///< PROJECTOR=IMAGE to project.
  bool srgb = false;     ///< Encodes images as sRGB instead of as the world's cameras do (often linear).
  std::string variants;  ///< For the image with parts: SLOT=VARIANT,… ; empty: each slot's first.
};

/// `limn simulate`: writes for every camera of the world CAMERA-ambient.png (projectors off),
/// CAMERA-white.png (all projectors white), CAMERA-shown.png (with `show`) and CAMERA-still-life.png (virtual
/// parts as if they were physical); also truth.json, and the true rig in rig/. Prints what it wrote.
Status run_simulate(const SimulateOptions& options);

}  // namespace limn::apps
