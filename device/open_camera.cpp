#include "device/open_camera.h"

#include <filesystem>

#include "device/gige_camera.h"
#include "device/mjpeg_camera.h"
#include "device/picture_camera.h"
#include "device/v4l2_camera.h"
#include "device/video_camera.h"

namespace limn::device {
namespace {

constexpr const char* k_forms =
    "http://HOST/PATH (MJPEG), rtsp://HOST/PATH, v4l2:/dev/video0, gige:ID, a video file, a picture, a "
    "folder of "
    "pictures";

using Opened = Result<std::unique_ptr<CameraSource>>;

template <class Camera>
Opened on_heap(Result<Camera> camera) {
  if (!camera) return camera.error();
  return std::unique_ptr<CameraSource>(std::make_unique<Camera>(std::move(*camera)));
}

bool is_picture(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  for (const char* known : {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"})
    if (extension == known) return true;
  return false;
}

Opened open_path(const CameraWanted& wanted) {
  const std::filesystem::path path = wanted.source;
  std::error_code problem;
  if (!std::filesystem::exists(path, problem))
    return error("{}: expected a source as one of: {}; found {}, where there is nothing.", wanted.name,
                 k_forms, wanted.source.empty() ? "an empty text" : wanted.source);
  if (std::filesystem::is_directory(path, problem) || is_picture(path))
    return on_heap(PictureCamera::open(path, {.name = wanted.name, .repeat = wanted.repeat}));
  return on_heap(VideoCamera::open_file(path, {.name = wanted.name, .grey = wanted.grey}));
}

// What has no settings that can be made from here.
Status without_settings(const CameraWanted& wanted) {
  const SensorSettings& sensor = wanted.sensor;
  const char* key = sensor.exposure_ms ? "exposure_ms" : sensor.gain ? "gain" : "white_balance_k";
  if (!sensor.exposure_ms && !sensor.gain && !sensor.white_balance_k) return {};
  return error("{}: {} cannot be set from here for {}. Set it on the camera itself and remove the key.",
               wanted.name, key, wanted.source);
}

Opened opened(const CameraWanted& wanted) {
  const std::string& source = wanted.source;
  if (source.starts_with("v4l2:"))
    return on_heap(V4l2Camera::open(source.substr(5), {.name = wanted.name,
                                                       .size = wanted.size,
                                                       .sensor = wanted.sensor,
                                                       .grey = wanted.grey,
                                                       .limit_s = wanted.limit_s}));
  if (source.starts_with("gige:"))
    return on_heap(GigeCamera::open(source.substr(5), {.name = wanted.name,
                                                       .size = wanted.size,
                                                       .sensor = wanted.sensor,
                                                       .grey = wanted.grey,
                                                       .limit_s = wanted.limit_s}));
  LIMN_TRY_STATUS(without_settings(wanted));
  if (source.starts_with("http:") || source.starts_with("https:"))
    return on_heap(
        MjpegCamera::open(source, {.name = wanted.name, .grey = wanted.grey, .limit_s = wanted.limit_s}));
  if (source.starts_with("rtsp:"))
    return on_heap(VideoCamera::open_rtsp(
        source, {.name = wanted.name, .grey = wanted.grey, .limit_s = wanted.limit_s}));
  return open_path(wanted);
}

}  // namespace

Result<std::unique_ptr<CameraSource>> open_camera(const CameraWanted& wanted) {
  auto camera = opened(wanted);
  if (!camera || wanted.size.empty() || (*camera)->size() == wanted.size) return camera;
  const cv::Size found = (*camera)->size();
  return error(
      "{} ({}): expected {}x{}, found {}x{}. Set the camera to that size, or calibrate it at this one.",
      wanted.name, wanted.source, wanted.size.width, wanted.size.height, found.width, found.height);
}

}  // namespace limn::device
