#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <filesystem>
#include <numbers>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <random>
#include <string>

#include "core/pose.h"

namespace limn::test {

inline namespace literals {
constexpr double operator""_deg(long double v) { return static_cast<double>(v) * std::numbers::pi / 180; }
constexpr double operator""_deg(unsigned long long v) {
  return static_cast<double>(v) * std::numbers::pi / 180;
}
constexpr double operator""_mm(long double v) { return static_cast<double>(v) * 1e-3; }
constexpr double operator""_mm(unsigned long long v) { return static_cast<double>(v) * 1e-3; }
}  // namespace literals

/// Usage: EXPECT_TRUE(pose_near(found, expected, 0.1_deg, 0.5_mm)). On failure it says by how much the angle
/// and the distance are off. It compares the rotation's angle itself. NaN fails.
testing::AssertionResult pose_near(const Pose& found, const Pose& expected, double angle, double distance);

/// Compares the distance of two points of any dimension; NaN fails.
testing::AssertionResult near(const Eigen::VectorXd& found, const Eigen::VectorXd& expected, double distance);

/// Checks that the mean absolute difference is <= `mean` and the largest <= `worst`, over all channels, in
/// levels (8-bit) or units (float). On failure it writes NAME-actual.png, NAME-expected.png and
/// NAME-difference.png (8x) to the test's output folder and names them. NaN or another size or type fails.
testing::AssertionResult image_near(
    const cv::Mat& actual, const cv::Mat& expected, double mean, double worst, const std::string& name);

/// A random generator seeded from the running test's name: the same numbers in every run of a test.
std::mt19937_64 test_rng();

/// An empty folder for the running test; each call deletes its content.
std::filesystem::path test_folder();

/// The folder of real photographs: $LIMN_REAL_DATA, else ../shared/data beside the checkout. They are not in
/// the repository; docs/measurements.md says where they come from. Nullopt when absent: tests then call
/// GTEST_SKIP() and name the folder.
std::optional<std::filesystem::path> real_data(const std::string& inside);

}  // namespace limn::test
