#include "wizard/capture/virtual_capture.h"

#include <functional>
#include <optional>

#include "calib/response/response_shots.h"
#include "core/log.h"

namespace limn::wizard {
namespace {

std::vector<calib::CapturedDevice> devices(const std::vector<Imager>& imagers) {
  std::vector<calib::CapturedDevice> devices;
  for (const Imager& imager : imagers)
    devices.push_back({imager.name, imager.width, imager.height, imager.sees});
  return devices;
}

// Captures `pose_count` poses; before each, `set_up` arranges the world.
Status capture_poses(const calib::CaptureSet& captures,
                     int pose_count,
                     const std::function<void(int)>& set_up,
                     sim::VirtualRig* rig) {
  ImageWriter writer;
  int done_before = 0;
  std::optional<Progress> progress;
  const calib::CaptureBackend capture = capture_backend(rig, &writer, [&](int done, int total) {
    if (!progress) progress.emplace("capture", total * pose_count);
    progress->step(done_before + done);
    if (done == total) done_before += total;
  });
  for (int pose = 0; pose < pose_count; ++pose) {
    set_up(pose);
    LIMN_TRY_STATUS(calib::capture_pose(captures, pose, capture));
  }
  rig->darken();
  return writer.finish();
}

}  // namespace

Result<calib::CaptureSet> plan_virtual_captures(const Plan& plan,
                                                const sim::VirtualRig& rig,
                                                const std::filesystem::path& out) {
  calib::CaptureSet captures =
      calib::plan_captures(out, devices(rig.world().rig.cameras), devices(rig.world().rig.projectors),
                           plan.board, plan.code, plan.code_options);
  captures.board_measured = plan.board_measured;
  if (plan.responses.empty()) return captures;
  for (std::size_t i = 0; i < captures.patterns.size(); ++i) {
    LIMN_TRY(captures.patterns[i],
             calib::linearised(captures.patterns[i], plan.responses, captures.projectors[i].name));
  }
  return captures;
}

calib::CaptureBackend capture_backend(sim::VirtualRig* rig,
                                      ImageWriter* writer,
                                      calib::ReportProgress report_progress) {
  return {.show = [rig](int projector, const cv::Mat& image) -> Status {
            rig->darken();
            const auto shown_at = rig->projector(projector).show(image);
            return shown_at ? Status() : Status(shown_at.error());
          },
          .grab = [rig](int camera) -> Result<cv::Mat> {
            LIMN_TRY(const Frame frame, rig->camera(camera).next());
            return frame.image;
          },
          .store = [writer](const std::filesystem::path& path,
                            const cv::Mat& image) { return writer->store(path, image); },
          .report_progress = std::move(report_progress)};
}

Status capture_response_images(const calib::CaptureSet& captures, sim::VirtualRig* rig) {
  ImageWriter writer;
  std::optional<Progress> progress;
  const calib::CaptureBackend capture = capture_backend(rig, &writer, [&](int done, int total) {
    if (!progress) progress.emplace("response", total);
    progress->step(done);
  });
  LIMN_TRY_STATUS(calib::capture_response(captures, capture));
  rig->darken();
  return writer.finish();
}

sim::Object board_object(const calib::Board& board, const Pose& world_from_board) {
  const calib::BoardSheet drawn = calib::draw_board(board);
  const double metres_per_px = 1 / drawn.pixels_per_metre;
  const Eigen::Vector2d px_centre((drawn.image.cols - 1) / 2.0, (drawn.image.rows - 1) / 2.0);
  const Eigen::Vector2d p_centre = (px_centre - drawn.px_board_origin) * metres_per_px;
  const Pose board_from_sheet(Eigen::Quaterniond::Identity(), {p_centre.x(), p_centre.y(), 0});
  return sim::sheet("board", drawn.image.cols * metres_per_px, drawn.image.rows * metres_per_px, drawn.image,
                    world_from_board * board_from_sheet);
}

Status capture_virtually(const Plan& plan, sim::VirtualRig* rig, const std::filesystem::path& out) {
  LIMN_TRY(const calib::CaptureSet captures, plan_virtual_captures(plan, *rig, out));
  LIMN_TRY_STATUS(calib::begin_captures(captures));
  rig->remove_prototype();
  const auto hold_board = [&](int pose) {
    rig->place(board_object(plan.board, plan.world_from_board[static_cast<std::size_t>(pose)]));
  };
  const Status done =
      capture_poses(captures, static_cast<int>(plan.world_from_board.size()), hold_board, rig);
  rig->remove("board");
  rig->restore_prototype();
  return done && plan.response ? capture_response_images(captures, rig) : done;
}

Status capture_prototype(const Plan& plan,
                         const std::vector<Pose>& world_from_prototype,
                         sim::VirtualRig* rig,
                         const std::filesystem::path& out) {
  LIMN_TRY(const calib::CaptureSet captures, plan_virtual_captures(plan, *rig, out));
  LIMN_TRY_STATUS(calib::begin_captures(captures));
  const Pose home = rig->world().world_from_prototype;
  const auto stand = [&](int pose) {
    rig->move("prototype", world_from_prototype[static_cast<std::size_t>(pose)]);
  };
  const Status done = capture_poses(captures, static_cast<int>(world_from_prototype.size()), stand, rig);
  rig->move("prototype", home);
  return done;
}

}  // namespace limn::wizard
