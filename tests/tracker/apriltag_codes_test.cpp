#include "tracker/apriltag_codes.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdlib>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <set>

#include "tests/support/matchers.h"
#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

namespace limn::tracker {
namespace {

// A family of AprilTag's own library.
struct LibraryFamily {
  std::string name;
  std::shared_ptr<apriltag_family_t> family;
};

std::vector<LibraryFamily> library_families() {
  return {{"apriltag_21h7", {tagCircle21h7_create(), tagCircle21h7_destroy}},
          {"apriltag_41h12", {tagStandard41h12_create(), tagStandard41h12_destroy}},
          {"apriltag_48h12", {tagCustom48h12_create(), tagCustom48h12_destroy}},
          {"apriltag_49h12", {tagCircle49h12_create(), tagCircle49h12_destroy}},
          {"apriltag_52h13", {tagStandard52h13_create(), tagStandard52h13_destroy}}};
}

// As the library's image_u8_destroy, which Debian's does not export.
void free_image(image_u8_t* image) {
  std::free(image->buf);  // NOLINT(cppcoreguidelines-no-malloc): from the C library
  std::free(image);       // NOLINT(cppcoreguidelines-no-malloc)
}

// Every id of a small family, about `count` of a large one.
std::vector<std::uint32_t> some_ids(const apriltag_family_t& family, std::uint32_t count) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < family.ncodes; id += std::max(1U, family.ncodes / count)) ids.push_back(id);
  return ids;
}

// Twelve markers, tilted and turned, in a picture of 640 x 480 pixels.
std::vector<PlacedMarker> twelve(const std::string& family,
                                 std::span<const std::uint32_t> ids,
                                 std::mt19937_64& rng) {
  std::uniform_real_distribution<double> any(0, 1);
  const double square =
      family == "apriltag_49h12" ? 50 : 60;  // px; the whole marker is up to 2.2 times as wide
  std::vector<PlacedMarker> markers;
  for (std::size_t i = 0; i < ids.size(); ++i)
    markers.push_back(
        test::placed(pinhole_vga(), {family, std::to_string(ids[i])},
                     {80.0 + 160.0 * static_cast<double>(i % 4), 80.0 + 160.0 * static_cast<double>(i / 4)},
                     square, 6.28 * any(rng), 0.6 * any(rng), 6.28 * any(rng)));
  return markers;
}

TEST(ApriltagCodes, AreDrawnAsAprilTagDrawsThem) {
  for (const auto& [name, family] : library_families())
    for (const std::uint32_t id : some_ids(*family, 50)) {
      const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> own(apriltag_to_image(family.get(), id),
                                                                   free_image);
      const cv::Mat expected(own->height, own->width, CV_8UC1, own->buf,
                             static_cast<std::size_t>(own->stride));
      const MarkerDrawing drawing = draw_whole_marker({name, std::to_string(id)}, 1).value();
      ASSERT_EQ(drawing.image.size(), expected.size()) << name;
      ASSERT_EQ(cv::norm(drawing.image, expected, cv::NORM_INF), 0) << name << ":" << id;
      EXPECT_NEAR(drawing.square_share(), static_cast<double>(family->width_at_border) / family->total_width,
                  1e-12);
    }
}

// Two different codes of a family differ in as many cells as its name says, however they are turned.
TEST(ApriltagCodes, TurnAsTheirCellsDo) {
  for (const std::string_view name : apriltag3_families()) {
    const ApriltagCodes source = apriltag3_codes(name);
    std::set<std::uint64_t> all;
    const std::size_t step = std::max<std::size_t>(1, source.codes.size() / 100);
    std::size_t count = 0;
    for (std::size_t id = 0; id < source.codes.size(); id += step, ++count)
      for (const std::uint64_t turn : four_turns(source.codes[id], source.grid)) all.insert(turn);
    EXPECT_EQ(all.size(), 4 * count) << name;
    for (auto a = all.begin(); a != all.end(); ++a)
      for (auto b = std::next(a); b != all.end(); ++b)
        ASSERT_GE(std::popcount(*a ^ *b), source.distance) << name;
  }
}

// Root mean square distance of corners.
struct Distances {
  double squares = 0;
  int count = 0;
  void add(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { squares += (a - b).squaredNorm(), ++count; }
  double rms() const { return std::sqrt(squares / count); }
};

cv::Mat picture(const std::vector<PlacedMarker>& markers, std::mt19937_64& rng) {
  return test::image_of(pinhole_vga(), test::plain(640, 480, 110), markers,
                        {.blur_px = 0.6, .noise_levels = 2}, rng);
}

TEST(ApriltagCodes, AreReadWithTheirCornersInPlace) {
  auto rng = test::test_rng();
  for (const auto& [name, family] : library_families()) {
    Detector detector(Families::load(std::vector{name}).value());
    const auto ids = some_ids(*family, 36);
    Distances distances;
    int missed = 0;  // a bright cell beside the border can hide an edge of a small marker
    for (std::size_t first = 0; first < ids.size(); first += 12) {
      const std::size_t count = std::min<std::size_t>(12, ids.size() - first);
      const auto markers = twelve(name, std::span(ids).subspan(first, count), rng);
      std::map<std::string, Detection> found;
      for (const Detection& detection : detector.detect(picture(markers, rng)))
        found.emplace(detection.marker.text(), detection);
      for (const PlacedMarker& marker : markers) {
        const bool is_found = found.contains(marker.marker.text());
        missed += is_found ? 0 : 1;
        if (!is_found) continue;
        const auto truth = test::true_corners(pinhole_vga(), marker);
        for (std::size_t i = 0; i < 4; ++i) {
          distances.add(found.at(marker.marker.text()).corners_px[i], truth[i]);
          EXPECT_TRUE(test::near(found.at(marker.marker.text()).corners_px[i], truth[i], 0.3))
              << marker.marker.text();
        }
      }
    }
    EXPECT_LE(missed, 1) << name;
    EXPECT_LT(distances.rms(), 0.08) << name;
  }
}

// AprilTag's own detector finds the same ids, and its corners, which start at the bottom left and run
// anticlockwise, are the same.
TEST(ApriltagCodes, AreFoundWhereAprilTagFindsThem) {
  auto rng = test::test_rng();
  for (const auto& [name, family] : library_families()) {
    if (family->ncodes > 3000) continue;  // the library's table of wrong bits would take gigabytes
    const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> peer(
        apriltag_detector_create(), apriltag_detector_destroy);
    peer->quad_decimate = 1;
    apriltag_detector_add_family_bits(peer.get(), family.get(), 1);
    const auto ids = some_ids(*family, 12);
    const cv::Mat image = picture(twelve(name, std::span(ids).first(12), rng), rng);
    const auto found = Detector(Families::load(std::vector{name}).value()).detect(image);
    image_u8_t theirs = {image.cols, image.rows, static_cast<int>(image.step[0]), image.data};
    zarray_t* list = apriltag_detector_detect(peer.get(), &theirs);
    Distances distances;
    for (int i = 0; i < zarray_size(list); ++i) {
      apriltag_detection_t* their = nullptr;
      zarray_get(list, i, static_cast<void*>(&their));
      for (const Detection& our : found)
        if (our.marker.id == std::to_string(their->id))
          for (int k = 0; k < 4; ++k)  // AprilTag's pixel centres lie at halves
            distances.add(our.corners_px[static_cast<std::size_t>(k)],
                          {their->p[3 - k][0] - 0.5, their->p[3 - k][1] - 0.5});
    }
    apriltag_detections_destroy(list);
    EXPECT_GE(distances.count, 4 * 11) << name;
    EXPECT_LT(distances.rms(), 0.1) << name;
  }
}

}  // namespace
}  // namespace limn::tracker
