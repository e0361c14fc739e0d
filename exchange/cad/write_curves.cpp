#include "exchange/cad/write_curves.h"

#include <unistd.h>

#include <cstdlib>
#include <opencascade/BRepBuilderAPI_MakeEdge.hxx>
#include <opencascade/GeomAPI_Interpolate.hxx>
#include <opencascade/Geom_BSplineCurve.hxx>
#include <opencascade/Interface_Static.hxx>
#include <opencascade/STEPCAFControl_Controller.hxx>
#include <opencascade/STEPCAFControl_Writer.hxx>
#include <opencascade/TColStd_Array1OfInteger.hxx>
#include <opencascade/TColStd_Array1OfReal.hxx>
#include <opencascade/TColgp_Array1OfPnt.hxx>
#include <opencascade/TColgp_HArray1OfPnt.hxx>
#include <opencascade/TDataStd_Name.hxx>
#include <opencascade/XCAFDoc_DocumentTool.hxx>
#include <opencascade/XCAFDoc_ShapeTool.hxx>
#include <system_error>

#include "core/file.h"
#include "exchange/cad/occt_document.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;
using exchange::CurveForm;
using exchange::NamedCurve;

constexpr double k_mm = 1e3;

gp_Pnt point_of(const Eigen::Vector3d& p) { return {k_mm * p.x(), k_mm * p.y(), k_mm * p.z()}; }

// Straight from point to point; the parameter is the length from the beginning.
Handle(Geom_Curve) polyline_through(const NamedCurve& curve) {
  const int count = static_cast<int>(curve.points.size()) + (curve.is_closed ? 1 : 0);
  TColgp_Array1OfPnt poles(1, count);
  TColStd_Array1OfReal knots(1, count);
  TColStd_Array1OfInteger multiplicities(1, count);
  for (int i = 1; i <= count; ++i) {
    poles(i) = point_of(curve.points[static_cast<std::size_t>(i - 1) % curve.points.size()]);
    knots(i) = i == 1 ? 0 : knots(i - 1) + poles(i).Distance(poles(i - 1));
    multiplicities(i) = i == 1 || i == count ? 2 : 1;
  }
  return new Geom_BSplineCurve(poles, knots, multiplicities, 1);
}

// Cubic, with two continuous derivatives, also where a closed curve closes.
Handle(Geom_Curve) spline_through(const NamedCurve& curve) {
  constexpr double k_same_mm = 1e-9;
  const Handle(TColgp_HArray1OfPnt) points =
      new TColgp_HArray1OfPnt(1, static_cast<int>(curve.points.size()));
  for (std::size_t i = 0; i < curve.points.size(); ++i)
    points->SetValue(static_cast<int>(i) + 1, point_of(curve.points[i]));
  GeomAPI_Interpolate through(points, curve.is_closed, k_same_mm);
  through.Perform();
  return through.IsDone() ? Handle(Geom_Curve)(through.Curve()) : Handle(Geom_Curve)();
}

Result<TopoDS_Shape> edge_of(const NamedCurve& curve, CurveForm form, const fs::path& path) {
  const Handle(Geom_Curve) through =
      form == CurveForm::spline ? spline_through(curve) : polyline_through(curve);
  if (!through.IsNull())
    if (BRepBuilderAPI_MakeEdge edge(through); edge.IsDone()) return edge.Shape();
  return error(
      "{}: curve '{}': expected points through which a curve goes, found some too close to each other. Write "
      "it with "
      "fewer points.",
      path.string(), curve.name);
}

// A name between quotation marks as STEP has it: characters outside ASCII by their numbers.
std::string step_text(const std::string& name) {
  std::string text = "'";
  bool is_wide = false;
  const TCollection_ExtendedString utf16(name.c_str(), Standard_True);
  for (int i = 1; i <= utf16.Length(); ++i) {
    const auto c = static_cast<unsigned>(utf16.Value(i));
    const bool is_plain = c >= 0x20 && c < 0x7F;
    if (is_plain == is_wide) text += is_plain ? "\\X0\\" : "\\X2\\";
    is_wide = !is_plain;
    text += is_plain ? std::string(c == '\'' || c == '\\' ? 2 : 1, static_cast<char>(c))
                     : fmt::format("{:04X}", c);
  }
  return text + (is_wide ? "\\X0\\'" : "'");
}

// OpenCASCADE writes names as UTF-8 and breaks lines inside letters, so that it gets these names.
std::string short_name(std::size_t index) { return fmt::format("limn_curve_{}", index); }

std::string with_names(const std::string& text, const std::vector<NamedCurve>& curves) {
  const std::string begin = "'limn_curve_";
  std::string out;
  std::size_t from = 0;
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, from)) {
    const std::size_t index = std::strtoul(text.c_str() + at + begin.size(), nullptr, 10);
    out += text.substr(from, at - from) + step_text(curves.at(index).name);
    from = text.find('\'', at + 1) + 1;
  }
  return out + text.substr(from);
}

Error not_written(const fs::path& path, const std::string& found) {
  return error("{}: expected to write a STEP file, found {}. Choose another folder.", path.string(), found);
}

}  // namespace

Status write_curves(const exchange::CurveList& list, const fs::path& path, ProgressLines* progress) {
  const Handle(TDocStd_Document) document = new_document();
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  progress->begin_stage("writing", 0, 100);
  for (std::size_t i = 0; i < list.curves.size(); ++i) {
    LIMN_TRY(const TopoDS_Shape edge, edge_of(list.curves[i], list.form, path));
    TDataStd_Name::Set(shapes->AddShape(edge, Standard_False), short_name(i).c_str());
  }
  STEPCAFControl_Controller::Init();  // before the settings, which it makes; the writer takes the schema from
                                      // them
  Interface_Static::SetCVal("write.step.schema", "AP242DIS");
  Interface_Static::SetCVal("write.step.unit", "MM");
  STEPCAFControl_Writer writer;
  if (!writer.Transfer(document, STEPControl_AsIs)) return not_written(path, "curves that it cannot express");
  std::string name = path.string() + ".XXXXXX";  // a name that nobody has
  const int descriptor = mkstemp(name.data());
  if (descriptor < 0) return not_written(path, "a folder that cannot be written or is full");
  close(descriptor);
  const fs::path raw = name;
  std::error_code none;
  const bool is_written = writer.Write(raw.c_str()) == IFSelect_RetDone;
  const auto text = read_file(raw);
  fs::remove(raw, none);
  if (!is_written || !text) return not_written(path, "a folder that cannot be written or is full");
  return write_file(path, with_names(*text, list.curves));
}

}  // namespace limn::cad
