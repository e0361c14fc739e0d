#include "tests/support/matchers.h"

#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <opencv2/core.hpp>

#include "core/image_io.h"

namespace limn::test {
namespace {

// "Suite.Name"; in SetUpTestSuite(), "Suite".
std::string running_test() {
  const testing::UnitTest& program = *testing::UnitTest::GetInstance();
  const auto* info = program.current_test_info();
  const auto* suite = program.current_test_suite();
  std::string name = info    ? std::string(info->test_suite_name()) + "." + info->name()
                     : suite ? suite->name()
                             : "setup";
  for (char& c : name) {
    if (c == '/') c = '_';
  }
  return name;
}

}  // namespace

testing::AssertionResult pose_near(const Pose& found, const Pose& expected, double angle, double distance) {
  const double found_angle = angle_between(found.rotation, expected.rotation);
  const double found_distance = (found.translation - expected.translation).norm();
  if (found_angle <= angle && found_distance <= distance) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "off by " << found_angle * 180 / std::numbers::pi << " deg (limit "
                                     << angle * 180 / std::numbers::pi << ") and " << found_distance * 1e3
                                     << " mm (limit " << distance * 1e3 << ")";
}

testing::AssertionResult near(const Eigen::VectorXd& found,
                              const Eigen::VectorXd& expected,
                              double distance) {
  const double found_distance = (found - expected).norm();
  if (found_distance <= distance) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "(" << found.transpose() << ") is " << found_distance << " from ("
                                     << expected.transpose() << "), limit " << distance;
}

testing::AssertionResult image_near(
    const cv::Mat& actual, const cv::Mat& expected, double mean, double worst, const std::string& name) {
  if (actual.size() != expected.size() || actual.type() != expected.type()) {
    return testing::AssertionFailure()
           << name << ": size or type differ: " << actual.cols << "x" << actual.rows << " type "
           << actual.type() << ", expected " << expected.cols << "x" << expected.rows << " type "
           << expected.type();
  }
  cv::Mat a, e;
  actual.reshape(1).convertTo(a, CV_64F);
  expected.reshape(1).convertTo(e, CV_64F);
  const cv::Mat difference = cv::abs(a - e);
  double found_worst = 0;
  cv::minMaxLoc(difference, nullptr, &found_worst);
  const double found_mean = cv::mean(difference)[0];
  const bool finite = cv::checkRange(a) && cv::checkRange(e);
  if (finite && found_mean <= mean && found_worst <= worst) return testing::AssertionSuccess();
  auto result = testing::AssertionFailure()
                << name << ": mean " << found_mean << " (limit " << mean << "), worst " << found_worst
                << " (limit " << worst << ")" << (finite ? "" : ", NaN or infinite values");
  const auto folder = test_folder();
  const double scale = actual.depth() == CV_8U ? 1 : 255;
  auto write = [&](const char* kind, const cv::Mat& image, double factor) {
    cv::Mat bytes;
    image.reshape(actual.channels(), actual.rows).convertTo(bytes, CV_8U, factor);
    const auto path = folder / (name + "-" + kind + ".png");
    if (write_png(path, bytes)) result << "\n  " << path.string();
  };
  write("actual", a, scale);
  write("expected", e, scale);
  write("difference", difference, 8 * scale);
  return result;
}

std::mt19937_64 test_rng() { return std::mt19937_64(std::hash<std::string>{}(running_test())); }

std::filesystem::path test_folder() {
  const auto folder =
      std::filesystem::temp_directory_path() / ("limn-test-" + std::to_string(getuid())) / running_test();
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

std::optional<std::filesystem::path> real_data(const std::string& inside) {
  const char* variable = std::getenv("LIMN_REAL_DATA");
  const std::filesystem::path root =
      variable ? std::filesystem::path(variable) : std::filesystem::path(LIMN_SOURCE_DIR) / "../shared/data";
  const auto path = root / inside;
  if (!std::filesystem::exists(path)) return std::nullopt;
  return path;
}

}  // namespace limn::test
