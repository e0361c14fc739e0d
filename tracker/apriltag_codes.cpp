#include "tracker/apriltag_codes.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>

#include "core/result.h"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

namespace limn::tracker {
namespace {

struct Source {
  std::string_view name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array k_sources = {
    Source{"apriltag_41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    Source{"apriltag_52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    Source{"apriltag_48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    Source{"apriltag_49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    Source{"apriltag_21h7", tagCircle21h7_create, tagCircle21h7_destroy},
};

constexpr auto k_names = [] {
  std::array<std::string_view, k_sources.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = k_sources[i].name;
  return names;
}();

// The library's places of bits are cells from the border's top-left corner, and its first bit is the highest.
ApriltagCodes codes_of(const apriltag_family_t& family) {
  const int width = family.total_width, rings = (family.total_width - family.width_at_border) / 2;
  std::vector<std::size_t> cell_of_bit;  // by the library's order
  std::vector<std::uint8_t> has_bit(static_cast<std::size_t>(width * width));
  for (std::uint32_t i = 0; i < family.nbits; ++i) {
    const int column = static_cast<int>(family.bit_x[i]) + rings;
    const int row = static_cast<int>(family.bit_y[i]) + rings;
    cell_of_bit.push_back(static_cast<std::size_t>(row * width + column));
    has_bit[cell_of_bit.back()] = 1;
  }
  ApriltagCodes result{
      grid_around_border(width, family.width_at_border, has_bit), {}, static_cast<int>(family.h)};
  for (std::uint32_t id = 0; id < family.ncodes; ++id) {
    std::uint64_t code = 0;
    for (std::uint32_t i = 0; i < family.nbits; ++i) {
      const std::uint64_t white = (family.codes[id] >> (family.nbits - 1 - i)) & 1;
      code |= (1 - white) << result.grid.cells[cell_of_bit[i]];
    }
    result.codes.push_back(code);
  }
  return result;
}

}  // namespace

std::span<const std::string_view> apriltag3_families() { return k_names; }

ApriltagCodes apriltag3_codes(std::string_view name) {
  const auto source =
      std::find_if(k_sources.begin(), k_sources.end(), [&](const Source& s) { return s.name == name; });
  LIMN_CHECK(source != k_sources.end());
  const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> family(source->create(),
                                                                                source->destroy);
  LIMN_CHECK(family->reversed_border);
  return codes_of(*family);
}

}  // namespace limn::tracker
