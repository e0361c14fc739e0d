#include "session/recalibration_stage.h"

#include <utility>

#include "session/frame_loop.h"

namespace limn::session {
namespace {

// Wait for a device call of a recalibration.
constexpr auto k_task_wait = std::chrono::milliseconds(10);

}  // namespace

RecalibrationStage::RecalibrationStage(Perception* perception,
                                       Session* session,
                                       SessionOutput* output,
                                       CaptureDevices* devices)
    : perception_(perception), session_(session), output_(output), devices_(devices) {}

void RecalibrationStage::step(const FrameClock& clock) {
  if (!devices_) return;
  if (!recalibration_) {
    if (std::exchange(session_->recalibration().is_requested, false)) begin(clock);
    return;
  }
  if (holds_light()) recalibration_->serve(k_task_wait);
  session_->recalibration().progress = recalibration_->words();
  if (const auto checked = recalibration_->take_result()) {
    pause();
    apply_recalibration(*checked, recalibration_->folder(), clock.now(), perception_, session_);
    recalibration_.reset();
  }
  if (!holds_light()) resume();
}

void RecalibrationStage::begin(const FrameClock& clock) {
  const auto folder = recalibration_folder(output_->out());
  if (!folder) return session_->warn(clock.now(), folder.message());
  pause();
  recalibration_ = std::make_unique<LiveRecalibration>(
      session_->setup().rig, *folder, [this](ImageWriter* writer) { return devices_->backend(writer); });
}

void RecalibrationStage::pause() {
  if (!std::exchange(is_paused_, true)) devices_->pause_perception(session_);
}

void RecalibrationStage::resume() {
  if (std::exchange(is_paused_, false)) devices_->resume_perception();
}

}  // namespace limn::session
