#include "wizard/capture/device_backend.h"

#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>
#include <thread>

#include "core/image_io.h"

namespace limn::wizard {
namespace {

constexpr double k_patience_s = 10;  // maximum wait for a camera's frame
constexpr double k_retry_s = 0.1;

cv::Mat level(const device::Display& display, int value) {
  return cv::Mat(display.size(), CV_8UC1, cv::Scalar(value));
}

}  // namespace

DeviceBackend::DeviceBackend(Devices devices, const calib::Board& board, std::atomic<WizardWish>* wish)
    : devices_(std::move(devices)),
      board_(board),
      wish_(wish),
      latency_s_(devices_.projectors.size(), FlashOptions().limit_s),
      is_black_(devices_.projectors.size(), false),
      boards_(devices_.cameras.size()),
      captured_at_(devices_.cameras.size()),
      period_s_(devices_.cameras.size(), 0) {}

WizardBackend DeviceBackend::backend(ImageWriter* writer) {
  return {.wait_for_board =
              [this](int, const WizardBackend::OnImage& on_image) { return wait_for_board(on_image); },
          .capture = {.show =
                          [this](int projector, const cv::Mat& image) {
                            return show(static_cast<std::size_t>(projector), image);
                          },
                      .grab = [this](int camera) { return grab(static_cast<std::size_t>(camera)); },
                      .store = [writer](const std::filesystem::path& path,
                                        const cv::Mat& image) { return writer->store(path, image); }},
          .wait_for_files = [writer] { return writer->finish(); },
          .now = devices_.now,
          .wait_for_prototype =
              [this](const WizardBackend::OnImage& on_image) { return wait_for_prototype(on_image); },
          .show_all = [this](const std::vector<cv::Mat>& images) { return show_all(images); },
          .flashes =
              [this](int projector, int camera) {
                device::Display* display = devices_.projectors.at(static_cast<std::size_t>(projector)).get();
                const Status dark = light_all(0);
                return FlashDevices{.show = [display, dark](bool white) -> Result<Stamp> {
                                      LIMN_TRY_STATUS(dark);
                                      return display->show(level(*display, white ? 255 : 0));
                                    },
                                    .next = [this, camera] { return next(static_cast<std::size_t>(camera)); },
                                    .wait = devices_.wait};
              },
          .use_latency =
              [this](int projector, double seconds) {
                latency_s_.at(static_cast<std::size_t>(projector)) = seconds;
              }};
}

// The next frame; tries again for k_patience_s if there is none.
Result<Frame> DeviceBackend::next(std::size_t camera) {
  const Stamp begun = devices_.now();
  for (;;) {
    Result<Frame> frame = devices_.cameras[camera]->next();
    if (frame) {
      if (captured_at_[camera] != Stamp{})
        period_s_[camera] = seconds_between(captured_at_[camera], frame->captured_at);
      captured_at_[camera] = frame->captured_at;
      return frame;
    }
    if (devices_.cameras[camera]->is_finite() || seconds_between(begun, devices_.now()) > k_patience_s)
      return frame.error();
    devices_.wait(k_retry_s);
  }
}

Status DeviceBackend::light_all(int value) {
  for (std::size_t i = 0; i < devices_.projectors.size(); ++i) {
    const auto shown_at = devices_.projectors[i]->show(level(*devices_.projectors[i], value));
    if (!shown_at) return shown_at.error();
    is_black_[i] = value == 0;
    lit_at_ = std::max(lit_at_, shifted(*shown_at, latency_s_[i]));
  }
  return {};
}

Status DeviceBackend::show(std::size_t projector, const cv::Mat& image) {
  for (std::size_t i = 0; i < devices_.projectors.size(); ++i) {
    if (i == projector || is_black_[i]) continue;
    const auto black_at = devices_.projectors[i]->show(level(*devices_.projectors[i], 0));
    if (!black_at) return black_at.error();
    is_black_[i] = true;
    lit_at_ = std::max(lit_at_, shifted(*black_at, latency_s_[i]));
  }
  const auto shown_at = devices_.projectors[projector]->show(image);
  if (!shown_at) return shown_at.error();
  is_black_[projector] = false;
  lit_at_ = std::max(lit_at_, shifted(*shown_at, latency_s_[projector]));
  return {};
}

// The first frame whose whole exposure lies after the last change of light. A stamp is the middle of an
// exposure, and an exposure lasts at most one frame period.
Result<cv::Mat> DeviceBackend::grab(std::size_t camera) {
  for (;;) {
    LIMN_TRY(const Frame frame, next(camera));
    if (frame.captured_at >= shifted(lit_at_, period_s_[camera] / 2)) return frame.image;
  }
}

// Lights the board with all projectors until it is still in a new place for at least one camera and moves for
// no camera.
Status DeviceBackend::wait_for_board(const WizardBackend::OnImage& on_image) {
  LIMN_TRY_STATUS(light_all(255));
  for (;;) {
    bool is_still = false, is_moving = false;
    for (std::size_t i = 0; i < devices_.cameras.size(); ++i) {
      LIMN_TRY(const Frame frame, next(i));
      const auto corners = calib::find_board(board_, to_grey(frame.image));
      if (on_image) on_image(static_cast<int>(i), frame.image, corners);
      const StillBoard::State state = boards_[i].add_corners(corners, frame.captured_at);
      is_still |= state == StillBoard::State::still;
      is_moving |= state == StillBoard::State::moving;
    }
    if (wish_ && *wish_ != WizardWish::none)
      return error("calibrate: stopped before the board was held still.");
    if (!is_still || is_moving) continue;
    for (StillBoard& board : boards_) board.captured();
    return {};
  }
}

// Waits until no camera sees the board and nothing moves in any image, or until a person says that the
// prototype is in place.
Result<bool> DeviceBackend::wait_for_prototype(const WizardBackend::OnImage& on_image) {
  LIMN_TRY_STATUS(light_all(255));
  std::vector<StillRoom> rooms(devices_.cameras.size());
  for (;;) {
    bool is_still = true;
    for (std::size_t i = 0; i < devices_.cameras.size(); ++i) {
      LIMN_TRY(const Frame frame, next(i));
      const auto corners = calib::find_board(board_, to_grey(frame.image));
      if (on_image) on_image(static_cast<int>(i), frame.image, corners);
      is_still &= rooms[i].add_image(frame.image, frame.captured_at) && corners.empty();
    }
    const WizardWish wish = wish_ ? wish_->exchange(WizardWish::none) : WizardWish::none;
    if (wish == WizardWish::leave || wish == WizardWish::skip || wish == WizardWish::finish) return false;
    if (is_still || wish == WizardWish::scan) return true;
  }
}

Status DeviceBackend::show_all(const std::vector<cv::Mat>& images) {
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto shown_at = devices_.projectors[i]->show(images[i]);
    if (!shown_at) return shown_at.error();
    is_black_[i] = false;
    lit_at_ = std::max(lit_at_, shifted(*shown_at, latency_s_[i]));
  }
  return {};
}

Result<DeviceBackend::Devices> open_devices(const device::Devices& named, device::DeviceOpener* opener) {
  DeviceBackend::Devices open{
      .cameras = {},
      .projectors = {},
      .now = [] { return std::chrono::time_point_cast<Stamp::duration>(std::chrono::steady_clock::now()); },
      .wait = [](double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }};
  for (const device::CameraConfig& wanted : named.cameras) {
    LIMN_TRY(auto camera, opener->camera(wanted));
    open.cameras.push_back(std::move(camera));
    if (wanted.sees == Spectrum::infrared) open.infrared.push_back(wanted.name);
  }
  for (device::DisplayConfig wanted : named.displays) {
    if (!wanted.name.starts_with("projector")) continue;
    wanted.latency_s = 0;  // DeviceBackend adds the measured latency
    LIMN_TRY(auto display, opener->display(wanted));
    open.projectors.push_back(std::move(display));
  }
  if (open.cameras.empty() || open.projectors.empty())
    return error(
        "{}: expected at least one camera and one display whose name begins with projector, found too few.",
        named.file.string());
  return open;
}

}  // namespace limn::wizard
