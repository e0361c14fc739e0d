#include "exchange/curves/dxf_curves.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

#include "exchange/curves/csv_curves.h"

namespace limn::exchange {
namespace {

using Eigen::Vector3d;

constexpr double k_largest_dxf = 1e7;         // in the file's unit
constexpr double k_arc_step = 2e-2;           // rad; a radius of 200 mm then has a sagitta of 0.01 mm
constexpr int k_pieces_of_span = 32;          // between two knots of a spline
constexpr std::size_t k_most_spline = 10000;  // control points of one spline
constexpr int k_most_degree = 15;

// A pair of lines: a code, and its value.
struct Pair {
  int code = 0;
  std::string_view value;
  std::size_t line = 0;
};

class Pairs {
 public:
  Pairs(std::string_view text, std::string where) : rest_(text), where_(std::move(where)) {}

  // The next pair; nullopt at the end or after a problem.
  std::optional<Pair> next() {
    if (rest_.empty() || !status_) return std::nullopt;
    Pair pair;
    pair.line = line_ + 1;
    std::string_view code = next_line();
    while (!code.empty() && code.front() == ' ') code.remove_prefix(1);
    while (!code.empty() && code.back() == ' ') code.remove_suffix(1);
    if (code.empty() && rest_.empty()) return std::nullopt;
    const auto [end, problem] = std::from_chars(code.data(), code.data() + code.size(), pair.code);
    if (problem != std::errc() || end != code.data() + code.size()) {
      status_ = error("{}: line {}: expected a code of DXF, found '{}'. Export it as ASCII DXF.", where_,
                      pair.line, printable(code));
      return std::nullopt;
    }
    pair.value = next_line();
    return pair;
  }
  double number(const Pair& pair) {
    std::string_view text = pair.value;
    while (!text.empty() && (text.front() == ' ' || text.front() == '+')) text.remove_prefix(1);
    while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
    double value = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem == std::errc() && end == text.data() + text.size() && std::abs(value) <= k_largest_dxf)
      return value;
    refuse(pair.line + 1, fmt::format("expected a number of at most {:g}, found '{}'.", k_largest_dxf,
                                      printable(pair.value)));
    return 0;
  }
  void refuse(std::size_t line, const std::string& sentence) {
    if (status_) status_ = error("{}: line {}: {}", where_, line, sentence);
  }
  std::size_t line() const { return line_; }
  const Status& status() const { return status_; }

 private:
  static std::string printable(std::string_view text) {
    std::string out(text.substr(0, 32));
    std::replace_if(
        out.begin(), out.end(), [](char c) { return c < 0x20 || c > 0x7e; }, '?');
    return out;
  }
  std::string_view next_line() {
    std::string_view line = rest_.substr(0, rest_.find('\n'));
    rest_.remove_prefix(std::min(rest_.size(), line.size() + 1));
    if (line.ends_with('\r')) line.remove_suffix(1);
    ++line_;
    return line;
  }
  std::string_view rest_;
  std::string where_;
  std::size_t line_ = 0;
  Status status_;
};

// What an entity says. Coordinates are kept in the order in which they come.
struct Entity {
  std::string type, layer;
  std::size_t line = 0;
  std::vector<Vector3d> points, more_points;  // codes 10-30 and 11-31
  std::vector<double> bulges, knots, weights;
  Vector3d d_up = Vector3d::UnitZ();
  double elevation = 0, radius = 0, start_deg = 0, end_deg = 360;
  int flags = 0, degree = 3;
};

void read_pair(const Pair& pair, Pairs* pairs, Entity* entity) {
  const auto coordinate = [&](std::vector<Vector3d>* points, int axis) {
    if (axis == 0) points->push_back(Vector3d::Zero());
    if (!points->empty()) points->back()[axis] = pairs->number(pair);
  };
  const bool is_light = entity->type == "LWPOLYLINE", is_spline = entity->type == "SPLINE";
  switch (pair.code) {
    case 8:
      entity->layer = std::string(pair.value);
      break;
    case 10:
      if (is_light) entity->bulges.push_back(0);
      [[fallthrough]];
    case 20:
    case 30:
      coordinate(&entity->points, pair.code / 10 - 1);
      break;
    case 11:
    case 21:
    case 31:
      coordinate(&entity->more_points, pair.code / 10 - 1);
      break;
    case 38:
      entity->elevation = pairs->number(pair);
      break;
    case 40:
      (is_spline ? entity->knots.emplace_back() : entity->radius) = pairs->number(pair);
      break;
    case 41:
      if (is_spline) entity->weights.push_back(pairs->number(pair));
      break;
    case 42:
      if (is_light && !entity->bulges.empty()) entity->bulges.back() = pairs->number(pair);
      if (entity->type == "VERTEX") entity->bulges = {pairs->number(pair)};
      break;
    case 50:
      entity->start_deg = pairs->number(pair);
      break;
    case 51:
      entity->end_deg = pairs->number(pair);
      break;
    case 70:
      entity->flags = static_cast<int>(std::clamp(pairs->number(pair), -1e6, 1e6));
      break;
    case 71:
      entity->degree = static_cast<int>(std::clamp(pairs->number(pair), -1e6, 1e6));
      break;
    case 210:
    case 220:
    case 230:
      entity->d_up[pair.code / 10 - 21] = pairs->number(pair);
      break;
    default:
      break;
  }
}

// The arbitrary axis algorithm of the DXF reference.
Eigen::Matrix3d axes_of(const Vector3d& d_up) {
  if (!(d_up.norm() > 1e-9)) return Eigen::Matrix3d::Identity();
  const Vector3d z = d_up.normalized();
  const bool is_near_z = std::abs(z.x()) < 1.0 / 64 && std::abs(z.y()) < 1.0 / 64;
  const Vector3d x = (is_near_z ? Vector3d::UnitY() : Vector3d::UnitZ()).cross(z).normalized();
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return axes;
}

// Points of an arc about `centre`, from one angle over a signed sweep; without its end.
void add_arc(const Vector3d& centre, double radius, double from, double sweep, std::vector<Vector3d>* to) {
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(sweep) / k_arc_step)));
  for (int i = 0; i < count; ++i) {
    const double angle = from + sweep * i / count;
    to->emplace_back(centre + radius * Vector3d(std::cos(angle), std::sin(angle), 0));
  }
}

// The points of a polyline in its plane. A bulge is the tangent of a quarter of an arc's sweep.
std::vector<Vector3d> with_arcs(const std::vector<Vector3d>& corners,
                                const std::vector<double>& bulges,
                                bool is_closed) {
  std::vector<Vector3d> points;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const bool is_last = i + 1 == corners.size();
    const double bulge = i < bulges.size() ? bulges[i] : 0;
    const Vector3d &a = corners[i], &b = corners[is_last ? 0 : i + 1];
    const double chord = (b - a).head<2>().norm();
    if (bulge == 0 || chord == 0 || (is_last && !is_closed)) {
      points.push_back(a);
      continue;
    }
    const double sweep = 4 * std::atan(bulge), radius = chord / 2 / std::sin(sweep / 2);
    const Vector3d ab = (b - a) / chord, d_left(-ab.y(), ab.x(), 0);
    const Vector3d centre = (a + b) / 2 + radius * std::cos(sweep / 2) * d_left;
    const Vector3d out = a - centre;
    const std::size_t first = points.size();
    add_arc(centre, std::abs(radius), std::atan2(out.y(), out.x()), sweep, &points);
    for (std::size_t k = first; k < points.size(); ++k) points[k].z() = a.z();
  }
  return points;
}

// De Boor's algorithm, in homogeneous coordinates.
Vector3d spline_at(double t,
                   std::size_t span,
                   int degree,
                   const std::vector<double>& knots,
                   const std::vector<Eigen::Vector4d>& control) {
  std::vector<Eigen::Vector4d> d(control.begin() + static_cast<std::ptrdiff_t>(span) - degree,
                                 control.begin() + static_cast<std::ptrdiff_t>(span) + 1);
  for (int r = 1; r <= degree; ++r)
    for (int j = degree; j >= r; --j) {
      const std::size_t i = span - static_cast<std::size_t>(degree - j);
      const double low = knots[i], high = knots[i + static_cast<std::size_t>(degree - r) + 1];
      const double share = high > low ? (t - low) / (high - low) : 0;
      d[static_cast<std::size_t>(j)] =
          (1 - share) * d[static_cast<std::size_t>(j) - 1] + share * d[static_cast<std::size_t>(j)];
    }
  return d.back().head<3>() / d.back().w();
}

std::optional<std::vector<Vector3d>> spline_points(const Entity& entity, Pairs* pairs) {
  const std::size_t count = entity.points.size();
  if (count == 0 && entity.more_points.size() >= 2) return entity.more_points;  // fit points alone
  const auto degree = static_cast<std::size_t>(std::clamp(entity.degree, 0, k_most_degree));
  const bool has_weights = entity.weights.size() == count;
  if (degree < 1 || static_cast<int>(degree) != entity.degree || count <= degree || count > k_most_spline ||
      entity.knots.size() != count + degree + 1 ||
      !std::is_sorted(entity.knots.begin(), entity.knots.end()) ||
      (has_weights && *std::min_element(entity.weights.begin(), entity.weights.end()) <= 0)) {
    pairs->refuse(
        entity.line,
        fmt::format("expected a spline with degree 1 to {}, control points and rising knots, found {} "
                    "points, {} knots and degree {}.",
                    k_most_degree, count, entity.knots.size(), entity.degree));
    return std::nullopt;
  }
  std::vector<Eigen::Vector4d> control;
  for (std::size_t i = 0; i < count; ++i) {
    const double w = has_weights ? entity.weights[i] : 1;
    control.emplace_back((Eigen::Vector4d() << w * entity.points[i], w).finished());
  }
  std::vector<Vector3d> points;
  for (std::size_t span = degree; span < count; ++span) {
    const double low = entity.knots[span], high = entity.knots[span + 1];
    if (!(high > low)) continue;
    for (int k = 0; k < k_pieces_of_span; ++k)
      points.push_back(spline_at(low + (high - low) * k / k_pieces_of_span, span, static_cast<int>(degree),
                                 entity.knots, control));
    if (span + 1 == count || entity.knots[span + 1] >= entity.knots[count])
      points.push_back(spline_at(high, span, static_cast<int>(degree), entity.knots, control));
  }
  return points;
}

// The entities of a file become curves one after the other.
class Collecting {
 public:
  explicit Collecting(Pairs* pairs) : pairs_(*pairs) {}

  void add(const Entity& entity) {
    if (entity.type == "POLYLINE") {
      constexpr int k_meshes = 16 | 64;  // a mesh of vertices; one of faces
      if ((entity.flags & k_meshes) != 0) ++left_out_["POLYLINE mesh"];
      polyline_ = (entity.flags & k_meshes) == 0 ? std::optional(entity) : std::nullopt;
      if (polyline_) polyline_->points.clear();
      return;
    }
    if (entity.type == "VERTEX") {
      constexpr int k_frame_point = 16;  // it belongs to a spline's frame, not to the curve
      if (!polyline_ || entity.points.empty() || (entity.flags & k_frame_point) != 0) return;
      polyline_->points.push_back(entity.points[0]);
      polyline_->bulges.push_back(entity.bulges.empty() ? 0 : entity.bulges[0]);
      return;
    }
    if (entity.type == "SEQEND") {
      if (polyline_) finish_polyline(*std::exchange(polyline_, std::nullopt));
      return;
    }
    add_simple(entity);
  }
  CurveList list;
  std::map<std::string, int> left_out_;

 private:
  void finish_polyline(const Entity& entity) {
    constexpr int k_closed = 1, k_is_3d = 8;
    const bool is_closed = (entity.flags & k_closed) != 0;
    if ((entity.flags & k_is_3d) != 0)
      add_curve(entity, entity.points, is_closed);
    else
      add_curve(entity, turned(with_arcs(entity.points, entity.bulges, is_closed), entity.d_up), is_closed);
  }
  void add_simple(const Entity& entity) {
    const auto radians = [](double degrees) { return degrees * std::numbers::pi / 180; };
    const bool is_circle = entity.type == "CIRCLE", is_arc = entity.type == "ARC";
    if (entity.type == "LINE" && !entity.points.empty() && !entity.more_points.empty()) {
      add_curve(entity, {entity.points[0], entity.more_points[0]}, false);
    } else if (entity.type == "LWPOLYLINE") {
      std::vector<Vector3d> corners = entity.points;
      for (Vector3d& p : corners) p.z() = entity.elevation;
      const bool is_closed = (entity.flags & 1) != 0;
      add_curve(entity, turned(with_arcs(corners, entity.bulges, is_closed), entity.d_up), is_closed);
    } else if (entity.type == "SPLINE") {
      if (const auto points = spline_points(entity, &pairs_))
        add_curve(entity, *points, (entity.flags & 1) != 0);
    } else if ((is_circle || is_arc) && !entity.points.empty()) {
      double sweep = is_circle ? 360 : std::fmod(entity.end_deg - entity.start_deg, 360.0);
      if (sweep <= 0) sweep += 360;
      std::vector<Vector3d> points;
      const double from = is_circle ? 0 : radians(entity.start_deg);
      add_arc(entity.points[0], entity.radius, from, radians(sweep), &points);
      if (is_arc)
        points.emplace_back(entity.points[0] + entity.radius * Vector3d(std::cos(from + radians(sweep)),
                                                                        std::sin(from + radians(sweep)), 0));
      add_curve(entity, turned(std::move(points), entity.d_up), is_circle);
    } else {
      ++left_out_[entity.type.substr(0, 32)];
    }
  }
  static std::vector<Vector3d> turned(std::vector<Vector3d> points, const Vector3d& d_up) {
    const Eigen::Matrix3d axes = axes_of(d_up);
    for (Vector3d& p : points) p = axes * p;
    return points;
  }
  void add_curve(const Entity& entity, std::vector<Vector3d> points, bool is_closed) {
    points_ += points.size();
    NamedCurve curve = cleaned({entity.layer, std::move(points), is_closed});
    const bool is_curve = curve.points.size() >= 2 &&
                          std::all_of(curve.points.begin(), curve.points.end(), [](const Vector3d& p) {
                            return p.allFinite() && p.cwiseAbs().maxCoeff() <= 10 * k_largest_dxf;
                          });
    if (!is_curve) {
      ++left_out_["curve of one point"];
      return;
    }
    if (curve.points.size() < 3) curve.is_closed = false;
    list.curves.push_back(std::move(curve));
    if (list.curves.size() > k_most_curves || points_ > k_most_curve_points)
      pairs_.refuse(entity.line, fmt::format("expected at most {} curves and {} points, found more.",
                                             k_most_curves, k_most_curve_points));
  }

  Pairs& pairs_;
  std::optional<Entity> polyline_;
  std::size_t points_ = 0;
};

// Metres for a unit of $INSUNITS; nullopt for one that no CAD program of this field uses. 0: not stated.
std::optional<double> metres_of_unit(int unit) {
  switch (unit) {
    case 0:
      return 1e-3;
    case 1:
      return 0.0254;
    case 2:
      return 0.3048;
    case 4:
      return 1e-3;
    case 5:
      return 1e-2;
    case 6:
      return 1.0;
    default:
      return std::nullopt;
  }
}

std::string layer_of(const std::string& name) {
  std::string layer;
  for (const char c : name) {
    const bool is_allowed = static_cast<unsigned char>(c) >= 0x20 && c != 0x7f &&
                            std::string_view("<>/\\\":;?*|=,`").find(c) == std::string_view::npos;
    layer += is_allowed ? c : '_';
  }
  return layer.empty() ? "0" : layer;
}

}  // namespace

std::string encode_dxf_curves(const std::vector<NamedCurve>& curves) {
  std::string text =
      "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n"
      "0\nSECTION\n2\nENTITIES\n";
  for (const NamedCurve& curve : curves) {
    const std::string layer = layer_of(curve.name);
    text += fmt::format("0\nPOLYLINE\n8\n{}\n66\n1\n70\n{}\n10\n0\n20\n0\n30\n0\n", layer,
                        curve.is_closed ? 9 : 8);
    for (const Vector3d& p : curve.points)
      text += fmt::format("0\nVERTEX\n8\n{}\n10\n{:.4f}\n20\n{:.4f}\n30\n{:.4f}\n70\n32\n", layer,
                          1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z());
    text += fmt::format("0\nSEQEND\n8\n{}\n", layer);
  }
  return text + "0\nENDSEC\n0\nEOF\n";
}

Result<CurveList> decode_dxf_curves(const std::string& text, const std::string& where) {
  if (text.starts_with("AutoCAD Binary DXF"))
    return error("{}: expected an ASCII DXF file, found a binary one. Save it as ASCII DXF.", where);
  Pairs pairs(text, where);
  Collecting collecting(&pairs);
  Entity entity;
  std::string section;
  std::string_view variable;
  int unit = 0;
  bool is_section_named = true, has_section = false;
  while (const auto pair = pairs.next()) {
    if (pair->code == 0) {
      if (section == "ENTITIES" && !entity.type.empty()) collecting.add(entity);
      entity = Entity();
      entity.type = std::string(pair->value);
      entity.line = pair->line;
      is_section_named = pair->value != "SECTION";
      if (pair->value == "ENDSEC") section.clear();
      if (pair->value == "SECTION" || pair->value == "ENDSEC" || pair->value == "EOF") entity.type.clear();
      if (pair->value == "EOF") break;
    } else if (pair->code == 2 && !is_section_named) {
      section = std::string(pair->value);
      is_section_named = has_section = true;
    } else if (section == "HEADER") {
      if (pair->code == 9) variable = pair->value;
      if (pair->code == 70 && variable == "$INSUNITS")
        unit = static_cast<int>(std::clamp(pairs.number(*pair), -1e6, 1e6));
    } else if (section == "ENTITIES" && !entity.type.empty()) {
      read_pair(*pair, &pairs, &entity);
      if (entity.points.size() + entity.knots.size() > 3 * k_most_curve_points)
        pairs.refuse(pair->line, fmt::format("expected at most {} points, found more.", k_most_curve_points));
    }
  }
  LIMN_TRY_STATUS(pairs.status());
  if (!has_section) return error("{}: expected an ASCII DXF file, found another text.", where);
  const auto metres = metres_of_unit(unit);
  if (!metres)
    return error("{}: expected inches, feet, mm, cm or m ($INSUNITS 1, 2, 4, 5, 6), found {}. Save it in mm.",
                 where, unit);
  CurveList list = std::move(collecting.list);
  if (unit == 0)
    list.warnings.push_back(
        fmt::format("{}: it states no unit ($INSUNITS); it is read as millimetres.", where));
  for (const auto& [type, count] : collecting.left_out_)
    list.warnings.push_back(
        fmt::format("{}: {} {} left out: it is no curve that is read.", where, count, type));
  if (list.curves.empty()) return error("{}: expected curves in its ENTITIES, found none.", where);
  for (NamedCurve& curve : list.curves) {
    for (Vector3d& p : curve.points) p *= *metres;
    curve = cleaned(std::move(curve));
  }
  std::erase_if(list.curves, [](const NamedCurve& curve) { return curve.points.size() < 2; });
  if (list.curves.empty()) return error("{}: expected curves of several points, found none.", where);
  return list;
}

}  // namespace limn::exchange
