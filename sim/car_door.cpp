#include "sim/car_door.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/json_text.h"
#include "scene/meshes/glb.h"
#include "scene/posed_scene.h"
#include "sim/ray_scene.h"

namespace limn::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double k_pi = std::numbers::pi;
constexpr double k_half_width = 0.30, k_half_height = 0.20;  // panel, m
constexpr double k_marker_size = 0.040;                      // m, black square
constexpr double k_plate_side = 1.3 * k_marker_size;         // plate with its white margin
constexpr double k_plate_gap = 0.3e-3;                       // least distance of a plate from the clay, m
// Height above the clay, m: above the noise of floats, but not visible.
constexpr double k_trim_lift = 0.1e-3;

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// To the micrometre, so that the files are reproducible.
double rounded(double v) { return std::round(v * 1e6) / 1e6; }

// Height of the clay above the door's plane, m. (x, y) must be inside the outline.
double height(double x, double y) {
  const double barrel = -0.046 * std::pow(y / k_half_height, 2) - 0.030 * std::pow(x / k_half_width, 2);
  const double swage = 0.060 + 0.07 * (x + 0.1) - y;         // the crease rises towards the rear
  const double shoulder = -0.028 * sigmoid(-swage / 0.011);  // above it the surface steps back
  const double ridge = 0.011 * std::exp(-std::max(swage, 0.0) / 0.045) * sigmoid(swage / 0.010);
  const double sill = 0.016 * sigmoid((-0.135 - y) / 0.014);
  const Vector2d handle((x - 0.165) / 0.062, (y - 0.125) / 0.026);
  const double recess = -0.022 * std::exp(-std::pow(handle.squaredNorm(), 2));
  return 0.045 + barrel + shoulder + ridge + sill + recess;
}

// Maps (s, t) in [-1, 1]² to the door's plane: rounded corners, an inclined front edge, a curved top.
Vector2d outlined(double s, double t) {
  const double narrowing = 1 - 0.05 * std::pow(std::abs(t), 7),
               lowering = 1 - 0.07 * std::pow(std::abs(s), 7);
  const double bow = t > 0 ? -0.012 * t * s * s : 0;
  return {s * k_half_width * narrowing + 0.012 * t * (s < 0 ? -s : 0), t * k_half_height * lowering + bow};
}

// The drop of the rounded edges of the clay.
double edge_drop(double s, double t) {
  const auto roll = [](double e) {
    const double depth = std::clamp((std::abs(e) - 0.965) / 0.035, 0.0, 1.0);
    return 0.010 * (1 - std::sqrt(1 - 0.98 * depth * depth));
  };
  return roll(s) + roll(t);
}

Vector3d clay(double s, double t) {
  const Vector2d p = outlined(s, t);
  return {p.x(), p.y(), height(p.x(), p.y()) - edge_drop(s, t)};
}

// Grid lines in [-1, 1]: evenly spaced, and closer at the rounded edges.
std::vector<double> grid_lines(int count) {
  std::vector<double> lines;
  const std::vector<double> roll = {0.965, 0.974, 0.982, 0.989, 0.994, 0.998, 1.0};
  for (auto e = roll.rbegin(); e != roll.rend(); ++e) lines.push_back(-*e);
  for (int i = 1; i < count; ++i) lines.push_back(-0.965 + 1.93 * i / count);
  lines.insert(lines.end(), roll.begin(), roll.end());
  return lines;
}

std::uint32_t add_vertex(scene::Mesh& mesh, const Vector3d& p, const Vector3d& n) {
  mesh.positions.push_back(Vector3d(rounded(p.x()), rounded(p.y()), rounded(p.z())).cast<float>());
  const Vector3d unit = n.normalized();
  mesh.normals.push_back(Vector3d(rounded(unit.x()), rounded(unit.y()), rounded(unit.z())).cast<float>());
  return static_cast<std::uint32_t>(mesh.positions.size() - 1);
}

void add_triangle(
    scene::Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint16_t material = 0) {
  mesh.triangles.push_back({a, b, c});
  mesh.triangle_materials.push_back(material);
}

// Adds quadrilaterals between consecutive rows of `columns` vertices. They are counter-clockwise when seen
// with rows running up and columns running right.
void add_grid(scene::Mesh& mesh,
              std::uint32_t first,
              int columns,
              int rows,
              std::uint16_t material,
              bool closed = false) {
  const auto width = static_cast<std::uint32_t>(columns);
  for (std::uint32_t r = 0; r + 1 < static_cast<std::uint32_t>(rows); ++r)
    for (std::uint32_t c = 0; c + (closed ? 0 : 1) < width; ++c) {
      const std::uint32_t next = (c + 1) % width;
      const std::uint32_t a = first + r * width + c, b = first + r * width + next;
      add_triangle(mesh, a, b, b + width, material);
      add_triangle(mesh, a, b + width, a + width, material);
    }
}

Vector3d clay_normal(double s, double t) {
  constexpr double k_step = 1e-4;
  const double s0 = std::max(-1.0, s - k_step), s1 = std::min(1.0, s + k_step);
  const double t0 = std::max(-1.0, t - k_step), t1 = std::min(1.0, t + k_step);
  return (clay(s1, t) - clay(s0, t)).cross(clay(s, t1) - clay(s, t0)).normalized();
}

void add_front(scene::Mesh& mesh, const std::vector<double>& columns, const std::vector<double>& rows) {
  for (const double t : rows)
    for (const double s : columns) {
      const Vector3d p = clay(s, t);
      add_vertex(mesh, p, clay_normal(s, t));
      mesh.uvs.emplace_back(static_cast<float>(rounded(0.5 + p.x() / (2 * k_half_width))),
                            static_cast<float>(rounded(0.5 + p.y() / (2 * k_half_height))));
    }
  add_grid(mesh, 0, static_cast<int>(columns.size()), static_cast<int>(rows.size()), 0);
}

// Adds sides and a flat back, so that the door is a solid block of clay.
void add_sides_and_back(scene::Mesh& mesh,
                        const std::vector<double>& columns,
                        const std::vector<double>& rows) {
  std::vector<Vector2d> border;  // counter-clockwise as seen from outside the door
  for (const double s : columns) border.emplace_back(s, -1);
  for (std::size_t i = 1; i < rows.size(); ++i) border.emplace_back(1, rows[i]);
  for (std::size_t i = columns.size() - 1; i-- > 0;) border.emplace_back(columns[i], 1);
  for (std::size_t i = rows.size() - 1; i-- > 1;) border.emplace_back(-1, rows[i]);
  constexpr double k_back = -0.095;  // m
  const auto count = static_cast<std::uint32_t>(border.size());
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const bool front : {true, false})
    for (std::uint32_t i = 0; i < count; ++i) {
      Vector3d p = clay(border[i].x(), border[i].y());
      const Vector2d along =
          outlined(border[(i + 1) % count].x(), border[(i + 1) % count].y()) -
          outlined(border[(i + count - 1) % count].x(), border[(i + count - 1) % count].y());
      if (!front) p.z() = k_back;
      add_vertex(mesh, p, Vector3d(along.y(), -along.x(), 0));
    }
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t a = first + i, b = first + (i + 1) % count;
    add_triangle(mesh, a, b + count, b);
    add_triangle(mesh, a, a + count, b + count);
  }
  const auto back = static_cast<std::uint32_t>(mesh.positions.size());
  add_vertex(mesh, {0, 0, k_back}, -Vector3d::UnitZ());
  for (const Vector2d& e : border) {
    const Vector2d p = outlined(e.x(), e.y());
    add_vertex(mesh, {p.x(), p.y(), k_back}, -Vector3d::UnitZ());
  }
  for (std::uint32_t i = 0; i < count; ++i)
    add_triangle(mesh, back, back + 1 + (i + 1) % count, back + 1 + i);
  mesh.uvs.resize(mesh.positions.size(), Eigen::Vector2f::Zero());
}

scene::Mesh door_mesh() {
  scene::Mesh mesh;
  mesh.materials = {scene::Material{}};
  mesh.materials[0].base_colour.setConstant(0.75F);
  const std::vector<double> columns = grid_lines(138), rows = grid_lines(92);
  add_front(mesh, columns, rows);
  add_sides_and_back(mesh, columns, rows);
  return mesh;
}

// The height of the triangulated surface, found by a ray along -z.
class Clay {
 public:
  explicit Clay(const scene::Mesh& mesh) : scene_(std::vector<MeshInstance>{{&mesh, Pose()}}) {}
  double height(double x, double y) const {
    const Hit hit = scene_.first_hit({Vector3d(x, y, 1), -Vector3d::UnitZ()});
    LIMN_CHECK(hit.object >= 0);
    return 1 - hit.distance;
  }

 private:
  RayScene scene_;
};

// The pose of a flat plate on the clay around (x, y): a least-squares plane, moved outwards until it is clear
// of the clay. Marker frame: x right, y down, z into the door.
Pose plate_on(const Clay& clay, double x, double y) {
  constexpr int k_half = 6;
  std::vector<Vector3d> points;
  for (int r = -k_half; r <= k_half; ++r)
    for (int c = -k_half; c <= k_half; ++c) {
      const double px = x + c * k_plate_side / 2 / k_half, py = y + r * k_plate_side / 2 / k_half;
      points.emplace_back(px, py, clay.height(px, py));
    }
  Eigen::MatrixX3d a(points.size(), 3);
  Eigen::VectorXd b(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    a.row(static_cast<Eigen::Index>(i)) << points[i].x() - x, points[i].y() - y, 1;
    b[static_cast<Eigen::Index>(i)] = points[i].z();
  }
  const Vector3d plane = (a.transpose() * a).ldlt().solve(a.transpose() * b);
  const Vector3d d_out = Vector3d(-plane.x(), -plane.y(), 1).normalized();
  const Vector3d p(x, y, plane.z());
  double lift = 0;
  for (const Vector3d& q : points) lift = std::max(lift, d_out.dot(q - p));
  const Vector3d d_right = (Vector3d::UnitX() - d_out.x() * d_out).normalized();
  Eigen::Matrix3d axes;
  axes << d_right, (-d_out).cross(d_right), -d_out;
  return Pose(axes, p + (lift + k_plate_gap) * d_out);
}

// ---- parts
// -------------------------------------------------------------------------------------------------

std::uint16_t add_material(scene::Mesh& mesh, const Vector3f& rgb) {
  scene::Material material;
  material.base_colour = rgb;
  mesh.materials.push_back(material);
  return static_cast<std::uint16_t>(mesh.materials.size() - 1);
}

constexpr int k_around = 56;  // vertices of a ring

// Adds rings of vertices p(k, angle), joined to a surface with smooth normals. When angles run
// counter-clockwise, the outside is to the right of increasing k.
void add_rings(scene::Mesh& mesh,
               int rings,
               const std::function<Vector3d(double, double)>& p,
               std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (int k = 0; k < rings; ++k)
    for (int i = 0; i < k_around; ++i) {
      const double angle = 2 * k_pi * i / k_around, along = static_cast<double>(k) / (rings - 1);
      const double before = std::max(0.0, along - 1e-3), after = std::min(1.0, along + 1e-3);
      Vector3d n =
          (p(along, angle + 1e-3) - p(along, angle - 1e-3)).cross(p(after, angle) - p(before, angle));
      if (n.norm() < 1e-12) n = p(0.5, angle) - p(0.5, angle + k_pi);
      add_vertex(mesh, p(along, angle), n);
    }
  add_grid(mesh, first, k_around, rings, material, true);
}

// A disc whose rim, the vertices of a ring, runs counter-clockwise about the normal; clockwise: the other
// way.
void add_disc(scene::Mesh& mesh,
              const Vector3d& centre,
              const Vector3d& normal,
              const std::function<Vector3d(double)>& rim,
              std::uint16_t material,
              bool is_clockwise = false) {
  const std::uint32_t middle = add_vertex(mesh, centre, normal);
  for (int i = 0; i < k_around; ++i) add_vertex(mesh, rim(2 * k_pi * i / k_around), normal);
  for (std::uint32_t i = 0; i < k_around; ++i) {
    const std::uint32_t here = middle + 1 + i, next = middle + 1 + (i + 1) % k_around;
    add_triangle(mesh, middle, is_clockwise ? next : here, is_clockwise ? here : next, material);
  }
}

// Rings that a disc closes at each end.
void add_closed_rings(scene::Mesh& mesh,
                      int rings,
                      const std::function<Vector3d(double, double)>& p,
                      std::uint16_t material) {
  add_rings(mesh, rings, p, material);
  for (const double k : {0.0, 1.0}) {
    const Vector3d centre = 0.5 * (p(k, 0) + p(k, k_pi));
    const Vector3d normal = (p(k, 0) - centre).cross(p(k, k_pi / 2) - centre).normalized();
    add_disc(
        mesh, centre, k == 0 ? Vector3d(-normal) : normal, [&](double angle) { return p(k, angle); },
        material, k == 0);
  }
}

struct MirrorStyle {
  std::string name;
  double half_width, half_height, depth;  // the housing, m
  double roundness;                       // superellipse: 2 round … 6 boxy
  double taper;                           // relative reduction in height of the inner side
  Vector3d centre;                        // centre of the glass, in the part's frame
  double turn;                            // rotation of the glass, from facing the viewer towards the rear
  double foot_radius, arm_radius;
  Vector3f paint, arm, rim, glass;  // linear RGB
};

const std::vector<MirrorStyle>& mirror_styles() {
  static const std::vector<MirrorStyle> styles = {{"classic",
                                                   0.052,
                                                   0.052,
                                                   0.045,
                                                   2.0,
                                                   0.0,
                                                   {-0.015, 0.050, 0.060},
                                                   0.55,
                                                   0.020,
                                                   0.0075,
                                                   {0.62F, 0.64F, 0.66F},
                                                   {0.55F, 0.57F, 0.60F},
                                                   {0.80F, 0.82F, 0.85F},
                                                   {0.16F, 0.26F, 0.36F}},
                                                  {"sport",
                                                   0.082,
                                                   0.040,
                                                   0.055,
                                                   3.0,
                                                   0.45,
                                                   {-0.030, 0.050, 0.066},
                                                   0.50,
                                                   0.018,
                                                   0.0090,
                                                   {0.62F, 0.02F, 0.02F},
                                                   {0.03F, 0.03F, 0.035F},
                                                   {0.03F, 0.03F, 0.035F},
                                                   {0.22F, 0.36F, 0.48F}},
                                                  {"city",
                                                   0.058,
                                                   0.066,
                                                   0.048,
                                                   5.0,
                                                   0.12,
                                                   {-0.020, 0.050, 0.064},
                                                   0.45,
                                                   0.024,
                                                   0.0110,
                                                   {0.02F, 0.14F, 0.52F},
                                                   {0.10F, 0.10F, 0.11F},
                                                   {0.75F, 0.75F, 0.72F},
                                                   {0.30F, 0.42F, 0.50F}}};
  return styles;
}

double signed_power(double v, double exponent) { return std::copysign(std::pow(std::abs(v), exponent), v); }

// A foot on the door at the origin, an arm, and a domed housing with a rim and a glass that faces the viewer
// and the rear: three closed pieces.
scene::Mesh mirror_mesh(const MirrorStyle& style) {
  scene::Mesh mesh;
  mesh.materials.clear();
  const std::uint16_t paint = add_material(mesh, style.paint), arm = add_material(mesh, style.arm);
  const std::uint16_t rim = add_material(mesh, style.rim), glass = add_material(mesh, style.glass);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(style.turn, Vector3d::UnitY()).toRotationMatrix();
  const auto outline = [&](double angle, double scale, double depth) {
    const double x = signed_power(std::cos(angle), 2 / style.roundness),
                 y = signed_power(std::sin(angle), 2 / style.roundness);
    const double low = 1 - style.taper * (x + 1) / 2;  // lower towards the door's rear
    return Vector3d(style.centre + turn * Vector3d(x * scale * style.half_width,
                                                   y * scale * low * style.half_height, depth));
  };
  const auto dome = [&](double k, double angle) {
    const double rise = k * k_pi / 2;
    return outline(angle, std::max(std::sin(rise), 1e-3), k < 1 ? -style.depth * std::cos(rise) : 0);
  };
  add_rings(mesh, 18, dome, paint);
  add_disc(
      mesh, style.centre + turn * Vector3d(0, 0, -style.depth), turn * -Vector3d::UnitZ(),
      [&](double angle) { return dome(0, angle); }, paint, true);
  const auto rim_ring = [&](double k, double angle) {
    return outline(angle, 1 - 0.10 * k, k < 1 ? 0.004 * std::sin(k * k_pi) - 0.002 * k : -0.002);
  };
  add_rings(mesh, 6, rim_ring, rim);
  const auto glass_rim = [&](double angle) { return rim_ring(1, angle); };
  add_disc(mesh, style.centre + turn * Vector3d(0, 0, -0.0015), turn * Vector3d::UnitZ(), glass_rim, glass);
  const auto foot = [&](double k, double angle) {
    const double r = style.foot_radius * std::sqrt(std::max(1 - k * k, 1e-6));
    return Vector3d(r * std::cos(angle), 0.7 * r * std::sin(angle), 0.012 * k - 0.004);
  };
  add_closed_rings(mesh, 8, foot, arm);
  const Vector3d p_end = style.centre + turn * Vector3d(0, -0.35 * style.half_height, -0.6 * style.depth);
  const Vector3d p_bend(0.1 * p_end.x(), 0.25 * p_end.y(), 0.9 * p_end.z());
  add_closed_rings(
      mesh, 16,
      [&](double k, double angle) {
        const Vector3d p = 2 * k * (1 - k) * p_bend + k * k * p_end;
        const Vector3d d = (2 * (1 - 2 * k) * p_bend + 2 * k * p_end).normalized();
        const Vector3d right = d.cross(Vector3d::UnitY()).normalized(), up = right.cross(d);
        return Vector3d(p + style.arm_radius * (1.3 - 0.3 * k) *
                                (std::cos(angle) * right + std::sin(angle) * up));
      },
      arm);
  return mesh;
}

// A strip along the lower flank that lies on the door's own triangles: chrome between two dark lines.
scene::Mesh trim_mesh(const Clay& clay, const Pose& prototype_from_part) {
  scene::Mesh mesh;
  mesh.materials.clear();
  const std::uint16_t dark = add_material(mesh, {0.03F, 0.03F, 0.04F}),
                      bright = add_material(mesh, {0.80F, 0.45F, 0.05F});
  const Pose part_from_prototype = prototype_from_part.inverse();
  constexpr int k_columns = 320;
  const auto point = [&](double x, double offset) {
    const double y = -0.083 + 0.045 * (x + 0.1) + offset * (1 - 0.5 * std::pow(std::abs(x) / 0.27, 2));
    return Vector3d(x, y, clay.height(x, y) + k_trim_lift);
  };
  const auto band = [&](double low, double high, std::uint16_t material) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    constexpr int k_rows = 5;
    for (int r = 0; r < k_rows; ++r)
      for (int c = 0; c < k_columns; ++c) {
        const double x = -0.27 + 0.54 * c / (k_columns - 1), offset = low + (high - low) * r / (k_rows - 1);
        const Vector3d n = (point(x + 1e-3, offset) - point(x - 1e-3, offset))
                               .cross(point(x, offset + 1e-3) - point(x, offset - 1e-3));
        add_vertex(mesh, part_from_prototype * point(x, offset), part_from_prototype.rotation * n);
      }
    add_grid(mesh, first, k_columns, k_rows, material);
  };
  band(-0.0090, -0.0055, dark);
  band(-0.0055, 0.0055, bright);
  band(0.0055, 0.0090, dark);
  return mesh;
}

// The pose of a part that stands `right` and `up` of its marker; the part's axes are the door's (x right, y
// up, z out).
Pose marker_from_upright(double right, double up) {
  return Pose(Eigen::Quaterniond(0, 1, 0, 0), Vector3d(right, -up, 0));
}

BodyMarker april_tag(const Clay& clay, int id, double x, double y) {
  return {{"apriltag_36h11", std::to_string(id)}, k_marker_size, plate_on(clay, x, y)};
}

constexpr double k_mirror_marker[2] = {-0.130, 0.128},
                 k_trim_marker[2] = {-0.030, -0.015};  // x, y on the door

scene::Prototype door_prototype() {
  scene::Prototype prototype;
  prototype.mesh = door_mesh();
  prototype.albedo = 0.75;
  const Clay clay(prototype.mesh);
  const double places[][2] = {{-0.245, -0.150}, {-0.085, -0.155}, {0.085, -0.155}, {0.245, -0.150},
                              {-0.245, 0.005},  {0.245, -0.010},  {0.030, 0.140},  {0.100, 0.010}};
  int id = 0;
  for (const auto& [x, y] : places) prototype.markers.push_back(april_tag(clay, id++, x, y));
  return prototype;
}

// A pose as scene.json holds it.
nlohmann::ordered_json pose_json(const Pose& pose) {
  const auto digits = [](double v) { return std::round(v * 1e9) / 1e9; };
  const auto& q = pose.rotation;
  const auto& t = pose.translation;
  return {{"rotation_wxyz", {digits(q.w()), digits(q.x()), digits(q.y()), digits(q.z())}},
          {"translation_m", {digits(t.x()), digits(t.y()), digits(t.z())}}};
}

// What the door is painted with in light: a lacquer whose reflections are the viewer's, and a matt paint.
std::vector<scene::Finish> door_finishes() {
  scene::Finish lacquer, sand;
  lacquer.name = "blue lacquer";
  lacquer.base_colour = {0.008, 0.07, 0.28};
  lacquer.metallic = 0.8;
  lacquer.roughness = 0.3;
  lacquer.clearcoat = 1;
  lacquer.clearcoat_roughness = 0.03;
  lacquer.for_viewer = true;
  sand.name = "matt sand";
  sand.base_colour = {0.6, 0.45, 0.3};
  return {lacquer, sand};
}

nlohmann::ordered_json finish_json(const scene::Finish& finish) {
  const Vector3d& rgb = finish.base_colour;
  return {{"name", finish.name},
          {"base_colour", {rgb.x(), rgb.y(), rgb.z()}},
          {"metallic", finish.metallic},
          {"roughness", finish.roughness},
          {"clearcoat", finish.clearcoat},
          {"clearcoat_roughness", finish.clearcoat_roughness},
          {"mode", finish.for_viewer ? "view" : "surface"}};
}

nlohmann::ordered_json slot_json(const scene::Slot& slot) {
  nlohmann::ordered_json json = {{"name", slot.name},
                                 {"marker", slot.marker.text()},
                                 {"size_mm", slot.size_m * 1e3},
                                 {"marker_from_part", pose_json(slot.marker_from_part)},
                                 {"mode", slot.mode == scene::Mode::view ? "view" : "surface"},
                                 {"stick_to_surface", slot.stick_to_surface}};
  for (const scene::Variant& variant : slot.variants)
    json["variants"].push_back(
        {{"name", variant.name}, {"mesh", slot.name + "-" + variant.name + ".glb"}, {"units", "m"}});
  return json;
}

// A designer's viewpoint: right of the middle, at standing height above the table, 1.5 m away. World frame as
// in config/worlds: z up, the door faces -y.
constexpr int k_viewer_size[2] = {1280, 800};
constexpr double k_viewer_fov_deg = 36;
Pose world_from_viewer() {
  return looking_at({0.28, -1.45, 0.78}, {0, 0, 0.43}, Vector3d::UnitZ()).inverse();
}

scene::Slot slot_on_door(const std::string& name, const std::string& aruco_id, scene::Mode mode) {
  scene::Slot slot;
  slot.name = name;
  slot.marker = {"aruco_4x4_50", aruco_id};
  slot.size_m = k_marker_size;
  slot.mode = mode;
  slot.stick_to_surface = true;
  return slot;
}

std::map<std::string, Pose> slot_places(const Clay& clay) {
  return {{"mirror", plate_on(clay, k_mirror_marker[0], k_mirror_marker[1])},
          {"trim", plate_on(clay, k_trim_marker[0], k_trim_marker[1])}};
}

// Where a perfect tracker puts a slot's part, including the projection onto the surface.
Pose prototype_from_part(const scene::Scene& scene, const std::string& slot, const Clay& clay) {
  std::vector<Track> tracks(2);
  tracks[0].body = "prototype";
  tracks[1].body = slot;
  tracks[1].world_from_body = slot_places(clay).at(slot);
  return scene::posed(scene, tracks).parts.at(0).world_from_part;
}

}  // namespace

scene::Scene car_door_scene() {
  scene::Scene scene;
  scene.prototype = door_prototype();
  const Clay clay(scene.prototype->mesh);
  scene::Slot mirror = slot_on_door("mirror", "0", scene::Mode::view);
  mirror.marker_from_part = marker_from_upright(-0.072, -0.010);
  for (const MirrorStyle& style : mirror_styles())
    mirror.variants.push_back({style.name, mirror_mesh(style)});
  scene::Slot trim = slot_on_door("trim", "1", scene::Mode::surface);
  trim.marker_from_part = marker_from_upright(0, 0);
  trim.variants.push_back({"line", {}});
  scene.slots = {mirror, trim};
  scene.slots[1].variants[0].mesh = trim_mesh(clay, prototype_from_part(scene, "trim", clay));
  scene.finishes = door_finishes();
  scene.viewers.emplace_back();
  scene.viewers[0].fixed =
      viewer_imager(world_from_viewer(), k_viewer_size[0], k_viewer_size[1], k_viewer_fov_deg);
  return scene;
}

std::map<std::string, Pose> car_door_slot_places() {
  const scene::Mesh door = door_mesh();
  const Clay clay(door);
  return slot_places(clay);
}

std::map<std::string, std::string> car_door_files() {
  const scene::Scene scene = car_door_scene();
  std::map<std::string, std::string> files;
  nlohmann::ordered_json json;
  json["schema"] = "limn.scene/1";
  json["prototype"] = {{"mesh", "door.glb"}, {"units", "m"}, {"albedo", scene.prototype->albedo}};
  for (const BodyMarker& marker : scene.prototype->markers)
    json["prototype"]["markers"].push_back({{"name", marker.marker.text()},
                                            {"size_mm", marker.size_m * 1e3},
                                            {"prototype_from_marker", pose_json(marker.body_from_marker)}});
  files["door.glb"] = scene::encode_glb(scene.prototype->mesh);
  for (const scene::Slot& slot : scene.slots) {
    json["slots"].push_back(slot_json(slot));
    for (const scene::Variant& variant : slot.variants)
      files[slot.name + "-" + variant.name + ".glb"] = scene::encode_glb(variant.mesh);
  }
  for (const scene::Finish& finish : scene.finishes) json["finishes"].push_back(finish_json(finish));
  json["viewer"]["fixed"] = {{"world_from_viewer", pose_json(world_from_viewer())},
                             {"size", {k_viewer_size[0], k_viewer_size[1]}},
                             {"fov_deg", k_viewer_fov_deg}};
  files["scene.json"] = json_text(json, 2) + "\n";
  return files;
}

}  // namespace limn::sim
