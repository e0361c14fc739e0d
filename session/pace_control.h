#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/rig.h"
#include "sim/trace.h"

namespace limn::session {

/// How much a session on the virtual rig computes.
struct Effort {
  double resolution = 1;         ///< scale of the virtual devices' image sides
  sim::TraceEffort trace;        ///< samples of the virtual cameras
  double screen_interval_s = 0;  ///< shortest time between two images of the screen
  bool operator==(const Effort&) const = default;
};

/// The efforts that a session may choose from, the largest first. The resolution falls last: first the screen
/// is drawn less often, then cameras take fewer samples. `may_resize`: the resolution may change, to shares
/// at which all devices of the rig keep their aspect ratios.
std::vector<Effort> efforts_for(const Rig& rig, bool may_resize);

/// How long a frame takes with this effort, relative to the largest one: a rough guess, which only decides
/// how far a step goes.
double guessed_cost(const Effort& effort);

/// What the effort leaves out, as a sentence for people; empty when it is the largest one.
std::string sentence(const Effort& effort);

/// Chooses an effort at which frames are made within the camera's period, from the times that frames took.
/// Falls when half of the last frames took longer; rises when there has been time to spare for a while. After
/// a rise that had to be taken back the next one is tried later and later, so that the effort does not swing.
class PaceControl {
 public:
  /// `costs`: those of the efforts, falling. `first`: the index to begin with.
  PaceControl(std::vector<double> costs, double period_s, std::size_t first);

  /// Notes how long a frame took, without the time that it waited. True: chosen() has changed.
  bool add_frame(double busy_s);
  /// The index of the chosen effort.
  std::size_t chosen() const { return chosen_; }
  /// Somebody has just changed something: the effort does not rise until there has been time to spare anew,
  /// because images with another resolution come with a pause.
  void delay_rise() { spare_s_ = 0; }
  /// Forgets the frames that count at present, for example after the session has stood still.
  void forget_frames();

 private:
  bool choose(std::size_t index);
  std::size_t fallen(double frame_s) const;

  std::vector<double> costs_;
  double period_s_;
  std::size_t chosen_;
  std::vector<double> frames_;  // times since the last choice or decision, s
  double passed_s_ = 0;         // their time, and that of waiting
  std::size_t to_skip_ = 0;     // frames after a change, which prepare everything
  double spare_s_ = 0;          // how long there has been time to spare
  double wait_s_;               // how long there must be time to spare before a rise
  double since_rise_s_ = 0;
  bool has_risen_ = false;  // the last change was a rise
};

}  // namespace limn::session
