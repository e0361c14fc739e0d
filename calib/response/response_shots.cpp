#include "calib/response/response_shots.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "calib/code/patterns.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/names.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;
using Role = ResponseImage::Role;

constexpr double k_least_contrast = 10;  // levels, white over black: below it there is more noise than light
constexpr size_t k_least_lit_pixels = 400;  // number of pixels' channels: a patch of 20 x 20

fs::path folder_of(const CaptureSet& captures, int projector, int camera) {
  return captures.folder / "response" / captures.projectors[static_cast<size_t>(projector)].name /
         captures.cameras[static_cast<size_t>(camera)].name;
}

int index_of(const std::vector<CapturedDevice>& devices, const std::string& name) {
  for (size_t i = 0; i < devices.size(); ++i)
    if (devices[i].name == name) return static_cast<int>(i);
  return -1;
}

// Folders in `folder`, each of which must be named after one of the devices; their indices, sorted.
Result<std::vector<int>> devices_in(const fs::path& folder, const std::vector<CapturedDevice>& devices) {
  std::vector<int> found;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    if (!entry.is_directory()) continue;
    const int index = index_of(devices, entry.path().filename().string());
    if (index < 0)
      return error("{}: expected a folder named after one of {}, found another name. Rename or remove it.",
                   entry.path().string(), joined_names(devices));
    found.push_back(index);
  }
  if (found.empty())
    return error("{}: expected folders named after {}, found none. See limn patterns --response.",
                 folder.string(), joined_names(devices));
  std::sort(found.begin(), found.end());
  return found;
}

Status check_shot(const cv::Mat& shot,
                  const fs::path& path,
                  const CapturedDevice& camera,
                  const cv::Mat& first) {
  if (shot.cols != camera.width || shot.rows != camera.height)
    return error("{}: expected {}x{} as the other images of {}, found {}x{}. Capture it again.",
                 path.string(), camera.width, camera.height, camera.name, shot.cols, shot.rows);
  if (shot.channels() != first.channels())
    return error("{}: expected {} as 000.png is, found {}. Take all images in the same camera mode.",
                 path.string(), first.channels() == 1 ? "grey" : "colour",
                 shot.channels() == 1 ? "grey" : "colour");
  return {};
}

Status check_count(const fs::path& folder) {
  const size_t count = response_images().size();
  const fs::path beyond = find_image(folder / image_name(static_cast<int>(count)));
  if (!fs::exists(beyond)) return {};
  return error("{}: expected {} response images, 000.png to {}, found more. See limn patterns --response.",
               beyond.string(), count, image_name(static_cast<int>(count) - 1));
}

Error dark(const ResponseShots& shots, size_t lit) {
  return error(
      "{}: expected images where white is at least {} levels brighter than black in {} places, found {}. All "
      "is dark: is the projector on, does the camera see its light? Expose longer.",
      shots.folder.string(), k_least_contrast, k_least_lit_pixels, lit);
}

Error saturated(const ResponseShots& shots, size_t unclipped, size_t lit) {
  return error(
      "{}: expected light below the sensor's limit (level {}), found it in only {} of {} illuminated places, "
      "the others are saturated. Use a shorter exposure or close the aperture.",
      shots.folder.string(), k_clipped, unclipped, lit);
}

}  // namespace

std::vector<size_t> images_of(Role role) {
  std::vector<size_t> indices;
  for (size_t i = 0; i < response_images().size(); ++i)
    if (response_images()[i].role == role) indices.push_back(i);
  return indices;
}

std::vector<size_t> ramp_of(int channel) {
  std::vector<size_t> indices = images_of(Role::ramp);
  std::erase_if(indices, [&](size_t i) { return response_images()[i].bgr[channel] == 0; });
  return indices;
}

Status capture_response(const CaptureSet& plan, const CaptureBackend& backend) {
  const int projectors = static_cast<int>(plan.projectors.size()),
            cameras = static_cast<int>(plan.cameras.size());
  const int images = static_cast<int>(response_images().size());
  int done = 0;
  for (int projector = 0; projector < projectors; ++projector) {
    const CapturedDevice& device = plan.projectors[static_cast<size_t>(projector)];
    for (int camera = 0; camera < cameras; ++camera)
      LIMN_TRY_STATUS(make_folder(folder_of(plan, projector, camera)));
    for (int i = 0; i < images; ++i) {
      LIMN_TRY_STATUS(backend.show(projector, draw_response(i, device.width, device.height)));
      for (int camera = 0; camera < cameras; ++camera) {
        LIMN_TRY(const cv::Mat image, backend.grab(camera));
        LIMN_TRY_STATUS(backend.store(folder_of(plan, projector, camera) / image_name(i), image));
        if (backend.report_progress) backend.report_progress(++done, projectors * images * cameras);
      }
    }
  }
  return {};
}

Result<std::vector<ResponsePair>> response_pairs(const CaptureSet& captures) {
  std::vector<ResponsePair> pairs;
  const fs::path folder = captures.folder / "response";
  if (std::error_code ignored; !fs::exists(folder, ignored)) return pairs;
  LIMN_TRY(const std::vector<int> projectors, devices_in(folder, captures.projectors));
  for (const int projector : projectors) {
    const std::string& name = captures.projectors[static_cast<size_t>(projector)].name;
    LIMN_TRY(const std::vector<int> cameras, devices_in(folder / name, captures.cameras));
    for (const int camera : cameras) pairs.push_back({projector, camera});
  }
  return pairs;
}

Result<ResponseShots> read_response_shots(const CaptureSet& captures, const ResponsePair& pair) {
  const CapturedDevice& camera = captures.cameras[static_cast<size_t>(pair.camera)];
  ResponseShots shots{pair.projector, pair.camera, folder_of(captures, pair.projector, pair.camera), {}};
  LIMN_TRY_STATUS(check_count(shots.folder));
  const fs::path white = find_image(shots.folder / image_name(static_cast<int>(images_of(Role::white)[0])));
  int used_bits = k_full_range;  // reported below if white is missing
  if (std::error_code ignored; fs::exists(white, ignored)) {
    LIMN_TRY(used_bits, find_used_bits(white));
  }
  for (size_t i = 0; i < response_images().size(); ++i) {
    const fs::path path = find_image(shots.folder / image_name(static_cast<int>(i)));
    if (std::error_code ignored; !fs::exists(path, ignored))
      return error("{}: missing; a response needs {} images (this one shows {}). Capture it again.",
                   path.string(), response_images().size(), response_images()[i].what());
    LIMN_TRY(cv::Mat shot, read_image(path, {.used_bits = used_bits}));
    LIMN_TRY_STATUS(check_shot(shot, path, camera, shots.images.empty() ? shot : shots.images[0]));
    shots.images.push_back(std::move(shot));
  }
  return shots;
}

Result<ResponseSamples> sampled(const ResponseShots& shots, size_t most) {
  const cv::Mat black = shots.images[images_of(Role::black)[0]],
                white = shots.images[images_of(Role::white)[0]];
  std::array<size_t, 3> brightest{ramp_of(0).back(), ramp_of(1).back(), ramp_of(2).back()};
  std::vector<size_t> lit;  // offsets of pixels' channels
  size_t lit_at_all = 0, saturated_black = 0;
  for (size_t i = 0; i < black.total() * black.elemSize(); ++i) {
    if (black.data[i] >= k_clipped) ++saturated_black;
    if (white.data[i] - black.data[i] < k_least_contrast) continue;
    ++lit_at_all;
    const bool clipped = std::any_of(brightest.begin(), brightest.end(),
                                     [&](size_t image) { return shots.images[image].data[i] >= k_clipped; });
    if (!clipped) lit.push_back(i);
  }
  if (saturated_black > black.total() * black.elemSize() / 2)
    return saturated(shots, black.total() * black.elemSize() - saturated_black,
                     black.total() * black.elemSize());
  if (lit_at_all < k_least_lit_pixels) return dark(shots, lit_at_all);
  if (lit.size() < k_least_lit_pixels) return saturated(shots, lit.size(), lit_at_all);
  ResponseSamples samples{shots.camera, shots.projector, std::min(most, lit.size()), {}};
  for (size_t k = 0; k < samples.count; ++k) {
    const size_t offset = lit[k * lit.size() / samples.count];
    for (const cv::Mat& image : shots.images) samples.levels.push_back(image.data[offset]);
  }
  return samples;
}

}  // namespace limn::calib
