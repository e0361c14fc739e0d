#include "exchange/mpcdi_report.h"

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace limn::exchange {
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
  ordered_json json = {{"size", size_of(map.image)},
                       {"bits", map.image.depth() == CV_16U ? 16 : 8},
                       {"channels", map.image.channels()}};
  if (is_alpha) json["gamma_embedded"] = map.gamma_embedded;
  double least = 0, most = 0;
  cv::minMaxIdx(map.image.reshape(1), &least, &most);
  const double full = map.image.depth() == CV_16U ? 65535 : 255;
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

}  // namespace

nlohmann::ordered_json mpcdi_report(const Mpcdi& mpcdi) {
  nlohmann::ordered_json json = {{"schema", "limn.import/1"},
                                 {"profile", k_mpcdi_profiles.text(mpcdi.profile)},
                                 {"version", mpcdi.version},
                                 {"made_by", mpcdi.made_by},
                                 {"date", mpcdi.date},
                                 {"remarks", mpcdi.remarks},
                                 {"regions", nlohmann::ordered_json::array()}};
  for (const MpcdiRegion& region : mpcdi.regions)
    json["regions"].push_back(report_of(region, holds_points(mpcdi.profile)));
  return json;
}

}  // namespace limn::exchange
