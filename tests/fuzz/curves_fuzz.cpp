// Files of curves: CSV and DXF.
#include "exchange/curves/csv_curves.h"
#include "exchange/curves/dxf_curves.h"
#include "tests/fuzz/fuzz_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace limn;
  const std::string text(reinterpret_cast<const char*>(bytes), size);
  if (const auto curves = exchange::decode_csv_curves(text, "curves.csv"))
    for (const exchange::NamedCurve& curve : *curves)
      LIMN_CHECK(exchange::check_curve(curve, "curves.csv").ok());
  else
    test::check_message(curves.message(), "curves.csv");
  if (const auto list = exchange::decode_dxf_curves(text, "curves.dxf"))
    for (const exchange::NamedCurve& curve : list->curves)
      LIMN_CHECK(exchange::check_curve(curve, "curves.dxf").ok());
  else
    test::check_message(list.message(), "curves.dxf");
  return 0;
}
