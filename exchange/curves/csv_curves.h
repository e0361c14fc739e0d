#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/curves/named_curve.h"

namespace limn::exchange {

constexpr std::size_t k_most_curves = 4096, k_most_curve_points = 400'000;  ///< In one file.

/// Rows "name,x_mm,y_mm,z_mm" under a row of headings; consecutive rows of one name are a curve, which
/// an empty row ends, too. A closed curve ends with its first point again. Points to a ten-thousandth of a
/// millimetre.
std::string encode_csv_curves(const std::vector<NamedCurve>& curves);

/// Reads it back. The row of headings may be missing. `where` names the text in
/// messages, which say the row. Errors: a row of another form, numbers that are not finite or larger than 100
/// m, a curve of fewer than two points, too many curves or points. Points that equal their neighbours are
/// left out.
Result<std::vector<NamedCurve>> decode_csv_curves(const std::string& text, const std::string& where);

/// The curve without points that equal their neighbours. Where the last equals the first it is closed.
NamedCurve cleaned(NamedCurve curve);

}  // namespace limn::exchange
