#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "sim/world.h"
#include "validate/shadow_fill.h"

namespace limn::validate {

/// A measure of `limn check`; its name is the key in a check file's `limits`.
struct CheckMeasure {
  std::string name;
  std::string what;    ///< A description for people.
  std::string unit;    ///< Empty for a share.
  bool least = false;  ///< The limit is a minimum, not a maximum.
};
const std::vector<CheckMeasure>& check_measures();

struct CheckLimit {
  CheckMeasure measure;
  double value = 0;
};

/// What the renderer knows of a world.
struct RendererInput {
  Rig rig;
  scene::Scene scene;
  scene::PosedScene posed;
};

/// A check that is ready to be measured: the true world, and what the renderer knows of it.
struct Check {
  std::string name;  ///< The file's stem.
  std::string about;
  std::vector<CheckLimit> limits;
  Imager viewer;                                      ///< View parts are drawn for its viewpoint.
  std::vector<scene::SharedViewpoint::Share> shares;  ///< Shares of the viewers in it; empty for one.
  Hand hand;                                          ///< The hand that shades in `refill_…`.

  sim::World truth;              ///< The true world, with the injected nudges.
  scene::PosedScene posed;       ///< The true poses of the parts.
  RendererInput renderer_input;  ///< The same without the nudges.
};

/// Reads a check file (limn.check/1, keys in config/README.md) with the world, scene and poses that it names.
Result<Check> load_check(const std::filesystem::path& path);

}  // namespace limn::validate
