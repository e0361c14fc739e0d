#include "calib/code/shot_order.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <tuple>

#include "core/image_io.h"
#include "core/log.h"
#include "core/median.h"
#include "core/names.h"
#include "core/parallel.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

// Lines of pixels across and down that all series together are tested on, and the limits for one series.
constexpr int k_all_lines = 240, k_most_lines = 24, k_least_lines = 6;
constexpr size_t k_blur_px = 5;      // distance over which an edge is blurred: no bit is sure within it
constexpr double k_least_range = 8;  // levels between bright and dark; below, noise flips bits
constexpr double k_of_bright = 0.3;  // share of a bright pixel's range; weaker ones are lit by reflections
constexpr double k_sure = 0.2;       // share of the range: distance from the threshold at which a bit is sure
constexpr int k_most_images = 64;    // bits of a word; the largest Gray code has 58
constexpr int k_least_changes = 12;  // changes of one bit; fewer say nothing about its place in the code
constexpr int k_least_pixels = 400;  // illuminated neighbours over all series
constexpr double k_fits = 0.7;       // share of the changes that are as in Gray code
constexpr double k_most_uneven = 0.1;    // share of the pixels where white is dark or black bright
constexpr double k_most_unpaired = 0.2;  // share of the pixels where an inverse shows the same as its pattern
constexpr double k_steady = 0.5;  // share of the label's changes along its direction that have one sign
constexpr int k_apart_px = 12;    // distance of pixels whose labels show the axis's direction
constexpr int k_most_step_px = 16;

bool has_columns(AxisOrder axes) { return axes != AxisOrder::rows; }
bool has_rows(AxisOrder axes) { return axes != AxisOrder::columns; }

// The images of one axis, widest stripes first: of the patterns, and of their inverses (empty: none).
struct AxisShots {
  std::vector<int> patterns, inverses;
  bool operator<(const AxisShots& other) const {
    return std::tie(patterns, inverses) < std::tie(other.patterns, other.inverses);
  }
};

// An order with the place of every image.
struct Layout {
  ShotOrder order;
  int count = 0;
  int white = -1, black = -1;
  AxisShots columns = {}, rows = {};
};

// Places white and black; returns the index of the first other image.
int place_white(Layout* layout) {
  const int last = layout->count - 1;
  switch (layout->order.white) {
    case WhitePlace::absent:
      return 0;
    case WhitePlace::white_black_first:
      layout->white = 0, layout->black = 1;
      return 2;
    case WhitePlace::black_white_first:
      layout->white = 1, layout->black = 0;
      return 2;
    case WhitePlace::white_black_last:
      layout->white = last - 1, layout->black = last;
      return 0;
    case WhitePlace::black_white_last:
      layout->white = last, layout->black = last - 1;
      return 0;
    case WhitePlace::white_first_black_last:
      layout->white = 0, layout->black = last;
      return 1;
    case WhitePlace::black_first_white_last:
      layout->white = last, layout->black = 0;
      return 1;
  }
  return 0;
}

Layout layout_of(const ShotOrder& order, int width, int height) {
  const int columns = has_columns(order.axes) ? bits_for(labels_on(width, order.step_px)) : 0;
  const int rows = has_rows(order.axes) ? bits_for(labels_on(height, order.step_px)) : 0;
  const int bits = columns + rows;
  Layout layout{order, bits * (order.inverses == InversePlace::none ? 1 : 2) + (order.has_white() ? 2 : 0)};
  const int first = place_white(&layout);
  const auto place = [&](int bit) -> std::pair<int, int> {  // places of the pattern and of its inverse
    switch (order.inverses) {
      case InversePlace::second:
        return {first + 2 * bit, first + 2 * bit + 1};
      case InversePlace::first:
        return {first + 2 * bit + 1, first + 2 * bit};
      case InversePlace::behind:
        return {first + bit, first + bits + bit};
      case InversePlace::before:
        return {first + bits + bit, first + bit};
      case InversePlace::none:
        break;
    }
    return {first + bit, -1};
  };
  const auto axis = [&](int from, int length) {
    AxisShots shots;
    for (int i = 0; i < length; ++i) {
      const auto [pattern, inverse] = place(from + (order.finest_first ? length - 1 - i : i));
      shots.patterns.push_back(pattern);
      if (inverse >= 0) shots.inverses.push_back(inverse);
    }
    return shots;
  };
  const bool rows_first = order.axes == AxisOrder::rows_columns;
  layout.columns = axis(rows_first ? rows : 0, columns);
  layout.rows = axis(rows_first ? 0 : columns, rows);
  return layout;
}

bool allows(const KnownOrder& known, const ShotOrder& order) {
  if (known.white) {
    const auto is = [&](std::initializer_list<WhitePlace> places) {
      return std::find(places.begin(), places.end(), order.white) != places.end();
    };
    using enum WhitePlace;
    const std::string& white = *known.white;
    if (white == "no-white" && !is({absent})) return false;
    if (white == "white-first" && !is({white_black_first, white_first_black_last})) return false;
    if (white == "black-first" && !is({black_white_first, black_first_white_last})) return false;
    if (white == "white-last" && !is({white_black_last, black_white_last})) return false;
  }
  return order.inverses == known.inverses.value_or(order.inverses) &&
         order.axes == known.axes.value_or(order.axes) &&
         order.finest_first == known.finest_first.value_or(order.finest_first) &&
         order.step_px == known.step_px.value_or(order.step_px);
}

// Whether stripes of several pixels still name enough labels on each axis to be a code.
bool has_enough_bits(const Layout& layout) {
  constexpr size_t k_least = 3;
  return (layout.columns.patterns.empty() || layout.columns.patterns.size() >= k_least) &&
         (layout.rows.patterns.empty() || layout.rows.patterns.size() >= k_least);
}

// Steps that give different numbers of bits: powers of two, or the one that is known.
std::vector<int> steps_of(const KnownOrder& known) {
  if (known.step_px) return {*known.step_px};
  return {1, 2, 4, 8, 16};
}

// All layouts that `known` allows, the most usual orders first.
std::vector<Layout> layouts(int width, int height, const KnownOrder& known) {
  using enum WhitePlace;
  std::vector<Layout> all;
  for (const int step : steps_of(known)) {
    for (const AxisOrder axes :
         {AxisOrder::columns_rows, AxisOrder::rows_columns, AxisOrder::columns, AxisOrder::rows}) {
      for (const InversePlace inverses : {InversePlace::second, InversePlace::first, InversePlace::none,
                                          InversePlace::behind, InversePlace::before}) {
        for (const WhitePlace white : {white_black_last, white_black_first, absent, black_white_first,
                                       black_white_last, white_first_black_last, black_first_white_last}) {
          for (const bool finest_first : {false, true}) {
            const ShotOrder order{white, inverses, axes, finest_first, step};
            if (!allows(known, order)) continue;
            Layout layout = layout_of(order, width, height);
            if (step == 1 || has_enough_bits(layout)) all.push_back(std::move(layout));
          }
        }
      }
    }
  }
  return all;
}

// The bits of neighbouring illuminated pixels on lines of one series: bit k of a word belongs to image k.
struct Line {
  bool is_across = true;  // else it runs down
  std::vector<std::uint64_t> bits, sure;
  std::vector<bool> lit;
};

// Values of one image along all lines, one after the other.
Result<std::vector<uchar>> values_of(const fs::path& file, int lines, cv::Size* size) {
  LIMN_TRY(const cv::Mat image, read_grey_image(file));
  if (size->empty()) *size = image.size();
  if (image.size() != *size)
    return error("{}: expected an image of {}x{} pixels, as the others of its series, found {}x{}.",
                 file.string(), size->width, size->height, image.cols, image.rows);
  std::vector<uchar> values;
  for (int i = 0; i < lines; ++i) {
    const uchar* row = image.ptr<uchar>((2 * i + 1) * image.rows / (2 * lines));
    values.insert(values.end(), row, row + image.cols);
  }
  for (int i = 0; i < lines; ++i) {
    const int x = (2 * i + 1) * image.cols / (2 * lines);
    for (int y = 0; y < image.rows; ++y) values.push_back(image.at<uchar>(y, x));
  }
  return values;
}

Line line_of(const std::vector<std::vector<uchar>>& images, size_t from, size_t length, double least) {
  Line line;
  for (size_t at = from; at < from + length; ++at) {
    int low = 255, high = 0;
    for (const auto& values : images) {
      low = std::min<int>(low, values[at]);
      high = std::max<int>(high, values[at]);
    }
    std::uint64_t bits = 0, sure = 0;
    const double middle = (low + high) / 2.0, margin = k_sure * (high - low);
    for (size_t k = 0; k < images.size(); ++k) {
      bits |= static_cast<std::uint64_t>(images[k][at] > middle ? 1 : 0) << k;
      sure |= static_cast<std::uint64_t>(std::abs(images[k][at] - middle) >= margin ? 1 : 0) << k;
    }
    line.bits.push_back(bits);
    line.sure.push_back(sure);
    line.lit.push_back(high - low >= least);
  }
  return line;
}

// The range that a pixel must have to count as illuminated.
double least_range(const std::vector<std::vector<uchar>>& images) {
  std::vector<int> ranges;
  for (size_t at = 0; at < images[0].size(); at += 7) {
    int low = 255, high = 0;
    for (const auto& values : images) {
      low = std::min<int>(low, values[at]);
      high = std::max<int>(high, values[at]);
    }
    ranges.push_back(high - low);
  }
  return std::max(k_least_range, k_of_bright * quantile(std::move(ranges), 0.95));
}

Result<std::vector<Line>> lines_of(const std::vector<fs::path>& series, int count) {
  std::vector<std::vector<uchar>> images;
  cv::Size size;
  for (const fs::path& file : series) {
    LIMN_TRY(std::vector<uchar> values, values_of(file, count, &size));
    images.push_back(std::move(values));
  }
  const double least = least_range(images);
  std::vector<Line> lines;
  const auto across = static_cast<size_t>(size.width), down = static_cast<size_t>(size.height);
  const auto all = static_cast<size_t>(count);
  for (size_t i = 0; i < all; ++i) lines.push_back(line_of(images, i * across, across, least));
  for (size_t i = 0; i < all; ++i) {
    lines.push_back(line_of(images, all * across + i * down, down, least));
    lines.back().is_across = false;
  }
  return lines;
}

Result<std::vector<Line>> lines_of_all(const std::vector<std::vector<fs::path>>& series) {
  const int count = std::clamp(k_all_lines / static_cast<int>(series.size()), k_least_lines, k_most_lines);
  std::vector<std::optional<Result<std::vector<Line>>>> parts(series.size());
  parallel_for(static_cast<int>(series.size()), [&](int i) {
    parts[static_cast<size_t>(i)] = lines_of(series[static_cast<size_t>(i)], count);
  });
  std::vector<Line> lines;
  for (auto& part : parts) {
    if (!part->ok()) return part->error();
    for (Line& line : **part) lines.push_back(std::move(line));
  }
  return lines;
}

std::uint64_t mask_of(int image) { return image < 0 ? 0 : std::uint64_t{1} << image; }

// How well the images of one axis are a Gray code.
struct AxisFit {
  double gray = 0;        // share of the changes of a bit that are as in Gray code, mean over the bits
  int tested = 0;         // number of bits with enough changes
  double unpaired = 0;    // share of the sure pixels where pattern and inverse are the same
  int largest = 0;        // largest label, in labels of the axis; the largest thousandth left out
  double steadiness = 0;  // share of the label's changes with one sign: 1 where it only grows or falls
  double along_x = 0, along_y = 0;  // median change of the label over k_apart_px pixels
};

// The axis's bits in a word of all images' bits, widest stripes highest.
unsigned code_of(std::uint64_t bits, const std::vector<int>& patterns) {
  unsigned code = 0;
  for (const int image : patterns) code = code << 1 | static_cast<unsigned>(bits >> image & 1);
  return code;
}

unsigned label_of(unsigned gray) {
  for (unsigned shift = 1; shift < 16; shift *= 2) gray ^= gray >> shift;
  return gray;
}

class AxisTest {
 public:
  explicit AxisTest(const AxisShots& shots) : shots_(shots) {
    const int bits = static_cast<int>(shots.patterns.size());
    left_out_ = bits >= 7 ? 2 : bits >= 5 ? 1 : 0;  // blur makes the finest bits unsure
    coarse_.assign(shots.patterns.begin(), shots.patterns.end() - left_out_);
    for (const int image : coarse_) needed_ |= mask_of(image);
    good_.resize(coarse_.size());
    all_.resize(coarse_.size());
  }

  void add(const Line& line) {
    size_t last = line.bits.size();  // the last pixel whose bits are sure; none yet
    for (size_t i = 0; i < line.bits.size(); ++i) {
      if (!line.lit[i]) continue;
      add_pixel(line, i);
      if ((line.sure[i] & needed_) == needed_) {
        if (last < i && i - last <= k_blur_px) add_neighbours(line.bits[last], line.bits[i]);
        last = i;
      }
      if (i + k_apart_px < line.bits.size() && line.lit[i + k_apart_px]) add_distant(line, i);
    }
  }

  AxisFit fit() {
    AxisFit fit;
    for (size_t k = 1; k < good_.size(); ++k) {
      if (all_[k] < k_least_changes) continue;
      fit.gray += static_cast<double>(good_[k]) / all_[k];
      ++fit.tested;
    }
    if (fit.tested > 0) fit.gray /= fit.tested;
    fit.unpaired = paired_ > 0 ? static_cast<double>(same_) / static_cast<double>(paired_) : 0;
    fit.largest = quantile(labels_, 0.999) << left_out_;
    fit.steadiness = std::max(steadiness_of(steps_[0], steps_[1]), steadiness_of(steps_[1], steps_[0]));
    fit.along_x = mean_of(&steps_[0]);
    fit.along_y = mean_of(&steps_[1]);
    return fit;
  }

 private:
  void add_pixel(const Line& line, size_t i) {
    for (size_t k = 0; k < shots_.inverses.size(); ++k) {
      const std::uint64_t pattern = mask_of(shots_.patterns[k]), inverse = mask_of(shots_.inverses[k]);
      if ((line.sure[i] & pattern) == 0 || (line.sure[i] & inverse) == 0) continue;
      ++paired_;
      same_ += ((line.bits[i] & pattern) != 0) == ((line.bits[i] & inverse) != 0) ? 1 : 0;
    }
  }

  // Where exactly one bit changes, the next finer one is 1 and all finer ones are 0.
  void add_neighbours(std::uint64_t first, std::uint64_t second) {
    if (((first ^ second) & needed_) == 0) return;
    const unsigned a = code_of(first, coarse_), changed = a ^ code_of(second, coarse_);
    if (std::popcount(changed) != 1) return;
    const int k = std::countr_zero(changed);
    ++all_[static_cast<size_t>(k)];
    if (k > 0 && (a & (changed - 1)) == changed >> 1) ++good_[static_cast<size_t>(k)];
  }

  void add_distant(const Line& line, size_t i) {
    if ((line.sure[i] & line.sure[i + k_apart_px] & needed_) != needed_) return;
    const int a = static_cast<int>(label_of(code_of(line.bits[i], coarse_)));
    const int b = static_cast<int>(label_of(code_of(line.bits[i + k_apart_px], coarse_)));
    labels_.push_back(a);
    steps_[line.is_across ? 0 : 1].push_back(b - a);
  }

  // The share of the changes that remains in their sum; 0 where the other direction's changes are larger. The
  // finer half of a Gray code is one, too, but its label goes up and down.
  static double steadiness_of(const std::vector<int>& steps, const std::vector<int>& others) {
    double sum = 0, sizes = 0, sizes_of_others = 0;
    for (const int step : steps) {
      sum += step;
      sizes += std::abs(step);
    }
    for (const int step : others) sizes_of_others += std::abs(step);
    return sizes > 0 && sizes >= sizes_of_others ? std::abs(sum) / sizes : 0;
  }

  // The mean without the tenths at both ends, which are depth edges.
  static double mean_of(std::vector<int>* steps) {
    if (steps->empty()) return 0;
    std::sort(steps->begin(), steps->end());
    const size_t cut = steps->size() / 10;
    double sum = 0;
    for (size_t i = cut; i < steps->size() - cut; ++i) sum += (*steps)[i];
    return sum / static_cast<double>(steps->size() - 2 * cut);
  }

  const AxisShots& shots_;
  int left_out_ = 0;
  std::vector<int> coarse_;
  std::uint64_t needed_ = 0;
  std::vector<int> good_, all_;  // for each bit, from the finest
  std::int64_t paired_ = 0, same_ = 0;
  std::vector<int> labels_;
  std::array<std::vector<int>, 2> steps_;
};

// The fits of all axes that were tested; many layouts share them.
class AxisFits {
 public:
  explicit AxisFits(const std::vector<Line>& lines) : lines_(lines) {}
  const AxisFit& of(const AxisShots& shots) {
    const auto [at, is_new] = fits_.try_emplace(shots);
    if (is_new && !shots.patterns.empty()) {
      AxisTest test(at->first);
      for (const Line& line : lines_) test.add(line);
      at->second = test.fit();
    }
    return at->second;
  }

 private:
  const std::vector<Line>& lines_;
  std::map<AxisShots, AxisFit> fits_;
};

// Share of the sure illuminated pixels where an image is bright.
std::vector<double> bright_shares(const std::vector<Line>& lines, int images) {
  std::vector<double> bright(static_cast<size_t>(images), 0), all(static_cast<size_t>(images), 1e-9);
  for (const Line& line : lines) {
    for (size_t i = 0; i < line.bits.size(); ++i) {
      if (!line.lit[i]) continue;
      for (int k = 0; k < images; ++k) {
        if ((line.sure[i] & mask_of(k)) == 0) continue;
        all[static_cast<size_t>(k)] += 1;
        bright[static_cast<size_t>(k)] += (line.bits[i] & mask_of(k)) != 0 ? 1 : 0;
      }
    }
  }
  for (size_t k = 0; k < bright.size(); ++k) bright[k] /= all[k];
  return bright;
}

// How likely the directions are in which columns and rows grow in the camera's images: an upright camera, one
// on its side, a mirrored projection, or a mirrored projection and a camera on its side.
double direction_score(const AxisFit& columns, const AxisFit& rows) {
  const double along = std::abs(columns.along_x * rows.along_y),
               crossed = std::abs(columns.along_y * rows.along_x);
  const bool is_mirrored = columns.along_x * rows.along_y - columns.along_y * rows.along_x < 0;
  const bool is_on_its_side = crossed > along;
  return is_mirrored ? (is_on_its_side ? -0.3 : -0.17) : (is_on_its_side ? -0.13 : 0);
}

struct Candidate {
  const Layout* layout = nullptr;
  double score = 0;
  bool fits = false, is_tested = false;
};

constexpr double k_rows_first = -0.05;  // score of an unusual order
constexpr double k_wide_step = -0.01;   // score of each pixel by which the stripes are wider than one
constexpr double k_impossible = -0.5;   // score of labels beyond the projector's edge

Candidate judged(
    const Layout& layout, const std::vector<double>& bright, AxisFits* fits, int width, int height) {
  Candidate candidate{&layout};
  if (layout.white >= 0 && (bright[static_cast<size_t>(layout.white)] < 1 - k_most_uneven ||
                            bright[static_cast<size_t>(layout.black)] > k_most_uneven))
    return candidate;
  double least = 1, unpaired = 0, beyond = 0, steadiness = 1;
  const std::array<std::pair<const AxisShots*, int>, 2> axes = {
      {{&layout.columns, width}, {&layout.rows, height}}};
  candidate.is_tested = true;
  for (const auto& [shots, size] : axes) {
    if (shots->patterns.empty()) continue;
    const AxisFit& fit = fits->of(*shots);
    candidate.is_tested = candidate.is_tested && fit.tested > 0;
    least = std::min(least, fit.gray);
    steadiness = std::min(steadiness, fit.steadiness);
    unpaired = std::max(unpaired, fit.unpaired);
    if (fit.largest >= labels_on(size, layout.order.step_px)) beyond = k_impossible;
  }
  candidate.fits = candidate.is_tested && least >= k_fits && unpaired <= k_most_unpaired &&
                   steadiness >= k_steady && beyond == 0;
  candidate.score = least - unpaired + beyond + k_wide_step * (layout.order.step_px - 1);
  if (layout.order.axes == AxisOrder::rows_columns) candidate.score += k_rows_first;
  if (!layout.columns.patterns.empty() && !layout.rows.patterns.empty())
    candidate.score += direction_score(fits->of(layout.columns), fits->of(layout.rows));
  return candidate;
}

// The best of the layouts; nullptr layout when there is none.
Candidate best_of(const std::vector<Layout>& layouts,
                  const std::vector<double>& bright,
                  AxisFits* fits,
                  int width,
                  int height) {
  Candidate best;
  for (const Layout& layout : layouts) {
    const Candidate candidate = judged(layout, bright, fits, width, height);
    const bool is_better = candidate.fits != best.fits ? candidate.fits : candidate.score > best.score;
    if (!best.layout || is_better) best = candidate;
  }
  return best;
}

// Whether a step that is no power of two explains the images as well; then only a person knows.
bool is_step_unsure(const Layout& layout, AxisFits* fits, int width, int height) {
  const auto explains = [&](int step) {
    const auto axis = [&](const AxisShots& shots, int size) {
      const int labels = labels_on(size, step);
      return shots.patterns.empty() || (bits_for(labels) == static_cast<int>(shots.patterns.size()) &&
                                        fits->of(shots).largest < labels);
    };
    return axis(layout.columns, width) && axis(layout.rows, height);
  };
  for (int step = layout.order.step_px + 1; step <= k_most_step_px; ++step) {
    if (explains(step)) return true;
  }
  return false;
}

Result<FoundOrder> found(const Layout& layout, int width, int height) {
  if (layout.order.axes == AxisOrder::rows)
    return error(
        "the images show a Gray code of rows only ({}). Limn reads columns, or columns and rows: capture the "
        "columns, too.",
        to_text(layout.order));
  CodeOptions options;
  options.inverses = layout.order.inverses != InversePlace::none;
  options.step_px = layout.order.step_px;
  if (layout.order.axes == AxisOrder::columns) options.axes = CodeAxes::columns;
  FoundOrder result;
  result.order = layout.order;
  LIMN_TRY(result.patterns, Patterns::create(PatternCode::gray, width, height, options));
  for (const AxisShots* axis : {&layout.columns, &layout.rows}) {
    for (size_t i = 0; i < axis->patterns.size(); ++i) {
      result.shots.push_back(axis->patterns[i]);
      if (!axis->inverses.empty()) result.shots.push_back(axis->inverses[i]);
    }
  }
  result.shots.push_back(layout.white);
  result.shots.push_back(layout.black);
  return result;
}

int illuminated(const std::vector<Line>& lines) {
  int count = 0;
  for (const Line& line : lines)
    count += static_cast<int>(std::count(line.lit.begin(), line.lit.end(), true));
  return count;
}

std::vector<Layout> with_count(std::vector<Layout> all, int count) {
  std::erase_if(all, [&](const Layout& layout) { return layout.count != count; });
  return all;
}

std::string series_name(const std::vector<std::vector<fs::path>>& series) {
  return series[0][0].parent_path().string();
}

Error no_order_fits(const std::vector<std::vector<fs::path>>& series, const KnownOrder& known, int count) {
  return error(
      "{}: the order of the images does not fit: no order of {} images of Gray code{} explains what they "
      "show. Expected each axis's bits from wide to narrow stripes (or narrow to wide), with or without "
      "inverses, white and black. Check --projector and --shots, whether images are missing or in a wrong "
      "place, and --order.",
      series_name(series), count, known.text.empty() ? "" : fmt::format(" with --order {}", known.text));
}

}  // namespace

std::string to_text(const ShotOrder& order) {
  constexpr std::array<const char*, 7> k_white = {
      "no white and black",   "white and black first",   "black and white first",  "white and black last",
      "black and white last", "white first, black last", "black first, white last"};
  constexpr std::array<const char*, 5> k_inverses = {
      "no inverses", "each pattern, then its inverse", "each inverse, then its pattern",
      "all patterns, then all inverses", "all inverses, then all patterns"};
  constexpr std::array<const char*, 4> k_axes = {"columns, then rows", "rows, then columns", "columns only",
                                                 "rows only"};
  std::string text =
      fmt::format("{}; {}; {}; {} stripes first", k_white[static_cast<size_t>(order.white)],
                  k_inverses[static_cast<size_t>(order.inverses)], k_axes[static_cast<size_t>(order.axes)],
                  order.finest_first ? "narrowest" : "widest");
  if (order.step_px > 1) text += fmt::format("; narrowest stripes {} pixels wide", order.step_px);
  return text;
}

Result<KnownOrder> KnownOrder::parse(const std::string& words) {
  static const std::map<std::string, InversePlace> k_inverses = {{"inverse-second", InversePlace::second},
                                                                 {"inverse-first", InversePlace::first},
                                                                 {"inverses-behind", InversePlace::behind},
                                                                 {"inverses-before", InversePlace::before},
                                                                 {"no-inverses", InversePlace::none}};
  static const std::map<std::string, AxisOrder> k_axes = {{"columns-first", AxisOrder::columns_rows},
                                                          {"rows-first", AxisOrder::rows_columns},
                                                          {"columns-only", AxisOrder::columns},
                                                          {"rows-only", AxisOrder::rows}};
  static const std::set<std::string> k_white = {"white-first", "black-first", "white-last", "no-white"};
  KnownOrder known;
  known.text = words;
  for (size_t from = 0; from < words.size();) {
    const size_t comma = std::min(words.find(',', from), words.size());
    const std::string word = words.substr(from, comma - from);
    from = comma + 1;
    const auto inverses = k_inverses.find(word);
    const auto axes = k_axes.find(word);
    if (inverses != k_inverses.end()) {
      known.inverses = inverses->second;
    } else if (axes != k_axes.end()) {
      known.axes = axes->second;
    } else if (k_white.count(word) > 0) {
      known.white = word;
    } else if (word == "finest-first" || word == "widest-first") {
      known.finest_first = word == "finest-first";
    } else {
      return usage_error(
          "--order: expected words such as white-first,rows-first, found '{}'. Words: white-first, "
          "black-first, white-last, no-white; inverse-second, inverse-first, inverses-behind, "
          "inverses-before, no-inverses; columns-first, rows-first, columns-only, rows-only; widest-first, "
          "finest-first. What is not said is found in the images.",
          word);
    }
  }
  return known;
}

std::vector<int> gray_code_counts(int projector_width, int projector_height, const KnownOrder& known) {
  std::vector<int> counts;
  for (const Layout& layout : layouts(projector_width, projector_height, known)) {
    if (std::find(counts.begin(), counts.end(), layout.count) == counts.end()) counts.push_back(layout.count);
  }
  return counts;
}

Result<FoundOrder> find_shot_order(const std::vector<std::vector<fs::path>>& series,
                                   int projector_width,
                                   int projector_height,
                                   const KnownOrder& known) {
  LIMN_CHECK(!series.empty() && !series[0].empty());
  const int width = projector_width, height = projector_height, count = static_cast<int>(series[0].size());
  const std::vector<Layout> allowed = with_count(layouts(width, height, known), count);
  if (allowed.empty() || count > k_most_images) return no_order_fits(series, known, count);
  LIMN_TRY(const std::vector<Line> lines, lines_of_all(series));
  if (illuminated(lines) < k_least_pixels) {
    const int usual = layouts(width, height, known).front().count;
    if (count != usual)
      return error(
          "{}: expected {} images ({}x{} Gray code with inverses, white and black), found {}. They show too "
          "little "
          "light of the projector to find another order. Check --projector and --shots.",
          series_name(series), usual, width, height, count);
    LIMN_TRY(FoundOrder assumed, found(allowed.front(), width, height));
    assumed.is_assumed = true;
    return assumed;
  }
  AxisFits fits(lines);
  const std::vector<double> bright = bright_shares(lines, count);
  const Candidate best = best_of(allowed, bright, &fits, width, height);
  KnownOrder any;
  any.step_px = known.step_px;
  const std::vector<Layout> all = with_count(layouts(width, height, any), count);
  const Candidate other = best_of(all, bright, &fits, width, height);
  // Rows and columns that have changed places look like a mirrored projection: as good as no fit.
  const bool is_worse = other.fits && best.layout->order != other.layout->order &&
                        (!best.fits || other.score - best.score > 0.2);
  if (is_worse)
    return error(
        "{}: --order {} does not fit: the images show another order ({}). Leave --order out, or say --order "
        "as the images are.",
        series_name(series), known.text, to_text(other.layout->order));
  if (!best.fits) return no_order_fits(series, known, count);
  LIMN_TRY(FoundOrder result, found(*best.layout, width, height));
  result.is_step_assumed =
      !known.step_px && best.layout->order.step_px > 1 && is_step_unsure(*best.layout, &fits, width, height);
  return result;
}

}  // namespace limn::calib
