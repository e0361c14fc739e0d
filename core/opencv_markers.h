#pragma once

// OpenCV's marker dictionaries and its detector, versions 4.6 to 4.10. All files of Limn use them through
// this header, so that what differs between versions stands here: since 4.7 dictionaries are values, the
// detector is a class, and functions have other names.

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/core/version.hpp>
#include <vector>

namespace limn {

/// The markers that OpenCV's detector found, in pixels. The corners run clockwise from the marker's top left.
struct OpencvMarkers {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
};

#if CV_VERSION_MAJOR > 4 || CV_VERSION_MINOR >= 7

/// The dictionary with OpenCV's number (PredefinedFamily::opencv_dictionary). Copies share their memory.
inline cv::aruco::Dictionary opencv_dictionary(int number) {
  return cv::aruco::getPredefinedDictionary(number);
}

/// A marker's image with a border of one cell.
inline cv::Mat opencv_marker_image(const cv::aruco::Dictionary& dictionary, int id, int side_px) {
  cv::Mat image;
  dictionary.generateImageMarker(id, side_px, image);
  return image;
}

inline OpencvMarkers find_opencv_markers(const cv::Mat& grey,
                                         const cv::aruco::Dictionary& dictionary,
                                         const cv::aruco::DetectorParameters& parameters = {}) {
  OpencvMarkers found;
  cv::aruco::ArucoDetector(dictionary, parameters).detectMarkers(grey, found.corners, found.ids);
  return found;
}

/// A ChArUco board with its markers where OpenCV 4.6 has them.
inline cv::Ptr<cv::aruco::CharucoBoard> opencv_charuco_board(cv::Size squares,
                                                             float square_m,
                                                             float marker_m,
                                                             const cv::aruco::Dictionary& dictionary) {
  const auto board = cv::makePtr<cv::aruco::CharucoBoard>(squares, square_m, marker_m, dictionary);
  board->setLegacyPattern(true);
  return board;
}

#else

/// The dictionary with OpenCV's number (PredefinedFamily::opencv_dictionary). Copies share their memory.
inline cv::aruco::Dictionary opencv_dictionary(int number) {
  return *cv::aruco::getPredefinedDictionary(number);
}

/// A marker's image with a border of one cell.
inline cv::Mat opencv_marker_image(const cv::aruco::Dictionary& dictionary, int id, int side_px) {
  cv::Mat image;
  dictionary.drawMarker(id, side_px, image);
  return image;
}

inline OpencvMarkers find_opencv_markers(const cv::Mat& grey,
                                         const cv::aruco::Dictionary& dictionary,
                                         const cv::aruco::DetectorParameters& parameters = {}) {
  OpencvMarkers found;
  cv::aruco::detectMarkers(grey, cv::makePtr<cv::aruco::Dictionary>(dictionary), found.corners, found.ids,
                           cv::makePtr<cv::aruco::DetectorParameters>(parameters));
  return found;
}

/// A ChArUco board with its markers where OpenCV 4.6 has them.
inline cv::Ptr<cv::aruco::CharucoBoard> opencv_charuco_board(cv::Size squares,
                                                             float square_m,
                                                             float marker_m,
                                                             const cv::aruco::Dictionary& dictionary) {
  return cv::aruco::CharucoBoard::create(squares.width, squares.height, square_m, marker_m,
                                         cv::makePtr<cv::aruco::Dictionary>(dictionary));
}

#endif

}  // namespace limn
