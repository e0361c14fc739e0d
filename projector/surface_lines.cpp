#include "projector/surface_lines.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "core/log.h"
#include "core/names.h"
#include "projector/bindings.h"

namespace limn::projector {
namespace {

constexpr double k_cell = 6e-3;  // m; some segments of usual curves (k_longest_piece of drape.cpp) in each
constexpr double k_most_blur = 3e-3;  // m; the widest patch of a pixel, as in shaders/surface_lines.glsl
constexpr std::size_t k_most_segments = 200'000;
constexpr std::size_t k_most_entries = 4'000'000;  // segments, once for each of their cells
constexpr double k_shortest_segment = 1e-7;        // m

struct Segment {
  Eigen::Vector3d a, b, d_normal;
  scene::LineStyle style;
};

using Cell = Eigen::Vector3i;

// As line_bucket in shaders/surface_lines.glsl.
std::uint32_t bucket_of(const Cell& cell, std::uint32_t buckets) {
  const auto at = cell.cast<std::uint32_t>();
  return (at.x() * 73856093U ^ at.y() * 19349663U ^ at.z() * 83492791U) % buckets;
}

Cell cell_of(const Eigen::Vector3d& p) { return (p / k_cell).array().floor().matrix().cast<int>(); }

// Calls `use` for the bucket of each cell that a segment's light can reach.
template <class Use>
void for_buckets(const Segment& segment, std::uint32_t buckets, const Use& use) {
  const double reach = light_reach(segment.style);
  const Cell low = cell_of((segment.a.cwiseMin(segment.b).array() - reach).matrix()),
             high = cell_of((segment.a.cwiseMax(segment.b).array() + reach).matrix());
  for (int x = low.x(); x <= high.x(); ++x)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int z = low.z(); z <= high.z(); ++z) {
        // The cell's middle is farther from the segment than its corners and the reach.
        const Eigen::Vector3d middle = k_cell * (Eigen::Vector3d(x, y, z).array() + 0.5).matrix();
        const Eigen::Vector3d ab = segment.b - segment.a;
        const double along = std::clamp((middle - segment.a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
        if ((segment.a + along * ab - middle).norm() > reach + k_cell * std::sqrt(3.0) / 2) continue;
        use(bucket_of({x, y, z}, buckets));
      }
}

Eigen::Vector4f texel(const Eigen::Vector3d& xyz, double w) {
  return {static_cast<float>(xyz.x()), static_cast<float>(xyz.y()), static_cast<float>(xyz.z()),
          static_cast<float>(w)};
}

// Whole numbers below 2^24 in the components of texels.
void append_packed(const std::vector<std::uint32_t>& numbers, std::vector<Eigen::Vector4f>* texels) {
  for (std::size_t i = 0; i < numbers.size(); i += 4) {
    Eigen::Vector4f four = Eigen::Vector4f::Zero();
    for (std::size_t k = i; k < std::min(i + 4, numbers.size()); ++k)
      four[static_cast<Eigen::Index>(k - i)] = static_cast<float>(numbers[k]);
    texels->push_back(four);
  }
}

struct Grid {
  std::vector<std::uint32_t> starts, entries;  // each bucket's first entry; indices of segments
};

Grid grid_of(const std::vector<Segment>& segments) {
  const auto buckets = static_cast<std::uint32_t>(std::max<std::size_t>(64, 4 * segments.size()));
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;  // bucket, segment
  for (std::size_t i = 0; i < segments.size(); ++i)
    for_buckets(segments[i], buckets, [&](std::uint32_t bucket) {
      if (pairs.size() < k_most_entries) pairs.emplace_back(bucket, static_cast<std::uint32_t>(i));
    });
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  Grid grid;
  grid.starts.assign(buckets + 1, 0);
  for (const auto& [bucket, segment] : pairs) {
    ++grid.starts[bucket + 1];
    grid.entries.push_back(segment);
  }
  for (std::size_t i = 1; i < grid.starts.size(); ++i) grid.starts[i] += grid.starts[i - 1];
  return grid;
}

std::size_t most_texels() {
  GLint64 texels = 0;
  glGetInteger64v(GL_MAX_TEXTURE_BUFFER_SIZE, &texels);
  return static_cast<std::size_t>(texels);
}

}  // namespace

double light_reach(const scene::LineStyle& style) {
  return std::max(style.width_m, k_most_blur) / 2 + k_most_blur / 2;
}

struct SurfaceLines::Staging {
  std::vector<Eigen::Vector4f> repeated;
  std::vector<Segment> segments;

  void add(const scene::SurfaceCurve& curve, const scene::LineStyle& style) {
    const std::size_t count = curve.points.size(), pieces = curve.is_closed ? count : count - 1;
    for (std::size_t i = 0; count > 1 && i < pieces; ++i) {
      const scene::SurfacePoint &a = curve.points[i], &b = curve.points[(i + 1) % count];
      if ((b.p - a.p).norm() < k_shortest_segment) continue;
      Eigen::Vector3d d_normal = a.d_normal + b.d_normal;
      if (a.d_normal.isZero() || b.d_normal.isZero()) d_normal.setZero();
      // Short pieces are in few cells.
      const int parts = static_cast<int>(std::min(1e6, std::ceil((b.p - a.p).norm() / k_cell)));
      for (int part = 0; part < parts && segments.size() <= k_most_segments; ++part)
        segments.push_back(
            {a.p + (b.p - a.p) * part / parts, a.p + (b.p - a.p) * (part + 1) / parts, d_normal, style});
    }
  }
};

void SurfaceLines::add(const scene::Line& line, Staging* staging) const {
  if (const auto& repeated = line.repeated) {
    const Eigen::Matrix4d lines_from_prototype = repeated->prototype_from_lines.inverse().matrix();
    const auto finite = [](double half) { return std::isfinite(half) ? half : 1e6; };
    for (const int row : {0, 1}) staging->repeated.emplace_back(lines_from_prototype.row(row).cast<float>());
    staging->repeated.push_back(
        texel({finite(repeated->half_size_m.x()), finite(repeated->half_size_m.y()), repeated->spacing_m},
              static_cast<double>(repeated->form)));
    staging->repeated.push_back(texel(line.style.colour, line.style.width_m / 2));
  }
  for (const scene::SurfaceCurve& curve : line.curves) staging->add(curve, line.style);
}

void SurfaceLines::place(const scene::PosedScene& posed) {
  if (shown_ && *shown_ == posed.lines && drawn_ == posed.drawn) return;
  shown_ = posed.lines;
  drawn_ = posed.drawn;
  ++changes_;
  Staging staging;
  for (const scene::Line& line : lines_)
    if (std::find(posed.lines.begin(), posed.lines.end(), line.name) != posed.lines.end())
      add(line, &staging);
  for (const scene::DrawnLine& line : posed.drawn) staging.add(line.curve, line.style);
  if (const std::size_t most = std::min(k_most_segments, most_texels() / 16);
      staging.segments.size() > most) {
    log_warning("lines: expected at most {} pieces, found {}; the last ones are left out.", most,
                staging.segments.size());
    staging.segments.resize(most);
  }
  is_empty_ = staging.repeated.empty() && staging.segments.empty();
  if (is_empty_) return;
  const Grid grid = grid_of(staging.segments);
  const std::size_t repeated_texels = 4, header = 2;
  const std::size_t first_bucket = header + staging.repeated.size(),
                    first_entry = first_bucket + (grid.starts.size() + 3) / 4,
                    first_segment = first_entry + (grid.entries.size() + 3) / 4;
  std::vector<Eigen::Vector4f> texels = {
      texel({static_cast<double>(staging.repeated.size() / repeated_texels),
             staging.segments.empty() ? 0.0 : static_cast<double>(grid.starts.size() - 1), k_cell},
            static_cast<double>(first_bucket)),
      texel({static_cast<double>(first_entry), static_cast<double>(first_segment), 0}, 0)};
  texels.insert(texels.end(), staging.repeated.begin(), staging.repeated.end());
  append_packed(grid.starts, &texels);
  append_packed(grid.entries, &texels);
  for (const Segment& segment : staging.segments) {
    texels.push_back(texel(segment.a, segment.style.width_m / 2));
    texels.push_back(texel(segment.b, 0));
    texels.push_back(texel(segment.d_normal, 0));
    texels.push_back(texel(segment.style.colour, 0));
  }
  // Mesa's software driver compiles programs anew when the size of a buffer becomes, or is no longer, a power
  // of two, and when it reaches 64 KB.
  constexpr std::size_t k_least_texels = 4096;
  const std::size_t capacity = std::bit_ceil(std::max(texels.size(), k_least_texels));
  texels.resize(std::max(texels.size(), std::min(capacity, most_texels())), Eigen::Vector4f::Zero());
  buffer_ = make_buffer(texels.data(), texels.size() * sizeof(Eigen::Vector4f));
  texels_ = make_texels(buffer_, GL_RGBA32F);
}

void SurfaceLines::bind() const {
  if (!is_empty_) glBindTextureUnit(k_lines_unit, *texels_);
}

}  // namespace limn::projector
