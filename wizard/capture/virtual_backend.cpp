#include "wizard/capture/virtual_backend.h"

#include <algorithm>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>

#include "calib/board/board_finder.h"
#include "core/image_io.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::wizard {
namespace {

constexpr double k_guard_s = 0.001;  // added to a measured latency

// A virtual rig's devices and the latencies measured so far.
struct VirtualBackend {
  sim::VirtualRig* rig = nullptr;
  std::vector<double> latency_s;  // latency of each projector
  std::vector<cv::Mat> frames;    // one exposure of all cameras; an image is empty once grabbed
  Stamp lit_at;                   // when the image shown last is on the surface

  Status show(int projector, const cv::Mat& image) {
    rig->darken();
    lit_at = shifted(rig->now(), latency_s.at(static_cast<std::size_t>(projector)) + k_guard_s);
    frames.assign(frames.size(), cv::Mat());
    const auto shown = rig->projector(projector).show(image);
    return shown ? Status() : Status(shown.error());
  }

  cv::Mat grab(int camera) {
    cv::Mat& wanted = frames.at(static_cast<std::size_t>(camera));
    if (wanted.empty()) {
      rig->advance(std::max(0.0, seconds_between(rig->now(), lit_at)));
      std::vector<int> all;
      for (int i = 0; i < static_cast<int>(frames.size()); ++i) all.push_back(i);
      std::size_t i = 0;
      for (Frame& frame : rig->expose(all)) frames[i++] = std::move(frame.image);
    }
    return std::exchange(wanted, cv::Mat());
  }

  // Gives `on_image` every camera's image of the board in white light.
  Status report_board_images(const calib::Board& board, const WizardBackend::OnImage& on_image) {
    LIMN_TRY_STATUS(show(0, cv::Mat(rig->projector(0).size(), CV_8UC1, cv::Scalar(255))));
    for (int i = 0; i < static_cast<int>(frames.size()); ++i) {
      const cv::Mat image = grab(i);
      on_image(i, image, calib::find_board(board, to_grey(image)));
    }
    return {};
  }

  // Removes the board and puts the prototype back where the world has it.
  Result<bool> wait_for_prototype(const WizardBackend::OnImage& on_image) {
    rig->remove("board");
    rig->restore_prototype();
    LIMN_TRY_STATUS(show(0, cv::Mat(rig->projector(0).size(), CV_8UC1, cv::Scalar(255))));
    for (int i = 0; on_image && i < static_cast<int>(frames.size()); ++i) on_image(i, grab(i), {});
    return true;
  }

  Status show_all(const std::vector<cv::Mat>& images) {
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto shown = rig->projector(static_cast<int>(i)).show(images[i]);
      if (!shown) return shown.error();
      lit_at = std::max(lit_at, shifted(rig->now(), latency_s.at(i) + k_guard_s));
    }
    frames.assign(frames.size(), cv::Mat());
    return {};
  }

  FlashDevices flashes(int projector, int camera) {
    rig->darken();
    const auto show = [r = rig, projector](bool white) -> Result<Stamp> {
      const Stamp at = r->now();
      const cv::Mat image(r->projector(projector).size(), CV_8UC1, cv::Scalar(white ? 255 : 0));
      LIMN_TRY([[maybe_unused]] const Stamp shown_at, r->projector(projector).show(image));
      return at;
    };
    return {.show = show,
            .next = [r = rig, camera] { return r->camera(camera).next(); },
            .wait = [r = rig](double seconds) { r->advance(seconds); }};
  }
};

}  // namespace

WizardBackend virtual_backend(const Plan& plan, sim::VirtualRig* rig, ImageWriter* writer) {
  const auto backend = std::make_shared<VirtualBackend>();
  backend->rig = rig;
  backend->latency_s.resize(rig->world().rig.projectors.size(), FlashOptions().limit_s);
  backend->frames.resize(rig->world().rig.cameras.size());
  return {
      .wait_for_board = [&plan, backend](int pose, const WizardBackend::OnImage& on_image) -> Status {
        const Pose& place = plan.world_from_board[static_cast<std::size_t>(pose)];
        backend->rig->place(board_object(plan.board, place));
        return on_image ? backend->report_board_images(plan.board, on_image) : Status();
      },
      .capture = {.show = [backend](int p, const cv::Mat& image) { return backend->show(p, image); },
                  .grab = [backend](int camera) -> Result<cv::Mat> { return backend->grab(camera); },
                  .store = [writer](const std::filesystem::path& path,
                                    const cv::Mat& image) { return writer->store(path, image); }},
      .wait_for_files = [writer] { return writer->finish(); },
      .now = [rig] { return rig->now(); },
      .wait_for_prototype =
          rig->world().scene && rig->world().scene->prototype
              ? [backend](
                    const WizardBackend::OnImage& on_image) { return backend->wait_for_prototype(on_image); }
              : std::function<Result<bool>(const WizardBackend::OnImage&)>(),
      .show_all = [backend](const std::vector<cv::Mat>& images) { return backend->show_all(images); },
      .flashes = [backend](int projector, int camera) { return backend->flashes(projector, camera); },
      .use_latency =
          [backend](int projector, double seconds) {
            backend->latency_s.at(static_cast<std::size_t>(projector)) = seconds;
          }};
}

}  // namespace limn::wizard
