#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/report/report.h"
#include "calib/report/rounded.h"
#include "core/json_text.h"

namespace limn::calib {
namespace {

using Json = nlohmann::ordered_json;

Json devices_json(const Assessment& assessment) {
  Json list = Json::array();
  for (const DeviceQuality& d : assessment.devices)
    list.push_back({{"name", d.name},
                    {"rms_px", rounded(d.rms_px)},
                    {"points", d.points},
                    {"outliers", d.outliers},
                    {"coverage", rounded(d.coverage)}});
  for (size_t i = 0; i < assessment.lens_stddev_px.size(); ++i)
    list[i]["lens_stddev_px"] = rounded(assessment.lens_stddev_px[i]);
  return list;
}

Json held_out_json(const CrossValidation& score) {
  Json poses = Json::array();
  for (const HeldOutPose& pose : score.poses)
    poses.push_back({{"pose", pose.pose}, {"rms_px", rounded(pose.rms_px)}, {"cells", pose.cells}});
  return {{"rms_px", rounded(score.rms_px)}, {"worst_px", rounded(score.worst_px)}, {"poses", poses}};
}

Json score_json(const EpipolarScore& score) {
  return {{"rms_px", rounded(score.rms_px)}, {"pixels", score.pixels}, {"outliers", score.outliers}};
}

Json epipolar_json(const Report& report) {
  const Observations& observations = report.observed.observations;
  Json list = Json::array();
  for (const EpipolarResidual& pair : report.assessment.epipolar)
    list.push_back({{"camera", observations.cameras[static_cast<size_t>(pair.camera)].name},
                    {"projector", observations.projectors[static_cast<size_t>(pair.projector)].name},
                    {"board", score_json(pair.board)},
                    {"room", score_json(pair.room)}});
  return list;
}

Json normalised_residuals_json(const NormalisedResiduals& normalised_residuals) {
  const auto one = [](const ResidualStatistics& s) -> Json {
    return {{"mean", rounded(s.mean)},
            {"stddev", rounded(s.stddev)},
            {"beyond_3", rounded(s.beyond_3)},
            {"count", s.count}};
  };
  return {{"corners", one(normalised_residuals.corners)},
          {"matches", one(normalised_residuals.matches)},
          {"held_out", one(normalised_residuals.held_out)}};
}

Json by_projector(const Report& report, const std::vector<double>& errors) {
  Json each = Json::object();
  for (size_t i = 0; i < errors.size(); ++i)
    each[report.observed.observations.projectors[i].name] = rounded(errors[i]);
  return each;
}

Json error_json(const Report& report) {
  const Assessment& a = report.assessment;
  return {{"p95", rounded(a.worst_predicted_mm())},
          {"per_projector", by_projector(report, a.predicted_error_mm)},
          {"held_out", by_projector(report, a.held_out_error_mm)},
          {"propagated", by_projector(report, a.propagated_error_mm)},
          {"from",
           "the larger of the held-out error and of the uncertainty propagated to a target in place, moved "
           "by 150 "
           "mm and turned by 40 degrees"},
          {"region", "the space where the boards were, as far as the projector and a camera reach"}};
}

// Each known cell as column, row and mm.
Json error_maps_json(const Report& report) {
  const Imager& camera = report.solution.rig.cameras.front();
  const auto pair = [](const Eigen::Vector2d& v) { return Json::array({rounded(v.x()), rounded(v.y())}); };
  Json list = Json::array();
  for (const ErrorMap& map : report.assessment.error_maps) {
    Json planes = Json::array();
    for (const ErrorMap::Plane& plane : map.planes) {
      Json cells = Json::array();
      for (size_t i = 0; i < plane.p95_mm.size(); ++i) {
        const int cell = static_cast<int>(i);
        if (std::isfinite(plane.p95_mm[i]))
          cells.push_back({cell % map.columns, cell / map.columns, rounded(plane.p95_mm[i])});
      }
      planes.push_back({{"depth_m", rounded(plane.depth_m)},
                        {"size_m", pair(map.size_m(camera, plane))},
                        {"cells", std::move(cells)}});
    }
    list.push_back(
        {{"projector", report.observed.observations.projectors[static_cast<size_t>(map.projector)].name},
         {"columns", map.columns},
         {"rows", map.rows},
         {"low", pair(map.low)},
         {"high", pair(map.high)},
         {"worst_mm", rounded(map.worst_mm())},
         {"planes", std::move(planes)}});
  }
  return list;
}

// All models that were tried, those without a solution without numbers; only the given ones where nothing was
// selected.
Json lenses_json(const Report& report) {
  Json list = Json::array();
  for (const ModelTrial& trial : report.lens_trials) {
    Json entry = {{"device", trial.device}, {"model", trial.model}};
    if (std::isfinite(trial.held_out_px))
      entry.update({{"held_out_px", rounded(trial.held_out_px)},
                    {"gain", rounded(trial.gain)},
                    {"uncertainty", rounded(trial.uncertainty)}});
    entry["chosen"] = trial.chosen;
    list.push_back(std::move(entry));
  }
  if (!report.lens_trials.empty()) return list;
  for (const auto* imagers : {&report.solution.rig.cameras, &report.solution.rig.projectors}) {
    for (const Imager& imager : *imagers)
      list.push_back({{"device", imager.name}, {"model", imager.lens.model.name()}, {"chosen", true}});
  }
  return list;
}

Json lengths_json(const Report& report) {
  const Observations& observations = report.observed.observations;
  const auto mm = [](double m) { return rounded(1e3 * m); };
  Json list = Json::array();
  for (const ScaleBarCheck& check : report.scale_bar_lengths) {
    Json views = Json::array();
    for (const ScaleBarView& view : check.views)
      views.push_back({{"pose", observations.poses[static_cast<size_t>(view.pose)]},
                       {"camera", observations.cameras[static_cast<size_t>(view.camera)].name},
                       {"projector", observations.projectors[static_cast<size_t>(view.projector)].name},
                       {"measured_mm", mm(view.measured_m)},
                       {"noise_mm", mm(view.noise_m)},
                       {"calibration_mm", mm(view.calibration_m)}});
    const auto seen = [&](double m) { return check.views.empty() ? Json() : Json(mm(m)); };
    list.push_back({{"from", check.known.from},
                    {"to", check.known.to},
                    {"expected_mm", mm(check.known.length_m)},
                    {"measured_mm", seen(check.measured_m)},
                    {"difference_mm", seen(check.measured_m - check.known.length_m)},
                    {"stddev_mm", seen(check.stddev_m)},
                    {"views", views}});
  }
  return list;
}

Json moved_json(const std::vector<DeviceMove>& devices) {
  Json list = Json::array();
  for (const DeviceMove& device : devices)
    list.push_back({{"name", device.name},
                    {"degrees", rounded(device.degrees)},
                    {"mm", rounded(device.mm)},
                    {"px", rounded(device.px)}});
  return list;
}

Json history_json(const History& history) {
  Json list = Json::array();
  for (const PastCalibration& past : history.past)
    list.push_back({{"made_at", past.made_at},
                    {"verdict", past.verdict},
                    {"held_out_px", rounded(past.held_out_px)},
                    {"worst_px", rounded(past.worst_px)},
                    {"predicted_mm", rounded(past.predicted_mm)},
                    {"moved", moved_json(past.moved)}});
  return list;
}

}  // namespace

std::string report_json(const Report& report) {
  const Assessment& a = report.assessment;
  Json faults = Json::array(), seconds = Json::object();
  for (const Fault& fault : a.faults)
    faults.push_back({{"name", to_text(fault.name)},
                      {"poses", fault.poses},
                      {"evidence", fault.evidence},
                      {"advice", fault.advice}});
  for (const auto& [stage, value] : report.seconds) seconds[stage] = std::round(value * 1e3) / 1e3;
  const auto since_last =
      report.history.rig ? device_moves(*report.history.rig, report.observed.observations, report.solution)
                         : std::vector<DeviceMove>();
  const Json json = {{"schema", "limn.report/1"},
                     {"made_at", report.made_at},
                     {"verdict", to_text(a.verdict)},
                     {"words", report.explanation.verdict},
                     {"advice", report.explanation.advice},
                     {"devices", devices_json(a)},
                     {"held_out", held_out_json(a.held_out)},
                     {"lens_models", lenses_json(report)},
                     {"predicted_error_mm", error_json(report)},
                     {"error_maps", error_maps_json(report)},
                     {"decode",
                      {{"share", rounded(a.decoded_share)},
                       {"share_of_contrasted", rounded(a.decoded_of_contrasted)},
                       {"outliers", a.decode_outliers}}},
                     {"epipolar", epipolar_json(report)},
                     {"pulls", normalised_residuals_json(a.normalised_residuals)},
                     {"scale_rests_on", report.scale_rests_on},
                     {"tie_markers", report.tie_markers},
                     {"known_lengths", lengths_json(report)},
                     {"faults", faults},
                     {"moved", moved_json(since_last)},
                     {"history", history_json(report.history)},
                     {"seconds", seconds}};
  return json_text(json, 2) + "\n";
}

}  // namespace limn::calib
