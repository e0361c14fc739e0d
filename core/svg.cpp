#include "core/svg.h"

#include <fmt/format.h>

#include "core/html.h"

namespace limn {
namespace {

using Eigen::Vector2d;

std::string listed(std::span<const Vector2d> points) {
  std::string text;
  for (const Vector2d& p : points)
    text += fmt::format("{}{:.1f},{:.1f}", text.empty() ? "" : " ", p.x(), p.y());
  return text;
}

}  // namespace

Svg::Svg(const Vector2d& low, const Vector2d& size, const std::string& attributes)
    : content_(fmt::format("<svg viewBox='{:g} {:g} {:g} {:g}' role='img' {}>",
                           low.x(),
                           low.y(),
                           size.x(),
                           size.y(),
                           attributes)) {}

void Svg::rect(const Vector2d& low,
               const Vector2d& size,
               const std::string& attributes,
               const std::string& title) {
  content_ += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' {}", low.x(), low.y(),
                          size.x(), size.y(), attributes);
  content_ += title.empty() ? "/>" : fmt::format("><title>{}</title></rect>", escaped(title));
}

void Svg::circle(const Vector2d& centre, double radius, const std::string& attributes) {
  content_ += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='{:.1f}' {}/>", centre.x(), centre.y(), radius,
                          attributes);
}

void Svg::line(const Vector2d& from, const Vector2d& to, const std::string& attributes) {
  content_ += fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' {}/>", from.x(), from.y(),
                          to.x(), to.y(), attributes);
}

void Svg::polyline(std::span<const Vector2d> points, const std::string& attributes) {
  content_ += fmt::format("<polyline points='{}' {}/>", listed(points), attributes);
}

void Svg::polygon(std::span<const Vector2d> points, const std::string& attributes) {
  content_ += fmt::format("<polygon points='{}' {}/>", listed(points), attributes);
}

void Svg::text(const Vector2d& at, const std::string& text, const std::string& attributes) {
  content_ +=
      fmt::format("<text x='{:.1f}' y='{:.1f}' {}>{}</text>", at.x(), at.y(), attributes, escaped(text));
}

void Svg::begin_group(const std::string& attributes) { content_ += fmt::format("<g {}>", attributes); }

void Svg::end_group() { content_ += "</g>"; }

}  // namespace limn
