#include "core/opencv_markers.h"

#include <opencv2/imgproc.hpp>

#include "core/program_library.h"

namespace limn {
namespace {

Result<const OpencvFunctions*> opencv_functions() {
  static const Result<void*> function = library_function({.file = "liblimn_markers.so",
                                                          .variable = "LIMN_MARKERS",
                                                          .purpose = "OpenCV's marker dictionaries",
                                                          .build_package = "libopencv-contrib-dev"},
                                                         "limn_opencv_functions");
  if (!function) return function.error();
  return reinterpret_cast<const OpencvFunctions* (*)()>(*function)();
}

}  // namespace

Result<OpencvDictionary> opencv_dictionary(int number) {
  LIMN_TRY(const OpencvFunctions* functions, opencv_functions());
  return functions->dictionary(number);
}

cv::Mat opencv_marker_image(const OpencvDictionary& dictionary, int id, int side_px) {
  const int side = dictionary.cells + 2;
  cv::Mat cells(side, side, CV_8U, cv::Scalar(0));
  std::uint64_t code = dictionary.codes.at(static_cast<std::size_t>(id));
  for (int row = dictionary.cells; row > 0; --row)
    for (int column = dictionary.cells; column > 0; --column, code >>= 1)
      cells.at<std::uint8_t>(row, column) = (code & 1) != 0 ? 255 : 0;
  cv::Mat image;
  cv::resize(cells, image, {side_px, side_px}, 0, 0, cv::INTER_NEAREST);
  return image;
}

OpencvMarkers find_opencv_markers(const cv::Mat& grey, const OpencvDictionary& dictionary, int border_cells) {
  return opencv_functions().value()->find_markers(grey, dictionary.number, border_cells);
}

}  // namespace limn
