#pragma once

#include <functional>
#include <opencascade/TopoDS_Face.hxx>
#include <opencascade/TopoDS_Shape.hxx>

#include "core/result.h"
#include "exchange/cad/cad_model.h"

namespace limn::cad {

/// Cuts a shape's surfaces into triangles. The chord error is measured on the surfaces and their edges; where
/// it is larger than `asked_mm`, the shape is cut again, finer; `how` may begin with a smaller one.
/// `colour_of` gives the colour of each face. Faces that cannot be cut are left out and counted.
struct Triangulated {
  CadMesh mesh;
  int lost_faces = 0;
  int coarse_faces = 0;  ///< Faces whose chord error is larger than `asked_mm`.
  int open_edges = 0;    ///< Edges with a surface on one side only.
};
Triangulated triangulated(const TopoDS_Shape& shape,
                          const Tessellation& how,
                          double asked_mm,
                          const std::function<Colour(const TopoDS_Face&)>& colour_of);

}  // namespace limn::cad
