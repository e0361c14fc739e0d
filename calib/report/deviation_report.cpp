#include "calib/report/deviation_report.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/surface/deviation_scale.h"
#include "core/config.h"
#include "core/json_text.h"

namespace limn::calib {
namespace {

static_assert(std::endian::native == std::endian::little);  // binary PLY is written as a copy of memory

constexpr double k_noisy = 1.6;  // a factor on the stated noise that deserves a sentence

double area_of_state(const DeviationSummary& summary, DeviationState state) {
  return summary.areas_m2[static_cast<std::size_t>(state)];
}

nlohmann::ordered_json json_of(const Registration& registration) {
  nlohmann::ordered_json json;
  json["world_from_prototype"] = to_json(registration.world_from_prototype);
  json["covariance"] = nlohmann::ordered_json::array();
  for (int r = 0; r < 6; ++r) {
    std::vector<double> row;
    for (int c = 0; c < 6; ++c) row.push_back(registration.covariance(r, c));
    json["covariance"].push_back(row);
  }
  json["rms_mm"] = 1e3 * registration.rms_m;
  json["points"] = registration.used;
  json["free_directions"] = registration.free_directions;
  return json;
}

template <class T>
void put_bytes(std::string* bytes, const T& value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

}  // namespace

std::vector<std::string> deviation_warnings(const Deviation& deviation,
                                            const DeviationSummary& summary,
                                            const Registration& registration) {
  std::vector<std::string> warnings;
  for (const std::string& free : registration.free_directions)
    warnings.push_back(fmt::format(
        "the scanned shape does not determine a {} (CAD's axes): that part of the alignment comes "
        "from the start alone. What depends on it is uncertain (hatched). Scan more of the "
        "prototype, or start from markers or points.",
        free));
  const double uncertain = area_of_state(summary, DeviationState::uncertain),
               measured = area_of_state(summary, DeviationState::measured) + uncertain,
               beyond = area_of_state(summary, DeviationState::beyond_reach);
  if (uncertain > 0.01 * measured)
    warnings.push_back(fmt::format(
        "{:.1f} % of the measured surface is uncertain: twice the standard deviation is larger than "
        "the tolerance of {:.3g} mm.",
        100 * uncertain / measured, 1e3 * deviation.tolerance_m));
  if (beyond > 1e-4)
    warnings.push_back(fmt::format(
        "{:.1f} cm2 of the CAD have the scan's surface more than {:.3g} mm away: something hides them "
        "(a hand, a cable), or the prototype differs more. They are not measured; --reach-mm takes "
        "larger differences.",
        1e4 * beyond, 1e3 * deviation.reach_m));
  if (deviation.facing_away_m2 > 1e-4)
    warnings.push_back(fmt::format(
        "{:.1f} cm2 of the CAD lie on the scan's surface and face the other way: their triangles are inside "
        "out, or they are the back of a thin sheet. They are not measured. Turn the CAD's triangles "
        "outwards.",
        1e4 * deviation.facing_away_m2));
  if (!deviation.noise_was_stated)
    warnings.emplace_back(
        "the scan states no standard deviations, or some that are not above 0: they are estimated from how "
        "much its surface scatters.");
  else if (deviation.noise_factor > k_noisy)
    warnings.push_back(fmt::format(
        "the scan's surface scatters {:.1f} times as much as its standard deviations say; they are "
        "enlarged by this factor.",
        deviation.noise_factor));
  return warnings;
}

std::string deviation_text(const DeviationSummary& summary, double tolerance_m) {
  const double certain = area_of_state(summary, DeviationState::measured);
  if (!(certain > 0))
    return fmt::format("No place is certain to {:.3g} mm: see the standard deviations.", 1e3 * tolerance_m);
  return fmt::format(
      "{:.1f} % of the measured surface ({:.0f} cm2) lies within {:.3g} mm of the CAD; it is at most {:.2f} "
      "mm "
      "proud and {:.2f} mm shy.",
      100 * summary.within_share, 1e4 * certain, 1e3 * tolerance_m, 1e3 * std::max(0.0, summary.highest_m),
      1e3 * std::max(0.0, -summary.lowest_m));
}

std::string deviation_json(const DeviationReport& report) {
  const DeviationSummary& s = report.summary;
  nlohmann::ordered_json json;
  json["schema"] = "limn.deviation/1";
  json["made_at"] = report.made_at;
  json["cad"] = report.cad;
  json["scan"] = report.scan;
  json["tolerance_mm"] = 1e3 * report.deviation.tolerance_m;
  json["reach_mm"] = 1e3 * report.deviation.reach_m;
  json["spacing_mm"] = 1e3 * report.deviation.cad.spacing_m;
  json["within_share"] = s.within_share;
  json["mean_mm"] = 1e3 * s.mean_m;
  json["rms_mm"] = 1e3 * s.rms_m;
  json["p95_mm"] = 1e3 * s.p95_m;
  json["lowest_mm"] = 1e3 * s.lowest_m;
  json["highest_mm"] = 1e3 * s.highest_m;
  json["stddev_mm"] = 1e3 * s.median_stddev_m;
  json["noise_factor"] = report.deviation.noise_factor;
  json["areas_cm2"] = nlohmann::ordered_json::object();
  for (std::size_t k = 0; k < s.areas_m2.size(); ++k)
    json["areas_cm2"][k_deviation_states.text(static_cast<DeviationState>(k))] = 1e4 * s.areas_m2[k];
  json["extremes"] = nlohmann::ordered_json::array();
  for (const DeviationExtreme& e : report.extremes)
    json["extremes"].push_back({{"prototype_m", {e.p_prototype.x(), e.p_prototype.y(), e.p_prototype.z()}},
                                {"deviation_mm", 1e3 * e.distance_m},
                                {"stddev_mm", 1e3 * e.stddev_m},
                                {"area_mm2", 1e6 * e.area_m2}});
  json["alignment"] = json_of(report.registration);
  json["alignment"]["start"] = report.start;
  if (report.fit_box) {
    const auto& box = *report.fit_box;
    json["alignment"]["fit_box_m"] = {{box.min().x(), box.min().y(), box.min().z()},
                                      {box.max().x(), box.max().y(), box.max().z()}};
  }
  json["warnings"] = report.warnings;
  json["seconds"] = report.seconds;
  return json_text(json, 2) + "\n";
}

std::string deviation_csv(const Deviation& deviation) {
  std::string csv = "x_mm,y_mm,z_mm,nx,ny,nz,deviation_mm,stddev_mm,state\n";
  const scene::ScanSurface& cad = deviation.cad.surface;
  for (std::size_t i = 0; i < cad.positions.size(); ++i) {
    const Eigen::Vector3f p = 1e3f * cad.positions[i];
    const Eigen::Vector3f& n = cad.normals[i];
    csv +=
        fmt::format("{:.3f},{:.3f},{:.3f},{:.4f},{:.4f},{:.4f},", p.x(), p.y(), p.z(), n.x(), n.y(), n.z());
    if (deviation.has(i))
      csv += fmt::format("{:.4f},{:.4f},", 1e3f * deviation.distances_m[i], 1e3f * deviation.stddevs_m[i]);
    else
      csv += ",,";
    csv += to_text(deviation.states[i]) + "\n";
  }
  return csv;
}

std::string deviation_ply(const Deviation& deviation) {
  const scene::ScanSurface& cad = deviation.cad.surface;
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment Limn: metres, the CAD's frame; deviation and stddev are "
      "NaN "
      "where nothing was measured\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nproperty float deviation\nproperty float "
      "stddev\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar state\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      cad.positions.size(), cad.triangles.size());
  for (std::size_t i = 0; i < cad.positions.size(); ++i) {
    put_bytes(&bytes, cad.positions[i]);
    put_bytes(&bytes, cad.normals[i]);
    put_bytes(&bytes, deviation.distances_m[i]);
    put_bytes(&bytes, deviation.stddevs_m[i]);
    put_bytes(&bytes, deviation.has(i)
                          ? band_colour_rgb(deviation_band(static_cast<double>(deviation.distances_m[i]),
                                                           deviation.tolerance_m))
                          : k_not_measured_rgb);
    put_bytes(&bytes, deviation.states[i]);
  }
  for (const auto& triangle : cad.triangles) {
    put_bytes(&bytes, std::uint8_t{3});
    put_bytes(&bytes, triangle);
  }
  return bytes;
}

}  // namespace limn::calib
