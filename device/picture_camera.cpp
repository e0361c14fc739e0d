#include "device/picture_camera.h"

#include <algorithm>

#include "core/picture.h"

namespace limn::device {
namespace {

bool is_picture(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

Result<std::vector<std::filesystem::path>> pictures_of(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code problem;
  if (fs::is_regular_file(path, problem)) return std::vector<fs::path>{path};
  if (!fs::is_directory(path, problem))
    return error("{}: expected a picture or a folder of pictures, found nothing there. Check the path.",
                 path.string());
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::directory_iterator(path, problem))
    if (is_picture(entry.path())) pictures.push_back(entry.path());
  if (problem)
    return error("{}: cannot be listed: {}. Check its permissions.", path.string(), problem.message());
  if (pictures.empty())
    return error("{}: expected .png or .jpg pictures, found none. Name the folder that holds the frames.",
                 path.string());
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

}  // namespace

Result<PictureCamera> PictureCamera::open(const std::filesystem::path& path,
                                          const PictureCameraOptions& options) {
  PictureCamera camera;
  camera.options_ = options;
  LIMN_TRY(camera.pictures_, pictures_of(path));
  LIMN_TRY(const cv::Mat first, read_picture(camera.pictures_.front()));
  camera.size_ = first.size();
  return camera;
}

Result<Frame> PictureCamera::next() {
  if (!options_.repeat && shown_ >= pictures_.size())
    return error("{}: all {} pictures have been played.", options_.name, pictures_.size());
  const std::filesystem::path& path = pictures_[shown_ % pictures_.size()];
  LIMN_TRY(cv::Mat image, read_picture(path));
  if (image.size() != size_)
    return error(
        "{}: expected {}x{} like the first picture of the folder, found {}x{}. Keep other pictures "
        "elsewhere.",
        path.string(), size_.width, size_.height, image.cols, image.rows);
  const double seconds = static_cast<double>(shown_++) / options_.frames_per_second;
  return Frame{options_.name, image, shifted(Stamp{}, seconds)};
}

std::string PictureCamera::description() const {
  return fmt::format("{} stored pictures, {}x{}, {:g} a second", pictures_.size(), size_.width, size_.height,
                     options_.frames_per_second);
}

}  // namespace limn::device
