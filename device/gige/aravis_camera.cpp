#include <arv.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <thread>
#include <utility>

#include "core/program_library.h"
#include "device/gige_camera.h"
#include "device/retry.h"
#include "device/wall_clock.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int k_buffers = 4;
constexpr guint k_socket_frames = 4;  // frames of socket buffer (net.core.rmem_max may allow less)
constexpr double k_oldest_stamp_s = 1;
constexpr auto k_longest_release = std::chrono::seconds(1);  // wait of the destructor for a lost camera

template <class Object>
struct Unref {
  void operator()(Object* object) const { g_object_unref(object); }
};
template <class Object>
using Owned = std::unique_ptr<Object, Unref<Object>>;

// Collects the error of an Aravis call.
class Complaint {
 public:
  Complaint() = default;
  Complaint(const Complaint&) = delete;
  Complaint& operator=(const Complaint&) = delete;
  ~Complaint() { g_clear_error(&error_); }
  GError** operator&() {
    g_clear_error(&error_);
    return &error_;
  }
  bool any() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason given"; }

 private:
  GError* error_ = nullptr;
};

// A supported pixel format and its conversion to an image.
struct Format {
  ArvPixelFormat format;
  const char* name;
  int type;             // OpenCV type of the raw image
  int to_bgr, to_grey;  // cv::ColorConversionCodes; -1: no conversion
};

// GenICam names a Bayer pattern by its first two pixels, OpenCV by the second row's second and third.
constexpr Format k_formats[] = {
    {ARV_PIXEL_FORMAT_MONO_8, "Mono8", CV_8UC1, -1, -1},
    {ARV_PIXEL_FORMAT_BAYER_RG_8, "BayerRG8", CV_8UC1, cv::COLOR_BayerBG2BGR, cv::COLOR_BayerBG2GRAY},
    {ARV_PIXEL_FORMAT_BAYER_GB_8, "BayerGB8", CV_8UC1, cv::COLOR_BayerGR2BGR, cv::COLOR_BayerGR2GRAY},
    {ARV_PIXEL_FORMAT_BAYER_GR_8, "BayerGR8", CV_8UC1, cv::COLOR_BayerGB2BGR, cv::COLOR_BayerGB2GRAY},
    {ARV_PIXEL_FORMAT_BAYER_BG_8, "BayerBG8", CV_8UC1, cv::COLOR_BayerRG2BGR, cv::COLOR_BayerRG2GRAY},
    {ARV_PIXEL_FORMAT_BGR_8_PACKED, "BGR8", CV_8UC3, -1, cv::COLOR_BGR2GRAY},
    {ARV_PIXEL_FORMAT_RGB_8_PACKED, "RGB8", CV_8UC3, cv::COLOR_RGB2BGR, cv::COLOR_RGB2GRAY},
};

// The first supported format that the camera has. Mono8 comes first when `grey`, else last.
Result<const Format*> chosen_format(ArvCamera* camera, bool grey) {
  guint count = 0;
  Complaint complaint;
  const std::unique_ptr<gint64, void (*)(void*)> has(
      arv_camera_dup_available_pixel_formats(camera, &count, &complaint), g_free);
  const auto is_there = [&](const Format& format) {
    return std::find(has.get(), has.get() + count, static_cast<gint64>(format.format)) != has.get() + count;
  };
  const Format* colour = std::find_if(std::begin(k_formats) + 1, std::end(k_formats), is_there);
  const bool mono = is_there(k_formats[0]);
  if (mono && (grey || colour == std::end(k_formats))) return &k_formats[0];
  if (colour != std::end(k_formats)) return colour;
  return error(
      "expected a camera with Mono8, 8-bit Bayer, RGB8 or BGR8, found none of these among its {} formats.",
      count);
}

CameraSetting judged(
    SensorSetting name, double asked, double found, const Complaint& complaint, double low, double high) {
  CameraSetting setting{name, asked, std::nullopt, ""};
  if (complaint.any()) {
    setting.problem = fmt::format("{} is refused ({}).", to_text(name), complaint.text());
    return setting;
  }
  setting.found = found;
  if (std::abs(found - asked) > 0.01 * std::max(std::abs(asked), 1.0))
    setting.problem = fmt::format("{}: asked for {:g}, the camera says {:g}. It takes {:g} to {:g}.",
                                  to_text(name), asked, found, low, high);
  return setting;
}

CameraSetting locked_exposure(ArvCamera* camera, double asked_ms) {
  Complaint complaint;
  if (arv_camera_is_exposure_auto_available(camera, &complaint))
    arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, &complaint);
  double low = 0, high = 0;
  arv_camera_get_exposure_time_bounds(camera, &low, &high, &complaint);
  arv_camera_set_exposure_time(camera, 1000 * asked_ms, &complaint);
  if (complaint.any())
    return judged(SensorSetting::exposure_ms, asked_ms, 0, complaint, low / 1000, high / 1000);
  const double found = arv_camera_get_exposure_time(camera, &complaint) / 1000;
  return judged(SensorSetting::exposure_ms, asked_ms, found, complaint, low / 1000, high / 1000);
}

CameraSetting locked_gain(ArvCamera* camera, double asked) {
  Complaint complaint;
  if (arv_camera_is_gain_auto_available(camera, &complaint))
    arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, &complaint);
  double low = 0, high = 0;
  arv_camera_get_gain_bounds(camera, &low, &high, &complaint);
  arv_camera_set_gain(camera, asked, &complaint);
  if (complaint.any()) return judged(SensorSetting::gain, asked, 0, complaint, low, high);
  const double found = arv_camera_get_gain(camera, &complaint);
  return judged(SensorSetting::gain, asked, found, complaint, low, high);
}

std::vector<CameraSetting> locked(ArvCamera* camera, const SensorSettings& wanted) {
  std::vector<CameraSetting> settings;
  if (wanted.exposure_ms) settings.push_back(locked_exposure(camera, *wanted.exposure_ms));
  if (wanted.gain) settings.push_back(locked_gain(camera, *wanted.gain));
  if (wanted.white_balance_k)
    settings.push_back(
        {SensorSetting::white_balance_k, *wanted.white_balance_k, std::nullopt,
         "white_balance_k is a setting that GigE Vision cameras do not have: remove the key."});
  return settings;
}

// Sets a region of `size` in the middle of the sensor (empty: leaves the present one) and reads it back.
Result<cv::Size> set_region(ArvCamera* camera, cv::Size size) {
  Complaint complaint;
  int x = 0, y = 0, width = 0, height = 0;
  if (!size.empty()) {
    int sensor_width = 0, sensor_height = 0;
    arv_camera_get_sensor_size(camera, &sensor_width, &sensor_height, &complaint);
    x = std::max(0, (sensor_width - size.width) / 2) & ~15;  // cameras require multiples
    y = std::max(0, (sensor_height - size.height) / 2) & ~15;
    if (!complaint.any()) arv_camera_set_region(camera, x, y, size.width, size.height, &complaint);
    if (complaint.any())
      return error(
          "expected the camera to accept a region of {}x{}, found: {}. Use a size that the camera supports.",
          size.width, size.height, complaint.text());
  }
  arv_camera_get_region(camera, &x, &y, &width, &height, &complaint);
  if (complaint.any()) return error("its region cannot be read: {}.", complaint.text());
  if (!size.empty() && cv::Size(width, height) != size)
    return error("expected a region of {}x{}, the camera says {}x{}. Use a size that the camera supports.",
                 size.width, size.height, width, height);
  return cv::Size(width, height);
}

struct Session {
  Owned<ArvCamera> camera;
  Owned<ArvStream> stream;
  const Format* format = nullptr;
  cv::Size size;
  std::vector<CameraSetting> settings;
};

Result<Session> begun(const std::string& id, const GigeCameraOptions& options, cv::Size size) {
  Session session;
  Complaint complaint;
  session.camera.reset(arv_camera_new(id.empty() ? nullptr : id.c_str(), &complaint));
  if (!session.camera)
    return error(
        "{}. Check that it is switched on, on this network and not in use; limn doctor lists cameras that "
        "answer.",
        complaint.text());
  ArvCamera* camera = session.camera.get();
  // Raw packet sockets need special rights and do not work on a loopback interface.
  if (arv_camera_is_gv_device(camera))
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  LIMN_TRY(session.format, chosen_format(camera, options.grey));
  arv_camera_set_pixel_format(camera, session.format->format, &complaint);
  if (complaint.any())
    return error("its format cannot be set to {}: {}.", session.format->name, complaint.text());
  LIMN_TRY(session.size, set_region(camera, size));
  session.settings = locked(camera, options.sensor);
  const guint payload = arv_camera_get_payload(camera, &complaint);
  if (!complaint.any()) session.stream.reset(arv_camera_create_stream(camera, nullptr, nullptr, &complaint));
  if (!session.stream) return error("its stream cannot be opened: {}.", complaint.text());
  // Cameras send a frame in one burst.
  if (ARV_IS_GV_STREAM(session.stream.get()))
    g_object_set(session.stream.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
                 "socket-buffer-size", static_cast<gint>(k_socket_frames * payload), nullptr);
  for (int i = 0; i < k_buffers; ++i)
    arv_stream_push_buffer(session.stream.get(), arv_buffer_new_allocate(payload));
  arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, &complaint);
  if (!complaint.any()) arv_camera_start_acquisition(camera, &complaint);
  if (complaint.any()) return error("it cannot be started: {}.", complaint.text());
  return session;
}

Result<cv::Mat> decoded(ArvBuffer* buffer, const Format& format, cv::Size size, bool grey) {
  if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS)
    return error(
        "packets of its frames are lost. Raise net.core.rmem_max and the network card's MTU, or use a "
        "smaller "
        "region.");
  std::size_t bytes = 0;
  const void* data = arv_buffer_get_image_data(buffer, &bytes);
  const cv::Size found(arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer));
  if (found != size || arv_buffer_get_image_pixel_format(buffer) != format.format)
    return error("expected frames of {} {}x{}, found another format of {}x{}. Start again.", format.name,
                 size.width, size.height, found.width, found.height);
  if (!data || bytes < static_cast<std::size_t>(size.area()) * CV_ELEM_SIZE(format.type))
    return error("expected {}x{} pixels, found {} bytes.", size.width, size.height, bytes);
  const cv::Mat raw(size, format.type, const_cast<void*>(data));
  const int conversion = grey ? format.to_grey : format.to_bgr;
  if (conversion < 0) return raw.clone();
  cv::Mat image;
  cv::cvtColor(raw, image, conversion);
  return image;
}

// Aravis' times are those of the wall clock.
Stamp arrival(ArvBuffer* buffer) {
  return from_wall_clock(std::chrono::nanoseconds(arv_buffer_get_system_timestamp(buffer)), k_oldest_stamp_s);
}

class AravisCamera : public CameraSource {
 public:
  static Result<std::unique_ptr<CameraSource>> open(const std::string& id, const GigeCameraOptions& options);
  AravisCamera(const AravisCamera&) = delete;
  AravisCamera& operator=(const AravisCamera&) = delete;
  ~AravisCamera() override;

  const std::string& name() const override { return options_.name; }
  cv::Size size() const override { return size_; }
  Result<Frame> next() override;
  std::string description() const override;
  std::vector<CameraSetting> settings() const override;

 private:
  AravisCamera(std::string id, const GigeCameraOptions& options)
      : id_(std::move(id)), options_(options), size_(options.size) {}
  void end(bool lost);
  bool may_begin(Stamp deadline);
  ArvBuffer* newest(Stamp deadline);
  std::optional<Frame> grabbed(ArvBuffer* buffer);

  std::string id_;
  GigeCameraOptions options_;
  cv::Size size_;  // the requested size, or the first frame's
  Retry retry_;
  std::optional<Session> session_;
  std::future<void> is_released_;  // release of the former session; not valid if there was none
  long openings_ = 0, dropped_ = 0, damaged_ = 0;
};

AravisCamera::~AravisCamera() {
  end(false);
  if (is_released_.valid()) is_released_.wait_for(k_longest_release);
}

// Aravis takes seconds to release a lost camera, because it waits for answers. So that runs on its own
// thread.
void AravisCamera::end(bool lost) {
  if (!session_) return;
  std::promise<void> released;
  is_released_ = released.get_future();
  std::thread([last = std::move(session_), lost, released = std::move(released)]() mutable {
    Complaint complaint;
    if (!lost) arv_camera_stop_acquisition(last->camera.get(), &complaint);  // a lost camera gets no command
    last.reset();
    released.set_value();
  }).detach();
  session_.reset();
}

// Waits until the former session has released the camera; false when it has not by `deadline`. A late
// release would end the next session's control of the camera.
bool AravisCamera::may_begin(Stamp deadline) {
  return !is_released_.valid() || is_released_.wait_until(deadline) == std::future_status::ready;
}

// The newest filled buffer; older ones are given back unread. If all buffers are full, newer frames were
// lost, so all are given back and the next frame is awaited. Null when none came in time.
ArvBuffer* AravisCamera::newest(Stamp deadline) {
  ArvStream* stream = session_->stream.get();
  for (;;) {
    const double left_s = std::max(0.0, seconds_between(Clock::now(), deadline));
    ArvBuffer* kept = arv_stream_timeout_pop_buffer(stream, static_cast<guint64>(1e6 * left_s));
    int filled = kept ? 1 : 0;
    while (ArvBuffer* newer = kept ? arv_stream_try_pop_buffer(stream) : nullptr) {
      arv_stream_push_buffer(stream, std::exchange(kept, newer));
      ++dropped_;
      ++filled;
    }
    if (filled < k_buffers || Clock::now() >= deadline) return kept;
    arv_stream_push_buffer(stream, kept);
    ++dropped_;
  }
}

std::optional<Frame> AravisCamera::grabbed(ArvBuffer* buffer) {
  double half_exposure_s = 0;
  for (const CameraSetting& setting : session_->settings)
    if (setting.name == SensorSetting::exposure_ms && setting.found) half_exposure_s = *setting.found / 2000;
  auto image = decoded(buffer, *session_->format, session_->size, options_.grey);
  const Stamp captured_at = shifted(arrival(buffer), -half_exposure_s);
  arv_stream_push_buffer(session_->stream.get(), buffer);
  if (image) return Frame{options_.name, *image, captured_at};
  ++damaged_;
  retry_.note(image.message());
  return std::nullopt;
}

Result<Frame> AravisCamera::next() {
  const Stamp deadline = shifted(Clock::now(), options_.limit_s);
  bool received = false;
  while (Clock::now() < deadline) {
    if (!session_) {
      if (!retry_.wait(deadline) || !may_begin(deadline)) break;
      auto fresh = begun(id_, options_, size_);
      if (!fresh) {
        retry_.note_failure(fresh.message());
        continue;
      }
      session_.emplace(std::move(*fresh));
      size_ = session_->size;
      ++openings_;
    }
    if (ArvBuffer* buffer = newest(deadline)) {
      received = true;
      if (auto frame = grabbed(buffer)) {
        retry_.note_success();
        return std::move(*frame);
      }
    } else if (!received) {
      end(true);
      retry_.note_failure("it sends no frame. Check its cable, trigger mode and the firewall.");
    }
  }
  return error("{} (gige:{}): expected an image within {:g} s, found none: {}", options_.name, id_,
               options_.limit_s, retry_.problem());
}

Result<std::unique_ptr<CameraSource>> AravisCamera::open(const std::string& id,
                                                         const GigeCameraOptions& options) {
  std::unique_ptr<AravisCamera> camera(new AravisCamera(id, options));
  auto first = camera->next();
  // A search takes a second and may use up the limit although the camera was found; then a second try is
  // made.
  if (!first && camera->session_) first = camera->next();
  if (!first) return first.error();
  return std::unique_ptr<CameraSource>(std::move(camera));
}

std::string AravisCamera::description() const {
  return fmt::format("GigE Vision, {} {}x{}; opened {} times, {} frames skipped for newer ones, {} damaged",
                     session_ ? session_->format->name : "lost", size_.width, size_.height, openings_,
                     dropped_, damaged_);
}

std::vector<CameraSetting> AravisCamera::settings() const {
  return session_ ? session_->settings : std::vector<CameraSetting>{};
}

}  // namespace
}  // namespace limn::device

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) void limn_open_gige_camera(
    const std::string& id,
    const limn::device::GigeCameraOptions& options,
    limn::Result<std::unique_ptr<limn::device::CameraSource>>* camera) {
  *camera = limn::device::AravisCamera::open(id, options);
}

extern "C" __attribute__((visibility("default"))) void limn_gige_cameras(std::vector<std::string>* ids) {
  arv_update_device_list();
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) ids->emplace_back(arv_get_device_id(i));
}
