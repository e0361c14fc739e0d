#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "core/enum_names.h"
#include "projector/renderer.h"

namespace limn::apps {

/// The names of --compensation, also in coverage.json.
inline constexpr EnumNames<projector::Compensation, 3> k_compensations{{"none", "geometry", "measured"}};
/// The names of --black, also in coverage.json: whether black is even.
inline constexpr EnumNames<bool, 2> k_blacks{{"as-is", "even"}};

/// The options of a command for the balance of the projectors' light.
struct LightArguments {
  projector::Compensation compensation = projector::Compensation::none;
  bool even_black = false;            ///< LightOptions::even_black
  std::optional<double> level;        ///< LightOptions::level
  std::filesystem::path measured_at;  ///< POSES.json of the response images; empty: the prototype as posed.
};

/// Sets the light of the renderer. `measured` takes the first camera of the rig for which response.json,
/// beside rig.json, holds the colour mixing with every projector. Errors: no such camera, a
/// prototype without a pose, a level that is not positive.
Status set_light(const LightArguments& arguments,
                 const std::filesystem::path& rig_path,
                 const Rig& rig,
                 const scene::Scene& scene,
                 const scene::PosedScene& posed,
                 projector::Renderer* renderer);

/// The value of "light" in coverage.json: how light was balanced, and what share of each projector's last
/// image was clipped. With even black also the contrast (white over black) where one projector reaches, and
/// the contrast without even black.
nlohmann::ordered_json light_report(const LightArguments& arguments,
                                    const Rig& rig,
                                    const projector::Renderer& renderer);

}  // namespace limn::apps
