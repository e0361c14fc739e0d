#include "wizard/window/wizard_window.h"

#include <chrono>
#include <future>
#include <mutex>
#include <thread>

#include "calib/board/board_finder.h"
#include "wizard/window/wizard_panel.h"
#include "wizard/window/wizard_view.h"

namespace limn::wizard {
namespace {

using State = WizardState;

constexpr auto k_pause = std::chrono::milliseconds(2);  // maximum wait for the executor

// The state that the worker thread and the window share.
class Progress {
 public:
  Progress(const WizardPlan& plan, std::atomic<WizardWish>* wish)
      : plan_(plan), targets_(plan.targets), wish_(wish) {
    step(WizardStep::devices) = {State::done, plan.devices};
    view_.board = plan.captures.board;
    view_.asks_for_size = !plan.captures.board_measured && !plan.captures.board.is_exact;
    for (const calib::CapturedDevice& camera : plan.captures.cameras)
      view_.cameras.push_back({.name = camera.name, .width = camera.width, .height = camera.height});
    for (const calib::CapturedDevice& projector : plan.captures.projectors)
      view_.projectors.push_back({projector.name, projector.width, projector.height, {}});
    view_.poses = static_cast<int>(plan.places.size());
  }

  WizardView view() const {
    const std::lock_guard lock(mutex_);
    return view_;
  }

  void wish(WizardWish wish) {
    *wish_ = wish;
    if (wish != WizardWish::leave) return;
    const std::lock_guard lock(mutex_);
    view_.is_leaving = true;
  }

  WizardListener listener(const std::function<void(const std::string&)>& say) {
    return {.say = say,
            .step =
                [this](WizardStep which, State state, const std::string& words) {
                  const std::lock_guard lock(mutex_);
                  const bool is_pose = which == WizardStep::board;
                  step(which) = {state,
                                 is_pose ? fmt::format("pose {} of {}", view_.pose + 1, view_.poses) : words};
                  view_.is_capturing &= which != WizardStep::solve;
                },
            .on_light =
                [this](const std::vector<ExposureReading>& light) {
                  const std::lock_guard lock(mutex_);
                  view_.light = light;
                },
            .pose_begins = [this](int pose) { pose_begins(pose); },
            .solved = [this](const calib::Report& report) { solved(report, view_.judged.size()); },
            .judging_begins = [this](int pose) { judging_begins(pose); },
            .judged =
                [this](const PoseJudged& judged, const calib::Observations& observations,
                       const std::vector<calib::Fault>& faults) {
                  add_judged_pose(judged, observations, faults);
                },
            .board_measured =
                [this] {
                  const std::lock_guard lock(mutex_);
                  return board_measured_;
                },
            .wish = wish_};
  }

  void take_board_size(const std::string& text) {
    const std::lock_guard lock(mutex_);
    board_measured_ = text;
  }

  // The rig has been solved.
  void solved(const calib::Report& report, std::size_t poses) {
    const std::lock_guard lock(mutex_);
    view_.is_capturing = false;
    view_.has_rig = true;
    for (std::size_t i = 0; i <= static_cast<std::size_t>(WizardStep::result); ++i) {
      if (view_.steps[i].state == State::waits) view_.steps[i].words = "done by an earlier run";
      if (view_.steps[i].state != State::fails) view_.steps[i].state = State::done;
    }
    step(WizardStep::board).words = fmt::format("{} poses", poses);
    step(WizardStep::solve).words = fmt::format("held-out {:.3f} px", report.assessment.held_out.rms_px);
    step(WizardStep::result).words = calib::to_text(report.assessment.verdict);
    view_.worth = report.assessment.verdict;
    view_.verdict = report.explanation.verdict;
    view_.faults = report.assessment.faults;
    view_.to_do = report.explanation.advice;
    view_.maps = report.assessment.error_maps;
    view_.advice.clear();
  }

  // The same backend; its images are copied into the view.
  WizardBackend with_live_view(WizardBackend backend) {
    const auto grab = backend.capture.grab;
    backend.capture.grab = [this, grab](int camera) -> Result<cv::Mat> {
      LIMN_TRY(const cv::Mat image, grab(camera));
      const std::lock_guard lock(mutex_);
      view_.cameras[static_cast<std::size_t>(camera)].image = image;
      return image;
    };
    backend.capture.report_progress = [this](int done, int total) {
      const std::lock_guard lock(mutex_);
      view_.images = done;
      view_.images_of = total;
    };
    backend.flashes = [this, flashes = backend.flashes](int projector, int camera) {
      FlashDevices flash = flashes(projector, camera);
      flash.next = [this, next = flash.next, camera]() -> Result<Frame> {
        LIMN_TRY(Frame frame, next());
        const std::lock_guard lock(mutex_);
        view_.cameras[static_cast<std::size_t>(camera)].image = frame.image;
        return frame;
      };
      return flash;
    };
    const WizardBackend::OnImage on_image = [this](int camera, const cv::Mat& image,
                                                   const std::vector<calib::BoardCorner>& corners) {
      const std::lock_guard lock(mutex_);
      WizardView::Camera& shown = view_.cameras.at(static_cast<std::size_t>(camera));
      shown.image = image;
      shown.corners.clear();
      for (const calib::BoardCorner& corner : corners) shown.corners.push_back(corner.px);
    };
    backend.wait_for_board = [wait = backend.wait_for_board, on_image](
                                 int pose, const WizardBackend::OnImage&) { return wait(pose, on_image); };
    if (backend.wait_for_prototype)
      backend.wait_for_prototype = [this, wait = backend.wait_for_prototype,
                                    on_image](const WizardBackend::OnImage&) {
        await_prototype(true);
        auto stands = wait(on_image);
        await_prototype(false);
        return stands;
      };
    return backend;
  }

  void end(const Result<Calibrated>& done) {
    const std::lock_guard lock(mutex_);
    view_.is_over = true;
    view_.is_capturing = false;
    if (!done) {
      for (WizardView::Step& step : view_.steps)
        if (step.state == State::runs) step.state = State::fails;
      view_.failure = done.message();
      return;
    }
    if (!done->no_prototype.empty())
      for (WizardView::Step& step : view_.steps)
        if (step.state == State::runs) step = {State::fails, done->no_prototype};
  }

 private:
  void await_prototype(bool awaits) {
    const std::lock_guard lock(mutex_);
    view_.awaits_prototype = awaits;
    view_.images = view_.images_of = 0;
    for (WizardView::Camera& camera : view_.cameras) {
      camera.target.clear();
      camera.corners.clear();
    }
  }

  void pose_begins(int pose) {
    const std::lock_guard lock(mutex_);
    const auto at = static_cast<std::size_t>(pose);
    view_.pose = pose;
    view_.place = plan_.places[at];
    view_.is_capturing = true;
    view_.images = 0;
    for (std::size_t i = 0; i < view_.cameras.size(); ++i) {
      view_.cameras[i].target = targets_[at][i];
      view_.cameras[i].corners.clear();
    }
  }

  void judging_begins(int pose) {
    const std::lock_guard lock(mutex_);
    view_.pose = pose;
    view_.place = plan_.places[static_cast<std::size_t>(pose)];
    view_.is_capturing = false;
  }

  void add_judged_pose(const PoseJudged& judged,
                       const calib::Observations& observations,
                       const std::vector<calib::Fault>& faults) {
    const std::lock_guard lock(mutex_);
    WizardView::Judged row{judged.pose, std::nullopt, std::nullopt};
    if (judged.assessment) {
      row.held_out_px = judged.assessment->held_out.rms_px;
      row.predicted_mm = predicted_mm(*judged.assessment);
    }
    view_.judged.push_back(row);
    if (judged.rig && plan_.targets_by) targets_ = plan_.targets_by(*judged.rig);
    view_.advice = !judged.assessment          ? "No rig yet: " + judged.unsolved
                   : judged.more_helps.empty() ? "These poses are enough."
                                               : "More poses help: " + judged.more_helps + ".";
    view_.faults = faults;
    std::vector<std::vector<Eigen::Vector2d>> cameras(view_.cameras.size()),
        projectors(view_.projectors.size());
    for (const calib::CornerObservation& corner : observations.corners)
      cameras[static_cast<std::size_t>(corner.camera)].push_back(corner.px);
    for (const calib::Match& match : observations.matches)
      projectors[static_cast<std::size_t>(match.projector)].push_back(match.px_projector);
    for (std::size_t i = 0; i < cameras.size(); ++i)
      view_.cameras[i].seen = cells_of(cameras[i], view_.cameras[i].width, view_.cameras[i].height);
    for (std::size_t i = 0; i < projectors.size(); ++i)
      view_.projectors[i].seen =
          cells_of(projectors[i], view_.projectors[i].width, view_.projectors[i].height);
  }

  WizardView::Step& step(WizardStep which) { return view_.steps.at(static_cast<std::size_t>(which)); }

  const WizardPlan& plan_;
  std::vector<std::vector<std::vector<Eigen::Vector2d>>> targets_;  // those known so far
  mutable std::mutex mutex_;
  WizardView view_;
  std::string board_measured_;
  std::atomic<WizardWish>* wish_;
};

}  // namespace

Result<Calibrated> calibrate_in_window(gui::GuiWindow* window,
                                       const WizardPlan& plan,
                                       const WizardBackend& backend,
                                       const std::function<void(const std::string&)>& say,
                                       std::atomic<WizardWish>* wish,
                                       MainThreadExecutor* executor,
                                       const WizardWork& work) {
  Progress progress(plan, wish);
  auto running = std::async(std::launch::async, [&]() -> Result<Calibrated> {
    try {
      Result<Calibrated> done = work(progress.with_live_view(backend), progress.listener(say));
      progress.end(done);
      return done;
    } catch (const std::exception& bug) {
      progress.end(error("this is a bug in Limn, please report it: {}", bug.what()));
      throw;
    }
  });
  BoardSizeInput size;
  for (bool is_closed = false; !is_closed;) {
    executor->serve();
    window->pressed_keys();
    if (!window->is_due()) {
      std::this_thread::sleep_for(k_pause);
      continue;
    }
    const WizardView view = progress.view();
    WizardWish asked = WizardWish::none;
    window->draw([&](gui::Gui& gui) { asked = draw_wizard(gui, view, &size); });
    progress.take_board_size(size.taken);
    if (!window->is_wanted()) asked = WizardWish::leave;
    is_closed = asked == WizardWish::leave && (view.is_over || !window->is_wanted());
    if (asked != WizardWish::none && !view.is_over) progress.wish(asked);
  }
  while (running.wait_for(k_pause) != std::future_status::ready) executor->serve();
  return running.get();
}

}  // namespace limn::wizard
