#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/curves/named_curve.h"

namespace limn::exchange {

/// Curves on their way between limn and limn-cad.
struct CurveList {
  std::vector<NamedCurve> curves = {};
  CurveForm form = CurveForm::polyline;
  std::vector<std::string> warnings = {};  ///< About the file that the curves are from.
};

/// JSON limn.curves/1, with points in millimetres: {"schema", "form", "curves": [{"name", "closed",
/// "points_mm": [[x, y, z], ...]}], "warnings"}.
std::string encode_curve_list(const CurveList& list);

/// Reads it back. `where` names the text in messages. Errors: no such JSON; check_curve().
Result<CurveList> decode_curve_list(const std::string& text, const std::string& where);

}  // namespace limn::exchange
