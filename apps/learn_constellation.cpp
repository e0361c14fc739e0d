#include "apps/learn_constellation.h"

#include <nlohmann/json.hpp>

#include "apps/camera_image.h"
#include "core/camera_files/imager_file.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "tracker/balls/constellation_learning.h"

namespace limn::apps {
namespace {

constexpr double k_least_ball_mm = 1, k_most_ball_mm = 1000;

nlohmann::ordered_json json_of(const tracker::LearnedConstellation& learned) {
  const Constellation& constellation = learned.constellation;
  nlohmann::ordered_json json = {{"schema", "limn.constellation/1"},
                                 {"name", constellation.name},
                                 {"ball_diameter_mm", 2e3 * constellation.radius_m},
                                 {"balls_mm", nlohmann::ordered_json::array()},
                                 {"stddev_mm", nlohmann::ordered_json::array()},
                                 {"pictures", learned.images},
                                 {"rms_px", learned.rms_px}};
  const auto add = [&](const char* key, const Eigen::Vector3d& p) {
    json[key].push_back({1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z()});
  };
  for (const Eigen::Vector3d& p : constellation.p_balls) add("balls_mm", p);
  for (const Eigen::Vector3d& deviations : learned.stddev_m) add("stddev_mm", deviations);
  return json;
}

void print(const tracker::LearnedConstellation& learned) {
  for (std::size_t i = 0; i < learned.stddev_m.size(); ++i) {
    const Eigen::Vector3d p_mm = 1e3 * learned.constellation.p_balls[i];
    print_out("ball {:<2} at ({:.2f}, {:.2f}, {:.2f}) mm, +- {:.2f} mm, {} images\n", i, p_mm.x(), p_mm.y(),
              p_mm.z(), 1e3 * learned.stddev_m[i].norm(), learned.images_of_ball[i]);
  }
  print_out("{} balls from {} images, {:.3f} px\n", learned.stddev_m.size(), learned.images, learned.rms_px);
  if (learned.dropped_balls > 0)
    log_warning(
        "{} round things were left out, because too few images show them in the same place on the body.",
        learned.dropped_balls);
}

Status check_options(const LearnConstellationOptions& options) {
  if (options.camera.empty())
    return usage_error("--learn-constellation: distances need a camera; add --camera X.cameramodel.");
  if (!(options.ball_mm >= k_least_ball_mm && options.ball_mm <= k_most_ball_mm))
    return usage_error("--ball-mm: expected the balls' diameter in millimetres, {} to {}, found {}.",
                       k_least_ball_mm, k_most_ball_mm, options.ball_mm);
  if (options.out.extension() != ".json")
    return usage_error("--out: expected a file that ends in .json, found '{}'.", options.out.string());
  return {};
}

}  // namespace

Status run_learn_constellation(const LearnConstellationOptions& options) {
  LIMN_TRY_STATUS(check_options(options));
  LIMN_TRY(Imager camera, load_imager(options.camera));
  camera.imager_from_world = Pose{};  // a body's frame has no world frame
  std::vector<Constellation> all;
  for (const auto& path : options.others) {
    LIMN_TRY(Constellation other, load_constellation(path));
    all.push_back(std::move(other));
  }
  tracker::BallFinder finder({.shade = options.shade, .encoding = options.encoding});
  std::vector<std::vector<tracker::Ball>> balls;
  Progress progress("detect", static_cast<int>(options.images.size()));
  for (const auto& path : options.images) {
    LIMN_TRY(const cv::Mat grey, read_image_of(camera, path));
    balls.push_back(finder.find(grey, camera.lens));
    progress.step(static_cast<int>(balls.size()));
  }
  std::vector<tracker::BallView> views;
  for (const auto& found : balls) views.push_back({&camera, found});
  const auto learned =
      tracker::learn_constellation(views, 0.5e-3 * options.ball_mm, options.out.stem().string());
  if (!learned) return error("--learn-constellation: {}", learned.message());
  all.push_back(learned->constellation);
  const Status distinct = check_distinct(all);
  if (!distinct) return error("--learn-constellation: {}", distinct.message());
  print(*learned);
  return write_file(options.out, json_text(json_of(*learned), 2) + "\n");
}

}  // namespace limn::apps
