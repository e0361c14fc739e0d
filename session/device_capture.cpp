#include "session/device_capture.h"

#include <algorithm>

namespace limn::session {
namespace {

// Wait for a frame before is_ended_ is checked again.
constexpr auto k_grab_wait = std::chrono::milliseconds(50);
constexpr double k_patience_s = 5;            // longest wait for an image
constexpr double k_longest_exposure_s = 0.1;  // assumed while a camera's period is not known

std::vector<std::string> device_names(const std::vector<Imager>& imagers) {
  std::vector<std::string> out;
  for (const Imager& imager : imagers) out.push_back(imager.name);
  return out;
}

}  // namespace

DeviceCapture::DeviceCapture(SessionDevices* devices,
                             CameraThreads* cameras,
                             PerceptionThread* perception,
                             const Rig& rig,
                             const std::atomic<bool>& is_ended)
    : devices_(devices),
      cameras_(cameras),
      perception_(perception),
      camera_names_(device_names(rig.cameras)),
      projector_names_(device_names(rig.projectors)),
      is_ended_(is_ended) {}

wizard::WizardBackend DeviceCapture::backend(ImageWriter* writer) {
  grabbed_.clear();
  latency_s_.assign(devices_->projectors.size(), wizard::FlashOptions().limit_s);
  wizard::WizardBackend backend;
  backend.capture.show = [this](int projector, const cv::Mat& image) {
    return show_pattern(static_cast<std::size_t>(projector), image);
  };
  backend.capture.grab = [this](int camera) {
    return grab(camera_names_.at(static_cast<std::size_t>(camera)));
  };
  backend.capture.store = [writer](const std::filesystem::path& path, const cv::Mat& image) {
    return writer->store(path, image);
  };
  backend.wait_for_files = [writer] { return writer->finish(); };
  backend.use_latency = [this](int projector, double seconds) {
    latency_s_.at(static_cast<std::size_t>(projector)) = seconds;
  };
  return backend;
}

void DeviceCapture::pause_perception(Session* session) {
  perception_->stop();
  for (const std::string& name : camera_names_)
    cameras_->want_images(name, tracker::DetectionSource::Images::exact);
  if (Perceived last = perception_->take_percepts({}); last.percepts)
    session->update_percepts(std::move(*last.percepts), last.moments);
}

void DeviceCapture::resume_perception() {
  for (const std::string& name : camera_names_)
    cameras_->want_images(name, tracker::DetectionSource::Images::some);
  perception_->start();
}

// Shows an image on one projector, and black on the others.
Status DeviceCapture::show_pattern(std::size_t projector, const cv::Mat& image) {
  for (std::size_t i = 0; i < devices_->projectors.size(); ++i) {
    device::Display* display = devices_->projectors[i].get();
    if (!display)
      return error("{}: expected a working projector, found none. Check its cable and its power.",
                   projector_names_[i]);
    LIMN_TRY(const Stamp shown_at,
             display->show(i == projector ? image : cv::Mat(display->size(), CV_8UC1, cv::Scalar(0))));
    // The measured latency counts from the call; the stamp contains the one that the devices file states.
    const double in_stamp_s = i < devices_->latency_s.size() ? devices_->latency_s[i] : 0;
    on_surface_at_ = std::max(on_surface_at_, shifted(shown_at, std::max(0.0, latency_s_[i] - in_stamp_s)));
  }
  return {};
}

// Returns an image whose whole exposure lies after the last pattern was shown; a stamp is the middle of an
// exposure.
Result<cv::Mat> DeviceCapture::grab(const std::string& camera) {
  const Stamp begun = now();
  for (;;) {
    auto newest = cameras_->take_output(k_grab_wait);
    if (newest) {
      newest->frames.merge(newest->images);
      for (auto& [name, frame] : newest->frames) {
        const auto [known, is_first] = grabbed_.try_emplace(name, Grabbed{{}, k_longest_exposure_s});
        if (!is_first)
          known->second.period_s = std::min(
              known->second.period_s, seconds_between(known->second.frame.captured_at, frame.captured_at));
        known->second.frame = std::move(frame);
      }
    }
    const auto found = grabbed_.find(camera);
    if (found != grabbed_.end() &&
        found->second.frame.captured_at >= shifted(on_surface_at_, found->second.period_s / 2))
      return found->second.frame.image;
    if (is_ended_) return error("the session was ended.");
    if (seconds_between(begun, now()) > k_patience_s)
      return error("{}: expected an image within {} s, found none. Check its cable.", camera, k_patience_s);
  }
}

}  // namespace limn::session
