#include "wizard/design/plan_page.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/judge/assess.h"
#include "core/html.h"
#include "core/svg.h"
#include "wizard/design/design_report.h"

namespace limn::design {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_margin_m = 0.35, k_tick_m = 0.5;
constexpr double k_view_px = 620;  // longer side of a drawing

constexpr const char* k_plan_style = R"(
:root { --camera: #1f66b1; --projector: #b36b00; }
@media (prefers-color-scheme: dark) { :root { --camera: #7db2f0; --projector: #f5b642; } }
.views { display: flex; flex-wrap: wrap; gap: 1.5rem; }
svg { max-width: 100%; height: auto; font: 13px system-ui, sans-serif; } svg text { fill: var(--text); }
.volume { fill: var(--line); stroke: var(--faint); } .tick { stroke: var(--line); }
.camera { stroke: var(--camera); fill: var(--camera); } .projector { stroke: var(--projector); fill: var(--projector); }
.reach { fill-opacity: .12; } svg .name { stroke: none; }
.light { font-size: 1.25rem; margin: .2rem 0; }
pre { overflow-x: auto; padding: 1rem; border: 1px solid var(--line); border-radius: 4px; }
)";

// A drawing's caption, and the world axes that point right and up in it.
struct View {
  const char* caption;
  int right, up;
};

// Maps world coordinates (m) to a drawing's pixels.
struct Sheet {
  View view;
  Vector2d low, high;
  double px_per_m = 1;

  Vector2d at(const Vector3d& p) const {
    return {(p[view.right] - low.x()) * px_per_m, (high.y() - p[view.up]) * px_per_m};
  }
  Vector2d size() const { return (high - low) * px_per_m; }
};

// Points on the rays of an imager's corners, at the depth of the volume's far end.
std::vector<Vector3d> reach_of(const Imager& imager, const DescribedRig& described) {
  const Pose world_from_imager = imager.imager_from_world.inverse();
  const double far_m =
      (described.p_centre - world_from_imager.translation).norm() + 0.5 * described.size_m.norm();
  std::vector<Vector3d> corners;
  for (const Vector2d& px : {Vector2d(0, 0), Vector2d(imager.width - 1, 0),
                             Vector2d(imager.width - 1, imager.height - 1), Vector2d(0, imager.height - 1)})
    if (const auto d = imager.lens.unproject(px))
      corners.push_back(world_from_imager * Vector3d(*d * (far_m / d->z())));
  return corners;
}

// The convex hull of points in a drawing (Andrew 1979, monotone chain).
std::vector<Vector2d> hull(std::vector<Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  const auto turns = [](const Vector2d& a, const Vector2d& b, const Vector2d& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
  };
  std::vector<Vector2d> out;
  for (int side = 0; side < 2; ++side) {
    const std::size_t begun = out.size();
    for (const Vector2d& p : points) {
      while (out.size() >= begun + 2 && turns(out[out.size() - 2], out.back(), p) <= 0) out.pop_back();
      out.push_back(p);
    }
    out.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return out;
}

void add_imager(const Imager& imager,
                const std::string& kind,
                const DescribedRig& described,
                const Sheet& sheet,
                Svg* svg) {
  const Vector2d at = sheet.at(imager.imager_from_world.inverse().translation);
  std::vector<Vector2d> points = {at};
  for (const Vector3d& corner : reach_of(imager, described)) points.push_back(sheet.at(corner));
  svg->polygon(hull(points), fmt::format("class='{} reach'", kind));
  svg->circle(at, 6, fmt::format("class='{}'", kind));
  svg->text(at + Vector2d(10, 5), imager.name, "class='name'");
}

std::string view_svg(const View& view, const DescribedRig& described) {
  Eigen::AlignedBox3d box(described.p_centre - described.size_m / 2,
                          described.p_centre + described.size_m / 2);
  for (const auto* imagers : {&described.rig.cameras, &described.rig.projectors})
    for (const Imager& imager : *imagers) box.extend(imager.imager_from_world.inverse().translation);
  const Vector2d margin = Vector2d::Constant(k_margin_m);
  Sheet sheet{view, Vector2d(box.min()[view.right], box.min()[view.up]) - margin,
              Vector2d(box.max()[view.right], box.max()[view.up]) + margin};
  sheet.px_per_m = k_view_px / (sheet.high - sheet.low).maxCoeff();
  const Vector2d size = sheet.size();
  Svg svg({0, 0}, size, fmt::format("width='{:.0f}' height='{:.0f}'", size.x(), size.y()));
  for (double x = std::ceil(sheet.low.x() / k_tick_m) * k_tick_m; x < sheet.high.x(); x += k_tick_m) {
    const double px = (x - sheet.low.x()) * sheet.px_per_m;
    svg.line({px, 0}, {px, size.y()}, "class='tick'");
  }
  for (double y = std::ceil(sheet.low.y() / k_tick_m) * k_tick_m; y < sheet.high.y(); y += k_tick_m) {
    const double px = (sheet.high.y() - y) * sheet.px_per_m;
    svg.line({0, px}, {size.x(), px}, "class='tick'");
  }
  const Vector2d a = sheet.at(described.p_centre - described.size_m / 2),
                 b = sheet.at(described.p_centre + described.size_m / 2);
  svg.rect(a.cwiseMin(b), (b - a).cwiseAbs(), "class='volume'");
  for (const Imager& imager : described.rig.projectors)
    add_imager(imager, "projector", described, sheet, &svg);
  for (const Imager& imager : described.rig.cameras) add_imager(imager, "camera", described, sheet, &svg);
  return html_figure(svg.element(), view.caption, fmt::format("(a square is {:g} m)", k_tick_m));
}

}  // namespace

std::string plan_page(const DescribedRig& described, const PredictedAccuracy& predicted_accuracy) {
  std::string html =
      "<h1>Rig design</h1>\n<p class=\"lead\">The accuracy is predicted by a simulated calibration with the "
      "noise of real images. Room light, defocus and a bending board are not simulated.</p>\n";
  for (std::size_t i = 0; i < predicted_accuracy.error_mm.size(); ++i) {
    const double mm = predicted_accuracy.error_mm[i];
    const char* worth = mm <= calib::k_good_mm ? "good" : mm <= calib::k_usable_mm ? "doubt" : "bad";
    html +=
        fmt::format("<p class=\"light\">{}: light lands within <b class=\"{}\">{:.2f} mm</b> (95 %)</p>\n",
                    escaped(described.rig.projectors[i].name), worth, mm);
  }
  for (const std::string& sentence : predicted_accuracy.advice)
    html += fmt::format("<p class=\"doubt\">{}</p>\n", escaped(sentence));
  html += "<div class=\"views\">\n";
  for (const View& view : {View{"from above", 0, 1}, View{"from the side", 1, 2}})
    html += view_svg(view, described);
  html += fmt::format("</div>\n<pre>{}</pre>\n", escaped(design_table(predicted_accuracy, described)));
  return html_page("Limn: rig design", HtmlColours::of_system, k_plan_style, html);
}

}  // namespace limn::design
