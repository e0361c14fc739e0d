#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "core/camera_files/imager_file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/support/matchers.h"
#include "tracker/detector.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

struct Listed {
  std::string file, id;
  std::vector<Eigen::Vector2d> corners;
};

std::vector<Listed> read_list(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  std::vector<Listed> list;
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    Listed row;
    std::getline(cells, row.file, ',');
    std::getline(cells, row.id, ',');
    for (std::string x, y; std::getline(cells, x, ',') && std::getline(cells, y, ',') && !x.empty();)
      row.corners.emplace_back(std::stod(x), std::stod(y));
    list.push_back(row);
  }
  return list;
}

std::vector<Detection> detections_in(const std::filesystem::path& image,
                                     const std::vector<std::string>& names) {
  Detector detector(Families::load(names).value());
  return detector.detect(read_grey_image(image).value());
}

#define DATA_OR_SKIP(folder)                                      \
  const auto folder##_data = test::real_data("markers/" #folder); \
  if (!folder##_data) GTEST_SKIP() << "no photographs: markers/" #folder

// Every listed marker is found once, in its corner order, within this distance of its listed corners; nothing
// else is found.
constexpr double k_corner_px = 1.2;

// The lists give the last black pixel; its middle lies half a pixel inside both sides.
Eigen::Vector2d corner_of_pixel(const Listed& row, std::size_t corner) {
  const auto& c = row.corners;
  const Eigen::Vector2d to = (c[corner] - c[(corner + 3) % 4]).normalized();
  const Eigen::Vector2d on = (c[(corner + 1) % 4] - c[corner]).normalized();
  const Eigen::Vector2d outward = Eigen::Vector2d(to.y(), -to.x()) + Eigen::Vector2d(on.y(), -on.x());
  return c[corner] + 0.5 * outward / (1 + to.dot(on));
}

// One listed corner of 284 lies 1.9 px off the plane through the corners of the board's other markers
// (undistorted with the lens file beside the images), and as far from where cv::cornerSubPix ends when it
// starts there. This is the plane's pixel. The board is not quite flat: its corners scatter by 0.5 px about
// the plane.
std::optional<Eigen::Vector2d> by_plane(const Listed& row, std::size_t corner) {
  if (row.file == "gboriginal.png" && row.id == "9" && corner == 0) return Eigen::Vector2d(419.0, 137.4);
  return std::nullopt;
}

void expect_listed(const std::filesystem::path& folder, const std::string& csv, const std::string& family) {
  const auto list = read_list(folder / csv);
  ASSERT_FALSE(list.empty());
  const auto found = detections_in(folder / list[0].file, {family});
  EXPECT_EQ(found.size(), list.size());
  for (const Listed& row : list) {
    const auto hit =
        std::find_if(found.begin(), found.end(), [&](const Detection& d) { return d.marker.id == row.id; });
    ASSERT_NE(hit, found.end()) << row.file << ": marker " << row.id << " is missing";
    for (std::size_t k = 0; k < 4; ++k)
      if (const auto plane = by_plane(row, k)) {
        EXPECT_LT((hit->corners_px[k] - *plane).norm(), 0.6 * (row.corners[k] - *plane).norm());
      } else {
        EXPECT_TRUE(test::near(hit->corners_px[k], corner_of_pixel(row, k), k_corner_px))
            << row.file << ": marker " << row.id;
      }
  }
}

TEST(Photographs, ShowAllSingleMarkers) {
  DATA_OR_SKIP(opencv);
  expect_listed(*opencv_data, "opencv_singlemarkers_6x6_250.csv", "aruco_6x6_250");
}
TEST(Photographs, ShowAllMarkersOfACharucoBoard) {
  DATA_OR_SKIP(opencv);
  expect_listed(*opencv_data, "opencv_choriginal_6x6_250.csv", "aruco_6x6_250");
}
TEST(Photographs, ShowAllMarkersOfACoveredCharucoBoard) {
  DATA_OR_SKIP(opencv);
  expect_listed(*opencv_data, "opencv_chocclusion_6x6_250.csv", "aruco_6x6_250");
}
TEST(Photographs, ShowAllMarkersOfAGridBoard) {
  DATA_OR_SKIP(opencv);
  expect_listed(*opencv_data, "opencv_gboriginal_tutorialdict.csv",
                "aruco:" + (*opencv_data / "tutorial_dict.yml").string());
}

TEST(Photographs, ShowTheIdsOfAllDiamonds) {
  DATA_OR_SKIP(opencv);
  std::vector<std::string> wanted, ids;
  for (const Listed& row : read_list(*opencv_data / "opencv_diamond_ids_tutorialdict_idsonly.csv"))
    wanted.push_back(row.id);
  for (const Detection& d : detections_in(*opencv_data / "diamondmarkers.png",
                                          {"aruco:" + (*opencv_data / "tutorial_dict.yml").string()}))
    ids.push_back(d.marker.id);
  std::sort(wanted.begin(), wanted.end());
  std::sort(ids.begin(), ids.end());
  EXPECT_EQ(ids, wanted);
}

// In AprilTag's own list a tag's corners start at another corner. In its pixel convention the median distance
// is .4 px.
bool is_listed_tag(const Listed& row, const Detection& found, double within_px) {
  if (found.marker.id != row.id) return false;
  return std::all_of(row.corners.begin(), row.corners.end(), [&](const Eigen::Vector2d& corner) {
    return std::any_of(found.corners_px.begin(), found.corners_px.end(),
                       [&](const Eigen::Vector2d& c) { return (c - corner).norm() < within_px; });
  });
}

// For one tag that is ten pixels high, the listed corners lie 3.5 px inside ours, within its ink.
TEST(Photographs, ShowAllDistantTagsAnd46Of47WhereTheyAreListed) {
  DATA_OR_SKIP(apriltag);
  std::map<std::string, std::vector<Detection>> found;
  int listed = 0, read = 0, hits = 0;
  for (const Listed& row : read_list(*apriltag_data / "apriltag_swarmathon.csv")) {
    if (!found.count(row.file))
      found[row.file] = detections_in(*apriltag_data / row.file, {"apriltag_36h11"});
    const auto& in_image = found[row.file];
    ++listed;
    const auto is_found = [&](double within_px) {
      return std::any_of(in_image.begin(), in_image.end(),
                         [&](const auto& d) { return is_listed_tag(row, d, within_px); });
    };
    read += is_found(4);
    hits += is_found(3);
  }
  EXPECT_EQ(listed, 47);
  EXPECT_EQ(read, 47);
  EXPECT_GE(hits, 46);
  for (const auto& [file, detections] : found)  // there are only two kinds of tags
    for (const Detection& d : detections)
      EXPECT_TRUE(d.marker.id == "0" || d.marker.id == "1") << file << d.marker.id;
}

TEST(Photographs, ShowHiroAtItsDistance) {
  DATA_OR_SKIP(artoolkit);
  auto camera = load_imager(*artoolkit_data / "hiro_frame_camera_para.dat");
  ASSERT_TRUE(camera) << camera.message();
  ASSERT_EQ(camera->width, 640);  // twice the frame's size
  for (const std::size_t i : {0u, 1u}) camera->lens.values[i] *= 0.5;
  for (const std::size_t i : {2u, 3u}) camera->lens.values[i] = 0.5 * (camera->lens.values[i] + 0.5) - 0.5;
  const auto grey = read_grey_image(*artoolkit_data / "hiro_frame_320x240.png").value();
  const std::vector<std::string> names = {"artoolkit:" + (*artoolkit_data / "kanji.patt").string(),
                                          "artoolkit:" + (*artoolkit_data / "sample1.patt").string(),
                                          "artoolkit:" + (*artoolkit_data / "hiro.patt").string()};
  const auto found = Detector(Families::load(names).value()).detect(grey, &camera->lens);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].marker.text(), "artoolkit:hiro.patt");
  // The text on the marker runs from the image's upper left to its lower right.
  EXPECT_TRUE(test::near(found[0].corners_px[0], Eigen::Vector2d(177, 21), 1.5));
  const auto poses = marker_poses(camera->lens, 0.08, found[0].corners_px, found[0].corner_covariance);
  ASSERT_FALSE(poses.empty());
  // There is no bound on rms_px: with this file's focal length the wrinkled paper is not square (2.5 px with
  // equal weights). The file is read as ARToolKit reads version 1: x0, y0, f, s; (p - c) s (1 - f 1e-8 r^2).
  EXPECT_GT(poses[0].camera_from_marker.translation.z(), 0.15);
  EXPECT_LT(poses[0].camera_from_marker.translation.z(), 0.5);
}

TEST(Photographs, WithoutMarkersShowNone) {
  const auto folder = test::real_data("graycode");
  if (!folder) GTEST_SKIP() << "no photographs: graycode";
  const std::vector<std::string> names = {"apriltag_36h11", "aruco_4x4_50", "aruco_6x6_250"};
  for (const std::string pose : {"capture_0", "capture_2", "capture_4"})
    for (const std::string shot :
         {"graycode_06.png", "graycode_10.png", "graycode_30.png", "graycode_40.png"})
      EXPECT_TRUE(detections_in(*folder / pose / shot, names).empty()) << pose << "/" << shot;
}

}  // namespace
}  // namespace limn::tracker
