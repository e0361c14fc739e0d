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

namespace limn::apps {

/// What `limn check` can measure, by its name in a check file's `limits`.
struct CheckMeasure {
  std::string name;
  std::string what;    ///< for people
  std::string unit;    ///< empty: a share
  bool least = false;  ///< the limit is the least that is good, else the most
};
const std::vector<CheckMeasure>& check_measures();

struct CheckLimit {
  CheckMeasure measure;
  double value = 0;
};

/// What the renderer is told of a world.
struct RendererInput {
  Rig rig;
  scene::Scene scene;
  scene::PosedScene posed;
};

/// A check, ready to be judged: what is true, and what the renderer is told of it.
struct Check {
  std::string name;  ///< the file's stem
  std::string about;
  std::vector<CheckLimit> limits;
  Imager viewer;                                      ///< whose eye view parts are drawn for
  std::vector<scene::SharedViewpoint::Share> shares;  ///< of the viewers, where several share that eye
  Hand hand;                                          ///< that shades in `refill_…`

  sim::World truth;         ///< with the injected nudges
  scene::PosedScene posed;  ///< where the parts truly are
  RendererInput told;       ///< the same, but for the nudges
};

/// Reads a check file (limn.check/1; config/README.md says its keys) with the world, scene and poses that it
/// names.
Result<Check> load_check(const std::filesystem::path& path);

}  // namespace limn::apps
