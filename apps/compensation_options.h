#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "projector/renderer.h"

namespace limn::apps {

/// How a command is told to balance the projectors' light.
struct LightArguments {
  std::string compensation = "none";  ///< none, geometry or measured
  std::string black = "as-is";        ///< or even
  std::optional<double> level;        ///< LightOptions::level
  std::filesystem::path measured_at;  ///< POSES.json of the response images; empty: as posed
};

/// Tells the renderer. `measured` takes the first camera of the rig whose colour mixing response.json beside
/// rig.json holds for every projector. Errors: words that are none of these, no such camera, a prototype that
/// is not placed, a level that is not positive.
Status set_light(const LightArguments& arguments,
                 const std::filesystem::path& rig_path,
                 const Rig& rig,
                 const scene::Scene& scene,
                 const scene::PosedScene& posed,
                 projector::Renderer* renderer);

/// "light" of coverage.json: how light was balanced and what share of each projector's last image could not
/// be given; with even black, contrast (white over black) where one projector reaches, and what it was.
nlohmann::ordered_json light_report(const LightArguments& arguments,
                                    const Rig& rig,
                                    const projector::Renderer& renderer);

}  // namespace limn::apps
