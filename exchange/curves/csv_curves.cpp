#include "exchange/curves/csv_curves.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "core/csv.h"

namespace limn::exchange {
namespace {

constexpr double k_m_per_mm = 1e-3;
constexpr double k_largest_csv_mm = 1e5;

// The fields of a row (RFC 4180); nullopt when a quote does not end in it.
std::optional<std::vector<std::string>> fields_of(std::string_view row) {
  std::vector<std::string> fields(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    const char c = row[i];
    if (is_quoted && c == '"' && i + 1 < row.size() && row[i + 1] == '"') {
      fields.back() += '"';
      ++i;
    } else if (c == '"') {
      is_quoted = !is_quoted;
    } else if (c == ',' && !is_quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  if (is_quoted) return std::nullopt;
  return fields;
}

std::optional<double> number_in(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || !(std::abs(value) <= k_largest_csv_mm))
    return std::nullopt;
  return value;
}

}  // namespace

NamedCurve cleaned(NamedCurve curve) {
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& p : curve.points)
    if (points.empty() || p != points.back()) points.push_back(p);
  while (points.size() > 2 && points.back() == points.front()) {
    points.pop_back();
    curve.is_closed = true;
  }
  if (points.size() < 3) curve.is_closed = false;
  curve.points = std::move(points);
  return curve;
}

std::string encode_csv_curves(const std::vector<NamedCurve>& curves) {
  std::string text = "name,x_mm,y_mm,z_mm\r\n";
  const NamedCurve* before = nullptr;
  for (const NamedCurve& curve : curves) {
    const std::string name = csv_field(curve.name);
    if (before && before->name == curve.name) text += "\r\n";
    before = &curve;
    const auto add = [&](const Eigen::Vector3d& p) {
      text += fmt::format("{},{:.4f},{:.4f},{:.4f}\r\n", name, p.x() / k_m_per_mm, p.y() / k_m_per_mm,
                          p.z() / k_m_per_mm);
    };
    for (const Eigen::Vector3d& p : curve.points) add(p);
    if (curve.is_closed && !curve.points.empty()) add(curve.points.front());
  }
  return text;
}

Result<std::vector<NamedCurve>> decode_csv_curves(const std::string& text, const std::string& where) {
  std::vector<NamedCurve> curves;
  std::size_t points = 0, row_number = 0;
  bool is_new = true;  // an empty row ends a curve
  std::string_view rest = text;
  if (rest.starts_with("\xef\xbb\xbf")) rest.remove_prefix(3);
  while (!rest.empty()) {
    std::string_view row = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), row.size() + 1));
    if (row.ends_with('\r')) row.remove_suffix(1);
    ++row_number;
    if (row.empty()) is_new = true;
    if (row.empty()) continue;
    const auto fields = fields_of(row);
    if (!fields || fields->size() != 4)
      return error("{}: row {}: expected a name, x, y and z in millimetres, found {} fields.", where,
                   row_number, fields ? fmt::format("{}", fields->size()) : "a quote that does not end");
    const auto x = number_in((*fields)[1]), y = number_in((*fields)[2]), z = number_in((*fields)[3]);
    const bool is_number = x && y && z;
    if (!is_number && row_number == 1) continue;  // headings
    if (!is_number)
      return error("{}: row {}: expected three numbers of millimetres, at most {}, found '{},{},{}'.", where,
                   row_number, k_largest_csv_mm, (*fields)[1].substr(0, 32), (*fields)[2].substr(0, 32),
                   (*fields)[3].substr(0, 32));
    if (is_new || curves.back().name != fields->front()) curves.push_back({.name = fields->front()});
    is_new = false;
    curves.back().points.push_back(k_m_per_mm * Eigen::Vector3d(*x, *y, *z));
    if (curves.size() > k_most_curves || ++points > k_most_curve_points)
      return error("{}: row {}: expected at most {} curves and {} points, found more.", where, row_number,
                   k_most_curves, k_most_curve_points);
  }
  if (curves.empty()) return error("{}: expected rows of points, found none.", where);
  for (NamedCurve& curve : curves) {
    curve = cleaned(std::move(curve));
    LIMN_TRY_STATUS(check_curve(curve, where));
  }
  return curves;
}

}  // namespace limn::exchange
