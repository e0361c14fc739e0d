#pragma once

// OpenCV's marker dictionaries and its detector, versions 4.6 to 4.10. All files that are linked with them
// include this header, so that what differs between versions stands here: since 4.7 dictionaries are values,
// the detector is a class, and functions have other names. Other files use core/opencv_markers.h.

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/core/version.hpp>

#include "core/opencv_markers.h"

namespace limn {

#if CV_VERSION_MAJOR > 4 || CV_VERSION_MINOR >= 7

/// The dictionary with OpenCV's number (PredefinedFamily::opencv_dictionary).
inline cv::aruco::Dictionary aruco_dictionary(int number) {
  return cv::aruco::getPredefinedDictionary(number);
}

inline OpencvMarkers find_aruco_markers(const cv::Mat& grey,
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

/// The dictionary with OpenCV's number (PredefinedFamily::opencv_dictionary).
inline cv::aruco::Dictionary aruco_dictionary(int number) {
  return *cv::aruco::getPredefinedDictionary(number);
}

inline OpencvMarkers find_aruco_markers(const cv::Mat& grey,
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
