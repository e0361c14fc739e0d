#pragma once

#include <gtest/gtest.h>

#include "calib/response/response_shots.h"
#include "sim/sensor_model.h"
#include "tests/support/matchers.h"

namespace limn::calib {

inline CaptureSet plan_of(const sim::World& world, const std::filesystem::path& folder) {
  std::vector<CapturedDevice> cameras, projectors;
  for (const Imager& imager : world.rig.cameras)
    cameras.push_back({imager.name, imager.width, imager.height});
  for (const Imager& imager : world.rig.projectors)
    projectors.push_back({imager.name, imager.width, imager.height});
  return plan_captures(folder, cameras, projectors, Board::parse("charuco:5x4:25mm").value());
}

/// Photographs of the response images, as the world's cameras take them.
inline CaptureSet captured(const sim::World& world) {
  const CaptureSet plan = plan_of(world, test::test_folder() / "captures");
  std::vector<sim::Samples> samples;
  for (size_t i = 0; i < world.rig.cameras.size(); ++i)
    samples.push_back(sim::trace(world, static_cast<int>(i)));
  std::vector<cv::Mat> shown(world.rig.projectors.size());
  std::uint64_t shots = 0;
  const Status status =
      capture_response(plan, {.show =
                                  [&](int projector, const cv::Mat& image) {
                                    for (cv::Mat& other : shown) other = cv::Mat();
                                    shown[static_cast<size_t>(projector)] = image;
                                    return Status();
                                  },
                              .grab = [&](int camera) -> Result<cv::Mat> {
                                return sim::photograph(world, samples[static_cast<size_t>(camera)], shown,
                                                       world.seed + ++shots);
                              }});
  EXPECT_TRUE(status.ok()) << status.message();
  return plan;
}

}  // namespace limn::calib
