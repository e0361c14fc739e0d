#include "calib/surface/deviation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <optional>
#include <tuple>
#include <unordered_map>

#include "core/median.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double k_line_facing = 0.5;      // cosine; scan and CAD face the same way within 60 degrees
constexpr double k_beyond_reaches = 4;     // reaches: within them a surface counts as beyond reach
constexpr double k_line_settled_m = 1e-7;  // step along the normal
constexpr double k_beside_m = 10e-6;       // distance of the normal's line from the scan's triangle: rounding
constexpr double k_sure_stddevs = 2;       // standard deviations that must fit into the tolerance
constexpr float k_none = std::numeric_limits<float>::quiet_NaN();

using ScanEdge = std::uint64_t;
ScanEdge scan_edge(std::uint32_t a, std::uint32_t b) {
  return (static_cast<ScanEdge>(std::min(a, b)) << 32) | std::max(a, b);
}

// Whether each vertex lies on an edge that only one triangle has, or shares a triangle with such a vertex:
// there the scan's errors are larger than stated.
std::vector<bool> vertices_near_edges(const scene::ScanSurface& scan) {
  std::vector<ScanEdge> edges;
  edges.reserve(3 * scan.triangles.size());
  for (const auto& [a, b, c] : scan.triangles)
    edges.insert(edges.end(), {scan_edge(a, b), scan_edge(b, c), scan_edge(c, a)});
  std::sort(edges.begin(), edges.end());
  std::vector<bool> at_edge(scan.positions.size(), false);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    if (end - i == 1) at_edge[edges[i] >> 32] = at_edge[edges[i] & 0xffffffffU] = true;
    i = end;
  }
  std::vector<bool> near_edge = at_edge;
  for (const auto& [a, b, c] : scan.triangles)
    if (at_edge[a] || at_edge[b] || at_edge[c]) near_edge[a] = near_edge[b] = near_edge[c] = true;
  return near_edge;
}

// The median length of the scan's edges, m.
double edge_length_of(const scene::ScanSurface& scan) {
  std::vector<float> lengths;
  const std::size_t step = scan.triangles.size() / 20'000 + 1;
  for (std::size_t i = 0; i < scan.triangles.size(); i += step) {
    const auto& [a, b, c] = scan.triangles[i];
    lengths.push_back((scan.positions[a] - scan.positions[b]).norm());
    lengths.push_back((scan.positions[b] - scan.positions[c]).norm());
  }
  return static_cast<double>(median(std::move(lengths)));
}

// Whether every point of the scan states a standard deviation that can be one.
bool states_noise(const scene::ScanSurface& scan) {
  return !scan.stddevs.empty() && std::all_of(scan.stddevs.begin(), scan.stddevs.end(), [](float stddev) {
    return std::isfinite(stddev) && stddev > 0;
  });
}

// The scan, prepared for lines that meet it.
class ScanTarget {
 public:
  explicit ScanTarget(const scene::ScanSurface& scan)
      : scan_(scan),
        mesh_(scene::mesh_of(scan)),
        index_(mesh_),
        near_edge_(vertices_near_edges(scan)),
        states_noise_(states_noise(scan)) {}

  struct Met {
    double distance = 0;  // along the line
    std::size_t triangle = 0;
    double cosine = 1;  // between the scan's normal and the line
  };
  // Where the line from p along the unit vector n meets the nearest triangle that faces n, up to `reach` away
  // on both sides. Each step goes on to the plane of the nearest triangle.
  std::optional<Met> meet(const Vector3d& p, const Vector3d& n, double reach) const {
    constexpr int k_steps = 16;
    Met met;
    for (int step = 0; step < k_steps; ++step) {
      const Vector3d q = p + met.distance * n;
      const auto near = index_.nearest(q, reach, &n, k_line_facing);
      if (!near) return std::nullopt;
      const Vector3d m = normal(near->triangle);
      met.cosine = m.dot(n);
      const double along = m.dot(near->p - q) / met.cosine;
      met.distance += along;
      met.triangle = near->triangle;
      if (std::abs(met.distance) > reach) return std::nullopt;
      if (std::abs(along) > k_line_settled_m) continue;
      if (near->distance > k_beside_m) return std::nullopt;  // the line passes beside the scan's edge
      return met;
    }
    return std::nullopt;
  }

  // Whether the scan's surface at p faces against n: the CAD's triangle there is inside out.
  bool faces_away(const Vector3d& p, const Vector3d& n, double within) const {
    const Vector3d against = -n;
    return index_.nearest(p, within, &against, k_line_facing).has_value();
  }

  bool is_near_edge(std::size_t triangle) const {
    const auto& [a, b, c] = scan_.triangles[triangle];
    return near_edge_[a] || near_edge_[b] || near_edge_[c];
  }

  // The mean of the corners' standard deviations along the scan's normal; 1 m where none are stated.
  double stddev(std::size_t triangle) const {
    if (!states_noise_) return 1;
    const auto& [a, b, c] = scan_.triangles[triangle];
    return static_cast<double>(scan_.stddevs[a] + scan_.stddevs[b] + scan_.stddevs[c]) / 3;
  }

 private:
  Vector3d normal(std::size_t triangle) const {
    const auto& [i, j, k] = scan_.triangles[triangle];
    const Vector3d a = scan_.positions[i].cast<double>();
    return (scan_.positions[j].cast<double>() - a).cross(scan_.positions[k].cast<double>() - a).normalized();
  }

  const scene::ScanSurface& scan_;
  scene::Mesh mesh_;
  scene::MeshBvh index_;
  std::vector<bool> near_edge_;
  bool states_noise_;
};

// Distances, and the stated standard deviations of the scan alone.
Status compare_along_normals(const ScanTarget& target,
                             const Pose& world_from_prototype,
                             const ReportStage& report,
                             Deviation* out) {
  const std::size_t count = out->cad.surface.positions.size();
  out->distances_m.assign(count, k_none);
  out->stddevs_m.assign(count, k_none);
  out->states.assign(count, DeviationState::not_measured);
  std::vector<std::uint8_t> faces_away(count, 0);
  constexpr std::size_t k_block = 20'000;  // points between two reports
  for (std::size_t begin = 0; begin < count; begin += k_block) {
    LIMN_TRY_STATUS(reported(
        report, {.name = "compare", .done = static_cast<int>(begin), .total = static_cast<int>(count)}));
    const cv::Range block(static_cast<int>(begin), static_cast<int>(std::min(count, begin + k_block)));
    cv::parallel_for_(block, [&](const cv::Range& range) {
      for (int k = range.start; k < range.end; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const Vector3d p = world_from_prototype * out->cad.surface.positions[i].cast<double>();
        const Vector3d n = world_from_prototype.rotation * out->cad.surface.normals[i].cast<double>();
        const auto met = target.meet(p, n, k_beyond_reaches * out->reach_m);
        if (!met || target.is_near_edge(met->triangle)) {
          faces_away[i] = !met && target.faces_away(p, n, out->tolerance_m);
          continue;
        }
        if (std::abs(met->distance) > out->reach_m) {
          out->states[i] = DeviationState::beyond_reach;
          continue;
        }
        out->states[i] = DeviationState::measured;
        out->distances_m[i] = static_cast<float>(met->distance);
        out->stddevs_m[i] = static_cast<float>(target.stddev(met->triangle) / met->cosine);
      }
    });
  }
  for (std::size_t i = 0; i < count; ++i)
    if (faces_away[i] != 0) out->facing_away_m2 += static_cast<double>(out->cad.areas_m2[i]);
  return {};
}

// The measured points near each other, by cells of a grid.
class Neighbourhood {
 public:
  Neighbourhood(const Deviation& deviation, double radius) : deviation_(deviation), radius_(radius) {
    for (std::size_t i = 0; i < deviation.states.size(); ++i)
      if (deviation.has(i)) cells_[key(cell(i))].push_back(static_cast<std::uint32_t>(i));
  }

  // A plane through the distances around a point: its height at the point and its slope (per m, in the
  // prototype's frame). Points nearer than `least` are left out. nullopt: too few, or on one side only.
  struct Plane {
    double height = 0;
    Vector3d slope = Vector3d::Zero();
  };
  std::optional<Plane> plane_at(std::size_t i, double least) const {
    constexpr int k_fewest = 12;
    constexpr float k_same_side = 0.8f;
    const scene::ScanSurface& cad = deviation_.cad.surface;
    const Vector3d n = cad.normals[i].cast<double>(), u = n.unitOrthogonal(), v = n.cross(u);
    Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    int count = 0;
    const Eigen::Vector3i middle = cell(i);
    for (int k = 0; k < 27; ++k) {
      const auto found = cells_.find(key(middle + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
      if (found == cells_.end()) continue;
      for (const std::uint32_t j : found->second) {
        const Vector3d d = (cad.positions[j] - cad.positions[i]).cast<double>();
        const double far = d.norm();
        if (far > radius_ || far < least || cad.normals[j].dot(cad.normals[i]) < k_same_side) continue;
        const Vector3d row(1, d.dot(u) / radius_, d.dot(v) / radius_);
        a += row * row.transpose();
        b += static_cast<double>(deviation_.distances_m[j]) * row;
        ++count;
      }
    }
    if (count < k_fewest) return std::nullopt;
    const Vector2d middle_uv = a.block<2, 1>(1, 0) / count;
    constexpr double k_one_sided = 0.3;  // share of the radius
    if (middle_uv.norm() > k_one_sided) return std::nullopt;
    const Vector3d x = a.ldlt().solve(b);
    if (!x.allFinite()) return std::nullopt;
    return Plane{x[0], (x[1] * u + x[2] * v) / radius_};
  }

 private:
  Eigen::Vector3i cell(std::size_t i) const {
    return (deviation_.cad.surface.positions[i].cast<double>() / radius_).array().floor().cast<int>();
  }
  static std::uint64_t key(const Eigen::Vector3i& c) {
    constexpr std::uint64_t k_mask = (1U << 21) - 1;
    const auto part = [](int value) { return static_cast<std::uint64_t>(value) & k_mask; };
    return (part(c.x()) << 42) | (part(c.y()) << 21) | part(c.z());
  }

  const Deviation& deviation_;
  double radius_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

constexpr double k_around = 5, k_inside = 2;  // radii of the neighbourhood, in spacings

// How many stated standard deviations the distances scatter about their neighbourhood. Steps and the slopes
// of real deviations are far off it and do not count.
double noise_factor(const Deviation& deviation, const Neighbourhood& around, double spacing) {
  constexpr std::size_t k_most = 20'000, k_fewest = 50;
  constexpr double k_normal = 1.4826;  // standard deviations in a median of absolute values
  constexpr double k_far_off = 4;      // standard deviations
  const std::size_t step = deviation.states.size() / k_most + 1;
  std::vector<double> sizes;
  for (std::size_t i = 0; i < deviation.states.size(); i += step) {
    if (!deviation.has(i)) continue;
    const auto plane = around.plane_at(i, k_inside * spacing);
    if (!plane) continue;
    const double off = static_cast<double>(deviation.distances_m[i]) - plane->height;
    sizes.push_back(std::abs(off) / static_cast<double>(deviation.stddevs_m[i]));
  }
  if (sizes.size() < k_fewest) return 1;
  const double limit = k_far_off * k_normal * median(sizes);
  double sum = 0;
  int count = 0;
  for (const double size : sizes)
    if (size <= limit) sum += size * size, ++count;
  return std::sqrt(sum / count);
}

// Adds the uncertainty of the registration: how much the distance changes when the CAD moves. Along
// directions that the shape does not determine it changes by the slope of the deviation.
void add_registration(const Registration& registration, const Neighbourhood& around, Deviation* out) {
  const Eigen::Quaterniond& rotation = registration.world_from_prototype.rotation;
  const bool slides = !registration.free_directions.empty();
  std::vector<float> sums = out->stddevs_m;
  cv::parallel_for_(cv::Range(0, static_cast<int>(sums.size())), [&](const cv::Range& range) {
    for (int k = range.start; k < range.end; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (!out->has(i)) continue;
      Vector3d n = out->cad.surface.normals[i].cast<double>();
      if (slides)
        if (const auto plane = around.plane_at(i, 0)) n -= plane->slope;
      const Vector3d m = rotation * n, arm = rotation * out->cad.surface.positions[i].cast<double>();
      Vector6d jacobian;
      jacobian << arm.cross(m), m;
      const double own = static_cast<double>(out->stddevs_m[i]);
      sums[i] = static_cast<float>(std::sqrt(own * own + jacobian.dot(registration.covariance * jacobian)));
    }
  });
  out->stddevs_m = std::move(sums);
}

// The points that share a triangle with each point, or its place: where a CAD has an edge or a seam, or its
// triangles share nothing, several points lie at one place.
std::vector<std::vector<std::uint32_t>> neighbours_of(const scene::ScanSurface& surface) {
  const std::size_t count = surface.positions.size();
  std::vector<std::vector<std::uint32_t>> of(count);
  for (const auto& [a, b, c] : surface.triangles) {
    of[a].insert(of[a].end(), {b, c});
    of[b].insert(of[b].end(), {a, c});
    of[c].insert(of[c].end(), {a, b});
  }
  std::vector<std::uint32_t> by_place(count);
  std::iota(by_place.begin(), by_place.end(), 0U);
  const auto place = [&](std::uint32_t i) {
    const Vector3f& p = surface.positions[i];
    return std::tuple(p.x(), p.y(), p.z());
  };
  std::sort(by_place.begin(), by_place.end(),
            [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  for (std::size_t k = 1; k < count; ++k) {
    const std::uint32_t a = by_place[k - 1], b = by_place[k];
    if (place(a) != place(b)) continue;
    of[a].push_back(b);
    of[b].push_back(a);
  }
  return of;
}

DeviationExtreme extreme_at(const Deviation& deviation, std::size_t i) {
  return {i, deviation.cad.surface.positions[i].cast<double>(), static_cast<double>(deviation.distances_m[i]),
          static_cast<double>(deviation.stddevs_m[i]), static_cast<double>(deviation.cad.areas_m2[i])};
}

}  // namespace

Result<Deviation> deviation(const scene::Mesh& cad,
                            const scene::ScanSurface& scan,
                            const Registration& registration,
                            const DeviationOptions& options) {
  if (scan.triangles.empty())
    return error(
        "expected a scan with triangles, found {} points alone: between points nobody knows what was "
        "measured. "
        "Give the folder of limn scan or its mesh.ply, or export the scan as a mesh.",
        scan.positions.size());
  LIMN_TRY_STATUS(reported(options.report_stage, {.name = "sample"}));
  Deviation out;
  out.tolerance_m = options.tolerance_m;
  out.reach_m = options.reach_m;
  out.noise_was_stated = states_noise(scan);
  const double spacing = options.spacing_m > 0 ? options.spacing_m : edge_length_of(scan);
  out.cad = surface_samples(cad, spacing, options.most_samples);
  {
    const ScanTarget target(scan);
    LIMN_TRY_STATUS(
        compare_along_normals(target, registration.world_from_prototype, options.report_stage, &out));
  }
  if (std::none_of(out.states.begin(), out.states.end(),
                   [](DeviationState state) { return state == DeviationState::measured; }))
    return error(
        "expected the scan's surface within {:.3g} mm of the CAD, found none. Check the pose, the units, and "
        "that the CAD's triangles are not inside out.",
        1e3 * options.reach_m);
  // Points within one triangle of the scan share its errors: its scatter shows between its triangles.
  const double grain = std::max(out.cad.spacing_m, edge_length_of(scan));
  const Neighbourhood around(out, k_around * grain);
  const double factor = noise_factor(out, around, grain);
  out.noise_factor = out.noise_was_stated ? std::max(1.0, factor) : 1;
  for (float& stddev : out.stddevs_m)
    stddev *= static_cast<float>(out.noise_was_stated ? out.noise_factor : factor);
  add_registration(registration, around, &out);
  for (std::size_t i = 0; i < out.states.size(); ++i)
    if (out.has(i) && k_sure_stddevs * static_cast<double>(out.stddevs_m[i]) > options.tolerance_m)
      out.states[i] = DeviationState::uncertain;
  return out;
}

std::vector<DeviationExtreme> extremes(const Deviation& deviation, std::size_t most, double least_area_m2) {
  const std::size_t count = deviation.states.size();
  const auto neighbours = neighbours_of(deviation.cad.surface);
  // 1: proud, -1: shy of the tolerance; 0: neither, or not certain.
  std::vector<int> side(count, 0);
  for (std::size_t i = 0; i < count; ++i)
    if (deviation.states[i] == DeviationState::measured &&
        std::abs(static_cast<double>(deviation.distances_m[i])) > deviation.tolerance_m)
      side[i] = deviation.distances_m[i] > 0 ? 1 : -1;
  std::vector<DeviationExtreme> found;
  std::vector<bool> done(count, false);
  for (std::size_t seed = 0; seed < count; ++seed) {
    if (side[seed] == 0 || done[seed]) continue;
    std::vector<std::uint32_t> open = {static_cast<std::uint32_t>(seed)};
    done[seed] = true;
    DeviationExtreme region = extreme_at(deviation, seed);
    double area = 0;
    while (!open.empty()) {
      const std::uint32_t at = open.back();
      open.pop_back();
      area += static_cast<double>(deviation.cad.areas_m2[at]);
      if (std::abs(static_cast<double>(deviation.distances_m[at])) > std::abs(region.distance_m))
        region = extreme_at(deviation, at);
      for (const std::uint32_t next : neighbours[at]) {
        if (done[next] || side[next] != side[seed]) continue;
        done[next] = true;
        open.push_back(next);
      }
    }
    region.area_m2 = area;
    const double surely = std::abs(region.distance_m) - k_sure_stddevs * region.stddev_m;
    if (area >= least_area_m2 && surely > deviation.tolerance_m) found.push_back(region);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::abs(a.distance_m) > std::abs(b.distance_m);
  });
  if (found.size() > most) found.resize(most);
  if (!found.empty()) return found;
  std::optional<std::size_t> low, high;
  for (std::size_t i = 0; i < count; ++i) {
    if (deviation.states[i] != DeviationState::measured) continue;
    if (!low || deviation.distances_m[i] < deviation.distances_m[*low]) low = i;
    if (!high || deviation.distances_m[i] > deviation.distances_m[*high]) high = i;
  }
  if (high) found.push_back(extreme_at(deviation, *high));
  if (low && low != high) found.push_back(extreme_at(deviation, *low));
  return found;
}

DeviationSummary summary_of(const Deviation& deviation) {
  DeviationSummary out;
  std::vector<float> sizes, stddevs;
  double certain = 0, within = 0, sum = 0, squares = 0;
  for (std::size_t i = 0; i < deviation.states.size(); ++i) {
    const auto area = static_cast<double>(deviation.cad.areas_m2[i]);
    out.areas_m2[static_cast<std::size_t>(deviation.states[i])] += area;
    if (deviation.states[i] != DeviationState::measured) continue;
    const auto distance = static_cast<double>(deviation.distances_m[i]);
    certain += area;
    sum += area * distance;
    squares += area * distance * distance;
    if (std::abs(distance) <= deviation.tolerance_m) within += area;
    out.lowest_m = sizes.empty() ? distance : std::min(out.lowest_m, distance);
    out.highest_m = sizes.empty() ? distance : std::max(out.highest_m, distance);
    sizes.push_back(std::abs(deviation.distances_m[i]));
    stddevs.push_back(deviation.stddevs_m[i]);
  }
  if (certain <= 0) return out;
  out.within_share = within / certain;
  out.mean_m = sum / certain;
  out.rms_m = std::sqrt(squares / certain);
  out.p95_m = static_cast<double>(quantile(std::move(sizes), 0.95));
  out.median_stddev_m = static_cast<double>(median(std::move(stddevs)));
  return out;
}

scene::ScanSurface part_in_box(const scene::ScanSurface& scan,
                               const Pose& world_from_prototype,
                               const Vector3d& low,
                               const Vector3d& high) {
  const Pose inverse = world_from_prototype.inverse();
  const Eigen::AlignedBox3d box(low, high);
  std::vector<bool> keep;
  keep.reserve(scan.positions.size());
  for (const Vector3f& p : scan.positions) keep.push_back(box.contains(inverse * p.cast<double>()));
  return scene::with_vertices_kept(scan, keep);
}

}  // namespace limn::calib
