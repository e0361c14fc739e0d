#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace limn::scene {

/// A text as strokes: polylines with x right and y up, whose capitals are 1 high and stand on y = 0.
struct StrokeText {
  std::vector<std::vector<Eigen::Vector2d>> strokes;
  double width = 0;
};

/// Capitals, digits and . , : - + / = ( ) % _ ' " ! ? and °, Ø, ±; small letters become capitals. Blanks have
/// no strokes, nor have other characters, which `unknown` then lists.
StrokeText stroke_text(const std::string& text, std::string* unknown = nullptr);

}  // namespace limn::scene
