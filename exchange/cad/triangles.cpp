#include "exchange/cad/triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <opencascade/BRepAdaptor_Curve.hxx>
#include <opencascade/BRepAdaptor_Surface.hxx>
#include <opencascade/BRepLProp_SLProps.hxx>
#include <opencascade/BRepMesh_IncrementalMesh.hxx>
#include <opencascade/BRepTools.hxx>
#include <opencascade/BRep_Tool.hxx>
#include <opencascade/Message_ProgressIndicator.hxx>
#include <opencascade/Poly_PolygonOnTriangulation.hxx>
#include <opencascade/Poly_Triangulation.hxx>
#include <opencascade/TopExp.hxx>
#include <opencascade/TopExp_Explorer.hxx>
#include <opencascade/TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <opencascade/TopTools_IndexedMapOfShape.hxx>
#include <opencascade/TopTools_ListOfShape.hxx>
#include <opencascade/TopoDS.hxx>
#include <optional>
#include <utility>

namespace limn::cad {
namespace {

constexpr double k_metres = 1e-3;      // the document's shapes are in millimetres
constexpr int k_most_samples = 20000;  // triangles of a shape on which the chord error is measured
constexpr int k_most_tries = 4, k_most_coarser = 6;
constexpr double k_seconds_a_face = 0.02;           // processor time; nearly all faces take far less
constexpr double k_safety = 0.75, k_finest = 0.05;  // shares of the wanted chord error
// Between the points at which it is measured a surface is a little farther from its triangles.
constexpr double k_measured = 0.98;

Eigen::Vector3d vector_of(const gp_XYZ& v) { return {v.X(), v.Y(), v.Z()}; }

// A face with its triangles.
struct Cut {
  TopoDS_Face face;
  Handle(Poly_Triangulation) triangles;
  gp_Trsf placed;
};

std::vector<Cut> cuts_of(const TopoDS_Shape& shape, int* lost_faces) {
  std::vector<Cut> cuts;
  *lost_faces = 0;
  for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) {
    TopLoc_Location place;
    const TopoDS_Face& face = TopoDS::Face(at.Current());
    const Handle(Poly_Triangulation)& triangles = BRep_Tool::Triangulation(face, place);
    if (triangles.IsNull() || triangles->NbTriangles() == 0)
      ++*lost_faces;
    else
      cuts.push_back({face, triangles, place.Transformation()});
  }
  return cuts;
}

// Ends the work of OpenCASCADE's mesher after some processor time.
class Deadline : public Message_ProgressIndicator {
 public:
  explicit Deadline(double seconds)
      : end_(std::clock() + static_cast<std::clock_t>(seconds * CLOCKS_PER_SEC)) {}
  Standard_Boolean UserBreak() override { return std::clock() > end_; }

 protected:
  void Show(const Message_ProgressScope& /*scope*/, Standard_Boolean /*is_forced*/) override {}

 private:
  std::clock_t end_;
};

// Whether the mesher came to its end in time.
bool cut_shape(const TopoDS_Shape& shape, double chord_mm, const Tessellation& how) {
  IMeshTools_Parameters parameters;
  parameters.Deflection = chord_mm;
  parameters.Angle = how.angle_deg * M_PI / 180;
  parameters.AngleInterior = parameters.Angle;
  // Shorter sides would follow kinks that are smaller than the chord error, in some files without end.
  parameters.MinSize = chord_mm;
  parameters.InParallel = Standard_False;  // a session needs the other cores for its frames
  BRepTools::Clean(shape);
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  const Handle(Deadline) deadline = new Deadline(how.solid_seconds + k_seconds_a_face * faces.Extent());
  const BRepMesh_IncrementalMesh mesher(shape, parameters, deadline->Start());
  return !deadline->UserBreak();
}

// Large shapes, and surfaces on which a refinement comes no nearer, need too many triangles for a small chord
// error: they are cut with a larger one, first with the one that is asked for. Whether that was so.
bool cut_in_time(const TopoDS_Shape& shape, double chord_mm, double asked_mm, const Tessellation& how) {
  constexpr double k_coarser = 8;
  if (cut_shape(shape, chord_mm, how)) return false;
  double coarse_mm = chord_mm < asked_mm ? asked_mm : k_coarser * chord_mm;
  for (int tried = 1; tried <= k_most_coarser && !cut_shape(shape, coarse_mm, how); ++tried)
    coarse_mm *= k_coarser;
  return true;
}

// ---- the chord error

// Whether the surface does not move (1e-6 mm) when u or v runs through the face: at a sphere's pole, at the
// tip of a cone. A node has any u or v there.
struct Pole {
  bool in_u = false, in_v = false;
};
Pole pole_at(const BRepAdaptor_Surface& surface, const gp_XY& uv, const gp_XY& range) {
  constexpr double k_still_mm = 1e-6;
  gp_Pnt p;
  gp_Vec du, dv;
  surface.D1(uv.X(), uv.Y(), p, du, dv);
  return {du.Magnitude() * range.X() < k_still_mm, dv.Magnitude() * range.Y() < k_still_mm};
}

// Gives corners at poles the u or v of the other ones.
void leave_poles(const BRepAdaptor_Surface& surface, const gp_XY& range, gp_XY (&uv)[3]) {
  Pole poles[3];
  for (int k = 0; k < 3; ++k) poles[k] = pole_at(surface, uv[k], range);
  const auto leave = [&](bool Pole::*at_pole, int coordinate) {
    double sum = 0;
    int count = 0;
    for (int k = 0; k < 3; ++k) {
      if (poles[k].*at_pole) continue;
      sum += uv[k].Coord(coordinate);
      ++count;
    }
    for (int k = 0; k < 3 && count > 0; ++k)
      if (poles[k].*at_pole) uv[k].SetCoord(coordinate, sum / count);
  };
  leave(&Pole::in_u, 1);
  leave(&Pole::in_v, 2);
}

// The largest distance of surface points from the triangles between whose corners they are, mm: at the
// middles of triangles and of their sides. Every `step`th triangle is measured.
double surface_error_mm(const Cut& cut, int step) {
  const BRepAdaptor_Surface surface(cut.face, Standard_False);
  if (surface.GetType() == GeomAbs_Plane || !cut.triangles->HasUVNodes()) return 0;
  const bool may_have_poles = surface.GetType() != GeomAbs_Cylinder;
  double u0 = 0, u1 = 0, v0 = 0, v1 = 0;
  BRepTools::UVBounds(cut.face, u0, u1, v0, v1);
  double worst = 0;
  for (int t = 1; t <= cut.triangles->NbTriangles(); t += step) {
    const Poly_Triangle& triangle = cut.triangles->Triangle(t);
    Eigen::Vector3d p[3];
    gp_XY uv[3];
    for (int k = 0; k < 3; ++k) {
      const int node = triangle.Value(k + 1);
      p[k] = vector_of(cut.triangles->Node(node).Transformed(cut.placed).XYZ());
      uv[k] = cut.triangles->UVNode(node).XY();
    }
    const Eigen::Vector3d d_normal = (p[1] - p[0]).cross(p[2] - p[0]);
    if (!(d_normal.norm() > 1e-12)) continue;
    if (may_have_poles) leave_poles(surface, {u1 - u0, v1 - v0}, uv);
    const gp_XY middles[4] = {(uv[0] + uv[1] + uv[2]) / 3, (uv[0] + uv[1]) / 2, (uv[1] + uv[2]) / 2,
                              (uv[2] + uv[0]) / 2};
    for (const gp_XY& middle : middles) {
      const Eigen::Vector3d on_surface = vector_of(surface.Value(middle.X(), middle.Y()).XYZ());
      worst = std::max(worst, std::abs((on_surface - p[0]).dot(d_normal.normalized())));
    }
  }
  return worst;
}

// The same for a face's edges and the sides of triangles along them.
double edge_error_mm(const Cut& cut) {
  double worst = 0;
  for (TopExp_Explorer at(cut.face, TopAbs_EDGE); at.More(); at.Next()) {
    const TopoDS_Edge& edge = TopoDS::Edge(at.Current());
    TopLoc_Location place;
    const Handle(Poly_Triangulation)& triangles = BRep_Tool::Triangulation(cut.face, place);
    const Handle(Poly_PolygonOnTriangulation)& line =
        BRep_Tool::PolygonOnTriangulation(edge, triangles, place);
    if (line.IsNull() || !line->HasParameters() || BRep_Tool::Degenerated(edge)) continue;
    const BRepAdaptor_Curve curve(edge);
    if (curve.GetType() == GeomAbs_Line) continue;
    for (int i = 1; i < line->NbNodes(); ++i) {
      const gp_Pnt a = triangles->Node(line->Node(i)).Transformed(cut.placed),
                   b = triangles->Node(line->Node(i + 1)).Transformed(cut.placed);
      const Eigen::Vector3d from = vector_of(a.XYZ()), along = vector_of(b.XYZ()) - from;
      const Eigen::Vector3d middle =
          vector_of(curve.Value((line->Parameter(i) + line->Parameter(i + 1)) / 2).XYZ()) - from;
      const double length = along.norm();
      if (length > 1e-9) worst = std::max(worst, middle.cross(along).norm() / length);
    }
  }
  return worst;
}

// The largest error of each face.
std::vector<double> chord_errors_mm(const std::vector<Cut>& cuts) {
  int count = 0;
  for (const Cut& cut : cuts) count += cut.triangles->NbTriangles();
  std::vector<double> errors;
  for (const Cut& cut : cuts)
    errors.push_back(std::max(surface_error_mm(cut, 1 + count / k_most_samples), edge_error_mm(cut)));
  return errors;
}

// ---- triangles

// The normals of the surface at a face's nodes. Where it has none, as at a pole or at the tip of a cone, the
// normal a little inside the face; zero where there is none either.
std::vector<Eigen::Vector3f> normals_of(const Cut& cut) {
  BRepAdaptor_Surface surface(cut.face, Standard_False);
  BRepLProp_SLProps at(surface, 1, 1e-12);
  std::vector<Eigen::Vector3f> normals(static_cast<std::size_t>(cut.triangles->NbNodes()),
                                       Eigen::Vector3f::Zero());
  if (!cut.triangles->HasUVNodes()) return normals;
  constexpr double k_inside = 1e-3;  // a share: 1 is the middle of the face
  gp_XY middle(0, 0);
  for (int node = 1; node <= cut.triangles->NbNodes(); ++node)
    middle += cut.triangles->UVNode(node).XY() / cut.triangles->NbNodes();
  const float side = cut.face.Orientation() == TopAbs_REVERSED ? -1.F : 1.F;
  for (int node = 1; node <= cut.triangles->NbNodes(); ++node) {
    gp_XY uv = cut.triangles->UVNode(node).XY();
    at.SetParameters(uv.X(), uv.Y());
    if (!at.IsNormalDefined()) {
      uv += k_inside * (middle - uv);
      at.SetParameters(uv.X(), uv.Y());
    }
    if (at.IsNormalDefined())
      normals[static_cast<std::size_t>(node) - 1] = side * vector_of(at.Normal().XYZ()).cast<float>();
  }
  return normals;
}

void append(const Cut& cut, CadPiece* piece) {
  const auto first = static_cast<std::uint32_t>(piece->positions.size());
  for (int node = 1; node <= cut.triangles->NbNodes(); ++node)
    piece->positions.push_back(
        (k_metres * vector_of(cut.triangles->Node(node).Transformed(cut.placed).XYZ())).cast<float>());
  std::vector<Eigen::Vector3f> normals = normals_of(cut);
  const bool turned = (cut.face.Orientation() == TopAbs_REVERSED) != cut.placed.IsNegative();
  std::vector<Eigen::Vector3f> sums(normals.size(), Eigen::Vector3f::Zero());
  for (int t = 1; t <= cut.triangles->NbTriangles(); ++t) {
    int a = 0, b = 0, c = 0;
    cut.triangles->Triangle(t).Get(a, b, c);
    if (turned) std::swap(b, c);
    std::array<std::uint32_t, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = first + static_cast<std::uint32_t>(std::array{a, b, c}[k]) - 1;
    const Eigen::Vector3f &p = piece->positions[corners[0]], &q = piece->positions[corners[1]],
                          &r = piece->positions[corners[2]];
    for (const std::uint32_t corner : corners) sums[corner - first] += (q - p).cross(r - p);
    piece->triangles.push_back(corners);
  }
  for (std::size_t i = 0; i < normals.size(); ++i) {
    if (normals[i].isZero()) normals[i] = sums[i];
    piece->normals.push_back(normals[i].squaredNorm() > 0 ? normals[i].normalized().eval()
                                                          : Eigen::Vector3f::UnitZ().eval());
  }
}

// Turns a closed surface whose inside is outside.
void face_outwards(CadMesh* mesh) {
  double volume = 0;  // six times
  for (const CadPiece& piece : mesh->pieces)
    for (const auto& [a, b, c] : piece.triangles)
      volume += piece.positions[a].cast<double>().dot(
          piece.positions[b].cast<double>().cross(piece.positions[c].cast<double>()));
  if (volume >= 0) return;
  for (CadPiece& piece : mesh->pieces) {
    for (auto& triangle : piece.triangles) std::swap(triangle[1], triangle[2]);
    for (Eigen::Vector3f& normal : piece.normals) normal = -normal;
  }
}

int count_open_edges(const TopoDS_Shape& shape) {
  TopTools_IndexedDataMapOfShapeListOfShape faces;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces);
  int open = 0;
  for (int i = 1; i <= faces.Extent(); ++i) {
    const TopoDS_Edge& edge = TopoDS::Edge(faces.FindKey(i));
    if (faces.FindFromIndex(i).Extent() != 1 || BRep_Tool::Degenerated(edge)) continue;
    if (!BRep_Tool::IsClosed(edge, TopoDS::Face(faces.FindFromIndex(i).First()))) ++open;  // not a seam
  }
  return open;
}

// What the mesher made of a shape.
struct Attempt {
  std::vector<Cut> cuts;
  int lost_faces = 0, coarse_faces = 0;
  double worst_mm = 0;
  bool is_better_than(const Attempt& other) const {
    return std::pair(lost_faces, worst_mm) < std::pair(other.lost_faces, other.worst_mm);
  }
};

Attempt attempt_of(const TopoDS_Shape& shape, double asked_mm) {
  Attempt out;
  out.cuts = cuts_of(shape, &out.lost_faces);
  for (const double mm : chord_errors_mm(out.cuts)) {
    out.worst_mm = std::max(out.worst_mm, mm);
    if (mm > asked_mm) ++out.coarse_faces;
  }
  return out;
}

// Cuts the shape, finer and finer until no surface is too far from its triangles. The mesher fails on some
// faces with one chord error and not with another one, so it gets a few tries for them, too, first with the
// one that is asked for.
Attempt best_attempt(const TopoDS_Shape& shape, double asked_mm, const Tessellation& how) {
  constexpr int k_tries_for_lost = 3;
  constexpr int k_fine_tries = 2;  // for a finer chord error than is asked for
  std::optional<Attempt> best;
  double chord_mm = how.chord_mm, most_mm = std::min(asked_mm, how.chord_mm);
  for (int tried = 1; tried <= k_most_tries; ++tried) {
    const bool is_coarse = cut_in_time(shape, chord_mm, asked_mm, how);
    Attempt attempt = attempt_of(shape, asked_mm);
    const double worst_mm = attempt.worst_mm;
    if (tried == k_fine_tries) most_mm = asked_mm;
    if (!best || attempt.is_better_than(*best)) best = std::move(attempt);
    const bool is_whole = best->lost_faces == 0;
    if (is_coarse || (worst_mm <= k_measured * most_mm && (is_whole || tried == k_tries_for_lost))) break;
    if (!is_whole && chord_mm < asked_mm && most_mm < asked_mm)
      chord_mm = most_mm = asked_mm;
    else
      chord_mm = std::max(k_finest * most_mm, chord_mm * std::min(k_safety, k_safety * most_mm / worst_mm));
  }
  return *std::move(best);
}

}  // namespace

Triangulated triangulated(const TopoDS_Shape& shape,
                          const Tessellation& how,
                          double asked_mm,
                          const std::function<Colour(const TopoDS_Face&)>& colour_of) {
  const Attempt best = best_attempt(shape, asked_mm, how);
  Triangulated out;
  out.lost_faces = best.lost_faces;
  out.coarse_faces = best.coarse_faces;
  out.mesh.chord_error_mm = best.worst_mm;
  std::map<Colour, std::size_t> piece_of;
  for (const Cut& cut : best.cuts) {
    const Colour colour = colour_of(cut.face);
    const auto [known, is_new] = piece_of.try_emplace(colour, out.mesh.pieces.size());
    if (is_new) out.mesh.pieces.push_back({.colour = colour});
    append(cut, &out.mesh.pieces[known->second]);
  }
  out.open_edges = count_open_edges(shape);
  out.mesh.is_closed = out.open_edges == 0;
  if (out.mesh.is_closed) face_outwards(&out.mesh);
  BRepTools::Clean(shape);
  return out;
}

}  // namespace limn::cad
