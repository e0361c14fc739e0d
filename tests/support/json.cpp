#include "tests/support/json.h"

#include <gtest/gtest.h>

#include "core/file.h"

namespace limn::test {

nlohmann::json read_json(const std::filesystem::path& path) {
  const auto text = read_file(path);
  EXPECT_TRUE(text) << text.message();
  if (!text) return {};
  auto json = nlohmann::json::parse(*text, nullptr, /*allow_exceptions=*/false, /*ignore_comments=*/true);
  EXPECT_FALSE(json.is_discarded()) << path << " is no JSON: " << *text;
  return json.is_discarded() ? nlohmann::json() : json;
}

std::filesystem::path write_json(const std::filesystem::path& path, const nlohmann::json& content) {
  const auto written = write_file(path, content.dump(2));
  EXPECT_TRUE(written) << written.message();
  return path;
}

Pose pose_of(const nlohmann::json& json) {
  const auto& q = json.at("rotation_wxyz");
  const auto& t = json.at("translation_m");
  return {Eigen::Quaterniond(q.at(0), q.at(1), q.at(2), q.at(3)), Eigen::Vector3d(t.at(0), t.at(1), t.at(2))};
}

}  // namespace limn::test
