#include "scene/lines/line.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "scene/lines/stroke_font.h"

namespace limn::scene {
namespace {

constexpr double k_mm = 1e-3;
constexpr double k_widest_mm = 20, k_thinnest_mm = 0.05;
constexpr double k_least_spacing_mm = 0.5, k_largest_mm = 20000;  // as the largest prototype
constexpr double k_least_height_mm = 1, k_largest_height_mm = 500;
constexpr std::size_t k_longest_text = 200;
constexpr std::size_t k_most_points_written = 4000;  // in one curve of scene.json

double read_mm(const ConfigNode& node, double least, double most) {
  const double mm = node.number();
  if (mm >= least && mm <= most) return k_mm * mm;
  node.problem(fmt::format("expected {} to {} mm, found {}.", least, most, mm));
  return k_mm * least;
}

LineStyle read_style(const ConfigNode& node) {
  LineStyle style;
  if (const auto colour = node.find("colour")) {
    style.colour = colour->vector3();
    if (style.colour.minCoeff() < 0 || style.colour.maxCoeff() > 1)
      colour->problem("expected linear light from 0 to 1 in red, green and blue.");
  }
  if (const auto width = node.find("width_mm")) style.width_m = read_mm(*width, k_thinnest_mm, k_widest_mm);
  return style;
}

std::string read_line_name(const ConfigNode& node) {
  const std::string name = node.text();
  if (!is_line_name(name))
    node.problem(fmt::format("expected a name of 1 to {} bytes, found '{}'.", k_longest_line_name, name));
  return name;
}

Eigen::Vector3d read_point(const ConfigNode& node) {
  const std::vector<double> mm = node.numbers(3);
  if (mm.size() != 3) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d p(mm[0], mm[1], mm[2]);
  if (p.cwiseAbs().maxCoeff() > k_largest_mm)
    node.problem(fmt::format("expected millimetres of at most {}, found more.", k_largest_mm));
  return k_mm * p;
}

// Axes in the order axis, next, next but one, so that the lines' frame is right-handed.
RepeatedLines read_sections(const ConfigNode& node) {
  node.only({"axis", "every_mm", "offset_mm"});
  const std::string axis = node.at("axis").choice({"x", "y", "z"});
  RepeatedLines lines;
  lines.spacing_m = read_mm(node.at("every_mm"), k_least_spacing_mm, k_largest_mm);
  const int first = axis == "y" ? 1 : axis == "z" ? 2 : 0;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) axes((first + k) % 3, k) = 1;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  if (const auto at = node.find("offset_mm")) offset[first] = read_mm(*at, -k_largest_mm, k_largest_mm);
  lines.prototype_from_lines = Pose(Eigen::Quaterniond(axes), offset);
  return lines;
}

RepeatedLines read_pattern(const ConfigNode& node) {
  node.only({"form", "spacing_mm", "size_mm", "prototype_from_pattern"});
  RepeatedLines lines;
  const std::string form = node.at("form").choice({"stripes", "grid", "dots"});
  lines.form = form == "grid"   ? RepeatedLines::Form::grid
               : form == "dots" ? RepeatedLines::Form::dots
                                : RepeatedLines::Form::stripes;
  lines.spacing_m = read_mm(node.at("spacing_mm"), k_least_spacing_mm, k_largest_mm);
  if (const auto pose = node.find("prototype_from_pattern")) lines.prototype_from_lines = pose->pose();
  if (const auto size = node.find("size_mm")) {
    const auto sides = size->items();
    if (sides.size() == 2)
      lines.half_size_m =
          k_mm / 2 * Eigen::Vector2d(sides[0].positive(k_largest_mm), sides[1].positive(k_largest_mm));
    else
      size->problem(fmt::format("expected width and height in mm, found {} numbers.", sides.size()));
  }
  return lines;
}

void read_curve(const ConfigNode& node, Line* line) {
  node.only({"points_mm", "closed", "file"});
  if (const auto file = node.find("file")) {
    line->file = file->path_inside();
    if (node.find("points_mm")) node.problem("expected points_mm or a file, found both. Remove one.");
    return;
  }
  exchange::NamedCurve curve;
  const auto points = node.at("points_mm").items();
  if (const auto closed = node.find("closed")) curve.is_closed = closed->boolean();
  const std::size_t least = curve.is_closed ? 3 : 2;
  if (points.size() < least || points.size() > k_most_points_written)
    node.at("points_mm")
        .problem(
            fmt::format("expected {} to {} points, found {}.", least, k_most_points_written, points.size()));
  else
    for (const ConfigNode& point : points) curve.points.push_back(read_point(point));
  line->to_lay.push_back(std::move(curve));
}

double read_height(const ConfigNode& node) {
  const auto height = node.find("height_mm");
  return height ? read_mm(*height, k_least_height_mm, k_largest_height_mm) : LineText().height_m;
}

std::optional<Eigen::Vector3d> read_reader(const ConfigNode& node) {
  const auto reader = node.find("read_from_mm");
  return reader ? std::optional(read_point(*reader)) : std::nullopt;
}

LineText read_text(const ConfigNode& node) {
  node.only({"text", "at_mm", "direction", "height_mm", "read_from_mm"});
  LineText text;
  text.text = node.at("text").text();
  std::string unknown;
  const bool is_empty = stroke_text(text.text, &unknown).strokes.empty();
  if (text.text.size() > k_longest_text || is_empty || !unknown.empty())
    node.at("text").problem(
        fmt::format("expected letters, digits and usual signs, at most {} bytes, found '{}'.", k_longest_text,
                    unknown.empty() ? text.text.substr(0, k_longest_text) : unknown));
  text.p_at = read_point(node.at("at_mm"));
  if (const auto direction = node.find("direction")) {
    text.d_along = direction->vector3();
    if (text.d_along.norm() < 1e-6) direction->problem("expected a direction, found zero.");
  }
  text.height_m = read_height(node);
  text.p_reader = read_reader(node);
  return text;
}

LineDimension read_dimension(const ConfigNode& node) {
  node.only({"from_mm", "to_mm", "height_mm", "read_from_mm"});
  return {read_point(node.at("from_mm")), read_point(node.at("to_mm")), read_height(node), read_reader(node)};
}

}  // namespace

bool is_line_name(const std::string& name) {
  return !name.empty() && name.size() <= k_longest_line_name &&
         std::none_of(name.begin(), name.end(),
                      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

Line read_line(const ConfigNode& node) {
  node.only({"name", "colour", "width_mm", "shown", "sections", "curve", "pattern", "text", "dimension",
             "outline"});
  Line line;
  line.name = read_line_name(node.at("name"));
  line.style = read_style(node);
  if (const auto shown = node.find("shown")) line.is_shown = shown->boolean();
  const auto sections = node.find("sections"), curve = node.find("curve"), pattern = node.find("pattern"),
             text = node.find("text"), dimension = node.find("dimension"), outline = node.find("outline");
  int kinds = 0;
  for (const auto* kind : {&sections, &curve, &pattern, &text, &dimension, &outline})
    kinds += kind->has_value();
  if (kinds != 1)
    node.problem(
        fmt::format("expected one of sections, curve, pattern, text, dimension and outline, found {}.",
                    kinds == 0 ? "none" : "several"));
  if (text) line.text = read_text(*text);
  if (dimension) line.dimension = read_dimension(*dimension);
  if (outline) {
    outline->only({"slot"});
    line.outline_of = outline->at("slot").text();
  }
  if (sections) line.repeated = read_sections(*sections);
  if (pattern) line.repeated = read_pattern(*pattern);
  if (curve) read_curve(*curve, &line);
  return line;
}

DrawnLine read_drawn_line(const ConfigNode& node) {
  node.only({"name", "colour", "width_mm", "closed", "points_mm", "normals"});
  DrawnLine line;
  line.name = read_line_name(node.at("name"));
  line.style = read_style(node);
  line.curve.is_closed = node.at("closed").boolean();
  const auto points = node.at("points_mm").items(), normals = node.at("normals").items();
  if (points.size() < 2 || points.size() > k_most_points_drawn || points.size() != normals.size()) {
    node.at("points_mm")
        .problem(fmt::format("expected 2 to {} points and a normal for each, found {} and {}.",
                             k_most_points_drawn, points.size(), normals.size()));
    return line;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d n = normals[i].vector3();
    line.curve.points.push_back(
        {read_point(points[i]), n.norm() > 0.5 ? Eigen::Vector3d(n.normalized()) : Eigen::Vector3d::Zero()});
  }
  return line;
}

nlohmann::ordered_json to_json(const DrawnLine& line) {
  const auto rounded = [](const Eigen::Vector3d& v, double step) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (int k = 0; k < 3; ++k) out.push_back(std::round(v[k] / step) * step);
    return out;
  };
  nlohmann::ordered_json points = nlohmann::ordered_json::array(), normals = nlohmann::ordered_json::array();
  for (const SurfacePoint& point : line.curve.points) {
    points.push_back(rounded(point.p / k_mm, 1e-3));
    normals.push_back(rounded(point.d_normal, 1e-3));
  }
  const Eigen::Vector3d& rgb = line.style.colour;
  return {{"name", line.name},
          {"colour", {rgb.x(), rgb.y(), rgb.z()}},
          {"width_mm", line.style.width_m / k_mm},
          {"closed", line.curve.is_closed},
          {"points_mm", points},
          {"normals", normals}};
}

}  // namespace limn::scene
