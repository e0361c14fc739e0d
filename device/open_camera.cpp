#include "device/open_camera.h"

#include <filesystem>

#include "core/image_io.h"
#include "device/address.h"
#include "device/gige_camera.h"
#include "device/image_sequence_camera.h"
#include "device/mjpeg_camera.h"
#include "device/v4l2_camera.h"
#include "device/video_camera.h"

namespace limn::device {
namespace {

constexpr const char* k_forms =
    "http://HOST/PATH (MJPEG), rtsp://HOST/PATH, v4l2:/dev/video0, gige:ID, ros:/TOPIC, a video file, an "
    "image, "
    "a folder of images";

using Opened = Result<std::unique_ptr<CameraSource>>;

template <class Camera>
Opened on_heap(Result<Camera> camera) {
  if (!camera) return camera.error();
  return std::unique_ptr<CameraSource>(std::make_unique<Camera>(std::move(*camera)));
}

Opened open_path(const CameraConfig& config) {
  const std::filesystem::path path = config.source;
  std::error_code problem;
  if (!std::filesystem::exists(path, problem))
    return error(
        "{}: expected a source of one of these forms: {}; found {}, which is none of them and no file.",
        config.name, k_forms, config.source.empty() ? "an empty text" : without_login(config.source));
  if (std::filesystem::is_directory(path, problem) || is_image_name(path))
    return on_heap(ImageSequenceCamera::open(path, {.name = config.name, .repeat = config.repeat}));
  return on_heap(VideoCamera::open_file(path, {.name = config.name, .grey = config.grey}));
}

// Error if settings are configured for a source that has none.
Status without_settings(const CameraConfig& config) {
  const SensorSettings& sensor = config.sensor;
  const SensorSetting key = sensor.exposure_ms ? SensorSetting::exposure_ms
                            : sensor.gain      ? SensorSetting::gain
                                               : SensorSetting::white_balance_k;
  if (!sensor.exposure_ms && !sensor.gain && !sensor.white_balance_k) return {};
  return error("{}: {} cannot be set by Limn for {}. Set it on the camera itself and remove the key.",
               config.name, to_text(key), without_login(config.source));
}

Opened opened(const CameraConfig& config) {
  const std::string& source = config.source;
  if (source.starts_with("v4l2:"))
    return on_heap(V4l2Camera::open(source.substr(5), {.name = config.name,
                                                       .size = config.size,
                                                       .sensor = config.sensor,
                                                       .grey = config.grey,
                                                       .limit_s = config.limit_s}));
  if (source.starts_with("gige:"))
    return open_gige_camera(source.substr(5), {.name = config.name,
                                               .size = config.size,
                                               .sensor = config.sensor,
                                               .grey = config.grey,
                                               .limit_s = config.limit_s});
  LIMN_TRY_STATUS(without_settings(config));
  if (source.starts_with("http:") || source.starts_with("https:"))
    return on_heap(
        MjpegCamera::open(source, {.name = config.name, .grey = config.grey, .limit_s = config.limit_s}));
  if (source.starts_with("rtsp:"))
    return on_heap(VideoCamera::open_rtsp(
        source, {.name = config.name, .grey = config.grey, .limit_s = config.limit_s}));
  return open_path(config);
}

}  // namespace

Result<std::unique_ptr<CameraSource>> open_camera(const CameraConfig& config) {
  auto camera = opened(config);
  if (!camera || config.size.empty() || (*camera)->size() == config.size) return camera;
  const cv::Size found = (*camera)->size();
  return error(
      "{} ({}): expected {}x{}, found {}x{}. Set the camera to that size, or calibrate it at this one.",
      config.name, without_login(config.source), config.size.width, config.size.height, found.width,
      found.height);
}

}  // namespace limn::device
