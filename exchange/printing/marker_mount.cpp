#include "exchange/printing/marker_mount.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"

namespace limn::exchange {
namespace {

static_assert(std::endian::native == std::endian::little, "STL is little-endian");

constexpr double k_steepest_view = 75 * std::numbers::pi / 180;  // from the marker's axis
constexpr double k_layer = 0.2;                                  // mm, layer height of printers
constexpr double k_highest_guide = 1;                            // mm
constexpr double k_guide_width = 2;                              // mm: five lines of a 0.4 mm nozzle
constexpr double k_play = 0.15;                                  // mm between paper and guide
constexpr double k_chamfer = 0.8;  // mm, at 45 degrees: room for the bulge of the first layer
constexpr double k_cover = 1.2;    // mm of plate above the bore
constexpr int k_bore_sides = 32;
constexpr double k_smallest = 3, k_largest = 152;  // mm: what `limn markers` prints on A4

using Loop = std::vector<std::uint32_t>;  // points in order, counter-clockwise from above

// Collects points by position, so that adjacent faces share them.
class Solid {
 public:
  std::uint32_t point(double x, double y, double z) {
    const Eigen::Vector3f p(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    const auto [at, added] =
        known_.emplace(std::array<float, 3>{p.x(), p.y(), p.z()}, static_cast<std::uint32_t>(points.size()));
    if (added) points.push_back(p);
    return at->second;
  }
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) { triangles.push_back({a, b, c}); }
  void quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    triangle(a, b, c);
    triangle(a, c, d);
  }
  // A wall from a loop up to another with equally many points, seen from outside the loop.
  void wall(const Loop& low, const Loop& high) {
    for (std::size_t i = 0; i < low.size(); ++i) {
      const std::size_t next = (i + 1) % low.size();
      quad(low[i], low[next], high[next], high[i]);
    }
  }

  std::vector<Eigen::Vector3f> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;

 private:
  std::map<std::array<float, 3>, std::uint32_t> known_;
};

// Face and guides: a grid of cells with two heights.
class Top {
 public:
  Top(const Mount& mount, Solid* solid) : mount_(mount), solid_(*solid) {
    const double outer = 0.5 * mount.side_mm, inner = outer - k_guide_width;
    const double arm = 0.25 * mount.paper_side_mm;
    lines_ = {-outer, -inner, -inner + 0.5 * arm, -inner + arm, inner - arm, inner, outer};
  }
  const std::array<double, 7>& lines() const { return lines_; }

  void build() {
    for (int row = 0; row < k_cells; ++row) {
      for (int col = 0; col < k_cells; ++col) {
        const bool high = is_guide(col, row);
        solid_.quad(corner(col, row, high), corner(col + 1, row, high), corner(col + 1, row + 1, high),
                    corner(col, row + 1, high));
        if (high) build_walls(col, row);
      }
    }
  }

 private:
  static constexpr int k_cells = 6;

  // Columns count to the right, rows upwards. Arms fill cells 1 and 2, and cell 4; the arm along the top from
  // the left fills only cell 1.
  static bool is_guide(int col, int row) {
    if (col < 0 || row < 0 || col >= k_cells || row >= k_cells) return false;
    const bool on_edge = col == 0 || row == 0 || col == k_cells - 1 || row == k_cells - 1;
    const bool in_gap = col == 3 || row == 3;
    const bool shortened = row == k_cells - 1 && col == 2;
    return on_edge && !in_gap && !shortened;
  }
  std::uint32_t corner(int col, int row, bool high) {
    return solid_.point(lines_[static_cast<std::size_t>(col)], lines_[static_cast<std::size_t>(row)],
                        mount_.plate_mm + (high ? mount_.guide_mm : 0));
  }
  void build_walls(int col, int row) {
    const auto wall = [&](int x0, int y0, int x1, int y1) {
      solid_.quad(corner(x0, y0, false), corner(x1, y1, false), corner(x1, y1, true), corner(x0, y0, true));
    };
    if (!is_guide(col, row - 1)) wall(col, row, col + 1, row);
    if (!is_guide(col + 1, row)) wall(col + 1, row, col + 1, row + 1);
    if (!is_guide(col, row + 1)) wall(col + 1, row + 1, col, row + 1);
    if (!is_guide(col - 1, row)) wall(col, row + 1, col, row);
  }

  const Mount& mount_;
  Solid& solid_;
  std::array<double, 7> lines_;
};

// The plate's outline at a height, with a point on every line of the top, beginning at the corner (-, -).
// `inset` moves the outline inwards.
Loop outline(const std::array<double, 7>& lines, double inset, double z, Solid* solid) {
  const double reach = lines.back() - inset;
  const auto along = [&](std::size_t i) { return std::clamp(lines[i], -reach, reach); };
  Loop loop;
  for (std::size_t i = 0; i < 6; ++i) loop.push_back(solid->point(along(i), -reach, z));
  for (std::size_t i = 0; i < 6; ++i) loop.push_back(solid->point(reach, along(i), z));
  for (std::size_t i = 6; i > 0; --i) loop.push_back(solid->point(along(i), reach, z));
  for (std::size_t i = 6; i > 0; --i) loop.push_back(solid->point(-reach, along(i), z));
  return loop;
}

// The bore's outline, beginning on the same diagonal.
Loop circle(double radius, double z, Solid* solid) {
  Loop loop;
  for (int i = 0; i < k_bore_sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / k_bore_sides - 0.75 * std::numbers::pi;
    loop.push_back(solid->point(radius * std::cos(angle), radius * std::sin(angle), z));
  }
  return loop;
}

// The back between its outline and the bore, seen from below: both loops are followed by angle.
void build_back(const Loop& outer, const Loop& inner, Solid* solid) {
  const auto angle = [&](const Loop& loop, std::size_t i) {
    if (i == loop.size()) return 2 * std::numbers::pi;
    const Eigen::Vector3f& p = solid->points[loop[i]];
    const double turned = std::atan2(p.y(), p.x()) + 0.75 * std::numbers::pi;
    return turned < -1e-6 ? turned + 2 * std::numbers::pi : turned;
  };
  std::size_t o = 0, i = 0;
  while (o < outer.size() || i < inner.size()) {
    const bool outwards =
        i == inner.size() || (o < outer.size() && angle(outer, o + 1) <= angle(inner, i + 1));
    const std::uint32_t at_outer = outer[o % outer.size()], at_inner = inner[i % inner.size()];
    if (outwards) {
      ++o;
      solid->triangle(at_inner, outer[o % outer.size()], at_outer);
    } else {
      ++i;
      solid->triangle(at_outer, at_inner, inner[i % inner.size()]);
    }
  }
}

// A blind bore that ends in a cone of 45 degrees, which prints without support.
void build_bore(const Mount& mount, const Loop& mouth, Solid* solid) {
  const double radius = 0.5 * mount.socket_mm;
  const Loop end = circle(radius, mount.socket_depth_mm, solid);
  for (std::size_t i = 0; i < mouth.size(); ++i) {
    const std::size_t next = (i + 1) % mouth.size();
    solid->quad(mouth[next], mouth[i], end[i], end[next]);
    solid->triangle(end[next], end[i], solid->point(0, 0, mount.socket_depth_mm + radius));
  }
}

Status write_stl(const Mount& mount, const std::filesystem::path& path) {
  std::string bytes(80, ' ');
  const std::string title = "limn marker mount, millimetres";
  bytes.replace(0, title.size(), title);
  const auto append = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  append(static_cast<std::uint32_t>(mount.triangles.size()));
  for (const auto& [a, b, c] : mount.triangles) {
    const Eigen::Vector3f &pa = mount.points_mm[a], &pb = mount.points_mm[b], &pc = mount.points_mm[c];
    const Eigen::Vector3f normal = (pb - pa).cross(pc - pa).normalized();
    for (const Eigen::Vector3f& v : {normal, pa, pb, pc}) {
      append(v.x());
      append(v.y());
      append(v.z());
    }
    append(std::uint16_t{0});
  }
  return write_file(path, bytes);
}

// Rounds to a thousandth, so that files are easy to read.
double rounded(double mm) { return std::round(mm * 1000) / 1000; }

}  // namespace

Mount marker_mount(const MountOptions& options) {
  Mount mount;
  mount.paper_side_mm = options.size_mm + 2 * options.margin_mm;
  mount.side_mm = mount.paper_side_mm + 2 * (k_play + k_guide_width);
  const double hidden_margin = 0.5 * options.margin_mm;
  mount.guide_mm =
      std::min(k_highest_guide, k_layer * std::floor(hidden_margin / std::tan(k_steepest_view) / k_layer));
  mount.socket_mm = mount.paper_side_mm >= 30 ? 6.2 : 3.2;  // for rods of 6 and 3 mm
  mount.socket_depth_mm = mount.socket_mm;
  mount.plate_mm =
      std::max(mount.paper_side_mm / 20, mount.socket_depth_mm + 0.5 * mount.socket_mm + k_cover);
  Solid solid;
  Top top(mount, &solid);
  top.build();
  const Loop back = outline(top.lines(), k_chamfer, 0, &solid);
  const Loop low = outline(top.lines(), 0, k_chamfer, &solid);
  solid.wall(back, low);
  solid.wall(low, outline(top.lines(), 0, mount.plate_mm, &solid));
  const Loop mouth = circle(0.5 * mount.socket_mm, 0, &solid);
  build_back(back, mouth, &solid);
  build_bore(mount, mouth, &solid);
  mount.points_mm = std::move(solid.points);
  mount.triangles = std::move(solid.triangles);
  const Eigen::Quaterniond half_turn(0, 1, 0,
                                     0);  // about x: the marker's y points down and its z into the paper
  mount.holder_from_marker = Pose(half_turn, {0, 0, (mount.plate_mm + options.paper_mm) / 1000});
  return mount;
}

Status run_mount(const MountOptions& options) {
  if (!(options.size_mm >= k_smallest && options.size_mm <= k_largest))
    return usage_error("--size-mm: expected {} to {} mm, which fits on A4, found {}.", k_smallest, k_largest,
                       options.size_mm);
  if (!(options.paper_mm >= 0 && options.paper_mm <= 2))
    return usage_error("--paper-mm: expected 0 to 2 mm of paper and glue, found {}.", options.paper_mm);
  if (options.out.extension() != ".stl")
    return usage_error("--mount: expected a file that ends in .stl, found '{}'.", options.out.string());
  const Mount mount = marker_mount(options);
  LIMN_TRY_STATUS(write_stl(mount, options.out));
  nlohmann::ordered_json json = {{"schema", "limn.mount/1"},
                                 {"size_mm", options.size_mm},
                                 {"paper_side_mm", rounded(mount.paper_side_mm)},
                                 {"paper_mm", options.paper_mm},
                                 {"side_mm", rounded(mount.side_mm)},
                                 {"plate_mm", rounded(mount.plate_mm)},
                                 {"guide_mm", rounded(mount.guide_mm)},
                                 {"socket_mm", rounded(mount.socket_mm)},
                                 {"socket_depth_mm", rounded(mount.socket_depth_mm)}};
  json["holder_from_marker"] = to_json(mount.holder_from_marker);
  std::filesystem::path pose_file = options.out;
  pose_file.replace_extension(".json");
  LIMN_TRY_STATUS(write_file(pose_file, json_text(json, 2) + "\n"));
  print_out("holder of {:g} x {:g} x {:g} mm in {}; print it on its back, cut the paper to {:g} x {:g} mm\n",
            rounded(mount.side_mm), rounded(mount.side_mm), rounded(mount.plate_mm + mount.guide_mm),
            options.out.string(), rounded(mount.paper_side_mm), rounded(mount.paper_side_mm));
  print_out("holder_from_marker (in {}): {}\n", pose_file.string(), json_text(json["holder_from_marker"]));
  return {};
}

}  // namespace limn::exchange
