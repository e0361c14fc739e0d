#pragma once

#include <opencascade/StepData_StepModel.hxx>
#include <string>
#include <vector>

namespace limn::cad {

/// Adds a warning for each place of a shape that is also scaled or mirrored (an operator
/// CARTESIAN_TRANSFORMATION_OPERATOR_3D): OpenCASCADE takes it as turned and moved alone.
void warn_of_places(const Handle(StepData_StepModel) & model, std::vector<std::string>* warnings);

}  // namespace limn::cad
