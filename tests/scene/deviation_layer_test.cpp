// Tests of the deviation layer as bytes: what comes from a file or another machine may be damaged.
#include "scene/deviation_layer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

DeviationLayer a_layer() {
  DeviationLayer layer;
  layer.number = 3;
  layer.triangles = {{0, 1}, {3, 2}};
  layer.values = {deviation_value(1e-3, 1e-4),
                  deviation_value(-2e-3, 1e-4),
                  k_no_deviation,
                  deviation_value(0, 0),
                  k_no_deviation,
                  deviation_value(3e-3, 2e-5),
                  deviation_value(1e-6, 65e-3),
                  deviation_value(-1e-6, 0),
                  deviation_value(5e-3, 1e-3)};
  for (Eigen::Vector3f& colour : layer.band_colours) colour.setConstant(0.25f);
  layer.marks = {{{0.1, 0.2, 0.3}, Eigen::Vector3d::UnitZ(), 3e-3}};
  layer.unsure = {"slide along x"};
  return layer;
}

TEST(DeviationLayer, HoldsMicrometres) {
  EXPECT_EQ(deviation_value(1e-3, 0), 1000U);
  EXPECT_EQ(deviation_value(-1e-6, 2e-6), 0x2ffffU);
  EXPECT_EQ(deviation_value(1, 1), 0xfffe0000U | 32767U) << "large numbers are limited";
  EXPECT_EQ(deviation_value(std::nan(""), 0), k_no_deviation);
  EXPECT_EQ(deviation_value(0, std::nan("")), k_no_deviation);
}

TEST(DeviationLayer, ComesBackFromItsBytes) {
  const DeviationLayer layer = a_layer();
  const auto back = deviation_layer_of(bytes_of(layer));
  ASSERT_TRUE(back) << back.message();
  EXPECT_EQ(back->number, 3);
  EXPECT_EQ(back->values, layer.values);
  ASSERT_EQ(back->triangles.size(), 2U);
  EXPECT_EQ(back->triangles[1].first, 3U);
  EXPECT_EQ(back->triangles[1].divisions, 2U);
  EXPECT_EQ(back->band_colours[6], layer.band_colours[6]);
  EXPECT_EQ(back->marks[0].p_prototype, layer.marks[0].p_prototype);
  EXPECT_EQ(back->unsure, layer.unsure);
  EXPECT_EQ(bytes_of(*back), bytes_of(layer));
}

TEST(DeviationLayer, DamagedBytesAreRefusedOrHarmless) {
  const std::string whole = bytes_of(a_layer());
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_FALSE(deviation_layer_of(whole.substr(0, length))) << length;
  EXPECT_FALSE(deviation_layer_of(whole + "x"));
  auto rng = test::test_rng();
  std::uniform_int_distribution<std::size_t> at(0, whole.size() - 1);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < 20'000; ++i) {
    std::string damaged = whole;
    for (int k = 0; k < 3; ++k) damaged[at(rng)] = static_cast<char>(byte(rng));
    const auto layer = deviation_layer_of(damaged);
    if (!layer) continue;
    for (const DeviationLayer::Triangle& triangle : layer->triangles)
      ASSERT_LE(triangle.first + points_of_divisions(triangle.divisions), layer->values.size());
  }
}

}  // namespace
}  // namespace limn::scene
