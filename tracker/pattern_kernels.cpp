// Compiled once for every kind of processor, with LIMN_VERSION as its name (tracker/CMakeLists.txt), and once
// for any processor. LIMN_SIMD cannot be used here, because GCC splits vector types before it makes versions
// of a function.
#include "tracker/pattern_kernels.h"

namespace limn::tracker::pattern {
namespace {

#if defined(__AVX512F__)
constexpr int k_lanes = 16;
#elif defined(__AVX2__)
constexpr int k_lanes = 8;
#else
constexpr int k_lanes = 4;
#endif
static_assert(k_together % k_lanes == 0);
using Lanes = float __attribute__((vector_size(4 * k_lanes)));
using Bits = std::uint32_t __attribute__((vector_size(4 * k_lanes)));

inline float least(float a, float b) { return b < a ? b : a; }
inline float most(float a, float b) { return b > a ? b : a; }

inline void load(const float* from, Lanes* lanes) { __builtin_memcpy(lanes, from, sizeof *lanes); }
inline void store(const Lanes& lanes, float* into) { __builtin_memcpy(into, &lanes, sizeof lanes); }

inline void square_root(const Lanes& squares, Lanes* roots) {
  for (int i = 0; i < k_lanes; ++i) (*roots)[i] = __builtin_sqrtf(squares[i]);
}

// e^x for x <= 0: 2^n times a polynomial (Cephes, expf). Bounded from below, so that products of several
// results do not become denormal, which is slow.
inline void exponential(const Lanes& x, Lanes* result) {
  constexpr float k_rounds = 12582912;  // adding it rounds to a whole number
  const Lanes least = x * 0 - 20;
  const Lanes bounded = x < least ? least : x;
  const Lanes shifted = bounded * 1.44269504F + k_rounds;
  const Lanes n = shifted - k_rounds;
  const Lanes f = bounded - n * 0.693359375F + n * 2.12194440e-4F;
  const Lanes tail =
      ((((1.9875691500e-4F * f + 1.3981999507e-3F) * f + 8.3334519073e-3F) * f + 4.1665795894e-2F) * f +
       1.6666665459e-1F) *
          f +
      5.0000001201e-1F;
  const Bits power = (__builtin_bit_cast(Bits, shifted) << 23) + 0x3F800000U;
  *result = (1 + f + f * f * tail) * __builtin_bit_cast(Lanes, power);
}

constexpr float k_reach = 4;  // an edge has an effect within this many sigmas

// Standard normal distribution and density (Abramowitz and Stegun 26.2.17, error below 1e-7).
inline void normal(const Lanes& z, Lanes* below, Lanes* density) {
  exponential(-0.5F * z * z, density);
  *density *= 0.39894228F;
  const Lanes size = z < 0 ? -z : z;
  const Lanes t = 1 / (1 + 0.2316419F * size);
  const Lanes beyond =
      *density * t *
      (((((1.330274429F * t - 1.821255978F) * t) + 1.781477937F) * t - 0.356563782F) * t + 0.319381530F);
  *below = z < 0 ? beyond : 1 - beyond;
}

// The cells around one coordinate of some places, seen through a Gaussian: each cell's share, and the share's
// first and second derivative by the place in sigmas.
struct Shares {
  static constexpr int k_most = Guess::k_row;
  int first, count;  // cells; -1 is the paper before the marker
  Lanes share[k_most], slope[k_most], bend[k_most];
};

inline void find_shares(const Lanes& at, const Lanes& sigma, int cells, Shares* shares) {
  float low = at[0] - k_reach * sigma[0];
  float high = at[0] + k_reach * sigma[0];
  for (int i = 1; i < k_lanes; ++i) {
    low = least(low, at[i] - k_reach * sigma[i]);
    high = most(high, at[i] + k_reach * sigma[i]);
  }
  // The lines between cells within reach, first and last.
  const auto last = static_cast<float>(cells);
  const int from = !(low > 0) ? 0 : low > last ? cells + 1 : static_cast<int>(__builtin_ceilf(low));
  const int to = !(high >= 0) ? -1 : high >= last ? cells : static_cast<int>(high);
  shares->first = from - 1;
  shares->count = 0;
  const Lanes sigmas = 1 / sigma;
  Lanes below = 1 + 0 * sigma, density = 0 * sigma, turn = 0 * sigma;
  for (int line = from; line <= to; ++line) {
    const Lanes z = (at - static_cast<float>(line)) * sigmas;
    Lanes line_below, line_density;
    normal(z, &line_below, &line_density);
    const int i = shares->count++;
    shares->share[i] = below - line_below;
    shares->slope[i] = density - line_density;
    shares->bend[i] = turn + z * line_density;
    below = line_below;
    density = line_density;
    turn = -z * line_density;
  }
  const int i = shares->count++;
  shares->share[i] = below;
  shares->slope[i] = density;
  shares->bend[i] = turn;
}

// The blur at some places, in cells: sigmas along rows and columns, and their correlation where the view is
// skewed.
struct Blur {
  Lanes x, y, correlation;
};

// The share of ink at some places, and its derivatives.
struct Ink {
  Lanes value, by_x, by_y, by_log_blur;
};

// Uses the first terms of the bivariate normal distribution in its correlation (tetrachoric series, Pearson
// 1900).
inline void see_ink(const Guess& guess, const Lanes& x, const Lanes& y, const Blur& blur, Ink* seen) {
  Shares columns, rows;
  find_shares(x, blur.x, guess.cells, &columns);
  find_shares(y, blur.y, guess.cells, &rows);
  const Lanes none = 0 * x;
  Lanes value = none, by_x = none, by_y = none, by_log_blur = none, twist = none, warp = none;
  for (int r = 0; r < rows.count; ++r) {
    const float* is_ink = &guess.is_ink[(rows.first + r + 1) * Guess::k_row + columns.first + 1];
    Lanes share = none, slope = none, bend = none;
    for (int c = 0; c < columns.count; ++c) {
      share += columns.share[c] * is_ink[c];
      slope += columns.slope[c] * is_ink[c];
      bend += columns.bend[c] * is_ink[c];
    }
    value += rows.share[r] * share;
    by_x += rows.share[r] * slope;
    by_y += rows.slope[r] * share;
    by_log_blur += rows.share[r] * bend + rows.bend[r] * share;
    twist += rows.slope[r] * slope;
    warp += rows.bend[r] * bend;
  }
  seen->value = value + blur.correlation * (twist + 0.5F * blur.correlation * warp);
  seen->by_log_blur = by_log_blur + 2 * blur.correlation * twist;
  seen->by_x = by_x / blur.x;
  seen->by_y = by_y / blur.y;
}

// Pixels' coordinates in cells, homogeneous, and the blur there.
struct Place {
  Lanes x, y, z;
  Lanes xx, xy, yx, yy;  // derivatives: cells for each pixel
  Blur blur;
};

inline void find_place(const Guess& guess, const Lanes& px, const Lanes& py, Place* place) {
  const float* h = guess.cells_from_px;
  place->x = h[0] * px + h[1] * py + h[2];
  place->y = h[3] * px + h[4] * py + h[5];
  place->z = h[6] * px + h[7] * py + h[8];
  const Lanes scale = 1 / place->z;
  const Lanes x = place->x * scale, y = place->y * scale;
  place->xx = (h[0] - x * h[6]) * scale;
  place->xy = (h[1] - x * h[7]) * scale;
  place->yx = (h[3] - y * h[6]) * scale;
  place->yy = (h[4] - y * h[7]) * scale;
  Lanes across, down;
  square_root(place->xx * place->xx + place->xy * place->xy, &across);
  square_root(place->yx * place->yx + place->yy * place->yy, &down);
  place->blur.x = guess.blur_px * across;
  place->blur.y = guess.blur_px * down;
  place->blur.correlation = (place->xx * place->yx + place->xy * place->yy) / (across * down);
}

// The background behind the paper: its share at each side, and derivatives.
struct Ground {
  Lanes share[4], by_margin[4], by_log_blur;
};

inline void add_ground(const Guess& guess,
                       const Lanes& x,
                       const Lanes& y,
                       const Blur& blur,
                       const Lanes& white,
                       Lanes* by_x,
                       Lanes* by_y,
                       Ground* seen) {
  const auto cells = static_cast<float>(guess.cells);
  const Lanes z_top = (-guess.margin[0] - y) / blur.y;
  const Lanes z_right = (x - cells - guess.margin[1]) / blur.x;
  const Lanes z_bottom = (y - cells - guess.margin[2]) / blur.y;
  const Lanes z_left = (-guess.margin[3] - x) / blur.x;
  bool is_near = false;
  for (int i = 0; i < k_lanes; ++i)
    is_near |= most(most(z_top[i], z_right[i]), most(z_bottom[i], z_left[i])) > -k_reach;
  if (!is_near) return;
  Lanes top, by_top, right, by_right, bottom, by_bottom, left, by_left;
  normal(z_top, &top, &by_top);
  normal(z_right, &right, &by_right);
  normal(z_bottom, &bottom, &by_bottom);
  normal(z_left, &left, &by_left);
  const Lanes between = 1 - left - right;
  seen->share[0] += between * top;
  seen->share[1] += right;
  seen->share[2] += between * bottom;
  seen->share[3] += left;
  const Lanes to_top = guess.behind[0] - white, to_right = guess.behind[1] - white;
  const Lanes to_bottom = guess.behind[2] - white, to_left = guess.behind[3] - white;
  const Lanes across = to_top * top + to_bottom * bottom;
  by_left *= (to_left - across) / blur.x;
  by_right *= (to_right - across) / blur.x;
  by_top *= between * to_top / blur.y;
  by_bottom *= between * to_bottom / blur.y;
  *by_x += by_right - by_left;
  *by_y += by_bottom - by_top;
  seen->by_log_blur -= (z_left * by_left + z_right * by_right) * blur.x;
  seen->by_log_blur -= (z_top * by_top + z_bottom * by_bottom) * blur.y;
  seen->by_margin[0] -= by_top;
  seen->by_margin[1] -= by_right;
  seen->by_margin[2] -= by_bottom;
  seen->by_margin[3] -= by_left;
}

inline void find_edges(const Guess& guess, const Lanes& px, const Lanes& py, std::int32_t* shows) {
  constexpr float k_edge = 0.01F;  // share of a step's steepest slope
  Place place;
  find_place(guess, px, py, &place);
  Ink seen;
  see_ink(guess, place.x / place.z, place.y / place.z, place.blur, &seen);
  for (int i = 0; i < k_lanes; ++i)
    shows[i] = most(__builtin_fabsf(seen.by_x[i] * place.blur.x[i]),
                    __builtin_fabsf(seen.by_y[i] * place.blur.y[i])) > k_edge;
}

inline void evaluate(const Guess& guess, const Places& places, std::size_t from, const Results& results) {
  Lanes px, py, level_x, level_y;
  load(&places.x[from], &px);
  load(&places.y[from], &py);
  load(&places.level_x[from], &level_x);
  load(&places.level_y[from], &level_y);
  Place place;
  find_place(guess, px, py, &place);
  const Lanes white = guess.paper[0] + guess.paper[1] * level_x + guess.paper[2] * level_y;
  const Lanes black = guess.black[0] + guess.black[1] * level_x + guess.black[2] * level_y;
  const Lanes none = 0 * px;
  Lanes ink_share = none, by_log_blur = none, by_motion_x = none, by_motion_y = none;
  Lanes by_shape[12];
  for (Lanes& by : by_shape) by = none;
  Ground behind;
  for (int s = 0; s < 4; ++s) behind.share[s] = behind.by_margin[s] = none;
  behind.by_log_blur = none;
  const auto number = static_cast<float>(guess.places);
  const float spacing = guess.places > 1 ? 1 / __builtin_sqrtf(number * number - 1) : 0;
  const float cells_a_half = 1 / guess.half;
  for (int i = 0; i < guess.places; ++i) {
    const float t = (static_cast<float>(i) - 0.5F * (number - 1)) * spacing;
    const Lanes scale = 1 / (place.z + t * guess.step[2]);
    Lanes x = (place.x + t * guess.step[0]) * scale;
    Lanes y = (place.y + t * guess.step[1]) * scale;
    const Lanes u = guess.half * x - 1, v = guess.half * y - 1;
    const Lanes arch_x = 1 - u * u, arch_y = 1 - v * v;
    x -= (guess.bends[0] * arch_x + guess.bends[1] * arch_y) * cells_a_half;
    y -= (guess.bends[2] * arch_x + guess.bends[3] * arch_y) * cells_a_half;
    Ink seen;
    see_ink(guess, x, y, place.blur, &seen);
    ink_share += seen.value;
    const Lanes step = black - white;
    Lanes by_x = step * seen.by_x, by_y = step * seen.by_y;
    by_log_blur += step * seen.by_log_blur;
    if (guess.has_ground) add_ground(guess, x, y, place.blur, white, &by_x, &by_y, &behind);
    const Lanes both = by_x * u + by_y * v;
    by_shape[0] -= by_x, by_shape[1] -= by_x * u, by_shape[2] -= by_x * v;
    by_shape[3] -= by_y, by_shape[4] -= by_y * u, by_shape[5] -= by_y * v;
    by_shape[6] -= both * u, by_shape[7] -= both * v;
    by_shape[8] -= by_x * arch_x, by_shape[9] -= by_x * arch_y;
    by_shape[10] -= by_y * arch_x, by_shape[11] -= by_y * arch_y;
    by_motion_x += t * by_x;
    by_motion_y += t * by_y;
  }
  const float share = 1 / number;
  const auto put = [&](int unknown, const Lanes& lanes) {
    store(lanes, results.derivatives[unknown] + from);
  };
  for (int i = 0; i < 8; ++i) put(shape + i, share * cells_a_half * by_shape[i]);
  for (int i = 0; i < 4; ++i) put(bend + i, share * cells_a_half * by_shape[8 + i]);
  put(log_blur, share * (by_log_blur + behind.by_log_blur));
  put(motion_x, share * (place.xx * by_motion_x + place.yx * by_motion_y));
  put(motion_y, share * (place.xy * by_motion_x + place.yy * by_motion_y));
  ink_share *= share;
  Lanes ground_share = none, ground_light = none;
  for (int s = 0; s < 4; ++s) {
    const Lanes of_side = share * behind.share[s];
    ground_share += of_side;
    ground_light += guess.behind[s] * of_side;
    put(ground + s, of_side);
    put(margin + s, share * behind.by_margin[s]);
  }
  const Lanes paper_share = 1 - ink_share - ground_share;
  put(paper, paper_share);
  put(paper + 1, paper_share * level_x);
  put(paper + 2, paper_share * level_y);
  put(ink, ink_share);
  put(ink + 1, ink_share * level_x);
  put(ink + 2, ink_share * level_y);
  store(ground_share, results.behind + from);
  store(black * ink_share + white * paper_share + ground_light, results.light + from);
}

void see_all(const Guess& guess, const Places& places, std::size_t count, const Results& results) {
  for (std::size_t i = 0; i < count; i += k_lanes) evaluate(guess, places, i, results);
}

void see_all_edges(
    const Guess& guess, const float* x, const float* y, std::size_t count, std::int32_t* shows) {
  for (std::size_t i = 0; i < count; i += k_lanes) {
    Lanes px, py;
    load(x + i, &px);
    load(y + i, &py);
    find_edges(guess, px, py, shows + i);
  }
}

}  // namespace

#ifdef LIMN_VERSION
extern const PatternKernels LIMN_VERSION;
const PatternKernels LIMN_VERSION = {see_all, see_all_edges};
#else
extern const PatternKernels light_of_x86_64_v3, light_of_x86_64_v4;

int pattern_kernel_versions() {
#ifdef LIMN_VERSIONS
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !__builtin_cpu_supports("bmi2"))
    return 1;
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                 __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")
             ? 3
             : 2;
#else
  return 1;
#endif
}

const PatternKernels& pattern_kernels(int version) {
  static const PatternKernels any = {see_all, see_all_edges};
#ifdef LIMN_VERSIONS
  if (version == 1) return light_of_x86_64_v3;
  if (version == 2) return light_of_x86_64_v4;
#endif
  (void)version;
  return any;
}
#endif

}  // namespace limn::tracker::pattern
