#include "wizard/measure/solve_captures.h"
// Time of the whole `limn solve` over the real captures, compared with cv::imread over the same images on one
// thread. Usage: solve_bench FOLDER_OF_GRAYCODE OUT [REPEATS]
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

double seconds_of(const std::function<void()>& work) {
  const auto begun = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: solve_bench FOLDER_OF_GRAYCODE OUT [REPEATS]\n");
    return 2;
  }
  limn::wizard::SolveCommandOptions options;
  options.captures = argv[1];
  options.out = argv[2];
  options.foreign.import_format = limn::wizard::ImportFormat::opencv_gray;
  options.foreign.projector = "1024x768";
  options.foreign.board = "chessboard:9x7:75mm";
  options.foreign.poses = "capture_*";
  options.foreign.shots = "graycode_*.png";
  const std::vector<fs::path> files = images_in(options.captures);
  // The two take turns, so that other work on the machine slows both; the fastest run of each counts.
  double reading = 1e9, solving = 1e9, held_out = 0, worst = 0;
  const int repeats = argc > 3 ? std::stoi(argv[3]) : 3;
  for (int i = 0; i < repeats; ++i) {
    int empty = 0;
    reading = std::min(reading, seconds_of([&] {
                         for (const fs::path& file : files)
                           empty += cv::imread(file.string(), 0).empty() ? 1 : 0;
                       }));
    if (empty > 0) return 1;
    solving = std::min(solving, seconds_of([&] {
                         const auto report = limn::wizard::solve_captures(options);
                         if (!report) return fmt::print(stderr, "{}\n", report.message());
                         held_out = report->assessment.held_out.rms_px;
                         worst = report->assessment.held_out.worst_px;
                       }));
  }
  fmt::print(
      "{} images: cv::imread, one thread {:.2f} s; limn solve {:.2f} s, {:.2f} times; held-out {:.3f} px, "
      "worst {:.3f} px\n",
      files.size(), reading, solving, solving / reading, held_out, worst);
  return held_out > 0 ? 0 : 1;
}
