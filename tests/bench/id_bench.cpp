// Counts wrong ids on real markers under hard conditions, with every family loaded, and checks the scores.
// id_bench [--frames N] [--seed S] [--only TEXT] [--detail]
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <map>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/predefined_family.h"
#include "tests/bench/tracker_frames.h"
#include "tracker/barcode.h"
#include "tracker/detector.h"

namespace {

using namespace limn;
using test::Condition;
using test::Cover;
using test::Light;
using test::TrackerFrame;
using test::TrueMarker;
using tracker::Detection;

struct Options {
  int frames = 4;
  std::uint64_t seed = 2026;  // reserved for reports; use another one for development
  std::string only;
  bool detail = false;
};

std::vector<Condition> hard_conditions() {
  return {
      {.group = "ordinary", .name = "60-120 px", .side_px = {60, 120}},
      {.group = "small", .name = "10-16 px", .side_px = {10, 16}, .tilt_deg = {0, 40}},
      {.group = "small", .name = "16-24 px", .side_px = {16, 24}, .tilt_deg = {0, 40}},
      {.group = "small", .name = "20-32 px, sigma 1.5", .side_px = {20, 32}, .blur_px = {1.5, 1.5}},
      {.group = "blurred", .name = "sigma 2.5", .blur_px = {2.5, 2.5}},
      {.group = "blurred", .name = "sigma 4", .blur_px = {4, 4}},
      {.group = "blurred", .name = "motion 12 px", .motion_px = 12},
      {.group = "noisy", .name = "12 levels", .side_px = {24, 80}, .noise_levels = 12},
      {.group = "noisy", .name = "25 levels", .side_px = {24, 80}, .noise_levels = 25},
      {.group = "noisy", .name = "JPEG 20", .side_px = {24, 80}, .jpeg_quality = 20},
      {.group = "low contrast", .name = "24 levels", .black = 100, .white = 124, .noise_levels = 3},
      {.group = "low contrast", .name = "dark, 8 to 40", .black = 8, .white = 40},
      {.group = "uneven light", .name = "slatted shadow 4:1", .light = Light::slats},
      {.group = "uneven light", .name = "projected clutter", .light = Light::projected},
      {.group = "steep", .name = "75 deg", .side_px = {100, 120}, .tilt_deg = {75, 75}},
      {.group = "steep", .name = "80 deg", .side_px = {100, 120}, .tilt_deg = {80, 80}},
      {.group = "steep", .name = "84 deg", .side_px = {120, 140}, .tilt_deg = {84, 84}},
      {.group = "covered", .name = "corner, 20 %", .cover = Cover::corner, .cover_share = 0.2},
      {.group = "covered", .name = "corner, 35 %", .cover = Cover::corner, .cover_share = 0.35},
      {.group = "covered", .name = "edge, 25 %", .cover = Cover::edge, .cover_share = 0.25},
      {.group = "covered", .name = "bitten by 16 %", .cover = Cover::bite, .cover_share = 0.16},
      {.group = "bent", .name = "bow 2 %", .bow = 0.02},
  };
}

// ---- markers ----

// Writes letters, some of them similar, as ARToolKit templates of 16 x 16 values; returns their family names.
std::vector<std::string> write_templates(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const std::string letter :
       {"A", "B", "C", "D", "E", "F", "G", "K", "L", "P", "R", "b", "e", "f", "h", "k", "2", "4", "5", "7"}) {
    cv::Mat large(256, 256, CV_8UC1, cv::Scalar(255));
    cv::putText(large, letter, {30, 215}, cv::FONT_HERSHEY_DUPLEX, 8, cv::Scalar(0), 26, cv::LINE_AA);
    cv::Mat values;
    cv::resize(large, values, {16, 16}, 0, 0, cv::INTER_AREA);
    std::string text;
    for (int turn = 0; turn < 4; ++turn) {
      for (int colour = 0; colour < 3; ++colour)
        for (int i = 0; i < 256; ++i) text += fmt::format(" {}", values.at<std::uint8_t>(i / 16, i % 16));
      cv::rotate(values, values, cv::ROTATE_90_COUNTERCLOCKWISE);
    }
    const auto file = folder / ("letter_" + letter + ".patt");
    if (const Status written = write_file(file, text); !written) throw std::runtime_error(written.message());
    names.push_back("artoolkit:" + file.string());
  }
  return names;
}

std::vector<std::string> every_family(const std::vector<std::string>& templates) {
  std::vector<std::string> names;
  for (const PredefinedFamily& family : predefined_families()) names.emplace_back(family.name);
  for (const tracker::Barcode& barcode : tracker::barcodes()) names.emplace_back(barcode.name);
  names.insert(names.end(), templates.begin(), templates.end());
  return names;
}

struct Kind {
  std::string name;
  std::vector<MarkerName> markers;
};

Kind codes_of(const std::string& family, int ids) {
  Kind kind{family, {}};
  for (int id = 0; id < ids; ++id) kind.markers.push_back({family, std::to_string(id)});
  return kind;
}

std::vector<Kind> all_kinds(const std::vector<std::string>& templates) {
  std::vector<Kind> kinds = {codes_of("apriltag_36h11", 587),
                             codes_of("apriltag_25h9", 35),
                             codes_of("apriltag_16h5", 30),
                             codes_of("aruco_4x4_50", 50),
                             codes_of("aruco_5x5_100", 100),
                             codes_of("aruco_6x6_250", 250),
                             codes_of("aruco_7x7_1000", 1000),
                             codes_of("aruco_original", 1024),
                             codes_of("artoolkit_3x3", 64),
                             codes_of("artoolkit_4x4_bch_13_9_3", 512),
                             codes_of("artoolkit_5x5_bch_22_12_5", 4096)};
  Kind letters{"templates", {}};
  for (const std::string& name : templates)
    letters.markers.push_back({"artoolkit", name.substr(std::string("artoolkit:").size())});
  kinds.push_back(letters);
  return kinds;
}

// Families share markers (aruco_4x4_50 is the beginning of aruco_4x4_1000), so the images are compared.
bool is_same_image(const MarkerName& found, const MarkerName& truth) {
  if (found.family == "artoolkit" || truth.family == "artoolkit")
    return found.family == truth.family &&
           std::filesystem::path(found.id).filename() == std::filesystem::path(truth.id).filename();
  static std::map<std::string, cv::Mat> drawn;
  const auto image = [](const MarkerName& name) -> const cv::Mat& {
    cv::Mat& known = drawn[name.text()];
    if (known.empty()) known = tracker::draw_marker(name, 1).value();
    return known;
  };
  const cv::Mat& a = image(found);
  cv::Mat b = image(truth).clone();
  for (int turn = 0; turn < 4; ++turn) {  // aruco_4x4_250:227 is apriltag_16h5:16, rotated
    if (a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0) return true;
    cv::rotate(b, b, cv::ROTATE_90_CLOCKWISE);
  }
  return false;
}

// ---- comparison with the truth ----

constexpr std::array<double, 10> k_bins = {0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999};

struct Bin {
  int right = 0, wrong = 0;
  double scores = 0;
};

struct Tally {
  int markers = 0, right = 0, wrong = 0, turned = 0, beside = 0;
  std::array<Bin, k_bins.size()> bins;

  void add(const Tally& t) {
    markers += t.markers, right += t.right, wrong += t.wrong, turned += t.turned, beside += t.beside;
    for (std::size_t i = 0; i < bins.size(); ++i) {
      bins[i].right += t.bins[i].right, bins[i].wrong += t.bins[i].wrong;
      bins[i].scores += t.bins[i].scores;
    }
  }
};

Eigen::Vector2d centre(const std::array<Eigen::Vector2d, 4>& c) { return 0.25 * (c[0] + c[1] + c[2] + c[3]); }

double longest_side(const std::array<Eigen::Vector2d, 4>& c) {
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) longest = std::max(longest, (c[i] - c[(i + 1) % 4]).norm());
  return longest;
}

// The true marker whose square contains the detection's centre, if any.
const TrueMarker* marker_below(const Detection& detection, const TrackerFrame& frame) {
  for (const TrueMarker& truth : frame.markers) {
    const std::vector<cv::Point2f> outline = {
        {static_cast<float>(truth.corners_px[0].x()), static_cast<float>(truth.corners_px[0].y())},
        {static_cast<float>(truth.corners_px[1].x()), static_cast<float>(truth.corners_px[1].y())},
        {static_cast<float>(truth.corners_px[2].x()), static_cast<float>(truth.corners_px[2].y())},
        {static_cast<float>(truth.corners_px[3].x()), static_cast<float>(truth.corners_px[3].y())}};
    const Eigen::Vector2d px = centre(detection.corners_px);
    const cv::Point2f point(static_cast<float>(px.x()), static_cast<float>(px.y()));
    if (cv::pointPolygonTest(outline, point, false) >= 0) return &truth;
  }
  return nullptr;
}

Tally judged(const std::vector<Detection>& detections, const TrackerFrame& frame, bool detail) {
  Tally tally;
  tally.markers = static_cast<int>(frame.markers.size());
  for (const Detection& detection : detections) {
    const TrueMarker* truth = marker_below(detection, frame);
    if (!truth) {
      ++tally.beside;
      continue;
    }
    const bool right = is_same_image(detection.marker, truth->marker);
    tally.right += right;
    tally.wrong += !right;
    const double off = (detection.corners_px[0] - truth->corners_px[0]).norm();
    tally.turned += right && detection.marker.family == truth->marker.family &&
                    off > 0.4 * longest_side(truth->corners_px);
    std::size_t bin = k_bins.size() - 1;
    while (detection.score < k_bins[bin]) --bin;
    (right ? tally.bins[bin].right : tally.bins[bin].wrong) += 1;
    tally.bins[bin].scores += detection.score;
    if (detail && !right)
      fmt::print("    {} for {}, score {:.4f}, {:.0f} px\n", detection.marker.text(), truth->marker.text(),
                 detection.score, longest_side(detection.corners_px));
  }
  return tally;
}

// ---- tables ----

void print_row(const std::string& name, const Tally& t) {
  const int found = t.right + t.wrong;
  fmt::print("  {:<36}{:>9}{:>9}{:>9.3f}{:>8}{:>9.3f}%{:>8}{:>8}\n", name, t.markers, found,
             static_cast<double>(t.right) / std::max(1, t.markers), t.wrong,
             100.0 * t.wrong / std::max(1, found), t.turned, t.beside);
}

void print_table(const std::string& title, const std::vector<std::pair<std::string, Tally>>& rows) {
  fmt::print("\n  {:<36}{:>9}{:>9}{:>9}{:>8}{:>10}{:>8}{:>8}\n", title, "markers", "found", "recall", "wrong",
             "wrong", "turned", "outside");
  for (const auto& [name, tally] : rows) print_row(name, tally);
}

void print_scores(const std::string& title, const Tally& tally) {
  fmt::print("\n  {:<36}{:>9}{:>9}{:>12}{:>12}\n", title, "found", "wrong", "mean score", "right");
  for (std::size_t i = 0; i < k_bins.size(); ++i) {
    const Bin& bin = tally.bins[i];
    const int found = bin.right + bin.wrong;
    if (found == 0) continue;
    fmt::print("  score {:<6} … {:<21}{:>9}{:>9}{:>12.5f}{:>12.5f}\n", k_bins[i],
               i + 1 < k_bins.size() ? k_bins[i + 1] : 1.0, found, bin.wrong, bin.scores / found,
               static_cast<double>(bin.right) / found);
  }
}

std::string class_of(const Kind& kind) {
  if (kind.name == "templates") return kind.name;
  return kind.name.starts_with("artoolkit") ? "barcodes" : "codes";
}

void bench(const Options& options, const std::filesystem::path& folder) {
  const auto templates = write_templates(folder);
  const auto kinds = all_kinds(templates);
  tracker::Detector detector(tracker::Families::load(every_family(templates)).value());
  std::vector<std::pair<std::string, Tally>> by_kind, by_condition;
  std::map<std::string, Tally> by_class;
  Tally all;
  for (const Condition& condition : hard_conditions()) {
    const std::string name = condition.group + ": " + condition.name;
    Tally tally;
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      if (by_kind.size() <= k) by_kind.emplace_back(kinds[k].name, Tally());
      if ((name + " " + kinds[k].name).find(options.only) == std::string::npos) continue;
      for (int i = 0; i < options.frames; ++i) {
        const TrackerFrame frame = test::tracker_frame(condition, options.seed * 100 + k, i,
                                                       std::span<const MarkerName>(kinds[k].markers));
        const Tally one = judged(detector.detect(frame.grey), frame, options.detail);
        by_kind[k].second.add(one);
        by_class[class_of(kinds[k])].add(one);
        tally.add(one);
      }
    }
    all.add(tally);
    by_condition.emplace_back(name, tally);
  }
  print_table("by condition", by_condition);
  by_kind.emplace_back("all", all);
  print_table("by kind of the true marker", by_kind);
  for (const auto& [name, tally] : by_class) print_scores(name, tally);
  print_scores("all", all);
}

std::optional<Options> parsed(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--detail")
      options.detail = true;
    else if (word == "--frames" && more)
      options.frames = std::max(1, std::atoi(argv[++i]));
    else if (word == "--seed" && more)
      options.seed = static_cast<std::uint64_t>(std::atoll(argv[++i]));
    else if (word == "--only" && more)
      options.only = argv[++i];
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
               "id_bench [--frames N for each condition and kind (4)] [--seed S] [--only TEXT of a condition "
               "or kind] [--detail: every wrong id]\n");
    return 2;
  }
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("limn-id-bench-{}", options->seed);
  std::filesystem::create_directories(folder);
  bench(*options, folder);
  std::filesystem::remove_all(folder);
}
