#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.h"
#include "core/gesture.h"
#include "tracker/detection.h"

namespace limn::tracker {

struct GestureOptions {
  double cover_s = 0.5;   ///< a cover must last this long; with less, hands that pass trigger the action
  double still_s = 0.45;  ///< and what covers it must be still this long; with less, arms at work trigger it
  double turn_deg = 30;   ///< angle of one step
  double lay_deg = 50;    ///< angle from its resting tilt
  /// Largest change in grey levels that still counts as still, measured in cells of a seventh of the marker's
  /// side. The tremor of a resting hand is allowed in addition, and more where the camera's noise is larger.
  double still_levels = 2;
};

/// Recognises one control marker's gestures in one camera's images. Pass it every image, in order.
///
/// A covering hand differs from a passing one by what hides the marker: it stays, is still, hides more than
/// an edge of the marker, and does not hide nearby markers on both sides of it (as an arm across does). A
/// cover triggers once; the marker must be seen again before the next.
class GestureReader {
 public:
  GestureReader(MarkerName marker, Gesture gesture, const GestureOptions& options = {});

  /// 0: no gesture; 1: the gesture was made; -1: a turn backwards. `grey` is the image in which `detections`
  /// (all markers) were found.
  int read(const cv::Mat& grey, std::span<const Detection> detections, Stamp captured_at);

  /// Whether the newest image showed the marker.
  bool is_seen() const { return is_seen_; }
  /// When the marker was seen last, if it has been out of sight for longer than gaps in detection last.
  std::optional<Stamp> hidden_since() const { return hidden_since_; }
  const MarkerName& marker() const { return marker_; }

 private:
  struct Neighbour {
    MarkerName marker;
    Eigen::Vector2d px;
    Stamp seen_at;
  };
  int seen(const cv::Mat& grey, const Detection& detection, Stamp at);
  int hidden(const cv::Mat& grey, Stamp at);
  int turned(const Detection& detection, Stamp at);
  int laid(const Detection& detection, Stamp at);
  void note_neighbours(std::span<const Detection> detections, Stamp at);
  bool hides_across(Stamp at) const;
  double still_for(const cv::Mat& patch, Stamp at);
  void note_noise(const cv::Mat& patch);
  bool is_mostly_there(const cv::Mat& patch) const;

  MarkerName marker_;
  Gesture gesture_;
  GestureOptions options_;
  bool is_seen_ = false;
  std::optional<Stamp> hidden_since_;
  bool is_armed_ = false;  // has been seen long enough for a gesture to count
  std::array<Eigen::Vector2d, 4> corners_px_{};
  cv::Rect place_;           // the marker's place and its surroundings
  double noise_levels_ = 0;  // standard deviation of a cell's change from image to image
  Stamp seen_since_, seen_at_;
  cv::Mat seen_patch_;   // the marker's place when it was seen last
  cv::Mat still_patch_;  // mean of its place since it last changed, over still_images_ images
  int still_images_ = 0;
  Stamp still_since_;
  std::vector<Neighbour> neighbours_;
  std::optional<double> turn_rest_;  // direction of its upper side when it last triggered, radians
  double turn_now_ = 0;              // newest direction; it has been constant since turn_since_
  Stamp turn_since_;
  std::optional<double> tilt_rest_;  // tilt of the marker at rest, radians
  Stamp tipped_since_;
  bool is_tipped_ = false;
};

}  // namespace limn::tracker
