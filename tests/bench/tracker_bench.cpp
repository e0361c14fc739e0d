// Compares Limn with libapriltag (quad_decimate 1 and 2) and OpenCV aruco on the same frames with exact
// truth. tracker_bench [--frames N] [--seed S] [--only TEXT] [--detail] [--ours] [--save FOLDER] [--photos
// FOLDER]
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "core/camera_files/imager_file.h"
#include "core/image_io.h"
#include "core/median.h"
#include "tests/bench/tracker_frames.h"
#include "tests/bench/tracker_peers.h"
#include "tracker/detector.h"
#include "tracker/marker_pose.h"

namespace {

using namespace limn;
using test::Condition;
using test::Found;
using test::Peer;
using test::TrackerFrame;
using test::TrueMarker;

struct Options {
  int frames = 4;
  std::uint64_t seed = 2026;  // reserved for reports; use another one for development
  std::string only;
  bool detail = false;
  bool ours_alone = false;
  std::filesystem::path save, photographs;
};

struct Tally {
  int markers = 0, found = 0, wrong = 0, flips = 0, poses = 0;
  double squares = 0;  // px^2, sum over the corners
  double outward = 0;  // px, away from the marker's centre
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  // Mean of both coordinates' squared normalised errors, for each corner that is not covered.
  std::vector<double> pulls;
  std::vector<double> turn_deg, shift_mm;  // pose errors

  int corners() const { return std::max(1, 4 * found); }
  void add(const Tally& t) {
    markers += t.markers, found += t.found, wrong += t.wrong, flips += t.flips, poses += t.poses;
    squares += t.squares, outward += t.outward, offset += t.offset;
    pulls.insert(pulls.end(), t.pulls.begin(), t.pulls.end());
    turn_deg.insert(turn_deg.end(), t.turn_deg.begin(), t.turn_deg.end());
    shift_mm.insert(shift_mm.end(), t.shift_mm.begin(), t.shift_mm.end());
  }
  double recall() const { return static_cast<double>(found) / std::max(1, markers); }
  double rms() const { return std::sqrt(squares / corners()); }
  double pull() const {
    return std::sqrt(std::accumulate(pulls.begin(), pulls.end(), 0.0) /
                     std::max(1.0, static_cast<double>(pulls.size())));
  }
  // The normalised error that a Gaussian has at the quantile that this share of corners exceeds: mean squares
  // of two coordinates are distributed exponentially.
  double pull_at(double share) const {
    if (pulls.empty()) return 0;
    std::vector<double> squares_of = pulls;
    const double square =
        value_of_rank(&squares_of, static_cast<std::size_t>(share * static_cast<double>(pulls.size())));
    return std::sqrt(square / -std::log(1 - share));
  }
};

// The found corners in the order of the truth: the nearest of all cyclic orders, in both directions. Families
// rotate their markers differently.
Found in_order(const Found& found, const TrueMarker& truth) {
  Found best = found;
  double least = 1e18;
  for (std::size_t turn = 0; turn < 4; ++turn)
    for (const bool reversed : {false, true}) {
      Found turned = found;
      double sum = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t k = reversed ? (turn + 4 - i) % 4 : (turn + i) % 4;
        turned.corners_px[i] = found.corners_px[k];
        turned.covariance[i] = found.covariance[k];
        sum += (turned.corners_px[i] - truth.corners_px[i]).squaredNorm();
      }
      if (sum < least) {
        least = sum;
        best = turned;
      }
    }
  return best;
}

double angle_between(const Pose& a, const Pose& b) {
  return Eigen::AngleAxisd(a.rotation_matrix().transpose() * b.rotation_matrix()).angle();
}

void judge_pose(const Found& found, const TrueMarker& truth, const TrackerFrame& frame, Tally* tally) {
  const auto poses =
      tracker::marker_poses(frame.lens, frame.marker_size_m, found.corners_px, found.covariance);
  if (poses.empty()) return;
  ++tally->poses;
  std::vector<double> turns;
  for (const auto& pose : poses)
    turns.push_back(angle_between(pose.camera_from_marker, truth.camera_from_marker));
  const std::size_t nearest =
      static_cast<std::size_t>(std::min_element(turns.begin(), turns.end()) - turns.begin());
  tally->flips += nearest != 0;
  tally->turn_deg.push_back(turns[nearest] * 180 / std::numbers::pi);
  tally->shift_mm.push_back(
      1000 * (poses[nearest].camera_from_marker.translation - truth.camera_from_marker.translation).norm());
}

void judge_marker(const Found& found, const TrueMarker& truth, const TrackerFrame& frame, Tally* tally) {
  const auto& c = truth.corners_px;
  const Eigen::Vector2d centre = 0.25 * (c[0] + c[1] + c[2] + c[3]);
  ++tally->found;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d e = found.corners_px[i] - c[i];
    tally->squares += e.squaredNorm();
    tally->outward += e.dot((c[i] - centre).normalized());
    tally->offset += e;
    if (!truth.corner_covered[i]) tally->pulls.push_back(0.5 * e.dot(found.covariance[i].inverse() * e));
  }
  judge_pose(found, truth, frame, tally);
}

Tally judged(const std::vector<Found>& list, const TrackerFrame& frame) {
  Tally tally;
  tally.markers = static_cast<int>(frame.markers.size());
  std::vector<bool> taken(frame.markers.size(), false);
  for (const Found& raw : list) {
    bool hit = false;
    for (std::size_t i = 0; i < frame.markers.size() && !hit; ++i) {
      const TrueMarker& truth = frame.markers[i];
      if (taken[i] || truth.marker != raw.marker) continue;
      const Found found = in_order(raw, truth);
      const double side = (truth.corners_px[0] - truth.corners_px[2]).norm();
      const double worst = (found.corners_px[0] - truth.corners_px[0]).norm();
      if (worst > 0.5 * side) continue;
      hit = taken[i] = true;
      judge_marker(found, truth, frame, &tally);
    }
    tally.wrong += !hit;
  }
  return tally;
}

// ---- accuracy ----

using Row = std::vector<Tally>;  // one for each peer

void print_rows(const std::vector<Peer>& peers, const std::vector<std::pair<std::string, Row>>& rows) {
  fmt::print("\n  {:<40}{:>8}", "recall / corner RMS px / wrong", "markers");
  for (const Peer& peer : peers) fmt::print("{:>22}", peer.name);
  fmt::print("\n");
  for (const auto& [name, row] : rows) {
    fmt::print("  {:<40}{:>8}", name, row[0].markers);
    for (const Tally& t : row) fmt::print("{:>8.3f}{:>8.3f}{:>6}", t.recall(), t.rms(), t.wrong);
    fmt::print("\n");
  }
}

void print_ours(const std::vector<std::pair<std::string, Row>>& rows) {
  fmt::print("\n  {:<40}{:>9}{:>9}{:>7}{:>7}{:>7}{:>10}{:>10}{:>8}\n", "limn alone", "offset", "outward",
             "pull", "50 %", "95 %", "turn deg", "shift mm", "flips");
  for (const auto& [name, row] : rows) {
    const Tally& t = row[0];
    fmt::print("  {:<40}{:>9.3f}{:>9.3f}{:>7.2f}{:>7.2f}{:>7.2f}{:>10.3f}{:>10.3f}{:>7.1f}%\n", name,
               t.offset.norm() / t.corners(), t.outward / t.corners(), t.pull(), t.pull_at(0.5),
               t.pull_at(0.95), median(t.turn_deg), median(t.shift_mm),
               100.0 * t.flips / std::max(1, t.poses));
  }
}

void save_frame(const Options& options,
                const Condition& condition,
                int number,
                const TrackerFrame& frame,
                const Tally& tally) {
  if (options.save.empty()) return;
  std::string name = condition.group + " " + condition.name;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
  std::filesystem::create_directories(options.save);
  const auto path = options.save / fmt::format("{}_{}_{}of{}.png", name, number, tally.found, tally.markers);
  cv::imwrite(path.string(), frame.grey);
}

// AprilTag's library searches for none of the families that it does not have.
std::vector<Peer> peers_for(const std::vector<std::string>& families, const Options& options) {
  std::vector<Peer> peers = {test::limn_peer(families, 1)};
  if (options.ours_alone) return peers;
  std::vector<std::string> tags;
  for (const std::string& family : families)
    if (family.starts_with("apriltag")) tags.push_back(family);
  peers.push_back(test::apriltag_peer(tags, 1, 1));
  peers.push_back(test::apriltag_peer(tags, 2, 1));
  peers.push_back(test::opencv_peer(families));
  return peers;
}

void bench_accuracy(const Options& options) {
  const std::vector<Peer> ordinary = peers_for(test::tracker_frame_families(), options);
  std::vector<std::pair<std::string, Row>> conditions, groups;
  Row all(ordinary.size());
  for (const Condition& condition : test::tracker_conditions()) {
    const std::string name = condition.group + ": " + condition.name;
    if (name.find(options.only) == std::string::npos) continue;
    const std::vector<Peer> peers =
        condition.family.empty() ? ordinary : peers_for({condition.family}, options);
    Row row(peers.size());
    for (int i = 0; i < options.frames; ++i) {
      const TrackerFrame frame = test::tracker_frame(condition, options.seed, i);
      for (std::size_t p = 0; p < peers.size(); ++p) {
        // Only Limn gets the lens, where it distorts; the others take none.
        const Tally tally =
            judged(peers[p].detect(frame.grey, condition.bent_lens ? &frame.lens : nullptr), frame);
        if (p == 0) save_frame(options, condition, i, frame, tally);
        row[p].add(tally);
      }
    }
    if (groups.empty() || groups.back().first != condition.group)
      groups.emplace_back(condition.group, Row(peers.size()));
    for (std::size_t p = 0; p < peers.size(); ++p) {
      groups.back().second[p].add(row[p]);
      all[p].add(row[p]);
    }
    conditions.emplace_back(name, std::move(row));
  }
  groups.emplace_back("all", std::move(all));
  if (options.detail) print_rows(ordinary, conditions);
  print_rows(ordinary, groups);
  print_ours(options.detail ? conditions : groups);
}

// ---- time ----

// The thread's processor time where there is one thread, so that other work on the machine counts little;
// wall-clock time with more threads.
double now_ms(int threads) {
  if (threads > 1)
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// The times of each peer. The peers take turns in rounds, each for a minimum time in every round, so that
// other work on the machine affects all alike.
std::vector<double> least_ms(std::span<const Peer> peers, const cv::Mat& grey, int threads) {
  constexpr int k_rounds = 6;
  constexpr double k_round_ms = 20;
  std::vector<double> least(peers.size(), 1e9);
  for (int round = 0; round < k_rounds; ++round)
    for (std::size_t p = 0; p < peers.size(); ++p)
      for (double spent = 0; spent < k_round_ms;) {
        const double started = now_ms(threads);
        peers[p].detect(grey, nullptr);
        const double ms = now_ms(threads) - started;
        least[p] = std::min(least[p], ms);
        spent += ms;
      }
  return least;
}

double least_ms(const Peer& peer, const cv::Mat& grey, int threads) {
  return least_ms(std::span(&peer, 1), grey, threads)[0];
}

void bench_time(const Options& options) {
  const std::vector<std::string> family = {"apriltag_36h11"};
  fmt::print("\n  {:<40}{:>8}{:>10}{:>10}{:>10}{:>10}\n", "clutter, 12 markers 32-120 px", "threads", "ms",
             "x limn", "recall", "RMS px");
  for (const auto& [width, height] : {std::pair{1280, 720}, std::pair{1920, 1080}})
    for (const int threads : {1, 2}) {
      cv::setNumThreads(threads);
      std::vector<Peer> peers = {test::limn_peer(family, threads)};
      if (!options.ours_alone) {
        peers.push_back(test::apriltag_peer(family, 1, threads));
        peers.push_back(test::apriltag_peer(family, 2, threads));
        peers.push_back(test::opencv_peer(family));
      }
      std::vector<std::vector<double>> ms(peers.size());
      Row row(peers.size());
      for (int i = 0; i < std::max(3, options.frames); ++i) {
        const TrackerFrame frame =
            test::cluttered_frame(width, height, 1000 * options.seed + static_cast<std::uint64_t>(i));
        const std::vector<double> least = least_ms(peers, frame.grey, threads);
        for (std::size_t p = 0; p < peers.size(); ++p) {
          ms[p].push_back(least[p]);
          row[p].add(judged(peers[p].detect(frame.grey, nullptr), frame));
        }
      }
      for (std::size_t p = 0; p < peers.size(); ++p)
        fmt::print("  {:<40}{:>8}{:>10.2f}{:>10.1f}{:>10.3f}{:>10.3f}\n",
                   fmt::format("{}x{} {}", width, height, peers[p].name), threads, median(ms[p]),
                   median(ms[p]) / median(ms[0]), row[p].recall(), row[p].rms());
    }
  cv::setNumThreads(1);
}

// Images that are hard for detectors, compared with an ordinary one of the same size, for every kind of code.
void bench_hostile(const Options& options) {
  constexpr int k_width = 1280;
  constexpr int k_height = 720;
  std::mt19937_64 rng(options.seed);
  const Peer limn =
      test::limn_peer(std::vector<std::string>{"apriltag_36h11", "aruco_4x4_50", "artoolkit_3x3"}, 1);
  std::vector<std::pair<std::string, cv::Mat>> images = {
      {"noise", test::noise(k_width, k_height, rng)},
      {"nested squares", test::nested_squares(k_width, k_height)}};
  for (const int square : {1, 2, 3, 5, 8, 12, 20, 40})
    images.emplace_back(fmt::format("checkerboard of {} px", square),
                        test::checkerboard(k_width, k_height, square));
  const double ordinary =
      least_ms(limn, test::cluttered_frame(k_width, k_height, 1000 * options.seed).grey, 1);
  fmt::print("\n  {:<40}{:>18}{:>10.2f}\n", "hard images, 1280x720", "ms; ordinary:", ordinary);
  for (const auto& [name, grey] : images) {
    const double ms = least_ms(limn, grey, 1);
    fmt::print("  {:<40}{:>18.2f}{:>9.1f}x\n", name, ms, ms / ordinary);
  }
}

// The 12 markers of a 1920x1080 clutter frame, followed to the next image of a still scene.
void bench_regions(const Options& options) {
  std::vector<double> ms;
  std::size_t markers = 0;
  std::size_t again = 0;
  for (int i = 0; i < std::max(3, options.frames); ++i) {
    const TrackerFrame frame =
        test::cluttered_frame(1920, 1080, 1000 * options.seed + static_cast<std::uint64_t>(i));
    tracker::Detector detector(tracker::Families::load(std::vector<std::string>{"apriltag_36h11"}).value());
    const auto last = detector.detect(frame.grey);
    cv::Mat next;
    cv::GaussianBlur(frame.grey, next, cv::Size(3, 3), 0.3);
    std::vector<tracker::Detection> found;
    double least = 1e9;
    for (int k = 0; k < 6; ++k) {
      const double started = now_ms(1);
      detector.follow(next, nullptr, last, &found);
      least = std::min(least, now_ms(1) - started);
    }
    ms.push_back(least);
    markers += last.size();
    again += found.size();
  }
  fmt::print("  {:<40}{:>8}{:>10.2f}{:>20.3f}\n", "1920x1080 limn by regions", 1, median(ms),
             static_cast<double>(again) / static_cast<double>(std::max<std::size_t>(1, markers)));
}

// ---- photographs with whole-pixel lists (the OpenCV ones) ----

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
                  .detect(read_grey_image(csv.parent_path() / file).value());
    const auto hit =
        std::find_if(found.begin(), found.end(), [&](const auto& d) { return d.marker.id == id; });
    for (std::size_t k = 0; k < 4 && std::getline(cells, x, ',') && std::getline(cells, y, ','); ++k)
      if (hit != found.end())
        all->push_back((hit->corners_px[k] - Eigen::Vector2d(std::stod(x), std::stod(y))).norm());
  }
}

void bench_photographs(const std::filesystem::path& folder) {
  std::vector<double> all;
  for (const char* csv : {"opencv_singlemarkers_6x6_250.csv", "opencv_choriginal_6x6_250.csv",
                          "opencv_chocclusion_6x6_250.csv"})
    add_distances(folder / csv, "aruco_6x6_250", &all);
  add_distances(folder / "opencv_gboriginal_tutorialdict.csv",
                "aruco:" + (folder / "tutorial_dict.yml").string(), &all);
  std::sort(all.begin(), all.end());
  fmt::print("\n  {} corners of photographs, px from whole-pixel lists:", all.size());
  for (const std::size_t percent : {10, 50, 75, 90, 95, 99, 100})
    if (!all.empty())
      fmt::print("  {}%: {:.3f}", percent, all[std::min(all.size() - 1, all.size() * percent / 100)]);
  fmt::print("\n");
}

// A flat board in OpenCV's photographs: the position of each marker's top left corner on it, in marker sides.
struct Board {
  const char* image;
  const char* family;
  const char* camera;
  Eigen::Vector2d (*place)(int id);
};

Eigen::Vector2d place_on_grid(int id) { return 1.2 * Eigen::Vector2d(id % 5, id / 5); }

// A board of 5 x 7 squares twice as wide as the markers, which are in the middles of the white squares.
Eigen::Vector2d place_on_charuco(int id) {
  for (int square = 0, marker = 0;; ++square)
    if ((square % 5 + square / 5) % 2 == 1 && marker++ == id)
      return 2 * Eigen::Vector2d(square % 5, square / 5) + Eigen::Vector2d(0.5, 0.5);
}

// The residuals left of `apart` when bent paper and smooth errors of the lens file are fitted by a cubic in
// the image for each coordinate. They are scaled up for the degrees of freedom that the fit uses.
std::vector<double> beside_smooth(const std::vector<cv::Point2d>& seen,
                                  const std::vector<cv::Point2d>& fitted) {
  constexpr int k_terms = 10;
  const auto count = static_cast<Eigen::Index>(seen.size());
  Eigen::MatrixXd terms(count, k_terms), apart(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    const cv::Point2d& at = fitted[static_cast<std::size_t>(i)];
    const double x = at.x / 320 - 1, y = at.y / 240 - 1;
    terms.row(i) << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
    const cv::Point2d off = seen[static_cast<std::size_t>(i)] - at;
    apart.row(i) << off.x, off.y;
  }
  const Eigen::MatrixXd left = apart - terms * terms.colPivHouseholderQr().solve(apart);
  const double freedom =
      std::sqrt(static_cast<double>(count) / static_cast<double>(std::max<Eigen::Index>(1, count - k_terms)));
  std::vector<double> distances;
  for (Eigen::Index i = 0; i < count; ++i) distances.push_back(freedom * left.row(i).norm());
  return distances;
}

// Distances of corners in pixels from their boards' planes, and what is left of them after beside_smooth().
struct BesidePlane {
  std::size_t markers = 0;
  std::vector<double> px, bent_px;

  void add(const BesidePlane& other) {
    markers += other.markers;
    px.insert(px.end(), other.px.begin(), other.px.end());
    bent_px.insert(bent_px.end(), other.bent_px.begin(), other.bent_px.end());
  }
  void print(const char* name) const {
    fmt::print(
        "  {:<28}{:>3} markers, px from the board's plane: median {:.3f}, worst {:.3f}; after "
        "the smooth fit: median {:.3f}\n",
        name, markers, median(px), *std::max_element(px.begin(), px.end()), median(bent_px));
  }
};

// For all found corners, undistorted with OpenCV's lens file.
BesidePlane bench_board(const std::filesystem::path& folder, const Board& board) {
  const std::string family =
      board.family[0] == '/' ? "aruco:" + (folder / (board.family + 1)).string() : board.family;
  const auto found = tracker::Detector(tracker::Families::load(std::vector{family}).value())
                         .detect(read_grey_image(folder / board.image).value());
  const Imager camera = load_imager(folder / board.camera).value();
  std::vector<cv::Point2d> seen, on_board;
  for (const auto& d : found)
    for (std::size_t k = 0; k < 4; ++k) {
      const auto ray = camera.lens.unproject(d.corners_px[k]);
      if (!ray) continue;
      const Eigen::Vector2d at =
          board.place(std::stoi(d.marker.id)) + Eigen::Vector2d(k == 1 || k == 2, k >= 2);
      on_board.emplace_back(at.x(), at.y());
      seen.emplace_back(camera.lens.values[0] * ray->x() / ray->z(),
                        camera.lens.values[1] * ray->y() / ray->z());
    }
  const cv::Mat plane = cv::findHomography(on_board, seen, 0);
  std::vector<cv::Point2d> fitted;
  cv::perspectiveTransform(on_board, fitted, plane);
  BesidePlane beside{found.size(), {}, beside_smooth(seen, fitted)};
  for (std::size_t i = 0; i < seen.size(); ++i) beside.px.push_back(cv::norm(seen[i] - fitted[i]));
  beside.print(board.image);
  return beside;
}

std::optional<Options> parsed(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--detail")
      options.detail = true;
    else if (word == "--ours")
      options.ours_alone = true;
    else if (word == "--frames" && more)
      options.frames = std::max(0, std::atoi(argv[++i]));
    else if (word == "--seed" && more)
      options.seed = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    else if (word == "--only" && more)
      options.only = argv[++i];
    else if (word == "--save" && more)
      options.save = argv[++i];
    else if (word == "--photos" && more)
      options.photographs = argv[++i];
    else
      return std::nullopt;
  }
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  const auto options = parsed(argc, argv);
  if (!options) {
    fmt::print(stderr,
               "tracker_bench [--frames N (4)] [--seed S] [--only TEXT of a condition] [--detail] "
               "[--ours: Limn without peers] "
               "[--save FOLDER for the frames] [--photos FOLDER of OpenCV's photographs]\n");
    return 2;
  }
  if (options->frames > 0) bench_accuracy(*options);
  if (options->only.empty()) {
    bench_time(*options);
    bench_regions(*options);
  }
  if (options->only.empty()) bench_hostile(*options);
  if (!options->photographs.empty()) {
    bench_photographs(options->photographs);
    BesidePlane all;
    for (const Board& board :
         {Board{"gboriginal.png", "/tutorial_dict.yml", "tutorial_camera_params.yml", place_on_grid},
          Board{"choriginal.jpg", "aruco_6x6_250", "tutorial_camera_charuco.yml", place_on_charuco},
          Board{"chocclusion_original.jpg", "aruco_6x6_250", "tutorial_camera_charuco.yml",
                place_on_charuco}})
      all.add(bench_board(options->photographs, board));
    all.print("all boards");
  }
}
