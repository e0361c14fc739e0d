#include "exchange/cad/step_places.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <opencascade/StepGeom_CartesianTransformationOperator3d.hxx>
#include <opencascade/StepGeom_Direction.hxx>
#include <opencascade/StepRepr_MappedItem.hxx>
#include <opencascade/StepRepr_Representation.hxx>
#include <opencascade/StepRepr_RepresentationMap.hxx>
#include <opencascade/TCollection_HAsciiString.hxx>
#include <opencascade/gp_XYZ.hxx>
#include <set>

#include "core/utf8.h"

namespace limn::cad {
namespace {

std::string text_of(const Handle(TCollection_HAsciiString) & text) {
  return text.IsNull() ? std::string() : as_utf8(text->ToCString());
}

}  // namespace

void warn_of_places(const Handle(StepData_StepModel) & model, std::vector<std::string>* warnings) {
  const auto axis = [](const Handle(StepGeom_Direction) & given) {
    return given.IsNull() || given->NbDirectionRatios() < 3
               ? gp_XYZ()
               : gp_XYZ(given->DirectionRatiosValue(1), given->DirectionRatiosValue(2),
                        given->DirectionRatiosValue(3));
  };
  std::map<const Standard_Transient*, std::string> wrong;  // what each does
  for (Standard_Integer i = 1; i <= model->NbEntities(); ++i) {
    const auto placed = Handle(StepGeom_CartesianTransformationOperator3d)::DownCast(model->Value(i));
    if (placed.IsNull()) continue;
    const double scale = placed->HasScale() ? placed->Scale() : 1;
    const bool is_mirrored =
        axis(placed->Axis1()).DotCross(axis(placed->Axis2()), axis(placed->Axis3())) * scale < 0;
    const bool is_scaled = std::abs(std::abs(scale) - 1) > 1e-6;
    if (is_mirrored || is_scaled)
      wrong[placed.get()] = is_scaled
                                ? fmt::format("{}scaled by {:.4g}", is_mirrored ? "mirrored and " : "", scale)
                                : "mirrored";
  }
  std::set<std::string> named;
  for (Standard_Integer i = 1; i <= model->NbEntities(); ++i) {
    const auto item = Handle(StepRepr_MappedItem)::DownCast(model->Value(i));
    if (item.IsNull() || item->MappingSource().IsNull()) continue;
    const auto found = wrong.find(item->MappingTarget().get());
    if (found == wrong.end()) continue;
    const auto shape = item->MappingSource()->MappedRepresentation();
    std::string name = text_of(item->Name());
    if (name.empty() && !shape.IsNull()) name = text_of(shape->Name());
    named.insert(fmt::format("'{}': a place is {}, which is not read; it is shown in its own size and hand",
                             name, found->second));
    wrong.erase(found);
  }
  for (const auto& [placed, what] : wrong)
    named.insert(
        fmt::format("a place in an assembly is {}, which is not read; its part is shown in its own size "
                    "and hand",
                    what));
  warnings->insert(warnings->end(), named.begin(), named.end());
}

}  // namespace limn::cad
