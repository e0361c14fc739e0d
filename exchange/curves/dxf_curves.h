#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/curves/curve_list.h"
#include "exchange/curves/named_curve.h"

namespace limn::exchange {

/// The curves as 3D polylines of an ASCII DXF file (AutoCAD release 12, which all programs read), in
/// millimetres ($INSUNITS 4). A curve's name is its layer, in which characters that layers cannot have become
/// '_'.
std::string encode_dxf_curves(const std::vector<NamedCurve>& curves);

/// The curves of an ASCII DXF file: LINE, POLYLINE, LWPOLYLINE (with arcs), SPLINE, ARC and CIRCLE of its
/// ENTITIES, each named after its layer. Arcs and splines become points that are at most about 0.01 mm off.
/// The unit is that of $INSUNITS (inch, foot, mm, cm, m); a file without one is read as millimetres, with a
/// warning. Entities of other kinds are left out with a warning. `where` names the text in messages, which
/// say the line. Errors: no DXF, a binary one, a pair that is broken, numbers that are not finite or too
/// large, an unknown unit, too many curves or points, no curve at all.
Result<CurveList> decode_dxf_curves(const std::string& text, const std::string& where);

}  // namespace limn::exchange
