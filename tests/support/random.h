#pragma once

#include <random>

namespace limn::test {

/// A number that is uniformly distributed between `low` and `high`.
inline double uniform(std::mt19937_64& rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(rng);
}

}  // namespace limn::test
