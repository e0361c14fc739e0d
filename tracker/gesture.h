#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.h"
#include "tracker/detection.h"

namespace limn::tracker {

/// What a person does with a control marker.
enum class Gesture {
  cover,  ///< a hand rests on it
  turn,   ///< it is turned about its own axis, step by step; clockwise is forwards
  lay     ///< it is tipped over, or out of sight
};

struct GestureOptions {
  double cover_s = 0.5;   ///< a cover lasts so long; shorter: hands that pass act
  double still_s = 0.45;  ///< and what covers it is still for so long; shorter: arms at work act
  double turn_deg = 30;   ///< one step
  double lay_deg = 50;    ///< from how it stood
  /// Grey levels by which what is still may change at least, seen in cells of a seventh of the marker's side,
  /// beside what the tremor of a resting hand does; more where the camera's noise is more.
  double still_levels = 2;
};

/// Reads one control marker's gestures from one camera's images. Give it every image, in order.
///
/// A cover is told from a hand that passes by what hides the marker: it stays, still, hides more than an edge
/// of it, and does not hide markers nearby on both sides of it (an arm that lies across does). It acts once;
/// the marker must be seen again before the next.
class GestureReader {
 public:
  GestureReader(MarkerName marker, Gesture gesture, const GestureOptions& options = {});

  /// 0: nothing; 1: the gesture was made; -1: a turn backwards. `grey` is the image that the detections of
  /// (all) markers are from.
  int read(const cv::Mat& grey, std::span<const Detection> detections, Stamp captured_at);

  /// Whether the newest image showed the marker.
  bool is_seen() const { return is_seen_; }
  /// When it was seen last, where it has been out of sight for longer than the detector misses a marker.
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
  bool is_armed_ = false;  // has been seen for long enough
  std::array<Eigen::Vector2d, 4> corners_px_{};
  cv::Rect place_;           // the marker's and what is around it
  double noise_levels_ = 0;  // standard deviation of a cell's change from image to image
  Stamp seen_since_, seen_at_;
  cv::Mat seen_patch_;   // what the marker's place looked like when it was seen last
  cv::Mat still_patch_;  // what it has looked like since it last changed, on average over so many images
  int still_images_ = 0;
  Stamp still_since_;
  std::vector<Neighbour> neighbours_;
  std::optional<double> turn_rest_;  // direction of its upper side when it last acted, radians
  double turn_now_ = 0;              // newest, and since when it has rested there
  Stamp turn_since_;
  std::optional<double> tilt_rest_;  // as it stands
  Stamp tipped_since_;
  bool is_tipped_ = false;
};

}  // namespace limn::tracker
