#include "exchange/cad/read_curves.h"

#include <algorithm>
#include <opencascade/BRepAdaptor_Curve.hxx>
#include <opencascade/BRepTools_WireExplorer.hxx>
#include <opencascade/BRep_Tool.hxx>
#include <opencascade/Precision.hxx>
#include <opencascade/TColStd_Array1OfReal.hxx>
#include <opencascade/TopExp.hxx>
#include <opencascade/TopExp_Explorer.hxx>
#include <opencascade/TopTools_IndexedMapOfShape.hxx>
#include <opencascade/TopTools_MapOfShape.hxx>
#include <opencascade/TopoDS.hxx>
#include <opencascade/TopoDS_Edge.hxx>
#include <opencascade/TopoDS_Iterator.hxx>
#include <opencascade/TopoDS_Wire.hxx>
#include <opencascade/XCAFDoc_ShapeTool.hxx>
#include <set>

#include "core/utf8.h"
#include "exchange/cad/leaves.h"
#include "exchange/cad/occt_document.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;
using exchange::NamedCurve;

constexpr std::size_t k_most_points = 5'000'000;
constexpr double k_metres = 1e-3, k_same_mm = 1e-7;
constexpr double k_read_percent = 60;

Eigen::Vector3d vector_of(const gp_Pnt& p) { return {p.X(), p.Y(), p.Z()}; }

double distance_from_line(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a;
  const double square = along.squaredNorm();
  const double share = square > 0 ? std::clamp((p - a).dot(along) / square, 0.0, 1.0) : 0;
  return (p - a - share * along).norm();
}

// Points of an edge, mm, of which the line differs from it by at most the chord error.
class Sampler {
 public:
  Sampler(const BRepAdaptor_Curve& curve, double chord_mm) : curve_(curve), chord_mm_(chord_mm) {}

  std::vector<Eigen::Vector3d> points() {
    const int pieces = curve_.NbIntervals(GeomAbs_C1);  // a corner is a point
    TColStd_Array1OfReal ends(1, pieces + 1);
    curve_.Intervals(ends, GeomAbs_C1);
    points_.push_back(at(ends(1)));
    for (int i = 1; i <= pieces; ++i) add_piece(ends(i), ends(i + 1));
    return std::move(points_);
  }

 private:
  Eigen::Vector3d at(double t) const { return vector_of(curve_.Value(t)); }

  void add_piece(double from, double to) {
    // An S of a spline may cross its chord in the middle, so that it is first cut.
    const int first = curve_.GetType() == GeomAbs_Line || is_straight() ? 1 : 8;
    for (int i = 0; i < first; ++i) {
      const double a = from + (to - from) * i / first, b = from + (to - from) * (i + 1) / first;
      add(a, at(a), b, at(b), 0);
    }
  }

  bool is_straight() const { return curve_.GetType() == GeomAbs_BSplineCurve && curve_.Degree() == 1; }

  void add(double a, const Eigen::Vector3d& p_a, double b, const Eigen::Vector3d& p_b, int depth) {
    constexpr int k_deepest = 20;
    const double middle = (a + b) / 2;
    const Eigen::Vector3d p = at(middle);
    double worst = distance_from_line(p, p_a, p_b);
    for (const double share : {0.25, 0.75})
      worst = std::max(worst, distance_from_line(at(a + share * (b - a)), p_a, p_b));
    // Between the points that are measured a curve is at most a little farther.
    if (worst <= 0.9 * chord_mm_ || depth == k_deepest || points_.size() > k_most_points) {
      points_.push_back(p_b);
      return;
    }
    add(a, p_a, middle, p, depth + 1);
    add(middle, p, b, p_b, depth + 1);
  }

  const BRepAdaptor_Curve& curve_;
  const double chord_mm_;
  std::vector<Eigen::Vector3d> points_;
};

std::vector<Eigen::Vector3d> points_of(const TopoDS_Edge& edge, double chord_mm) {
  if (BRep_Tool::Degenerated(edge)) return {};
  const BRepAdaptor_Curve curve(edge);
  if (Precision::IsInfinite(curve.FirstParameter()) || Precision::IsInfinite(curve.LastParameter()))
    return {};
  std::vector<Eigen::Vector3d> points = Sampler(curve, chord_mm).points();
  if (edge.Orientation() == TopAbs_REVERSED) std::reverse(points.begin(), points.end());
  return points;
}

using Points = std::vector<Eigen::Vector3d>;

// Lines joined to chains where their ends meet.
std::vector<Points> chains_of(std::vector<Points> lines) {
  constexpr double k_meet_mm = 1e-4;
  constexpr std::size_t k_most = 5000;  // more stay apart: each is compared with each
  if (lines.size() > k_most) return lines;
  const auto meet = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - b).norm() <= k_meet_mm;
  };
  std::vector<Points> chains;
  while (!lines.empty()) {
    Points chain = std::move(lines.front());
    lines.erase(lines.begin());
    for (std::size_t i = 0; i < lines.size();) {
      Points& next = lines[i];
      if (meet(chain.front(), next.front()) || meet(chain.back(), next.back()))
        std::reverse(next.begin(), next.end());
      if (meet(chain.back(), next.front())) {
        chain.insert(chain.end(), next.begin(), next.end());
      } else if (meet(chain.front(), next.back())) {
        chain.insert(chain.begin(), next.begin(), next.end());
      } else {
        ++i;
        continue;
      }
      lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(i));
      i = 0;
    }
    chains.push_back(std::move(chain));
  }
  return chains;
}

// The curves of a file, as they are collected.
class Curves {
 public:
  explicit Curves(const CurveSampling& how) : how_(how) {}

  void add_shape(const TopoDS_Shape& shape,
                 const gp_Trsf& placed,
                 const std::string& product,
                 const ShapeNames& names) {
    for (TopExp_Explorer at(shape, TopAbs_WIRE, TopAbs_FACE); at.More(); at.Next())
      add_wire(TopoDS::Wire(at.Current()), placed, product, names);
    for (TopExp_Explorer at(shape, TopAbs_EDGE, TopAbs_WIRE); at.More(); at.Next())
      add(points_of(TopoDS::Edge(at.Current()), how_.chord_mm), placed,
          name_of(at.Current(), product, names));
    if (!how_.with_edges) return;
    TopTools_IndexedMapOfShape edges;  // an edge between two faces counts once
    for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next())
      TopExp::MapShapes(at.Current(), TopAbs_EDGE, edges);
    for (int i = 1; i <= edges.Extent(); ++i)
      add(points_of(TopoDS::Edge(edges(i)), how_.chord_mm), placed, name_of(edges(i), product, names));
  }

  std::vector<NamedCurve> all;
  std::size_t count = 0;

 private:
  static std::string name_of(const TopoDS_Shape& shape, const std::string& product, const ShapeNames& names) {
    const std::string* own = names.Seek(shape.Located(TopLoc_Location()));
    return own ? *own : product;
  }

  void add_wire(const TopoDS_Wire& wire,
                const gp_Trsf& placed,
                const std::string& product,
                const ShapeNames& names) {
    Points points;
    TopTools_MapOfShape followed;
    const std::string name = name_of(wire, product, names);
    for (BRepTools_WireExplorer at(wire); at.More(); at.Next()) {
      const std::vector<Eigen::Vector3d> more = points_of(at.Current(), how_.chord_mm);
      points.insert(points.end(), more.begin(), more.end());
      followed.Add(at.Current());
    }
    add(std::move(points), placed, name);
    // The explorer ends at a branch and at a gap.
    std::vector<Points> rest;
    for (TopoDS_Iterator at(wire); at.More(); at.Next()) {
      if (at.Value().ShapeType() != TopAbs_EDGE || followed.Contains(at.Value())) continue;
      Points more = points_of(TopoDS::Edge(at.Value()), how_.chord_mm);
      if (!more.empty()) rest.push_back(std::move(more));
    }
    for (Points& chain : chains_of(std::move(rest))) add(std::move(chain), placed, name);
  }

  void add(std::vector<Eigen::Vector3d> points, const gp_Trsf& placed, const std::string& name) {
    for (Eigen::Vector3d& p : points)
      p = k_metres * vector_of(gp_Pnt(p.x(), p.y(), p.z()).Transformed(placed));
    const auto same = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return (a - b).norm() <= k_metres * k_same_mm;
    };
    points.erase(std::unique(points.begin(), points.end(), same), points.end());
    const bool is_closed = points.size() > 3 && same(points.front(), points.back());
    if (is_closed) points.pop_back();
    if (points.size() < 2) return;
    count += points.size();
    all.push_back({numbered(name), std::move(points), is_closed});
  }

  std::string numbered(const std::string& name) {
    std::string own = name;
    for (int number = 2; !names_.insert(own).second; ++number) own = fmt::format("{} {}", name, number);
    return own;
  }

  const CurveSampling& how_;
  std::set<std::string> names_;
};

}  // namespace

Result<exchange::CurveList> read_curves(const fs::path& path,
                                        const CurveSampling& how,
                                        ProgressLines* progress) {
  LIMN_TRY(const OcctDocument document, read_document(path, progress));
  progress->begin_stage("following curves", k_read_percent, 100);
  Curves curves(how);
  LIMN_TRY(const Leaves leaves, leaves_of(document.document, path));
  for (std::size_t i = 0; i < leaves.all.size(); ++i) {
    const Leaf& leaf = leaves.all[i];
    const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(leaf.product);
    if (shape.IsNull()) continue;
    curves.add_shape(shape, leaf.placed, leaf.name.empty() ? as_utf8(path.stem().string()) : leaf.name,
                     document.shape_names);
    progress->advance(static_cast<double>(i + 1) / static_cast<double>(leaves.all.size()));
    if (curves.count > k_most_points)
      return error(
          "{}: expected curves of at most {} million points, found more with a chord error of {} mm. Allow a "
          "larger one (--chord-mm).",
          path.string(), k_most_points / 1'000'000, how.chord_mm);
  }
  if (curves.all.empty())
    return error("{}: expected {} with curves, found {}. Export the curves themselves{}.", path.string(),
                 a_file(document.format),
                 how.with_edges ? "none" : "none that bounds no surface and whose segments meet",
                 how.with_edges ? "" : ", or read the edges of surfaces (--edges)");
  return exchange::CurveList{.curves = std::move(curves.all), .warnings = document.warnings};
}

}  // namespace limn::cad
