#include "core/predefined_family.h"

#include <algorithm>

#include "core/names.h"
#include "core/opencv_aruco.h"

namespace limn {
namespace {

constexpr PredefinedFamily k_families[] = {
    {"aruco_4x4_50", cv::aruco::DICT_4X4_50},           {"aruco_4x4_100", cv::aruco::DICT_4X4_100},
    {"aruco_4x4_250", cv::aruco::DICT_4X4_250},         {"aruco_4x4_1000", cv::aruco::DICT_4X4_1000},
    {"aruco_5x5_50", cv::aruco::DICT_5X5_50},           {"aruco_5x5_100", cv::aruco::DICT_5X5_100},
    {"aruco_5x5_250", cv::aruco::DICT_5X5_250},         {"aruco_5x5_1000", cv::aruco::DICT_5X5_1000},
    {"aruco_6x6_50", cv::aruco::DICT_6X6_50},           {"aruco_6x6_100", cv::aruco::DICT_6X6_100},
    {"aruco_6x6_250", cv::aruco::DICT_6X6_250},         {"aruco_6x6_1000", cv::aruco::DICT_6X6_1000},
    {"aruco_7x7_50", cv::aruco::DICT_7X7_50},           {"aruco_7x7_100", cv::aruco::DICT_7X7_100},
    {"aruco_7x7_250", cv::aruco::DICT_7X7_250},         {"aruco_7x7_1000", cv::aruco::DICT_7X7_1000},
    {"aruco_original", cv::aruco::DICT_ARUCO_ORIGINAL}, {"apriltag_16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"apriltag_25h9", cv::aruco::DICT_APRILTAG_25h9},   {"apriltag_36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"apriltag_36h11", cv::aruco::DICT_APRILTAG_36h11},
};

}  // namespace

std::span<const PredefinedFamily> predefined_families() { return k_families; }

const PredefinedFamily* find_predefined_family(std::string_view name) { return find_named(k_families, name); }

}  // namespace limn
