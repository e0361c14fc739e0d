#include "core/median.h"

#include <gtest/gtest.h>

#include <array>
#include <span>
#include <vector>

namespace limn {
namespace {

TEST(Median, IsTheMiddleOneAndTheUpperOfTwo) {
  EXPECT_EQ(median(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(median(std::vector<int>{4, 1, 3, 2}), 3);
  EXPECT_EQ(median(std::vector<float>{7}), 7);
}

TEST(Median, WithoutValuesIsWhatTheCallerSays) {
  EXPECT_EQ(median(std::vector<double>{}), 0);
  EXPECT_EQ(median(std::vector<double>{}, 1.5), 1.5);
  EXPECT_EQ(quantile(std::vector<double>{}, 0.9, -1.0), -1);
}

TEST(Median, OfAnEvenNumberCanBeTheMeanOfTheMiddleTwo) {
  EXPECT_EQ(mean_median(std::array<double, 4>{9, 1, 4, 2}), 3);
  EXPECT_EQ(mean_median(std::vector<double>{9, 1, 4}), 4);
}

TEST(Median, QuantilesAreValuesOfTheGiven) {
  std::vector<double> values;
  for (int i = 100; i >= 0; --i) values.push_back(i);
  EXPECT_EQ(quantile(values, 0), 0);
  EXPECT_EQ(quantile(values, 0.95), 95);
  EXPECT_EQ(quantile(values, 1), 100);
}

TEST(Median, ARankIsFoundInPlaceAndInAPart) {
  std::array<int, 6> values = {5, 3, 1, -9, -8, -7};
  const std::span<int> part(values.data(), 3);
  EXPECT_EQ(value_of_rank(&part, 1), 3);
  EXPECT_EQ(values[3], -9) << "values outside the part do not change";
}

}  // namespace
}  // namespace limn
