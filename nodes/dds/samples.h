#pragma once

#include <dds/dds.h>

#include <array>
#include <cstddef>

namespace limn::nodes {

/// Takes all samples that a reader has and calls `receive(sample, info)` for each. The sample is valid during
/// the call.
template <class Receive>
void take_all(dds_entity_t reader, const Receive& receive) {
  constexpr std::size_t k_batch = 8;
  for (int count = static_cast<int>(k_batch); count == static_cast<int>(k_batch);) {
    std::array<void*, k_batch> samples{};
    std::array<dds_sample_info_t, k_batch> infos{};
    count = dds_take(reader, samples.data(), infos.data(), k_batch, k_batch);
    for (std::size_t i = 0; static_cast<int>(i) < count; ++i) receive(samples[i], infos[i]);
    if (count > 0) dds_return_loan(reader, samples.data(), count);
  }
}

}  // namespace limn::nodes
