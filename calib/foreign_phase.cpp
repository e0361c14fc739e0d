#include "calib/foreign_phase.h"

#include <memory>
#include <optional>

#include "calib/shot_files.h"
#include "calib/temporary_folder.h"
#include "core/image_io.h"
#include "core/parallel.h"

namespace limn::calib {
namespace {

// The description for this number of images: with white and black, or without.
std::optional<PhaseSeries> series_of_count(const ForeignPhaseCaptures& foreign, int count) {
  PhaseSeries series = foreign.series;
  for (const WhitePlace white : {WhitePlace::absent, foreign.series.white}) {
    series.white = white;
    if (series.count(foreign.projector_width, foreign.projector_height) == count) return series;
  }
  return std::nullopt;
}

Result<PhaseSeries> series_in(const ForeignPhaseCaptures& foreign, const ShotFiles& shots) {
  const size_t usual = shots.poses[0].files[0].size();
  for (const ShotPose& pose : shots.poses) {
    for (const auto& files : pose.files) {
      if (files.size() != usual)
        return error(
            "{}: expected {} images '{}', as in the first pose, found {}. Leave it out with --skip-poses.",
            (foreign.folder / pose.name).string(), usual, foreign.shots, files.size());
    }
  }
  if (auto series = series_of_count(foreign, static_cast<int>(usual))) return *series;
  PhaseSeries plain = foreign.series;
  plain.white = WhitePlace::absent;
  const int expected = plain.count(foreign.projector_width, foreign.projector_height);
  return error(
      "{}: expected {} images as --steps, --periods and --cue describe, or {} with white and black, found "
      "{}. Check "
      "them, --projector and --shots.",
      (foreign.folder / shots.poses[0].name).string(), expected, expected + 2, usual);
}

}  // namespace

Result<CaptureSet> import_phase(const ForeignPhaseCaptures& foreign) {
  const int width = foreign.projector_width, height = foreign.projector_height;
  LIMN_TRY_STATUS(check(foreign.series, width, height));
  LIMN_TRY(const Patterns whole, Patterns::create(PatternCode::gray, width, height));  // checks the size
  LIMN_TRY(const ShotFiles shots,
           find_shots({foreign.folder, foreign.poses, foreign.shots, foreign.skip},
                      [&](int count) { return series_of_count(foreign, count).has_value(); }));
  LIMN_TRY(const PhaseSeries series, series_in(foreign, shots));
  LIMN_TRY(TemporaryFolder made, TemporaryFolder::create());
  const auto folder = std::make_shared<const TemporaryFolder>(std::move(made));
  CaptureSet captures{foreign.folder, {}, {{"projector0", whole.width, whole.height}}, {}, foreign.board, {}};
  captures.patterns.push_back(recoded_patterns(width, height));
  captures.made_images = folder;
  for (size_t i = 0; i < shots.cameras.size(); ++i) {
    LIMN_TRY(const cv::Mat first, read_image(shots.poses[0].files[i][0]));
    captures.cameras.push_back({shots.cameras[i], first.cols, first.rows});
  }
  for (const ShotPose& pose : shots.poses) {
    captures.poses.push_back({pose.name, {}});
    captures.poses.back().images.emplace_back(shots.cameras.size());
  }
  const int cameras = static_cast<int>(shots.cameras.size());
  const int count = static_cast<int>(shots.poses.size()) * cameras;
  std::vector<Status> results(static_cast<size_t>(count));
  parallel_for(count, [&](int i) {
    const auto pose = static_cast<size_t>(i / cameras), camera = static_cast<size_t>(i % cameras);
    auto files = recoded(series, shots.poses[pose].files[camera], width, height,
                         folder->path() / shots.poses[pose].name / shots.cameras[camera]);
    if (files)
      captures.poses[pose].images[0][camera] = *std::move(files);
    else
      results[static_cast<size_t>(i)] = files.error();
  });
  for (const Status& result : results) LIMN_TRY_STATUS(result);
  return captures;
}

}  // namespace limn::calib
