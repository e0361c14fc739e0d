#include "session/deviation/small_gaps.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

namespace limn::session {
namespace {

using Neighbours = std::vector<std::vector<std::uint32_t>>;

constexpr std::size_t k_most_points = 60;
constexpr int k_rounds = 40;  // averages until a gap is smooth

bool is_certain(const calib::Deviation& comparison, std::size_t i) {
  return comparison.states[i] == calib::DeviationState::measured;
}

// The connected points that are not certain around `seed`. They are marked in `seen`.
std::vector<std::uint32_t> gap_around(std::uint32_t seed,
                                      const calib::Deviation& comparison,
                                      const Neighbours& neighbours,
                                      std::vector<bool>* seen) {
  std::vector<std::uint32_t> gap = {seed};
  (*seen)[seed] = true;
  for (std::size_t k = 0; k < gap.size(); ++k)
    for (const std::uint32_t next : neighbours[gap[k]]) {
      if ((*seen)[next] || is_certain(comparison, next)) continue;
      (*seen)[next] = true;
      gap.push_back(next);
    }
  return gap;
}

void bridge(const std::vector<std::uint32_t>& gap,
            const Neighbours& neighbours,
            calib::Deviation* comparison) {
  float low = std::numeric_limits<float>::infinity(), high = -low, stddev = 0;
  double sum = 0;
  int count = 0;
  for (const std::uint32_t i : gap)
    for (const std::uint32_t k : neighbours[i]) {
      if (!is_certain(*comparison, k)) continue;
      const float distance = comparison->distances_m[k];
      low = std::min(low, distance);
      high = std::max(high, distance);
      stddev = std::max(stddev, comparison->stddevs_m[k]);
      sum += static_cast<double>(distance);
      ++count;
    }
  if (count == 0 || static_cast<double>(high - low) > comparison->tolerance_m) return;
  for (const std::uint32_t i : gap) comparison->distances_m[i] = static_cast<float>(sum / count);
  for (int round = 0; round < k_rounds; ++round)
    for (const std::uint32_t i : gap) {
      float around = 0;
      for (const std::uint32_t k : neighbours[i]) around += comparison->distances_m[k];
      comparison->distances_m[i] = around / static_cast<float>(neighbours[i].size());
    }
  for (const std::uint32_t i : gap) {
    comparison->stddevs_m[i] = stddev;
    comparison->states[i] = calib::DeviationState::measured;
  }
}

}  // namespace

calib::Deviation with_small_gaps_bridged(calib::Deviation comparison) {
  const Neighbours neighbours = calib::neighbours_of(comparison.cad);
  std::vector<bool> seen(comparison.states.size(), false);
  for (std::uint32_t seed = 0; seed < seen.size(); ++seed) {
    if (seen[seed] || is_certain(comparison, seed)) continue;
    const std::vector<std::uint32_t> gap = gap_around(seed, comparison, neighbours, &seen);
    const bool is_hidden = std::ranges::any_of(
        gap, [&](std::uint32_t i) { return comparison.states[i] == calib::DeviationState::beyond_reach; });
    if (gap.size() <= k_most_points && !is_hidden) bridge(gap, neighbours, &comparison);
  }
  return comparison;
}

}  // namespace limn::session
