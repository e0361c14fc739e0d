#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/data_folder.h"
#include "core/file.h"
#include "scene/files/cad_program.h"
#include "scene/meshes/mesh.h"
#include "tests/exchange/step_text.h"
#include "tests/support/matchers.h"

namespace limn::test {

/// A folder for CAD files, and what limn-cad makes of them.
class Cad : public testing::Test {
 protected:
  void SetUp() override {
    unsetenv("LIMN_CAD");
    if (!std::filesystem::exists(private_library("limn-cad")))
      GTEST_SKIP() << "limn-cad was not built: libocct-data-exchange-dev is not installed";
  }

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    EXPECT_TRUE(write_file(folder / name, text));
    return folder / name;
  }

  // What limn-cad reports of a file.
  nlohmann::json report(const std::filesystem::path& file, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"--out", (folder / "out.glb").string()});
    const auto text = scene::run_limn_cad(file, more);
    EXPECT_TRUE(text) << text.message();
    return text ? nlohmann::json::parse(*text) : nlohmann::json();
  }

  scene::Mesh load(const std::filesystem::path& file, std::optional<scene::LengthUnit> units = {}) const {
    auto mesh = scene::load_mesh(file, units);
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh ? std::move(*mesh) : scene::Mesh{};
  }

  std::string refusal(const std::filesystem::path& file) const {
    const auto mesh = scene::load_mesh(file, {});
    EXPECT_FALSE(mesh);
    return mesh ? "" : mesh.message();
  }

  const std::filesystem::path folder = test_folder();
};

inline std::string box_file(const std::string& unit, const std::string& schema) {
  StepText step(unit, schema);
  step.part("T\\X2\\00FC\\X0\\rgriff", {step.box({100, 50, 20})});
  return step.file();
}

inline Eigen::AlignedBox3f box_of(const scene::Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p);
  return box;
}

inline Eigen::Vector3f size_of(const scene::Mesh& mesh) { return box_of(mesh).sizes(); }

inline Eigen::AlignedBox3d box_of(const nlohmann::json& solid) {
  const auto corner = [&](std::size_t i) {
    return Eigen::Vector3d(solid["box_m"][i][0], solid["box_m"][i][1], solid["box_m"][i][2]);
  };
  return {corner(0), corner(1)};
}

}  // namespace limn::test
