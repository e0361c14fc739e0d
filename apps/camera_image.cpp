#include "apps/camera_image.h"

#include "core/image_io.h"

namespace limn::apps {

Result<cv::Mat> read_image_of(const Imager& camera, const std::filesystem::path& path) {
  LIMN_TRY(const cv::Mat grey, read_grey_image(path));
  if (camera.width > 0 && (grey.cols != camera.width || grey.rows != camera.height))
    return error(
        "{}: expected an image of the camera's size {}x{}, found {}x{}. Use images of the same camera and "
        "mode.",
        path.string(), camera.width, camera.height, grey.cols, grey.rows);
  return grey;
}

}  // namespace limn::apps
