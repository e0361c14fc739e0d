#include "tracker/identify.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <memory_resource>
#include <numeric>
#include <utility>
#include <vector>

#include "tracker/quad_sampler.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr int k_max_grid = 9;  // 7 cells and the border
// Largest share of border cells that may read white (a finger, glare). Families with few bits need a clean
// border.
constexpr double k_border_errors = 0.12;
constexpr double k_border_errors_few_bits = 0.05;
// The same where the marker may be covered, and the margins below which cells are then counted as hidden.
constexpr double k_border_errors_covered = 0.25;
constexpr std::array<double, 4> k_hidden_below = {0, 0.2, 0.4, 0.6};
constexpr int k_few_bits = 25;
// Smallest mean margin of the cells (0: at the limit between black and white, 1: as black or white as beside
// the edge). Clutter has less.
constexpr double k_min_margin = 0.35;
constexpr double k_min_margin_few_bits = 0.5;
// Largest margin that all wrong bits may have together, as a share of the sum over all bits: a clear bit that
// is wrong is not noise.
constexpr double k_max_wrong_margin = 0.1;
constexpr double k_uneven_paper = 1.3;            // brightest side over the second darkest
constexpr double k_min_template_variance = 0.02;  // standard deviation of a fifteenth of black to white
constexpr double k_brightest = 2;         // bound on brightness, so that glare counts no more than this
constexpr double k_sharpen_below_px = 4;  // smaller cells blur into each other
constexpr double k_sharpening = 0.25;     // weight of the Laplacian
// Every bit of a barcode is data. Its code cannot reject clutter, so its light must: smallest and mean margin
// of its cells, and the share of its border's places that may be light.
constexpr double k_min_barcode_margin = 0.4;
constexpr double k_min_mean_barcode_margin = 0.75;
constexpr double k_barcode_border_errors = 0.02;

// The plane a + b x + c y over the unit square, through the values at the middles of its four sides.
struct Plane {
  float a, b, c;
  explicit Plane(const std::array<double, 4>& side)
      : a(static_cast<float>(0.25 * (side[0] + side[1] + side[2] + side[3]) - 0.5 * (side[1] - side[3]) -
                             0.5 * (side[2] - side[0]))),
        b(static_cast<float>(side[1] - side[3])),
        c(static_cast<float>(side[2] - side[0])) {}
};

// Places in the unit square.
struct Places {
  std::size_t count = 0;
  std::array<float, QuadSampler::k_most> x, y;

  void add(double at_x, double at_y) {
    x[count] = static_cast<float>(at_x);
    y[count++] = static_cast<float>(at_y);
  }
  // Adds one or five places in the middle half of the cell about (x, y), of a grid with `cells` a side.
  void add_cell(double at_x, double at_y, double cells, bool several) {
    add(at_x, at_y);
    if (!several) return;
    const double d = 0.2 / cells;
    add(at_x - d, at_y - d);
    add(at_x + d, at_y - d);
    add(at_x - d, at_y + d);
    add(at_x + d, at_y + d);
  }
};

using Fractions = std::array<float, QuadSampler::k_most>;
using Grid = std::array<double, k_max_grid * k_max_grid>;

// The limits between black and white that are tried. It is the middle, or lower where a shadow crosses: white
// paper in the shadow must be lighter than the ink in the light (a shadow 4 times darker and ink 7 times
// darker than paper).
constexpr double k_middle = 0.5;
constexpr std::array<double, 3> k_limits = {k_middle, 0.35, 0.22};

// Samples as fractions of the way from black to white, at one or five places of every cell, border included.
struct CellSamples {
  int cells = 0;  // cells along a side, border included
  bool several = false;
  Fractions fraction;

  std::size_t places() const { return several ? 5 : 1; }
};
static_assert(5 * k_max_grid * k_max_grid <= QuadSampler::k_most);

// -1 at black, 0 at the limit, 1 as far above the limit as black is below it.
inline float relative(float fraction, float limit) {
  constexpr auto k_most = static_cast<float>(k_brightest);
  const float value = (fraction - limit) / limit;
  const float bounded = value < k_most ? value : k_most;
  return bounded > -k_most ? bounded : -k_most;
}

// Replaces levels by fractions of the way from dark to light at their places.
LIMN_SIMD void to_fractions(const Plane& dark,
                            const Plane& light,
                            const float* __restrict x,
                            const float* __restrict y,
                            std::size_t count,
                            float* __restrict levels) {
  for (std::size_t i = 0; i < count; ++i) {
    const float low = dark.a + dark.b * x[i] + dark.c * y[i];
    const float apart = light.a + light.b * x[i] + light.c * y[i] - low;
    const float range = apart > 2 ? apart : 2;
    levels[i] = (levels[i] - low) / range;
  }
}

// Reads one quad, relative to the levels inside and outside its edges.
struct Reader {
  QuadSampler levels;
  Plane light, dark;
  double side_px;

  Reader(const cv::Mat& image, const RefinedQuad& quad)
      : levels(image, quad.corners_px),
        light(quad.outside_level),
        dark(quad.inside_level),
        side_px(std::sqrt(area(quad.corners_px))) {}

  static double area(const std::array<Eigen::Vector2d, 4>& q) {
    const Eigen::Vector2d a = q[2] - q[0];
    const Eigen::Vector2d b = q[3] - q[1];
    return 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  }

  void fractions(const Places& places, Fractions* into) const {
    const std::span x = std::span(places.x).first(places.count), y = std::span(places.y).first(places.count);
    levels.between(x, y, into->data());
    to_fractions(dark, light, x.data(), y.data(), places.count, into->data());
  }

  // Number of places that are light.
  int light_places(const Places& places) const {
    Fractions found;
    fractions(places, &found);
    return static_cast<int>(std::count_if(found.begin(),
                                          found.begin() + static_cast<std::ptrdiff_t>(places.count),
                                          [](float fraction) { return fraction > k_middle; }));
  }

  void read(int cells, CellSamples* samples) const {
    read_cells(
        cells, cells, [&](int i) { return (i + 0.5) / cells; }, samples);
  }

  // For a family whose border is wider than a cell: the border counts as one ring of cells, read in its
  // middle.
  void read_barcode(const CodeFamily& family, CellSamples* samples) const {
    const double side_cells = family.cells + 2 * family.border_cells;
    const auto middle = [&](int i) {
      if (i == 0) return 0.5 * family.border_cells / side_cells;
      if (i > family.cells) return 1 - 0.5 * family.border_cells / side_cells;
      return (family.border_cells + i - 0.5) / side_cells;
    };
    read_cells(family.cells + 2, side_cells, middle, samples);
  }

 private:
  template <typename Middle>
  void read_cells(int cells, double side_cells, const Middle& middle, CellSamples* samples) const {
    samples->cells = cells;
    samples->several = side_px / side_cells >= k_sharpen_below_px;
    Places places;
    for (int row = 0; row < cells; ++row)
      for (int column = 0; column < cells; ++column)
        places.add_cell(middle(column), middle(row), side_cells, samples->several);
    fractions(places, &samples->fraction);
  }
};

// ---- certainty ----

// The pattern that a quad would show, in the quad's rotation.
struct Pattern {
  double border = 0, cells = 0;  // width of the border, cells along a side
  std::uint64_t code = 0;
  const TemplatePattern* drawn = nullptr;  // a template instead of a code
  std::size_t rotation = 0;                // the template's

  bool operator==(const Pattern&) const = default;

  // The row (or column) of cells at a share of the side; -1 in the border.
  int cell_at(double share) const {
    const double place = share * (cells + 2 * border) - border;
    return place < 0 || place >= cells ? -1 : static_cast<int>(place);
  }
  // Value of a cell, -1 black … 1 white.
  float value(int row, int column) const {
    if (row < 0 || column < 0) return -1;
    const int columns = static_cast<int>(cells);
    if (!drawn) return (code >> (columns * columns - 1 - (row * columns + column))) & 1 ? 1 : -1;
    for (std::size_t k = 0; k < rotation; ++k) row = columns - 1 - std::exchange(column, row);
    return static_cast<float>(drawn->grey[static_cast<std::size_t>(row * columns + column)] / 127.5 - 1);
  }
};

Pattern pattern_of(const CodeFamily& family, std::uint64_t code) {
  return {family.border_cells, static_cast<double>(family.cells), code, nullptr, 0};
}
Pattern pattern_of(const TemplatePattern& drawn, std::size_t rotation) {
  return {0.5 * drawn.size, static_cast<double>(drawn.size), 0, &drawn, rotation};
}

// The patterns accepted in a quad, and rival patterns that it might show instead.
struct Readings {
  struct Accepted {
    Identity identity;
    Pattern pattern;
    double limit = k_middle;  // the one between black and white
    double random_hit = 1;    // probability that random cells are accepted as some marker of the family
  };
  Certainty certainty = Certainty::weighed;
  std::pmr::vector<Accepted> accepted;
  std::pmr::vector<Pattern> others;

  Readings(Certainty wanted, std::pmr::memory_resource* memory)
      : certainty(wanted), accepted(memory), others(memory) {}
};

// The whole square, sampled at the same places for every pattern, whatever its cells, and smoothed as
// templates are.
class SeenSquare {
 public:
  SeenSquare(const Reader& reader, double limit);
  /// Correlation of the pattern with the square, -1 … 1.
  double correlation(const Pattern& pattern) const;

 private:
  static constexpr std::size_t k_places = 20;  // places along a side
  using Values = std::array<float, k_places * k_places>;
  Values values_;

  static double share(std::size_t place) { return (static_cast<double>(place) + 0.5) / k_places; }
  // Smooths and scales to zero mean and unit length.
  static void normalise(Values* values);
};

double mean_relative(const float* fractions, std::size_t places, double limit) {
  double sum = 0;
  for (std::size_t i = 0; i < places; ++i) sum += relative(fractions[i], static_cast<float>(limit));
  return sum / static_cast<double>(places);
}

LIMN_SIMD float sum_of(const float* __restrict values, std::size_t count) {
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::size_t i = 0; i < count; ++i) sum += values[i];
  return sum;
}

LIMN_SIMD float product_of(const float* a, const float* b, std::size_t count) {
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

void SeenSquare::normalise(Values* values) {
  Values scratch;
  smooth(*values, scratch, k_places);
  const float mean = sum_of(values->data(), values->size()) / (k_places * k_places);
  for (float& value : *values) value -= mean;
  const float scale = 1 / std::sqrt(1e-9f + product_of(values->data(), values->data(), values->size()));
  for (float& value : *values) value *= scale;
}

SeenSquare::SeenSquare(const Reader& reader, double limit) {
  Places places;
  for (std::size_t row = 0; row < k_places; ++row)
    for (std::size_t column = 0; column < k_places; ++column) places.add(share(column), share(row));
  Fractions fractions;
  reader.fractions(places, &fractions);
  for (std::size_t i = 0; i < values_.size(); ++i)
    values_[i] = relative(fractions[i], static_cast<float>(limit));
  normalise(&values_);
}

// A place on the border between two cells counts half of each, so that the value does not depend on the
// square's rotation.
double SeenSquare::correlation(const Pattern& pattern) const {
  constexpr double k_beside = 1e-6;
  std::array<int, k_places> before, after;  // the cells on both sides of each place
  for (std::size_t i = 0; i < k_places; ++i) {
    before[i] = pattern.cell_at(share(i) - k_beside);
    after[i] = pattern.cell_at(share(i) + k_beside);
  }
  Values shown;
  for (std::size_t row = 0; row < k_places; ++row) {
    float* const into = &shown[row * k_places];
    if (row > 0 && before[row] == after[row - 1] && before[row] == before[row - 1] &&
        after[row] == before[row]) {
      std::copy_n(into - k_places, k_places, into);
      continue;
    }
    for (std::size_t column = 0; column < k_places; ++column) {
      const auto of_row = [&](int cell) {
        return 0.5F * (pattern.value(cell, before[column]) + pattern.value(cell, after[column]));
      };
      const float upper = of_row(before[row]);
      into[column] = after[row] == before[row] ? upper : 0.5F * (upper + of_row(after[row]));
    }
  }
  normalise(&shown);
  return product_of(shown.data(), values_.data(), values_.size());
}

// Log likelihood ratio of a pattern and none, for `k_independent` values in Gaussian noise whose variance is
// estimated from the residual. The floor is the share that geometry and light leave unexplained at best.
constexpr double k_independent = 60;
constexpr double k_residual_floor = 0.03;
double evidence(double correlation) {
  const double c = std::clamp(correlation, 0.0, 1.0);
  return 0.5 * k_independent * std::log((1 + k_residual_floor) / (1 - c * c + k_residual_floor));
}

// An unknown pattern is assumed to explain the square as well as a pattern with this correlation.
constexpr double k_unknown_correlation = 0.75;

// The likeliest reading, with the probability that it is right; nullopt when that is too low.
std::optional<Identity> chosen(const Reader& reader, const Readings& readings) {
  if (readings.accepted.empty()) return std::nullopt;
  if (readings.certainty == Certainty::any) return readings.accepted.front().identity;
  std::array<std::optional<SeenSquare>, k_limits.size()> seen_by_limit;
  const auto seen_at = [&](double limit) -> const SeenSquare& {
    const auto i =
        static_cast<std::size_t>(std::find(k_limits.begin(), k_limits.end(), limit) - k_limits.begin());
    if (!seen_by_limit[i]) seen_by_limit[i].emplace(reader, limit);
    return *seen_by_limit[i];
  };
  const Readings::Accepted* best = nullptr;
  double most = -2;
  for (const Readings::Accepted& reading : readings.accepted) {
    const double alike = seen_at(reading.limit).correlation(reading.pattern);
    if (alike <= most) continue;
    most = alike;
    best = &reading;
  }
  const SeenSquare& seen = seen_at(best->limit);
  double next = 0;
  const auto compete = [&](const Pattern& other) {
    if (other != best->pattern) next = std::max(next, seen.correlation(other));
  };
  for (const Readings::Accepted& reading : readings.accepted) compete(reading.pattern);
  for (const Pattern& other : readings.others) compete(other);
  const double another = std::exp(evidence(next) - evidence(most));
  const double unknown = best->random_hit * std::exp(evidence(k_unknown_correlation) - evidence(most));
  Identity identity = best->identity;
  identity.score = 1 / (1 + another + unknown);
  if (identity.score < k_min_confidence) return std::nullopt;
  return identity;
}

// Removes blur from the four neighbours (outside the marker is white).
void sharpen(int cells, Grid* grid) {
  const Grid before = *grid;
  const auto value = [&](int row, int column) {
    const bool outside = row < 0 || column < 0 || row >= cells || column >= cells;
    return outside ? 1.0 : before[static_cast<std::size_t>(row * cells + column)];
  };
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column) {
      const double here = value(row, column);
      const double around =
          value(row - 1, column) + value(row + 1, column) + value(row, column - 1) + value(row, column + 1);
      (*grid)[static_cast<std::size_t>(row * cells + column)] = here + k_sharpening * (4 * here - around);
    }
}

// Values of all cells, border included.
Grid grid_of(const CellSamples& samples, double limit) {
  Grid grid;
  const auto count = static_cast<std::size_t>(samples.cells * samples.cells);
  for (std::size_t i = 0; i < count; ++i)
    grid[i] = mean_relative(&samples.fraction[i * samples.places()], samples.places(), limit);
  if (!samples.several) sharpen(samples.cells, &grid);
  return grid;
}

struct Bits {
  std::uint64_t code = 0;
  std::array<double, 64> margin;  // for each bit, lowest first; at most 1
  double mean_margin = 0;
  int border_errors = 0;
  int border_cells = 0;
};

Bits bits_of(const Grid& grid, int cells) {
  Bits bits;
  const int width = cells + 2;
  int at = cells * cells;
  for (int row = 0; row < width; ++row)
    for (int column = 0; column < width; ++column) {
      const double value = grid[static_cast<std::size_t>(row * width + column)];
      if (row == 0 || column == 0 || row > cells || column > cells) {
        ++bits.border_cells;
        bits.border_errors += value > 0;
        continue;
      }
      bits.code = (bits.code << 1) | std::uint64_t{value > 0};
      const double margin = std::min(1.0, std::abs(value));
      bits.margin[static_cast<std::size_t>(--at)] = margin;
      bits.mean_margin += margin / (cells * cells);
    }
  return bits;
}

bool is_barcode(const CodeFamily& family) { return family.border_cells != 1; }

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
  // A barcode's border is not always a whole number of cells.
  if (is_barcode(family)) return cells;
  cells.count = family.cells + 2;
  int bit = family.cells * family.cells;
  for (int row = 1; row <= family.cells; ++row)
    for (int column = 1; column <= family.cells; ++column)
      cells.white[static_cast<std::size_t>(row * cells.count + column)] = (code >> --bit) & 1;
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

// The code other than `code` that would need the least margin of wrong bits, of any family with the same
// geometry of cells.
LIMN_POPCOUNT std::uint64_t next_code(const Families& families,
                                      const CodeFamily& family,
                                      const Bits& bits,
                                      std::uint64_t code) {
  const auto count = static_cast<std::size_t>(family.cells * family.cells);
  std::array<double, 65> least{};  // smallest sum of margins, by the number of wrong bits
  std::copy_n(bits.margin.begin(), count, least.begin() + 1);
  std::sort(least.begin() + 1, least.begin() + 1 + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = 1; i <= count; ++i) least[i] += least[i - 1];
  std::uint64_t next = ~code & ((std::uint64_t{1} << count) - 1);
  double wrong = least[count] + 1;
  for (const CodeFamily& like : families.codes()) {
    if (like.cells != family.cells || like.border_cells != family.border_cells) continue;
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

bool read_code(const Families& families,
               const CodeFamily& family,
               const Bits& bits,
               double limit,
               std::uint64_t readable,
               Readings* readings) {
  const int count = family.cells * family.cells;
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

void read_code(const Families& families,
               const CodeFamily& family,
               const Bits& bits,
               double limit,
               Reading reading,
               Readings* readings) {
  const int count = family.cells * family.cells;
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
bool is_border_dark(const Reader& reader) {
  constexpr int k_places = 24;  // places along a side
  Places places;
  for (const double inset : {0.08, 0.19})
    for (int i = 0; i < k_places; ++i) {
      const double along = inset + (1 - 2 * inset) * i / k_places;
      places.add(along, inset);
      places.add(1 - inset, along);
      places.add(1 - along, 1 - inset);
      places.add(inset, 1 - along);
    }
  return reader.light_places(places) <= k_barcode_border_errors * 8 * k_places;
}

Bits barcode_bits(const Reader& reader, const CodeFamily& family) {
  CellSamples samples;
  reader.read_barcode(family, &samples);
  return bits_of(grid_of(samples, k_middle), family.cells);
}

void read_barcodes(const Reader& reader, const Families& families, Readings* readings) {
  for (const CodeFamily& family : families.codes()) {
    if (!is_barcode(family)) continue;
    const Bits bits = barcode_bits(reader, family);
    const auto least =
        std::min_element(bits.margin.begin(), bits.margin.begin() + family.cells * family.cells);
    if (*least < k_min_barcode_margin || bits.mean_margin < k_min_mean_barcode_margin) continue;
    if (is_border_dark(reader)) read_code(families, family, bits, k_middle, Reading::open, readings);
  }
}

// Adds the nearest code of every barcode family as a rival, even if its margins are too small for reading:
// almost any cells are a barcode with fewer cells.
void add_rival_barcodes(const Reader& reader, const Families& families, Readings* readings) {
  for (const CodeFamily& family : families.codes()) {
    if (!is_barcode(family)) continue;
    const Bits bits = barcode_bits(reader, family);
    const Nearest like = nearest(family.codes, bits.code, ~std::uint64_t{0});
    readings->others.push_back(pattern_of(family, family.codes[like.id][like.rotation]));
  }
}

// Whether there is a template's border, a quarter of the side wide: dark at 12 places of its middle ring.
bool has_template_border(const Reader& reader) {
  Places places;
  for (int i = 0; i < 3; ++i) {
    const double along = 0.2 + 0.3 * i;
    places.add(along, 0.125);
    places.add(along, 0.875);
    places.add(0.125, along);
    places.add(0.875, along);
  }
  return reader.light_places(places) <= 1;
}

double correlation(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// The inner half as size x size values, smoothed, with zero mean and unit length; empty when it is flat.
std::vector<float> read_inner_half(const Reader& reader, int size) {
  std::vector<float> values;
  const double cells = 2.0 * size;
  const bool several = reader.side_px / cells > 2;
  for (int row = 0; row < size; ++row) {
    Places places;
    for (int column = 0; column < size; ++column)
      places.add_cell((column + size / 2 + 0.5) / cells, (row + size / 2 + 0.5) / cells, cells, several);
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

void read_templates(const Reader& reader, const std::vector<TemplatePattern>& templates, Readings* readings) {
  if (templates.empty() || !has_template_border(reader)) return;
  std::map<int, std::vector<float>> seen;  // by the template's size
  std::vector<std::pair<double, Pattern>> alike;
  std::optional<Readings::Accepted> best;
  double most = 0;
  for (const TemplatePattern& drawn : templates) {
    if (!seen.contains(drawn.size)) seen[drawn.size] = read_inner_half(reader, drawn.size);
    const std::vector<float>& values = seen[drawn.size];
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
    best = {{{"artoolkit", drawn.id}, top, 0, {}}, pattern_of(drawn, top), k_middle, 1};
  }
  if (best) readings->accepted.push_back(*best);
  // The two most similar of all templates and their rotations; one of them may be the best itself.
  const auto two = alike.begin() + std::min<std::ptrdiff_t>(2, std::ssize(alike));
  std::partial_sort(alike.begin(), two, alike.end(),
                    [](const auto& a, const auto& b) { return a.first > b.first; });
  for (auto other = alike.begin(); other != two; ++other) readings->others.push_back(other->second);
}

void read_codes(const Reader& reader, const Families& families, Reading reading, Readings* readings) {
  const std::size_t limits = reading == Reading::open ? 1 : k_limits.size();
  CellSamples samples;
  std::array<Bits, k_limits.size()> bits;
  for (const CodeFamily& family : families.codes()) {
    if (is_barcode(family)) continue;
    const bool is_read = samples.cells == family.cells + 2;
    if (!is_read) reader.read(family.cells + 2, &samples);
    for (std::size_t i = 0; i < limits; ++i) {
      if (!is_read) bits[i] = bits_of(grid_of(samples, k_limits[i]), family.cells);
      read_code(families, family, bits[i], k_limits[i], reading, readings);
    }
  }
}

std::optional<Identity> read(const Reader& reader,
                             const Families& families,
                             Reading reading,
                             Certainty certainty) {
  std::array<std::byte, 1 << 14> buffer;  // enough in nearly all cases
  std::pmr::monotonic_buffer_resource memory(buffer.data(), buffer.size());
  Readings readings(certainty, &memory);
  read_codes(reader, families, reading, &readings);
  if (reading == Reading::open) {
    read_barcodes(reader, families, &readings);
    read_templates(reader, families.templates(), &readings);
    if (!readings.accepted.empty() && certainty == Certainty::weighed)
      add_rival_barcodes(reader, families, &readings);
  }
  return chosen(reader, readings);
}

// The level at `rank` in ascending order. There are few levels, so all are compared with all.
LIMN_SIMD int level_of_rank(const std::uint8_t* levels, int count, int rank) {
  constexpr int k_lanes = 64;
  std::array<std::uint8_t, k_lanes> padded{}, smaller{};
  std::copy_n(levels, count, padded.begin());
  for (int i = 0; i < count; ++i) {
    const std::uint8_t level = levels[i];
    for (std::size_t k = 0; k < k_lanes; ++k)
      smaller[k] = static_cast<std::uint8_t>(smaller[k] + (level < padded[k] ? 1 : 0));
  }
  int highest = 0;
#pragma omp simd reduction(max : highest)
  for (std::size_t k = 0; k < k_lanes; ++k) {
    const int level = smaller[k] <= rank ? padded[k] : 0;
    highest = level > highest ? level : highest;
  }
  return highest;
}

// Levels of the nearest pixels at some places of a quad.
template <std::size_t count>
std::array<std::uint8_t, count> nearest_levels(const cv::Mat& grey,
                                               const Quad& quad,
                                               const std::array<std::array<float, count>, 2>& places) {
  std::array<std::uint8_t, count> levels;
  QuadSampler(grey, quad.corners_px).nearest(places[0], places[1], levels.data());
  return levels;
}

}  // namespace

bool can_be_covered(const CodeFamily& family) { return !is_barcode(family) && family.max_errors.size() > 1; }

bool may_be_marker(const cv::Mat& grey, const Quad& quad, double min_contrast) {
  constexpr float k_inset = 0.07F;  // inside the border of every family (a ninth or more)
  constexpr std::size_t k_border = 20, k_inside = 25;
  static constexpr auto k_at = [] {
    std::array<std::array<float, k_border + k_inside>, 2> at{};
    std::size_t count = 0;
    const auto add = [&](float x, float y) { at[0][count] = x, at[1][count++] = y; };
    for (std::size_t i = 0; i < k_border / 4; ++i) {
      const float along = 0.1F + 0.2F * static_cast<float>(i);
      add(along, k_inset), add(along, 1 - k_inset), add(k_inset, along), add(1 - k_inset, along);
    }
    for (int row = 0; row < 5; ++row)
      for (int column = 0; column < 5; ++column)
        add(0.2F + 0.15F * static_cast<float>(column), 0.2F + 0.15F * static_cast<float>(row));
    return at;
  }();
  const auto levels = nearest_levels(grey, quad, k_at);
  const auto inside = levels.begin() + k_border;
  const int lightest = *std::max_element(inside, levels.end());
  const int middle = level_of_rank(levels.data(), k_border, k_border / 2);
  if (lightest - middle < min_contrast) return false;
  // Three quarters of the border must be darker than a limit halfway to the lightest inside.
  return level_of_rank(levels.data(), k_border, k_border * 3 / 4) < middle + 0.6 * (lightest - middle);
}

bool may_be_covered_code(const cv::Mat& grey, const Quad& quad) {
  constexpr std::size_t k_along = 10, k_border = 4 * k_along;
  constexpr int k_max_light = k_border * 7 / 40;  // codes with fingers, bites or slatted shadow have up to 5
  constexpr std::size_t k_cells = 6;
  // Smallest number of changes between neighbouring cells, of 60 pairs. Every code of the families that are
  // read when covered has at least 17, and a quarter may be hidden. Two or three edges through a quad make
  // 12.
  constexpr int k_min_changes = 13;
  static constexpr auto k_at = [] {
    std::array<std::array<float, k_border + k_cells * k_cells>, 2> at{};
    std::size_t count = 0;
    const auto add = [&](float x, float y) { at[0][count] = x, at[1][count++] = y; };
    for (std::size_t i = 0; i < k_along; ++i) {
      constexpr float k_inset = 1.0F / 16;
      const float along = k_inset + (1 - 2 * k_inset) * static_cast<float>(i) / (k_along - 1);
      add(along, k_inset), add(along, 1 - k_inset), add(k_inset, along), add(1 - k_inset, along);
    }
    const auto middle = [](std::size_t i) { return (static_cast<float>(i) + 1.5F) / (k_cells + 2); };
    for (std::size_t row = 0; row < k_cells; ++row)
      for (std::size_t column = 0; column < k_cells; ++column) add(middle(column), middle(row));
    return at;
  }();
  const auto levels = nearest_levels(grey, quad, k_at);
  const auto border = std::span(levels).first(k_border);
  const auto inside = std::span(levels).subspan(k_border);
  const double dark = level_of_rank(border.data(), k_border, k_border / 2);
  // The brightest may be glare.
  const double light = level_of_rank(inside.data(), static_cast<int>(inside.size()), 31);
  const double middle = dark + k_middle * (light - dark);
  if (std::count_if(border.begin(), border.end(), [&](int level) { return level > middle; }) > k_max_light)
    return false;
  return std::any_of(k_limits.begin(), k_limits.end(), [&](double share) {
    const double limit = dark + share * (light - dark);
    int changes = 0;
    for (std::size_t i = 0; i < inside.size(); ++i) {
      const bool is_light = inside[i] > limit;
      changes += i % k_cells != k_cells - 1 && is_light != (inside[i + 1] > limit);
      changes += i + k_cells < inside.size() && is_light != (inside[i + k_cells] > limit);
    }
    return changes >= k_min_changes;
  });
}

bool has_quarter_border(const cv::Mat& grey, const RefinedQuad& quad) {
  return is_border_dark(Reader(grey, quad));
}

std::optional<Identity> identify(const cv::Mat& grey,
                                 const RefinedQuad& quad,
                                 const Families& families,
                                 Reading reading,
                                 Certainty certainty) {
  if (reading == Reading::covered) return read(Reader(grey, quad), families, reading, certainty);
  if (const auto found = read(Reader(grey, quad), families, reading, certainty)) return found;
  // Something brighter than the paper may lie behind one side: use the level of the second darkest side for
  // all.
  std::array<double, 4> levels = quad.outside_level;
  std::sort(levels.begin(), levels.end());
  if (levels[3] < k_uneven_paper * levels[1]) return std::nullopt;
  RefinedQuad even = quad;
  even.outside_level.fill(levels[1]);
  return read(Reader(grey, even), families, reading, certainty);
}

}  // namespace limn::tracker
