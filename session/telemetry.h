#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/append_log.h"
#include "core/frame.h"
#include "core/result.h"

namespace limn::session {

/// Quantiles of many values >= 0 in fixed memory, within 1 %: a histogram whose bins grow by 2 %.
class Quantiles {
 public:
  void add(double value);
  /// The value that `share` (0 … 1) of the values do not exceed; NaN while there are none.
  double at(double share) const;
  double mean() const { return count_ > 0 ? sum_ / static_cast<double>(count_) : 0; }
  std::size_t count() const { return count_; }

 private:
  std::array<std::size_t, 1000> bins_{};
  std::size_t count_ = 0;
  double sum_ = 0, least_ = 0, most_ = 0;
};

/// Measurements of one frame, from the camera to the projected light.
struct ShownFrame {
  Stamp captured_at;  ///< when the newest camera image that was used was taken
  Stamp shown_at;
  double detect_ms = 0, filter_ms = 0, paint_ms = 0, screen_ms = 0, record_ms = 0;
  int markers = 0;           ///< in the newest images
  int lost = 0;              ///< number of lost bodies
  int missed = 0;            ///< camera images that never arrived or were not processed
  double placement_mm = -1;  ///< RMS distance of the parts from their true positions; -1: unknown
};

/// What a session has measured, in memory that does not grow with time.
class Telemetry {
 public:
  /// Starts telemetry.csv in the folder, one row per shown frame; with an empty path nothing is written.
  static Result<Telemetry> create(const std::filesystem::path& folder);

  void add(const ShownFrame& frame);
  /// Adds a note, for example about a device that failed or a look that was saved. The last 500 are kept.
  void note(Stamp at, const std::string& what);
  /// The notes that are kept, with their seconds on the session's clock.
  const std::vector<std::pair<double, std::string>>& notes() const { return notes_; }

  nlohmann::ordered_json summary() const;
  /// Writes a page for people: the summary, charts of times over the session, and the notes.
  Status write_page(const std::filesystem::path& path, const std::string& title) const;

 private:
  struct Measure {
    std::string name, unit, what;
    Quantiles all;
  };
  struct Slice {  // a time slice of the session
    double begins_s = 0, latency_ms = 0, paint_ms = 0, placement_mm = 0;
    int count = 0;
  };
  Telemetry();
  void add_to_slice(const ShownFrame& frame, double latency_ms);

  std::vector<Measure> measures_;
  std::vector<Slice> slices_;
  double slice_s_ = 0.5;
  std::vector<std::pair<double, std::string>> notes_;
  AppendLog csv_;
  Stamp begun_at_, last_at_;
  std::size_t frames_ = 0, missed_ = 0, with_lost_ = 0;
};

}  // namespace limn::session
