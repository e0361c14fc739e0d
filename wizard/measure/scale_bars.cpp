#include "wizard/measure/scale_bars.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/code/decode.h"
#include "core/marker.h"
#include "tracker/detector.h"

namespace limn::wizard {
namespace {

calib::DetectedMark mark_of(const tracker::Detection& detection, int camera, int pose) {
  calib::DetectedMark mark{camera, pose, detection.marker.text(), detection.corners_px, 0};
  double variance = 0;
  for (const Eigen::Matrix2d& covariance : detection.corner_covariance) variance += covariance.trace() / 8;
  mark.stddev_px = std::sqrt(variance);
  return mark;
}

}  // namespace

Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths) {
  std::set<std::string> wanted, family_set;
  for (const calib::ScaleBar& known : lengths) {
    for (const std::string& name : {known.from, known.to}) {
      LIMN_TRY(const MarkerName marker, MarkerName::parse(name));
      wanted.insert(name);
      family_set.insert(marker.family);
    }
  }
  const std::vector<std::string> names(family_set.begin(), family_set.end());
  LIMN_TRY(tracker::Families families, tracker::Families::load(names, captures.folder));
  tracker::Detector detector(std::move(families));
  std::vector<calib::DetectedMark> marks;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      std::set<std::string> found;
      for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
        const auto& files = captures.poses[pose].images[projector][camera];
        const calib::CapturedDevice& device = captures.cameras[camera];
        LIMN_TRY(const cv::Mat white,
                 calib::read_shot(files[static_cast<size_t>(captures.patterns[projector].white())],
                                  device.width, device.height));
        for (const tracker::Detection& detection : detector.detect(white, &rig.cameras[camera].lens)) {
          const std::string name = detection.marker.text();
          if (wanted.contains(name) && found.insert(name).second)
            marks.push_back(mark_of(detection, static_cast<int>(camera), static_cast<int>(pose)));
        }
      }
    }
  }
  return marks;
}

Result<std::vector<calib::ScaleBar>> scale_bar_lengths(const calib::CaptureSet& captures,
                                                       const std::vector<std::string>& options) {
  std::vector<calib::ScaleBar> lengths;
  for (const std::string& text : captures.scale_bar_lengths) {
    auto known = calib::parse_scale_bar(text);
    if (!known) return error("{}: {}", (captures.folder / "capture.json").string(), known.message());
    lengths.push_back(*known);
  }
  for (const std::string& text : options) {
    auto known = calib::parse_scale_bar(text);
    if (!known) return usage_error("--known-length: {}", known.message());
    lengths.push_back(*known);
  }
  return lengths;
}

}  // namespace limn::wizard
