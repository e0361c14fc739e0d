#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/pose.h"
#include "core/result.h"
#include "exchange/curves/named_curve.h"

namespace limn::scene {

/// How a line looks.
struct LineStyle {
  Eigen::Vector3d colour = Eigen::Vector3d::Ones();  ///< Linear light, 0 … 1, red, green, blue.
  double width_m = 0.7e-3;                           ///< On the surface.
  bool operator==(const LineStyle&) const = default;
};

/// Lines at equal distances in the plane z = 0 of their own frame. They are projected on the prototype along
/// that frame's z axis, through its whole depth.
struct RepeatedLines {
  enum class Form {
    stripes,  ///< Along y, at x = 0, one spacing, two spacings and so on, to both sides.
    grid,     ///< Stripes along y and along x.
    dots      ///< Discs where a grid's stripes cross; the style's width is their diameter.
  };
  Form form = Form::stripes;
  double spacing_m = 0.01;
  Pose prototype_from_lines;
  /// Half the width and height of the area that they cover, around the frame's origin.
  Eigen::Vector2d half_size_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
};

/// A point on the prototype's surface, in the prototype's frame (m).
struct SurfacePoint {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  /// Unit normal of the mesh's triangle there, as it winds. Zero where the mesh winds inconsistently, so that
  /// its sides cannot be distinguished.
  Eigen::Vector3d d_normal = Eigen::Vector3d::Zero();
  bool operator==(const SurfacePoint&) const = default;
};

/// Pieces of straight lines between points of the surface, which follow it to within 0.1 mm.
struct SurfaceCurve {
  std::vector<SurfacePoint> points;
  bool is_closed = false;  ///< The last point is joined to the first, which is not repeated.
  bool operator==(const SurfaceCurve&) const = default;
};

/// A text on the surface, which begins at a point.
struct LineText {
  std::string text;
  Eigen::Vector3d p_at = Eigen::Vector3d::Zero();
  Eigen::Vector3d d_along =
      Eigen::Vector3d::UnitX();  ///< The way it runs; its part along the surface counts.
  double height_m = 0.008;       ///< The height of its capitals.
  /// From where it is read; absent: from where the mesh's normals point.
  std::optional<Eigen::Vector3d> p_reader = {};
};

/// The straight distance between two points of the surface, with its number in millimetres.
struct LineDimension {
  Eigen::Vector3d p_from = Eigen::Vector3d::Zero(), p_to = Eigen::Vector3d::Zero();
  double height_m = 0.008;  ///< The height of the number.
  std::optional<Eigen::Vector3d> p_reader = {};
};

/// A line of the scene: an entry of `lines` of scene.json. `repeated`, `curves` or `outline_of` says
/// where it runs.
struct Line {
  std::string name;
  LineStyle style;
  bool is_shown = true;  ///< Whether a session shows it at first.
  std::optional<RepeatedLines> repeated;
  std::vector<SurfaceCurve> curves;
  // What `curves` are made from by lay_lines().
  std::vector<exchange::NamedCurve> to_lay = {};
  std::filesystem::path file = {};  ///< A file of curves; empty: none.
  std::optional<LineText> text = {};
  std::optional<LineDimension> dimension = {};
  /// The slot whose part's outline it is (scene/lines/outline.h); empty: none.
  std::string outline_of = {};
};

/// Where a stroke runs, in the prototype's frame.
struct Stroke {
  /// Points near the surface (m); or with `p_camera` unit directions of rays from there, which meet the
  /// surface.
  std::vector<Eigen::Vector3d> points;
  std::optional<Eigen::Vector3d> p_camera;
};
constexpr std::size_t k_most_stroke_points = 400;  ///< In one request.

/// A line that was drawn in a session.
struct DrawnLine {
  std::string name;
  LineStyle style;
  SurfaceCurve curve;
  bool operator==(const DrawnLine&) const = default;
};

constexpr std::size_t k_most_lines = 256;           ///< In a scene; likewise drawn ones in a session.
constexpr std::size_t k_most_points_drawn = 4000;   ///< Points of all lines that were drawn in a session.
constexpr std::size_t k_most_points_shown = 20000;  ///< The same with outlines of parts.
constexpr std::size_t k_most_points_laid = 20000;   ///< Points of one curve on the surface.
constexpr std::size_t k_longest_line_name = 64;

/// Whether a line may have this name: 1 to 64 bytes without control characters.
bool is_line_name(const std::string& name);

/// Reads an entry of `lines` of a scene (config/README.md). Curves are not laid on the surface yet, and a
/// file is not read. Problems are recorded at the node.
Line read_line(const ConfigNode& node);

/// A drawn line of a look, with its points on the surface.
DrawnLine read_drawn_line(const ConfigNode& node);
/// As read_drawn_line() reads it.
nlohmann::ordered_json to_json(const DrawnLine& line);

}  // namespace limn::scene
