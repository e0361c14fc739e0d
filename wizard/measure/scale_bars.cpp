#include "wizard/measure/scale_bars.h"

#include <algorithm>
#include <charconv>
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

bool is_on_board(const calib::Board& board, const MarkerName& marker) {
  const bool is_grid = board.kind == calib::BoardKind::aprilgrid;
  if (marker.family != (is_grid ? "apriltag_36h11" : board.dictionary)) return false;
  int id = 0;
  const auto read = std::from_chars(marker.id.data(), marker.id.data() + marker.id.size(), id);
  return read.ec == std::errc() && id < board.columns * board.rows;
}

// The markers in the images of one pose of one camera.
Status add_marks(const calib::CaptureSet& captures,
                 size_t pose,
                 size_t camera,
                 const Lens* lens,
                 tracker::Detector* detector,
                 std::vector<calib::DetectedMark>* marks) {
  std::set<std::string> found;
  for (size_t projector = 0; projector < captures.projectors.size(); ++projector) {
    const auto& files = captures.poses[pose].images[projector][camera];
    const calib::CapturedDevice& device = captures.cameras[camera];
    LIMN_TRY(const cv::Mat white,
             calib::read_shot(files[static_cast<size_t>(captures.patterns[projector].white())], device.width,
                              device.height));
    for (const tracker::Detection& detection : detector->detect(white, lens)) {
      if (!is_on_board(captures.board, detection.marker) && found.insert(detection.marker.text()).second)
        marks->push_back(mark_of(detection, static_cast<int>(camera), static_cast<int>(pose)));
    }
  }
  return {};
}

}  // namespace

Result<std::vector<calib::DetectedMark>> marks_of(const calib::CaptureSet& captures,
                                                  const std::vector<std::string>& families,
                                                  const Rig* rig) {
  LIMN_TRY(tracker::Families loaded, tracker::Families::load(families, captures.folder));
  tracker::Detector detector(std::move(loaded));
  std::vector<calib::DetectedMark> marks;
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera)
      LIMN_TRY_STATUS(
          add_marks(captures, pose, camera, rig ? &rig->cameras[camera].lens : nullptr, &detector, &marks));
  }
  return marks;
}

std::vector<std::string> families_of(const std::vector<calib::ScaleBar>& lengths) {
  std::set<std::string> families;
  for (const calib::ScaleBar& known : lengths) {
    for (const std::string& name : {known.from, known.to}) {
      if (const auto marker = MarkerName::parse(name)) families.insert(marker->family);
    }
  }
  return {families.begin(), families.end()};
}

Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths) {
  std::set<std::string> wanted;
  for (const calib::ScaleBar& known : lengths) {
    for (const std::string& name : {known.from, known.to}) {
      LIMN_TRY([[maybe_unused]] const MarkerName marker, MarkerName::parse(name));
      wanted.insert(name);
    }
  }
  LIMN_TRY(auto marks, marks_of(captures, families_of(lengths), &rig));
  std::erase_if(marks, [&](const calib::DetectedMark& mark) { return !wanted.contains(mark.name); });
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
