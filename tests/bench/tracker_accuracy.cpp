// How near our corners come: swept over size, blur, white margin, tilt and bend of the paper on pictures with
// exact truth, and, given the folder of the OpenCV photographs, beside their whole-pixel lists.
// tracker_accuracy [FOLDER]
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "core/picture.h"
#include "tests/tracker/marker_pictures.h"
#include "tracker/detector.h"

namespace {

using namespace limn;
using limn::test::PlacedMarker;

struct Case {
  std::string name;
  double low_px, high_px, low_tilt_deg, high_tilt_deg, low_blur, high_blur, margin, bow = 0;
};

double uniform(std::mt19937_64& rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(rng);
}

// Outward: mean error away from the marker's centre. Pull: RMS of a coordinate's error in its own standard
// deviations.
void print_case(const Case& c, int count) {
  std::mt19937_64 rng(7);
  const Lens lens = Lens::pinhole(600, 600, 319.5, 239.5);
  tracker::Detector detector(
      tracker::Families::load(std::vector<std::string>{"apriltag_36h11", "aruco_4x4_50"}).value());
  int found = 0, wrong = 0;
  double squares = 0, outward = 0, pulls = 0, worst = 0;
  for (int i = 0; i < count; ++i) {
    const MarkerName name{i % 2 ? "apriltag_36h11" : "aruco_4x4_50", std::to_string(i % 50)};
    PlacedMarker marker =
        test::placed(lens, name, {uniform(rng, 120, 520), uniform(rng, 120, 360)},
                     uniform(rng, c.low_px, c.high_px), uniform(rng, 0, 2 * std::numbers::pi),
                     uniform(rng, c.low_tilt_deg, c.high_tilt_deg) * std::numbers::pi / 180,
                     uniform(rng, 0, 2 * std::numbers::pi));
    marker.margin = c.margin;
    marker.bow = c.bow;
    test::PictureOptions options;
    options.noise_levels = 2;
    options.blur_px = uniform(rng, c.low_blur, c.high_blur);
    const cv::Mat grey =
        test::picture_of(lens, test::plain(640, 480, 100), std::vector{marker}, options, rng);
    const auto truth = test::true_corners(lens, marker);
    const Eigen::Vector2d centre = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (const tracker::Detection& d : detector.detect(grey)) {
      if (d.marker != name || (d.corners_px[0] - truth[0]).norm() > 5) {
        ++wrong;
        continue;
      }
      ++found;
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = d.corners_px[k] - truth[k];
        squares += e.squaredNorm();
        outward += e.dot((truth[k] - centre).normalized());
        pulls += 0.5 * e.dot(d.corner_covariance[k].inverse() * e);
        worst = std::max(worst, e.norm());
      }
    }
  }
  const double corners = std::max(1, 4 * found);
  fmt::print("  {:<34}{:>8.3f}{:>9.3f}{:>10.3f}{:>8.2f}{:>8.2f}{:>7}\n", c.name,
             static_cast<double>(found) / count, std::sqrt(squares / corners), outward / corners, worst,
             std::sqrt(pulls / corners), wrong);
}

// Distances of a photograph's corners from their list.
void add_distances(const std::filesystem::path& csv, const std::string& family, std::vector<double>* all) {
  std::ifstream stream(csv);
  std::string line;
  std::getline(stream, line);
  std::vector<tracker::Detection> found;
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    std::string file, id, x, y;
    std::getline(cells, file, ',');
    std::getline(cells, id, ',');
    if (found.empty())
      found = tracker::Detector(tracker::Families::load(std::vector{family}).value())
                  .detect(read_grey_picture(csv.parent_path() / file).value());
    const auto hit =
        std::find_if(found.begin(), found.end(), [&](const auto& d) { return d.marker.id == id; });
    for (std::size_t k = 0; k < 4 && std::getline(cells, x, ',') && std::getline(cells, y, ','); ++k) {
      if (hit == found.end()) continue;
      const Eigen::Vector2d listed(std::stod(x), std::stod(y));
      all->push_back((hit->corners_px[k] - listed).norm());
      if (all->back() > 1.3)
        fmt::print("  {} marker {} corner {}: listed ({}, {}), found ({:.2f}, {:.2f}), {:.2f} px\n", file, id,
                   k, x, y, hit->corners_px[k].x(), hit->corners_px[k].y(), all->back());
    }
  }
}

void print_photographs(const std::filesystem::path& folder) {
  std::vector<double> all;
  for (const char* csv : {"opencv_singlemarkers_6x6_250.csv", "opencv_choriginal_6x6_250.csv",
                          "opencv_chocclusion_6x6_250.csv"})
    add_distances(folder / csv, "aruco_6x6_250", &all);
  add_distances(folder / "opencv_gboriginal_tutorialdict.csv",
                "aruco:" + (folder / "tutorial_dict.yml").string(), &all);
  if (all.empty()) return;
  std::sort(all.begin(), all.end());
  fmt::print("{} corners of photographs, px from whole-pixel lists:", all.size());
  for (const int percent : {10, 50, 75, 90, 95, 99, 100})
    fmt::print("  {}%: {:.3f}", percent,
               all[std::min(all.size() - 1, all.size() * static_cast<std::size_t>(percent) / 100)]);
  fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int k_count = 100;
  fmt::print("  {:<34}{:>8}{:>9}{:>10}{:>8}{:>8}{:>7}\n", "", "recall", "rms px", "outward", "worst", "pull",
             "wrong");
  for (const Case& c :
       std::vector<Case>{{"sharp 48-120 px", 48, 120, 0, 70, 0, 0, 0.125},
                         {"blur 0.5, 32-120 px", 32, 120, 0, 60, 0.5, 0.5, 0.125},
                         {"small 16-32 px, blur 0.4", 16, 32, 0, 45, 0.4, 0.4, 0.125},
                         {"blur 1.5-2.5, 48-120 px", 48, 120, 0, 60, 1.5, 2.5, 0.125},
                         {"blur 2.5-3.5, 48-120 px", 48, 120, 0, 60, 2.5, 3.5, 0.125},
                         {"margin 6 %, blur 0.7, 48-120 px", 48, 120, 0, 60, 0.7, 0.7, 0.06},
                         {"margin 3 %, blur 0.7, 48-120 px", 48, 120, 0, 60, 0.7, 0.7, 0.03},
                         {"margin 1.5 %, blur 0.7, 48-120 px", 48, 120, 0, 60, 0.7, 0.7, 0.015},
                         {"steep 75-84 deg, blur 0.5", 80, 200, 75, 84, 0.5, 0.5, 0.125},
                         {"paper bent by 0.3 %, blur 0.5", 48, 120, 0, 40, 0.5, 0.5, 0.125, 0.003},
                         {"paper bent by 0.6 %, blur 0.5", 48, 120, 0, 40, 0.5, 0.5, 0.125, 0.006},
                         {"paper bent by 1.2 %, blur 1", 48, 120, 0, 40, 1, 1, 0.125, 0.012}})
    print_case(c, k_count);
  if (argc > 1) print_photographs(argv[1]);
}
