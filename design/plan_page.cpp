#include "design/plan_page.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/judge/assess.h"
#include "core/html.h"
#include "design/design_report.h"

namespace limn::apps {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_margin_m = 0.35, k_tick_m = 0.5;
constexpr double k_view_px = 620;  // longer side of a drawing

constexpr const char* k_plan_style = R"(
:root { color-scheme: light dark; --ground: #fbfaf8; --text: #1d1f23; --faint: #6b6862; --line: #dddad3;
        --camera: #1f66b1; --projector: #b36b00; --good: #17683c; --doubt: #8a5a00; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ground: #14161a; --text: #e8e6e1; --faint: #a9a69f; --line: #2b2f36;
        --camera: #7db2f0; --projector: #f5b642; --good: #7fd1a0; --doubt: #f5b642; --bad: #ff9a7a; } }
body { margin: 0 auto; max-width: 1320px; padding: 2rem 1.5rem 4rem; background: var(--ground); color: var(--text);
       font: 16px/1.5 system-ui, sans-serif; }
h1 { font-weight: 600; margin: 0 0 .3rem; } .lead { color: var(--faint); margin: 0 0 1.5rem; max-width: 50rem; }
.views { display: flex; flex-wrap: wrap; gap: 1.5rem; } figure { margin: 0; } figcaption { color: var(--faint); }
svg { max-width: 100%; height: auto; font: 13px system-ui, sans-serif; } svg text { fill: var(--text); }
.volume { fill: var(--line); stroke: var(--faint); } .tick { stroke: var(--line); }
.camera { stroke: var(--camera); fill: var(--camera); } .projector { stroke: var(--projector); fill: var(--projector); }
.reach { fill-opacity: .12; } .name { stroke: none; }
.light { font-size: 1.25rem; margin: .2rem 0; } .good { color: var(--good); } .doubt { color: var(--doubt); }
.bad { color: var(--bad); } pre { overflow-x: auto; padding: 1rem; border: 1px solid var(--line); border-radius: 4px; }
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

std::string imager_svg(const Imager& imager,
                       const char* kind,
                       const DescribedRig& described,
                       const Sheet& sheet) {
  const Vector3d p_eye = imager.imager_from_world.inverse().translation;
  std::vector<Vector2d> points = {sheet.at(p_eye)};
  for (const Vector3d& corner : reach_of(imager, described)) points.push_back(sheet.at(corner));
  std::string polygon;
  for (const Vector2d& p : hull(points)) polygon += fmt::format("{:.1f},{:.1f} ", p.x(), p.y());
  const Vector2d at = points.front();
  return fmt::format(
      "<polygon class=\"{} reach\" points=\"{}\"/><circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"6\"/>"
      "<text class=\"name\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
      kind, polygon, kind, at.x(), at.y(), at.x() + 10, at.y() + 5, escaped(imager.name));
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
  std::string svg = fmt::format("<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\">",
                                size.x(), size.y());
  for (double x = std::ceil(sheet.low.x() / k_tick_m) * k_tick_m; x < sheet.high.x(); x += k_tick_m) {
    const double px = (x - sheet.low.x()) * sheet.px_per_m;
    svg += fmt::format("<line class=\"tick\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"0\" y2=\"{1:.0f}\"/>", px,
                       size.y());
  }
  for (double y = std::ceil(sheet.low.y() / k_tick_m) * k_tick_m; y < sheet.high.y(); y += k_tick_m) {
    const double px = (sheet.high.y() - y) * sheet.px_per_m;
    svg += fmt::format("<line class=\"tick\" y1=\"{0:.1f}\" y2=\"{0:.1f}\" x1=\"0\" x2=\"{1:.0f}\"/>", px,
                       size.x());
  }
  const Vector2d a = sheet.at(described.p_centre - described.size_m / 2),
                 b = sheet.at(described.p_centre + described.size_m / 2);
  svg += fmt::format("<rect class=\"volume\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>",
                     std::min(a.x(), b.x()), std::min(a.y(), b.y()), std::abs(b.x() - a.x()),
                     std::abs(b.y() - a.y()));
  for (const Imager& imager : described.rig.projectors)
    svg += imager_svg(imager, "projector", described, sheet);
  for (const Imager& imager : described.rig.cameras) svg += imager_svg(imager, "camera", described, sheet);
  return fmt::format("<figure>{}</svg><figcaption>{}; a square is {:g} m</figcaption></figure>\n", svg,
                     view.caption, k_tick_m);
}

}  // namespace

std::string plan_page(const DescribedRig& described, const PredictedAccuracy& predicted_accuracy) {
  std::string html = fmt::format(
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>The rig as planned</title><style>{}</style><h1>The rig as "
      "planned</h1>\n"
      "<p class=\"lead\">Predicted by simulating its calibration with the noise of real images. Room light, "
      "defocus and a bent board are not included.</p>\n",
      k_plan_style);
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
  return html + fmt::format("</div>\n<pre>{}</pre>\n</html>\n",
                            escaped(design_table(predicted_accuracy, described)));
}

}  // namespace limn::apps
