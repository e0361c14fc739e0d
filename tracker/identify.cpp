#include "tracker/identify.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <memory_resource>
#include <numeric>
#include <utility>
#include <vector>

#include "tracker/quad_reader.h"
#include "tracker/reading_choice.h"

namespace limn::tracker {
namespace identity {
namespace {

// Largest share of border cells that may read white (a finger, glare). Families with few bits need a clean
// border.
constexpr double k_border_errors = 0.12;
constexpr double k_border_errors_few_bits = 0.05;
// The same where the marker may be covered, and the margins below which cells are then counted as hidden.
constexpr double k_border_errors_covered = 0.25;
constexpr std::array<double, 4> k_hidden_below = {0, 0.2, 0.4, 0.6};
constexpr int k_few_bits = 25;
// Cells of one side of the border, between its corners, that may read white where something lies over that
// side.
constexpr int k_broken_side_errors = 3;
// Largest probability that random cells are a code of a family that is read there, and smallest mean margin
// of the cells.
constexpr double k_max_broken_hit = 0.007;
constexpr double k_min_broken_margin = 0.8;
// Smallest mean margin of the cells (0: at the limit between black and white, 1: as black or white as beside
// the edge). Clutter has less.
constexpr double k_min_margin = 0.35;
constexpr double k_min_margin_few_bits = 0.5;
// Largest margin that all wrong bits may have together, as a share of the sum over all bits: a clear bit that
// is wrong is not noise.
constexpr double k_max_wrong_margin = 0.1;
constexpr double k_uneven_paper = 1.3;            // brightest side over the second darkest
constexpr double k_min_template_variance = 0.02;  // standard deviation of a fifteenth of black to white
// Every bit of a barcode is data. Its code cannot reject clutter, so its light must: smallest and mean margin
// of its cells, and the share of its border's places that may be light.
constexpr double k_min_barcode_margin = 0.4;
constexpr double k_min_mean_barcode_margin = 0.75;
constexpr double k_barcode_border_errors = 0.02;
constexpr double k_surroundings = 0.06;  // distance of the paper beside a square that is looked at, in sides
constexpr double k_quarter = 0.25;       // width of a barcode's border, as share of the side

struct Bits {
  std::uint64_t code = 0;
  std::array<double, 64> margin;  // for each bit, lowest first; at most 1
  double mean_margin = 0;
  int border_errors = 0;
  int border_cells = 0;
  std::array<int, 4> side_errors{};  // errors on each side of the border, without its corners

  // Whether the errors of the border are few, and none lies anywhere but on `side`.
  bool only_breaks(std::size_t side) const {
    return border_errors == side_errors[side] && border_errors <= k_broken_side_errors;
  }
};

Bits bits_of(const Grid& values, const CodeGrid& grid) {
  Bits bits;
  std::size_t at = 0;
  for (int row = 0; row < grid.width; ++row)
    for (int column = 0; column < grid.width; ++column, ++at) {
      const auto cell = static_cast<int>(grid.cells[at]);
      const double value = values[at];
      if (cell == CodeGrid::k_unused) continue;
      if (cell < 0) {
        ++bits.border_cells;
        const bool is_wrong = (value > 0) != (cell == CodeGrid::k_light);
        bits.border_errors += is_wrong;
        const int last = grid.width - 1;
        const bool across = row == 0 || row == last, down = column == 0 || column == last;
        if (is_wrong && across != down)
          ++bits.side_errors[across ? (row == 0 ? 0 : 2) : (column == 0 ? 3 : 1)];
        continue;
      }
      bits.code |= std::uint64_t{value > 0} << cell;
      const double margin = std::min(1.0, std::abs(value));
      bits.margin[static_cast<std::size_t>(cell)] = margin;
      bits.mean_margin += margin / grid.bits;
    }
  return bits;
}

struct Nearest {
  std::size_t id = 0, rotation = 0;
  int errors = 64;
};

// Uses the processor's own bit count where it has one.
#define LIMN_POPCOUNT __attribute__((target_clones("popcnt", "default")))

LIMN_POPCOUNT Nearest nearest(const std::vector<std::array<std::uint64_t, 4>>& codes,
                              std::uint64_t seen,
                              std::uint64_t readable) {
  Nearest best;
  for (std::size_t id = 0; id < codes.size(); ++id)
    for (std::size_t k = 0; k < 4; ++k) {
      const int errors = __builtin_popcountll((codes[id][k] ^ seen) & readable);
      if (errors < best.errors) best = {id, k, errors};
    }
  return best;
}

SeenCells cells_of(const CodeFamily& family, std::uint64_t code) {
  SeenCells cells;
  const CodeGrid& grid = family.grid;
  // A barcode's border is not always a whole number of cells.
  if (is_barcode(family) || grid.side() > static_cast<int>(SeenCells::k_max)) return cells;
  cells.count = grid.side();
  std::size_t at = 0;
  for (int row = 0; row < cells.count; ++row)
    for (int column = 0; column < cells.count; ++column) {
      const auto cell = static_cast<int>(grid.at(row + grid.rings, column + grid.rings));
      cells.white[at++] = cell >= 0 ? (code >> cell) & 1 : cell != CodeGrid::k_dark;
    }
  return cells;
}

// The bits whose margin is at least `margin`.
std::uint64_t readable_bits(const Bits& bits, int count, double margin) {
  std::uint64_t readable = 0;
  for (int i = 0; i < count; ++i)
    readable |= std::uint64_t{bits.margin[static_cast<std::size_t>(i)] >= margin} << i;
  return readable;
}

double margin_of(const Bits& bits, std::uint64_t chosen) {
  double sum = 0;
  for (; chosen != 0; chosen &= chosen - 1)
    sum += bits.margin[static_cast<std::size_t>(std::countr_zero(chosen))];
  return sum;
}

bool have_same_cells(const CodeFamily& a, const CodeFamily& b) {
  return a.cells == b.cells && a.border_cells == b.border_cells && a.grid.cells == b.grid.cells;
}

// The code other than `code` that would need the least margin of wrong bits, of any of the families with the
// same geometry of cells.
LIMN_POPCOUNT std::uint64_t next_code(const std::vector<CodeFamily>& families,
                                      const CodeFamily& family,
                                      const Bits& bits,
                                      std::uint64_t code) {
  const auto count = static_cast<std::size_t>(family.grid.bits);
  std::array<double, 65> least{};  // smallest sum of margins, by the number of wrong bits
  std::copy_n(bits.margin.begin(), count, least.begin() + 1);
  std::sort(least.begin() + 1, least.begin() + 1 + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = 1; i <= count; ++i) least[i] += least[i - 1];
  std::uint64_t next = ~code & ((std::uint64_t{1} << count) - 1);
  double wrong = least[count] + 1;
  for (const CodeFamily& like : families) {
    if (!have_same_cells(like, family)) continue;
    for (const auto& turns : like.codes)
      for (const std::uint64_t other : turns) {
        const std::uint64_t differing = other ^ bits.code;
        if (other == code || least[static_cast<std::size_t>(std::popcount(differing))] >= wrong) continue;
        const double margin = margin_of(bits, differing);
        if (margin >= wrong) continue;
        wrong = margin;
        next = other;
      }
  }
  return next;
}

double random_hit(const CodeFamily& family, int readable, int errors) {
  double words_with = 1;  // binomial(readable, i)
  double words = 0;
  for (int i = 0; i <= errors; ++i) {
    words += words_with;
    words_with *= static_cast<double>(readable - i) / (i + 1);
  }
  return std::min(1.0, 4 * static_cast<double>(family.codes.size()) * words / std::ldexp(1.0, readable));
}

// Whether the cells are a code without a doubt, but for a part of one side of the border.
bool is_clear_beside_broken_side(const CodeFamily& family, const Bits& bits) {
  return bits.mean_margin >= k_min_broken_margin &&
         random_hit(family, family.cells * family.cells, 0) <= k_max_broken_hit &&
         nearest(family.codes, bits.code, ~std::uint64_t{0}).errors == 0;
}

bool read_code(const std::vector<CodeFamily>& families,
               const CodeFamily& family,
               const Bits& bits,
               double limit,
               std::uint64_t readable,
               Readings* readings) {
  const int count = family.grid.bits;
  const auto hidden = static_cast<std::size_t>(count - std::popcount(readable));
  if (hidden >= family.max_errors.size()) return false;
  const Nearest best = nearest(family.codes, bits.code, readable);
  if (best.errors > family.max_errors[hidden]) return false;
  const std::uint64_t code = family.codes[best.id][best.rotation];
  if (margin_of(bits, (code ^ bits.code) & readable) > k_max_wrong_margin * bits.mean_margin * count)
    return false;
  const Identity identity{{family.name, std::to_string(best.id)}, best.rotation, 0, cells_of(family, code)};
  readings->accepted.push_back(
      {identity, pattern_of(family, code), limit, random_hit(family, std::popcount(readable), best.errors)});
  if (readings->certainty == Certainty::weighed)
    readings->others.push_back(pattern_of(family, next_code(families, family, bits, code)));
  return true;
}

void read_code(const std::vector<CodeFamily>& families,
               const CodeFamily& family,
               const Bits& bits,
               double limit,
               Reading reading,
               Readings* readings) {
  const int count = family.grid.bits;
  const bool few = count <= k_few_bits;
  const bool covered = reading == Reading::covered;
  if (covered && !can_be_covered(family)) return;
  const double border_share = covered ? k_border_errors_covered
                              : few   ? k_border_errors_few_bits
                                      : k_border_errors;
  const double min_margin = few ? k_min_margin_few_bits : k_min_margin;
  if (bits.border_errors > border_share * bits.border_cells || bits.mean_margin < min_margin) return;
  std::uint64_t before = 0;
  for (const double margin : k_hidden_below) {
    const std::uint64_t readable = readable_bits(bits, count, margin);
    if (readable == before) continue;
    before = readable;
    if (read_code(families, family, bits, limit, readable, readings) || !covered) return;
  }
}

// Whether the whole border is dark, near its outer edge and near the cells, where other families have cells.
// `border` is its width as share of the side.
bool is_border_dark(const QuadReader& reader, double border) {
  constexpr int k_places = 24;  // places along a side
  Places places;
  for (const double inset : {0.32 * border, 0.76 * border}) places.add_ring(inset, k_places);
  return reader.light_places(places) <= k_barcode_border_errors * 8 * k_places;
}

// Whether the border is dark where a border of two cells has its inner ring, for 5 x 5 to 7 x 7 cells (other
// markers with so many cells have cells there), and no light ring divides it, as the white margin of a marker
// on a dark card does.
bool has_wide_border(const QuadReader& reader) {
  constexpr int k_places = 6;  // places along a side
  constexpr double k_inset = 0.15;
  Places places;
  places.add_ring(k_inset, k_places);
  if (reader.light_places(places) > 2) return false;
  constexpr int k_few_places = 3, k_rings = 8;
  for (int ring = 0; ring < k_rings; ++ring) {
    Places around;
    around.add_ring(0.03 + 0.02 * ring, k_few_places);
    if (reader.light_places(around) > 2 * k_few_places) return false;
  }
  return true;
}

Bits barcode_bits(const QuadReader& reader, const CodeFamily& family) {
  CellSamples samples;
  reader.read_inside(family.cells, family.border_cells, &samples);
  return bits_of(grid_of(samples, k_middle), family.grid);
}

void read_barcodes(const QuadReader& reader, const Families& families, Readings* readings) {
  for (const CodeFamily& family : families.codes()) {
    if (!is_barcode(family)) continue;
    const Bits bits = barcode_bits(reader, family);
    const auto least = std::min_element(bits.margin.begin(), bits.margin.begin() + family.grid.bits);
    if (*least < k_min_barcode_margin || bits.mean_margin < k_min_mean_barcode_margin) continue;
    if (is_border_dark(reader, k_quarter))
      read_code(families.codes(), family, bits, k_middle, Reading::open, readings);
  }
}

// Adds the nearest code of every barcode family as a rival, even if its margins are too small for reading:
// almost any cells are a barcode with fewer cells.
void add_rival_barcodes(const QuadReader& reader, const Families& families, Readings* readings) {
  for (const CodeFamily& family : families.codes()) {
    if (!is_barcode(family)) continue;
    const Bits bits = barcode_bits(reader, family);
    const Nearest like = nearest(family.codes, bits.code, ~std::uint64_t{0});
    readings->others.push_back(pattern_of(family, family.codes[like.id][like.rotation]));
  }
}

// Whether there is a template's border of that width (share of the side): dark at 12 places of its middle
// ring.
bool has_template_border(const QuadReader& reader, double border) {
  Places places;
  const double middle = 0.5 * border;
  for (int i = 0; i < 3; ++i) {
    const double along = 0.2 + 0.3 * i;
    places.add(along, middle);
    places.add(along, 1 - middle);
    places.add(middle, along);
    places.add(1 - middle, along);
  }
  return reader.light_places(places) <= 1;
}

double correlation(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// The inside of a template's border as size x size values, smoothed, with zero mean and unit length; empty
// when it is flat.
std::vector<float> read_inside(const QuadReader& reader, int size, double border) {
  std::vector<float> values;
  const double cells = size / (1 - 2 * border);  // along the square's side
  const bool several = reader.side_px / cells > 2;
  const auto middle = [&](int i) { return border + (i + 0.5) / cells; };
  for (int row = 0; row < size; ++row) {
    Places places;
    for (int column = 0; column < size; ++column)
      places.add_cell(middle(column), middle(row), cells, several);
    Fractions fractions;
    reader.fractions(places, &fractions);
    const std::size_t each = several ? 5 : 1;
    for (std::size_t i = 0; i < places.count; i += each)
      values.push_back(static_cast<float>(mean_relative(&fractions[i], each, k_middle)));
  }
  values = smoothed(values, size);
  double mean = 0;
  for (const float v : values) mean += v / static_cast<double>(values.size());
  double square = 0;
  for (const float v : values) square += (v - mean) * (v - mean);
  if (square < k_min_template_variance * static_cast<double>(values.size())) return {};
  for (float& v : values) v = static_cast<float>((v - mean) / std::sqrt(square));
  return values;
}

void read_templates(const QuadReader& reader,
                    const std::vector<TemplatePattern>& templates,
                    Readings* readings) {
  if (templates.empty()) return;
  std::map<std::pair<int, double>, std::vector<float>> seen;  // by the template's size and border
  std::vector<std::pair<double, Pattern>> alike;
  std::optional<Readings::Accepted> best;
  double most = 0;
  for (const TemplatePattern& drawn : templates) {
    const auto [found, is_new] = seen.try_emplace({drawn.size, drawn.border});
    std::vector<float>& values = found->second;
    if (is_new && has_template_border(reader, drawn.border))
      values = read_inside(reader, drawn.size, drawn.border);
    if (values.empty()) continue;
    std::array<double, 4> turns;
    for (std::size_t k = 0; k < 4; ++k) {
      turns[k] = correlation(drawn.rotations[k], values);
      alike.emplace_back(turns[k], pattern_of(drawn, k));
    }
    const auto top = static_cast<std::size_t>(std::max_element(turns.begin(), turns.end()) - turns.begin());
    std::sort(turns.begin(), turns.end());
    if (turns[3] < k_min_correlation || turns[3] - turns[2] < k_min_rotation_lead) continue;
    if (turns[3] <= most) continue;
    most = turns[3];
    best = {{{drawn.family, drawn.id}, top, 0, {}}, pattern_of(drawn, top), k_middle, 1};
  }
  if (best) readings->accepted.push_back(*best);
  // The two most similar of all templates and their rotations; one of them may be the best itself.
  const auto two = alike.begin() + std::min<std::ptrdiff_t>(2, std::ssize(alike));
  std::partial_sort(alike.begin(), two, alike.end(),
                    [](const auto& a, const auto& b) { return a.first > b.first; });
  for (auto other = alike.begin(); other != two; ++other) readings->others.push_back(other->second);
}

void read_codes(const QuadReader& reader,
                const std::vector<CodeFamily>& families,
                Reading reading,
                Readings* readings) {
  const std::size_t limits = reading == Reading::covered ? k_limits.size() : 1;
  CellSamples samples;
  std::array<Bits, k_limits.size()> bits;
  const CodeFamily* last = nullptr;
  for (const CodeFamily& family : families) {
    if (is_barcode(family)) continue;
    const CodeGrid& grid = family.grid;
    const bool is_read = samples.cells == grid.width && samples.rings == grid.rings;
    if (!is_read) reader.read(grid.width, grid.rings, &samples);
    const bool has_bits = last && have_same_cells(*last, family);
    last = &family;
    for (std::size_t i = 0; i < limits; ++i) {
      if (!has_bits) bits[i] = bits_of(grid_of(samples, k_limits[i]), grid);
      read_code(families, family, bits[i], k_limits[i], reading, readings);
    }
  }
}

// Whether the paper beside each side (top, right, bottom, left) is light.
std::array<bool, 4> light_surroundings(const QuadReader& reader) {
  constexpr int k_places = 8;       // places along a side
  constexpr int k_dark_places = 1;  // that may be dark
  std::array<Places, 4> beside;
  for (int i = 0; i < k_places; ++i) {
    const double along = (i + 0.5) / k_places;
    beside[0].add(along, -k_surroundings);
    beside[1].add(1 + k_surroundings, along);
    beside[2].add(along, 1 + k_surroundings);
    beside[3].add(-k_surroundings, along);
  }
  std::array<bool, 4> is_light{};
  for (std::size_t side = 0; side < 4; ++side)
    is_light[side] = reader.light_places(beside[side]) >= k_places - k_dark_places;
  return is_light;
}

// Reads codes of which something covers a part of one side, border or paper; the paper beside the other sides
// must be light.
void read_beside_broken_side(const QuadReader& reader,
                             const std::vector<CodeFamily>& families,
                             Readings* readings) {
  const std::array<bool, 4> is_light = light_surroundings(reader);
  const auto dark_sides = std::ranges::count(is_light, false);
  if (dark_sides > 1) return;
  for (const CodeFamily& family : families) {
    if (!can_have_broken_side(family)) continue;
    const CodeGrid& grid = family.grid;
    CellSamples samples;
    reader.read(grid.width, grid.rings, &samples);
    const Bits bits = bits_of(grid_of(samples, k_middle), grid);
    bool is_broken = false;  // on one side alone
    for (std::size_t side = 0; side < 4; ++side)
      is_broken |= bits.only_breaks(side) && (dark_sides == 0 || !is_light[side]);
    if (is_broken && is_clear_beside_broken_side(family, bits))
      read_code(families, family, bits, k_middle, readable_bits(bits, grid.bits, 0), readings);
  }
}

std::optional<Identity> read(const QuadReader& reader,
                             const Families& families,
                             Reading reading,
                             Certainty certainty) {
  std::array<std::byte, 1 << 14> buffer;  // enough in nearly all cases
  std::pmr::monotonic_buffer_resource memory(buffer.data(), buffer.size());
  Readings readings(certainty, &memory);
  const bool exact = reading == Reading::broken_side;
  if (exact)
    read_beside_broken_side(reader, families.codes(), &readings);
  else
    read_codes(reader, families.codes(), reading, &readings);
  if (reading == Reading::open) {
    read_barcodes(reader, families, &readings);
    read_templates(reader, families.templates(), &readings);
    if (!readings.accepted.empty() && certainty == Certainty::weighed)
      add_rival_barcodes(reader, families, &readings);
  }
  if (auto chosen = choose_reading(reader, readings)) return chosen;
  if (exact || families.wide_borders().empty() || !has_wide_border(reader)) return std::nullopt;
  Readings wide(certainty, &memory);
  read_codes(reader, families.wide_borders(), reading, &wide);
  return choose_reading(reader, wide);
}

}  // namespace
}  // namespace identity

bool can_be_covered(const CodeFamily& family) {
  return !is_barcode(family) && family.grid.rings == 0 && family.max_errors.size() > 1;
}

bool can_have_broken_side(const CodeFamily& family) {
  return !is_barcode(family) && family.grid.rings == 0 && family.border_cells == 1 && !can_be_covered(family);
}

bool has_dark_border(const cv::Mat& grey, const RefinedQuad& quad, double border) {
  return identity::is_border_dark(identity::QuadReader(grey, quad, 0), border);
}

std::optional<Identity> identify(const cv::Mat& grey,
                                 const RefinedQuad& quad,
                                 const Families& families,
                                 Reading reading,
                                 Certainty certainty) {
  const double beyond = std::max(families.reach(), reading == Reading::open ? 0 : identity::k_surroundings);
  if (reading != Reading::open)
    return identity::read(identity::QuadReader(grey, quad, beyond), families, reading, certainty);
  if (auto found = identity::read(identity::QuadReader(grey, quad, beyond), families, reading, certainty))
    return found;
  // Something brighter than the paper may lie behind one side: use the level of the second darkest side for
  // all.
  std::array<double, 4> levels = quad.outside_level;
  std::sort(levels.begin(), levels.end());
  if (levels[3] < identity::k_uneven_paper * levels[1]) return std::nullopt;
  RefinedQuad even = quad;
  even.outside_level.fill(levels[1]);
  return identity::read(identity::QuadReader(grey, even, beyond), families, reading, certainty);
}

}  // namespace limn::tracker
