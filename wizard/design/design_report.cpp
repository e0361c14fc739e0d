#include "wizard/design/design_report.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/json_text.h"

namespace limn::design {
namespace {

nlohmann::ordered_json number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(std::round(value * 1e4) / 1e4)
                              : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json json_of(const PredictedImager& imager) {
  nlohmann::ordered_json json = {{"name", imager.name},
                                 {"distance_m", number(imager.distance_m)},
                                 {"pixel_mm", number(imager.pixel_mm)},
                                 {"pixel_on_surface_mm", number(imager.surface_mm)},
                                 {"steep_deg", number(imager.steep_deg)},
                                 {"coverage", number(imager.coverage)}};
  if (imager.lux > 0) json["lux"] = number(imager.lux);
  return json;
}

nlohmann::ordered_json json_of(const PredictedAccuracy& predicted_accuracy) {
  using Json = nlohmann::ordered_json;
  Json json = {{"coverage", number(predicted_accuracy.coverage)},
               {"cameras", Json::array()},
               {"projectors", Json::array()},
               {"pairs", Json::array()},
               {"markers", Json::array()},
               {"advice", predicted_accuracy.advice}};
  for (const PredictedImager& camera : predicted_accuracy.cameras) json["cameras"].push_back(json_of(camera));
  for (std::size_t i = 0; i < predicted_accuracy.projectors.size(); ++i) {
    Json projector = json_of(predicted_accuracy.projectors[i]);
    projector["predicted_error_mm"] = number(predicted_accuracy.error_mm[i]);
    projector["of_calibration_mm"] = number(predicted_accuracy.calibration_mm[i]);
    projector["of_measuring_mm"] = number(predicted_accuracy.measuring_mm[i]);
    json["projectors"].push_back(std::move(projector));
  }
  for (const PredictedPair& pair : predicted_accuracy.pairs)
    json["pairs"].push_back({{"camera", pair.camera},
                             {"projector", pair.projector},
                             {"angle_deg", number(pair.angle_deg)},
                             {"coverage", number(pair.coverage)}});
  for (const PredictedMarker& marker : predicted_accuracy.markers)
    json["markers"].push_back({{"camera", marker.camera},
                               {"side_px", number(marker.side_px)},
                               {"farthest_px", number(marker.farthest_px)},
                               {"across_mm", number(marker.across_mm)},
                               {"along_mm", number(marker.along_mm)}});
  return json;
}

}  // namespace

std::string design_json(const PredictedAccuracy& predicted_accuracy) {
  return json_text(json_of(predicted_accuracy), 2);
}

std::string design_table(const PredictedAccuracy& predicted_accuracy, const DescribedRig& described) {
  std::string out;
  out += fmt::format("{:<14} {:>8} {:>9} {:>14} {:>7} {:>9} {:>7}\n", "", "dist., m", "pixel, mm",
                     "on surface, mm", "steep", "coverage", "lux");
  for (const auto* imagers : {&predicted_accuracy.cameras, &predicted_accuracy.projectors}) {
    for (const PredictedImager& imager : *imagers)
      out += fmt::format("{:<14} {:>8.2f} {:>9.2f} {:>14.2f} {:>5.0f} ° {:>7.0f} %{}\n", imager.name,
                         imager.distance_m, imager.pixel_mm, imager.surface_mm, imager.steep_deg,
                         100 * imager.coverage, imager.lux > 0 ? fmt::format(" {:>7.0f}", imager.lux) : "");
  }
  for (const PredictedPair& pair : predicted_accuracy.pairs)
    out += fmt::format("{} and {}: {:.0f} degrees apart, both reach {:.0f} % of the volume\n", pair.camera,
                       pair.projector, pair.angle_deg, 100 * pair.coverage);
  for (const PredictedMarker& marker : predicted_accuracy.markers)
    out += fmt::format(
        "{}: a {:g} mm marker is {:.0f} px ({:.0f} at the far end), located within {:.2f} mm across the view "
        "and {:.2f} mm along it (95 %)\n",
        marker.camera, 1000 * described.marker_m, marker.side_px, marker.farthest_px, marker.across_mm,
        marker.along_mm);
  out += fmt::format("{} and at least one projector reach {:.0f} % of the volume\n",
                     described.rig.cameras.front().name, 100 * predicted_accuracy.coverage);
  for (std::size_t i = 0; i < predicted_accuracy.error_mm.size(); ++i)
    out += fmt::format(
        "{}: light lands within {:.2f} mm (95 %; calibration {:.2f}, measuring the prototype {:.2f})\n",
        described.rig.projectors[i].name, predicted_accuracy.error_mm[i],
        predicted_accuracy.calibration_mm[i], predicted_accuracy.measuring_mm[i]);
  for (const std::string& sentence : predicted_accuracy.advice) out += fmt::format("advice: {}\n", sentence);
  if (predicted_accuracy.advice.empty())
    out += fmt::format("nothing is too small, too far, too steep or out of reach\n");
  return out;
}

}  // namespace limn::design
