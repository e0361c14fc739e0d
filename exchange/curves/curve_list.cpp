#include "exchange/curves/curve_list.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"

namespace limn::exchange {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr const char* k_schema = "limn.curves/1";
constexpr double k_mm = 1e3;

// Throws json::exception.
CurveList list_in(const json& text) {
  CurveList list{.form = k_curve_form.find(text.at("form").get<std::string>()).value_or(CurveForm::polyline)};
  for (const json& curve : text.at("curves")) {
    NamedCurve read{.name = curve.at("name").get<std::string>(), .is_closed = curve.at("closed").get<bool>()};
    for (const json& p : curve.at("points_mm"))
      read.points.emplace_back(
          Eigen::Vector3d(p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>()) / k_mm);
    list.curves.push_back(std::move(read));
  }
  list.warnings = text.at("warnings").get<std::vector<std::string>>();
  return list;
}

}  // namespace

std::string encode_curve_list(const CurveList& list) {
  ordered_json curves = ordered_json::array();
  for (const NamedCurve& curve : list.curves) {
    ordered_json points = ordered_json::array();
    for (const Eigen::Vector3d& p : curve.points)
      points.push_back({k_mm * p.x(), k_mm * p.y(), k_mm * p.z()});
    curves.push_back({{"name", curve.name}, {"closed", curve.is_closed}, {"points_mm", points}});
  }
  return json_text(ordered_json{{"schema", k_schema},
                                {"form", k_curve_form.text(list.form)},
                                {"curves", curves},
                                {"warnings", list.warnings}});
}

Result<CurveList> decode_curve_list(const std::string& text, const std::string& where) {
  const json read = json::parse(text, nullptr, false);
  if (!read.is_object() || read.value("schema", json()) != k_schema)
    return error("{}: expected curves as {}, found another text. Write the curves again.", where, k_schema);
  try {
    CurveList list = list_in(read);
    for (const NamedCurve& curve : list.curves) LIMN_TRY_STATUS(check_curve(curve, where));
    return list;
  } catch (const json::exception& problem) {
    return error("{}: expected curves as {}, found a fault in it ({}). Write the curves again.", where,
                 k_schema, problem.what());
  }
}

}  // namespace limn::exchange
