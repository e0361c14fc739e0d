#include "core/opencv_aruco.h"
#include "core/program_library.h"

LIMN_LIBRARY_VERSION(LIMN_VERSION)

namespace limn {
namespace {

OpencvDictionary dictionary(int number) {
  const cv::aruco::Dictionary known = aruco_dictionary(number);
  OpencvDictionary dictionary{number, known.markerSize, {}};
  for (int id = 0; id < known.bytesList.rows; ++id) {
    const cv::Mat cells =
        cv::aruco::Dictionary::getBitsFromByteList(known.bytesList.rowRange(id, id + 1), known.markerSize);
    std::uint64_t code = 0;
    for (int row = 0; row < cells.rows; ++row)
      for (int column = 0; column < cells.cols; ++column)
        code = (code << 1) | std::uint64_t{cells.at<std::uint8_t>(row, column) != 0};
    dictionary.codes.push_back(code);
  }
  return dictionary;
}

OpencvMarkers find_markers(const cv::Mat& grey, int number, int border_cells) {
  cv::aruco::DetectorParameters parameters;
  parameters.markerBorderBits = border_cells;
  return find_aruco_markers(grey, aruco_dictionary(number), parameters);
}

}  // namespace
}  // namespace limn

extern "C" __attribute__((visibility("default"))) const limn::OpencvFunctions* limn_opencv_functions() {
  static const limn::OpencvFunctions functions = {.dictionary = &limn::dictionary,
                                                  .find_markers = &limn::find_markers};
  return &functions;
}
