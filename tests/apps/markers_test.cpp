#include "apps/markers.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "core/file.h"
#include "core/picture.h"
#include "tests/support/matchers.h"
#include "tracker/detector.h"

namespace limn::apps {
namespace {

TEST(Markers, PrintTrueToSizeAndAreFound) {
  const auto folder = test::test_folder();
  MarkersOptions options;
  options.family = "aruco_4x4_50";
  options.ids = "0-3,17,20-22";
  options.out = folder / "sheet.pdf";
  ASSERT_TRUE(run_markers(options));
  EXPECT_EQ(read_file(options.out).value().rfind("%PDF", 0), 0u);
  const std::string render =
      "pdftoppm -r 127 -png '" + options.out.string() + "' '" + (folder / "page").string() + "' 2>/dev/null";
  if (std::system(render.c_str()) != 0) GTEST_SKIP() << "no pdftoppm (poppler-utils)";
  const auto grey = read_grey_picture(folder / "page-1.png");
  ASSERT_TRUE(grey) << grey.message();
  std::set<std::string> ids;
  tracker::Detector detector(tracker::Families::load(std::vector<std::string>{"aruco_4x4_50"}).value());
  for (const auto& found : detector.detect(*grey)) {
    ids.insert(found.marker.id);
    EXPECT_NEAR((found.corners_px[1] - found.corners_px[0]).norm(), 200, 0.3);  // 40 mm at 5 px a mm
    EXPECT_LT(found.corners_px[0].x(), found.corners_px[1].x());
    EXPECT_LT(found.corners_px[0].y(), found.corners_px[3].y());
  }
  EXPECT_EQ(ids, (std::set<std::string>{"0", "1", "2", "3", "17", "20", "21", "22"}));
}

TEST(Markers, DrawSvgPages) {
  MarkersOptions options;
  options.ids = "0-30";
  options.out = test::test_folder() / "sheet.svg";
  ASSERT_TRUE(run_markers(options));
  EXPECT_TRUE(read_file(options.out));
  EXPECT_TRUE(read_file(options.out.parent_path() / "sheet-2.svg"));
}

TEST(Markers, DrawABoardWithItsScale) {
  MarkersOptions options;
  options.board = "chessboard:9x7:20mm";
  for (const char* name : {"board.pdf", "board.png", "board.svg"}) {
    options.out = test::test_folder() / name;
    const Status status = run_markers(options);
    EXPECT_TRUE(status) << status.message();
  }
}

TEST(Markers, TellWrongUsage) {
  const auto folder = test::test_folder();
  const auto wrong = [&](const MarkersOptions& options) {
    const Status status = run_markers(options);
    return !status && status.error().wrong_usage;
  };
  MarkersOptions good;
  good.out = folder / "a.pdf";
  ASSERT_TRUE(run_markers(good));
  for (const char* ids : {"", "a", "3-1", "1,,2", "99"}) {
    MarkersOptions bad = good;
    bad.ids = ids;
    EXPECT_TRUE(wrong(bad)) << ids;
  }
  MarkersOptions bad = good;
  bad.size_mm = 500;
  EXPECT_TRUE(wrong(bad));
  bad = good;
  bad.out = folder / "a.docx";
  EXPECT_TRUE(wrong(bad));
  bad = good;
  bad.family = "nonsense";
  EXPECT_TRUE(wrong(bad));
}

}  // namespace
}  // namespace limn::apps
