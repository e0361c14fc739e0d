#include "device/image_sequence_camera.h"

#include <algorithm>

#include "core/image_io.h"

namespace limn::device {
namespace {

Result<std::vector<std::filesystem::path>> images_of(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code problem;
  if (fs::is_regular_file(path, problem)) return std::vector<fs::path>{path};
  if (!fs::is_directory(path, problem))
    return error("{}: expected an image or a folder of images, found nothing there. Check the path.",
                 path.string());
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(path, problem))
    if (is_image_name(entry.path())) images.push_back(entry.path());
  if (problem)
    return error("{}: cannot be listed: {}. Check its permissions.", path.string(), problem.message());
  if (images.empty())
    return error(
        "{}: expected images (.png, .jpg, .bmp, .tif, .webp …), found none. Give the folder that contains "
        "the "
        "frames.",
        path.string());
  std::sort(images.begin(), images.end());
  return images;
}

}  // namespace

Result<ImageSequenceCamera> ImageSequenceCamera::open(const std::filesystem::path& path,
                                                      const ImageSequenceCameraOptions& options) {
  ImageSequenceCamera camera;
  camera.options_ = options;
  LIMN_TRY(camera.images_, images_of(path));
  LIMN_TRY(const cv::Mat first, read_image(camera.images_.front()));
  camera.size_ = first.size();
  return camera;
}

Result<Frame> ImageSequenceCamera::next() {
  if (!options_.repeat && shown_ >= images_.size())
    return error("{}: all {} images have been played.", options_.name, images_.size());
  const std::filesystem::path& path = images_[shown_ % images_.size()];
  if (used_bits_ < k_full_range) {
    LIMN_TRY(const int used_bits, find_used_bits(path));
    used_bits_ = std::max(used_bits_, used_bits);
  }
  LIMN_TRY(cv::Mat image, read_image(path, {.used_bits = used_bits_}));
  if (image.size() != size_)
    return error(
        "{}: expected {}x{} like the first image of the folder, found {}x{}. Keep other images "
        "elsewhere.",
        path.string(), size_.width, size_.height, image.cols, image.rows);
  const double seconds = static_cast<double>(shown_++) / options_.frames_per_second;
  return Frame{options_.name, image, shifted(Stamp{}, seconds)};
}

std::string ImageSequenceCamera::description() const {
  return fmt::format("{} stored images, {}x{}, {:g} per second", images_.size(), size_.width, size_.height,
                     options_.frames_per_second);
}

}  // namespace limn::device
