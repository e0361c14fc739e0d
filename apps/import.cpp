#include "apps/import.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "apps/exchange/mpcdi_reader.h"
#include "core/config.h"
#include "core/log.h"
#include "core/rig.h"

namespace limn::apps {
namespace {

using nlohmann::ordered_json;

ordered_json size_of(const cv::Mat& map) { return {map.cols, map.rows}; }

ordered_json report_of(const cv::Mat& warp, bool has_points) {
  int known = 0;
  Eigen::AlignedBox3d box;
  for (auto p = warp.begin<cv::Vec3f>(); p != warp.end<cv::Vec3f>(); ++p) {
    if (!std::isfinite((*p)[0])) continue;
    ++known;
    box.extend(Eigen::Vector3d((*p)[0], (*p)[1], (*p)[2]));
  }
  ordered_json json = {{"size", size_of(warp)}, {"known_share", known / static_cast<double>(warp.total())}};
  const auto corner = [](const Eigen::Vector3d& p) { return ordered_json{p.x(), p.y(), p.z()}; };
  if (has_points) json["box_m"] = {corner(box.min()), corner(box.max())};
  return json;
}

ordered_json report_of(const MpcdiBlendMap& map, bool is_alpha) {
  ordered_json json = {{"size", size_of(map.picture)},
                       {"bits", map.picture.depth() == CV_16U ? 16 : 8},
                       {"channels", map.picture.channels()}};
  if (is_alpha) json["gamma_embedded"] = map.gamma_embedded;
  double least = 0, most = 0;
  cv::minMaxIdx(map.picture.reshape(1), &least, &most);
  const double full = map.picture.depth() == CV_16U ? 65535 : 255;
  json["range"] = {least / full, most / full};
  return json;
}

ordered_json report_of(const MpcdiRegion& region, bool has_points) {
  ordered_json json = {{"id", region.id}, {"size", {region.width, region.height}}};
  if (region.frustum) {
    const MpcdiFrustum& f = *region.frustum;
    json["frustum_deg"] = {{"yaw", f.yaw},     {"pitch", f.pitch}, {"roll", f.roll}, {"left", f.left},
                           {"right", f.right}, {"up", f.up},       {"down", f.down}};
  }
  if (region.frame)
    json["eye_m"] = {region.frame->p_eye.x(), region.frame->p_eye.y(), region.frame->p_eye.z()};
  if (!region.warp.empty()) json["warp"] = report_of(region.warp, has_points);
  if (region.alpha) json["alpha"] = report_of(*region.alpha, true);
  if (region.beta) json["beta"] = report_of(*region.beta, false);
  if (!region.distortion.empty()) json["distortion"] = report_of(region.distortion, false);
  if (region.lens) json["lens"] = region.lens->model.name();
  return json;
}

ordered_json report_of(const Mpcdi& mpcdi) {
  ordered_json json = {
      {"schema", "limn.import/1"},       {"profile", mpcdi.profile}, {"version", mpcdi.version},
      {"made_by", mpcdi.made_by},        {"date", mpcdi.date},       {"remarks", mpcdi.remarks},
      {"regions", ordered_json::array()}};
  const bool has_points = mpcdi.profile == "a3" || mpcdi.profile == "sl";
  for (const MpcdiRegion& region : mpcdi.regions) json["regions"].push_back(report_of(region, has_points));
  return json;
}

std::string sentence_of(const ordered_json& region) {
  std::string text = fmt::format("{}: {}x{}", region["id"].get<std::string>(), region["size"][0].get<int>(),
                                 region["size"][1].get<int>());
  const auto size = [](const ordered_json& map) {
    return fmt::format("{}x{}", map["size"][0].get<int>(), map["size"][1].get<int>());
  };
  if (region.contains("eye_m"))
    text += fmt::format(", at ({:.3f}, {:.3f}, {:.3f}) m", region["eye_m"][0].get<double>(),
                        region["eye_m"][1].get<double>(), region["eye_m"][2].get<double>());
  if (region.contains("warp"))
    text += fmt::format(", warp {} ({:.1f} % known)", size(region["warp"]),
                        100 * region["warp"]["known_share"].get<double>());
  for (const char* name : {"alpha", "beta"}) {
    if (!region.contains(name)) continue;
    const auto& map = region[name];
    text += fmt::format(", {} {} bits ({:.3f} … {:.3f})", name, map["bits"].get<int>(),
                        map["range"][0].get<double>(), map["range"][1].get<double>());
  }
  if (region.contains("distortion")) text += ", distortion " + size(region["distortion"]);
  return text;
}

// A name for a device, and so for its file, that the rig does not have yet.
std::string name_of(std::string id, const Rig& rig) {
  std::replace_if(
      id.begin(), id.end(), [](char c) { return c == '/' || static_cast<unsigned char>(c) < ' '; }, '_');
  while (rig.find(id)) id += '_';
  return id;
}

// The projectors that a pinhole, or a lens of Limn's, describes.
Result<Rig> rig_of(const Mpcdi& mpcdi, const std::string& file) {
  Rig rig;
  for (const MpcdiRegion& region : mpcdi.regions) {
    if (auto imager = imager_of(region)) {
      imager->name = name_of(region.id, rig);
      rig.projectors.push_back(*imager);
      if (!region.lens && !region.distortion.empty())
        log_warning("import: {}: its distortion map is left out; the rig has the frustum's pinhole",
                    region.id);
    } else {
      log_warning("import: {}: left out of the rig", region.id);
    }
  }
  if (!rig.projectors.empty()) return rig;
  return error(
      "{}: expected a region with a frustum, a coordinateFrame and a plain lens for --out, found none.",
      file);
}

}  // namespace

Status run_import(const ImportOptions& options) {
  LIMN_TRY(const Mpcdi mpcdi, read_mpcdi(options.file));
  if (!options.out.empty()) {
    LIMN_TRY(const Rig rig, rig_of(mpcdi, options.file.string()));
    LIMN_TRY_STATUS(save_rig(rig, options.out));
  }
  for (const std::string& remark : mpcdi.remarks) log_warning("import: {}", remark);
  const ordered_json report = report_of(mpcdi);
  if (options.json) {
    fmt::print("{}\n", report.dump(2));
    return {};
  }
  fmt::print("MPCDI {}, profile {}, {} region{}{}\n", mpcdi.version, mpcdi.profile, mpcdi.regions.size(),
             mpcdi.regions.size() == 1 ? "" : "s", mpcdi.made_by.empty() ? "" : ", made by " + mpcdi.made_by);
  for (const auto& region : report["regions"]) fmt::print("{}\n", sentence_of(region));
  return {};
}

}  // namespace limn::apps
