#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

namespace limn {

/// One SVG drawing for an HTML page, built shape by shape: later shapes lie on top. Coordinates are in the
/// drawing's own units, x to the right and y down, written with one decimal. `attributes` are inserted into a
/// shape's tag as they are ("fill='#fff' stroke-width='2'"); texts are escaped.
class Svg {
 public:
  /// The drawing shows the rectangle from `low` to `low + size`.
  Svg(const Eigen::Vector2d& low, const Eigen::Vector2d& size, const std::string& attributes = "");

  /// `title`, where it is not empty, appears while the pointer rests on the rectangle.
  void rect(const Eigen::Vector2d& low,
            const Eigen::Vector2d& size,
            const std::string& attributes,
            const std::string& title = "");
  void circle(const Eigen::Vector2d& centre, double radius, const std::string& attributes);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const std::string& attributes);
  void polyline(std::span<const Eigen::Vector2d> points, const std::string& attributes);
  void polygon(std::span<const Eigen::Vector2d> points, const std::string& attributes);
  void text(const Eigen::Vector2d& at, const std::string& text, const std::string& attributes);

  /// Shapes from here to end_group() have these attributes, too.
  void begin_group(const std::string& attributes);
  void end_group();

  /// The whole <svg> element.
  std::string element() const { return content_ + "</svg>"; }

 private:
  std::string content_;
};

}  // namespace limn
