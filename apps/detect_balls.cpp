#include "apps/detect_balls.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/camera_image.h"
#include "core/camera_files/imager_file.h"
#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "tracker/balls/constellation_pose.h"

namespace limn::apps {
namespace {

using Explanations = std::vector<tracker::ConstellationFit>;

struct BallOutcome {
  std::filesystem::path path;
  std::vector<tracker::Ball> balls;
  std::vector<Explanations> found;  // one for each constellation
};

nlohmann::ordered_json json_of(const tracker::Ball& ball) {
  return {{"centre_px", {ball.centre_px.x(), ball.centre_px.y()}},
          {"centre_stddev_px", std::sqrt(0.5 * ball.centre_covariance.trace())},
          {"radius_px", ball.radius_px},
          {"half_angle_rad", ball.half_angle}};
}

nlohmann::ordered_json json_of(const tracker::ConstellationFit& fit) {
  nlohmann::ordered_json node = {{"camera_from_constellation", to_json(fit.fit.world_from_body)},
                                 {"rms_px", fit.fit.rms_px},
                                 {"weight", fit.weight}};
  for (const tracker::BallMatch& match : fit.matches)
    node["matches"].push_back({{"ball", match.ball}, {"in_constellation", match.in_constellation}});
  for (int row = 0; row < 6; ++row) {
    nlohmann::ordered_json values = nlohmann::ordered_json::array();
    for (int column = 0; column < 6; ++column) values.push_back(fit.fit.covariance(row, column));
    node["covariance"].push_back(values);
  }
  return node;
}

std::string json_of(const std::vector<BallOutcome>& outcomes,
                    const std::vector<Constellation>& constellations) {
  nlohmann::ordered_json images = nlohmann::ordered_json::array();
  for (const BallOutcome& outcome : outcomes) {
    nlohmann::ordered_json node = {{"file", outcome.path.string()},
                                   {"balls", nlohmann::ordered_json::array()},
                                   {"constellations", nlohmann::ordered_json::array()}};
    for (const tracker::Ball& ball : outcome.balls) node["balls"].push_back(json_of(ball));
    for (std::size_t i = 0; i < constellations.size(); ++i) {
      if (outcome.found[i].empty()) continue;
      nlohmann::ordered_json poses = nlohmann::ordered_json::array();
      for (const tracker::ConstellationFit& fit : outcome.found[i]) poses.push_back(json_of(fit));
      node["constellations"].push_back({{"name", constellations[i].name}, {"poses", poses}});
    }
    images.push_back(node);
  }
  return json_text(nlohmann::ordered_json{{"images", images}}, 1) + "\n";
}

void print(const BallOutcome& outcome, const std::vector<Constellation>& constellations) {
  std::size_t count = 0;
  for (const Explanations& fits : outcome.found) count += fits.empty() ? 0 : 1;
  print_out("{}: {} balls, {} constellations\n", outcome.path.string(), outcome.balls.size(), count);
  for (std::size_t i = 0; i < constellations.size(); ++i)
    for (const tracker::ConstellationFit& fit : outcome.found[i]) {
      const Eigen::Vector3d t_mm = 1e3 * fit.fit.world_from_body.translation;
      const Eigen::Vector3d deviations_mm = 1e3 * fit.fit.covariance.diagonal().tail<3>().cwiseSqrt();
      print_out(
          "  {:<24} at ({:.2f}, {:.2f}, {:.2f}) mm, +- ({:.2f}, {:.2f}, {:.2f}) mm, {} balls, {:.3f} px",
          constellations[i].name, t_mm.x(), t_mm.y(), t_mm.z(), deviations_mm.x(), deviations_mm.y(),
          deviations_mm.z(), fit.matches.size(), fit.fit.rms_px);
      print_out("{}\n", outcome.found[i].size() > 1 ? fmt::format(", weight {:.2f}", fit.weight) : "");
    }
}

}  // namespace

Status run_detect_balls(const DetectBallsOptions& options) {
  if (options.camera.empty())
    return usage_error("--constellation: poses need a camera; add --camera X.cameramodel.");
  LIMN_TRY(Imager camera, load_imager(options.camera));
  camera.imager_from_world = Pose{};
  std::vector<Constellation> constellations;
  for (const auto& path : options.constellations) {
    LIMN_TRY(Constellation one, load_constellation(path));
    constellations.push_back(std::move(one));
  }
  LIMN_TRY_STATUS(check_distinct(constellations));
  tracker::BallFinder finder({.shade = options.shade, .encoding = options.encoding});
  std::vector<BallOutcome> outcomes;
  int failed = 0;
  for (const auto& path : options.images) {
    const auto grey = read_image_of(camera, path);
    if (!grey) {
      log_warning("{}", grey.message());
      ++failed;
      continue;
    }
    BallOutcome outcome{path, finder.find(*grey, camera.lens), {}};
    const tracker::BallView view{&camera, outcome.balls};
    outcome.found = tracker::identified(constellations, std::span(&view, 1));
    print(outcome, constellations);
    outcomes.push_back(std::move(outcome));
  }
  if (!options.json.empty()) LIMN_TRY_STATUS(write_file(options.json, json_of(outcomes, constellations)));
  if (failed > 0) return error("{} of {} images could not be processed.", failed, options.images.size());
  return {};
}

}  // namespace limn::apps
