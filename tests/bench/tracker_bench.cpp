// Ours beside libapriltag (decimate 1) and OpenCV aruco, one thread each, on the same cluttered pictures with
// exact truth: time and accuracy in one table. tracker_bench [PICTURES]
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/core/utility.hpp>
#include <string>
#include <vector>

#include "tests/tracker/marker_pictures.h"
#include "tracker/detector.h"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

namespace {

using namespace limn;
using limn::test::PlacedMarker;

struct Found {
  int id;
  std::array<Eigen::Vector2d, 4> corners;
};
using Detect = std::function<std::vector<Found>(const cv::Mat&)>;

struct Tally {
  std::vector<double> ms;
  int markers = 0, hits = 0, wrong = 0, corners = 0;
  double squares = 0;
};

struct Scene {
  cv::Mat grey;
  std::vector<std::pair<int, std::array<Eigen::Vector2d, 4>>> truth;
};

Scene cluttered(int width, int height, std::mt19937_64& rng) {
  const Lens lens = Lens::pinhole(width, width, (width - 1) / 2.0, (height - 1) / 2.0);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  Scene scene;
  std::vector<PlacedMarker> markers;
  constexpr int k_columns = 4, k_rows = 3;
  for (int i = 0; i < k_columns * k_rows; ++i) {
    const int id = std::uniform_int_distribution<int>(0, 586)(rng);
    const Eigen::Vector2d px((i % k_columns + 0.5) * width / k_columns,
                             (i / k_columns + 0.5) * height / k_rows);
    markers.push_back(test::placed(lens, {"apriltag_36h11", std::to_string(id)},
                                   px + Eigen::Vector2d(uniform(-30, 30), uniform(-30, 30)), uniform(32, 120),
                                   uniform(0, 6.28), uniform(0, 1.2), uniform(0, 6.28)));
    scene.truth.emplace_back(id, test::true_corners(lens, markers.back()));
  }
  test::PictureOptions options;
  options.blur_px = 0.5;
  options.noise_levels = 2;
  scene.grey = test::picture_of(lens, test::clutter(width, height, rng), markers, options, rng);
  return scene;
}

// Distance of the best assignment of the four corners that keeps their cyclic order: families turn their
// markers differently.
double corner_squares(const Found& found, const std::array<Eigen::Vector2d, 4>& truth) {
  double best = 1e18;
  for (std::size_t turn = 0; turn < 4; ++turn)
    for (const bool reversed : {false, true}) {
      double sum = 0;
      for (std::size_t i = 0; i < 4; ++i)
        sum += (found.corners[reversed ? (turn + 4 - i) % 4 : (turn + i) % 4] - truth[i]).squaredNorm();
      best = std::min(best, sum);
    }
  return best;
}

void judge(const std::vector<Found>& found, const Scene& scene, Tally* tally) {
  std::vector<bool> taken(scene.truth.size(), false);
  tally->markers += static_cast<int>(scene.truth.size());
  for (const Found& f : found) {
    bool hit = false;
    for (std::size_t i = 0; i < scene.truth.size() && !hit; ++i) {
      const double squares = corner_squares(f, scene.truth[i].second);
      if (taken[i] || scene.truth[i].first != f.id || squares > 4 * 25) continue;
      hit = taken[i] = true;
      ++tally->hits;
      tally->corners += 4;
      tally->squares += squares;
    }
    tally->wrong += !hit;
  }
}

void run(const std::string& name,
         const Detect& detect,
         const Scene& scene,
         std::map<std::string, Tally>* tallies) {
  Tally& tally = (*tallies)[name];
  std::vector<Found> found = detect(scene.grey);  // warm
  std::vector<double> ms;
  for (int i = 0; i < 3; ++i) {
    const auto started = std::chrono::steady_clock::now();
    found = detect(scene.grey);
    ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count());
  }
  std::sort(ms.begin(), ms.end());
  tally.ms.push_back(ms[1]);
  judge(found, scene, &tally);
}

Detect ours() {
  auto detector = std::make_shared<tracker::Detector>(
      tracker::Families::load(std::vector<std::string>{"apriltag_36h11"}).value());
  return [detector](const cv::Mat& grey) {
    std::vector<Found> found;
    for (const auto& d : detector->detect(grey)) found.push_back({std::stoi(d.marker.id), d.corners_px});
    return found;
  };
}

Detect apriltag() {
  std::shared_ptr<apriltag_family_t> family(tag36h11_create(), tag36h11_destroy);
  std::shared_ptr<apriltag_detector_t> detector(apriltag_detector_create(), apriltag_detector_destroy);
  apriltag_detector_add_family_bits(detector.get(), family.get(), 2);
  detector->quad_decimate = 1;
  detector->nthreads = 1;
  return [family, detector](const cv::Mat& grey) {
    image_u8_t picture = {grey.cols, grey.rows, static_cast<int>(grey.step[0]), grey.data};
    zarray_t* list = apriltag_detector_detect(detector.get(), &picture);
    std::vector<Found> found;
    for (int i = 0; i < zarray_size(list); ++i) {
      apriltag_detection_t* d = nullptr;
      zarray_get(list, i, &d);
      Found f{d->id, {}};
      // Its pixel centres lie at halves.
      for (int k = 0; k < 4; ++k)
        f.corners[static_cast<std::size_t>(k)] = {d->p[k][0] - 0.5, d->p[k][1] - 0.5};
      found.push_back(f);
    }
    apriltag_detections_destroy(list);
    return found;
  };
}

Detect opencv() {
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  return [dictionary, parameters](const cv::Mat& grey) {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(grey, dictionary, corners, ids, parameters);
    std::vector<Found> found;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      Found f{ids[i], {}};
      for (std::size_t k = 0; k < 4; ++k) f.corners[k] = {corners[i][k].x, corners[i][k].y};
      found.push_back(f);
    }
    return found;
  };
}

void print_table(const std::string& title, std::map<std::string, Tally>& tallies) {
  const auto median = [](std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
  };
  const double mine = median(tallies["limn"].ms);
  fmt::print("{}\n  {:<24}{:>9}{:>8}{:>9}{:>12}{:>7}\n", title, "", "ms", "ratio", "recall", "corner px",
             "wrong");
  for (const auto& [name, tally] : tallies)
    fmt::print("  {:<24}{:>9.2f}{:>8.1f}{:>9.3f}{:>12.3f}{:>7}\n", name, median(tally.ms),
               median(tally.ms) / mine, static_cast<double>(tally.hits) / tally.markers,
               std::sqrt(tally.squares / std::max(1, tally.corners)), tally.wrong);
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  const int pictures = argc > 1 ? std::max(1, std::atoi(argv[1])) : 6;
  const std::map<std::string, Detect> peers = {
      {"limn", ours()}, {"libapriltag decimate 1", apriltag()}, {"OpenCV aruco SUBPIX", opencv()}};
  for (const auto& [width, height] : {std::pair{1920, 1080}, std::pair{1280, 720}}) {
    std::mt19937_64 rng(static_cast<std::uint64_t>(width));
    std::map<std::string, Tally> tallies;
    for (int i = 0; i < pictures; ++i) {
      const Scene scene = cluttered(width, height, rng);
      for (const auto& [name, detect] : peers) run(name, detect, scene, &tallies);
    }
    print_table(fmt::format("{} cluttered pictures {}x{}, 12 markers 32-120 px, tilt up to 69 degrees",
                            pictures, width, height),
                tallies);
  }
}
