#pragma once

#include <chrono>
#include <deque>
#include <optional>

#include "core/frame.h"

namespace limn::nodes {

/// A question for another machine's time and its answer, with the four stamps of NTP (RFC 5905, section 8).
struct ClockExchange {
  Stamp asked_at;     ///< on this machine's clock
  Stamp received_at;  ///< on the other machine's clock
  Stamp answered_at;  ///< on the other machine's clock
  Stamp arrived_at;   ///< on this machine's clock
};

/// Another machine's clock at a moment.
struct ClockEstimate {
  Stamp at;                            ///< the moment, on this machine's clock
  std::chrono::nanoseconds offset{0};  ///< the other clock minus this one
  double rate = 0;                     ///< what the offset gains in a second; 1e-6 is 1 ppm
  double stddev_s = 0;                 ///< the offset's, without the path's asymmetry (see ClockEstimator)
  double rate_stddev = 0;
  double round_trip_s = 0;  ///< the shortest time to the other machine and back
  int steps = 0;            ///< how often one of the two clocks has stepped

  Stamp to_other(Stamp local) const;
  Stamp to_local(Stamp other) const;
  /// The largest error of the offset that the path's asymmetry can cause, in addition to `stddev_s`.
  double most_asymmetry_s() const { return round_trip_s / 2; }
};

/// Estimates the offset and the rate of another machine's clock from exchanges.
///
/// The delay in one direction has a smallest value, that of the idle path, and queues only add to it. So the
/// measured delays of a direction, which contain the offset, lie above a line, and touch it now and then
/// (Moon, Skelly, Towsley: Estimation and removal of clock skew from network delay measurements, INFOCOM
/// 1999; Zhang, Liu, Xia: Clock synchronization algorithms for network measurements, INFOCOM 2002). The two
/// directions are bounded separately. NTP's clock filter (RFC 5905, section 10), which chooses the exchange
/// with the smallest round trip, needs both delays to be small at once: with queues of up to 20 ms it is
/// three times as far off after ten exchanges.
///
/// Above the line the smallest delays are taken to be evenly distributed, with an unknown density. The
/// likelihood of a rate is that of the K smallest delays of each direction lying as close together as they
/// do; the offset is the middle between the two lines, integrated over all rates. The window of exchanges is
/// as long as the change of rates (temperature) permits: the noisier the network, the longer.
///
/// `stddev_s` says what queues and rates leave open. For one-sided delays, the true offset is within two of
/// them in 90 to 98 % of all moments, in the first seconds in more. It is too small for delays that
/// are normally distributed about a mean, which queues do not make. The shortest delays of the two directions
/// are taken to be equal: nothing in the exchanges can show the contrary. If they differ, the offset is wrong
/// by half the difference, at most half the shortest round trip; `stddev_s` does not contain this,
/// `most_asymmetry_s()` is its bound.
///
/// Exchanges below the line contradict it: a clock has stepped (a laptop was suspended), or NTP changes its
/// rate. After two in a row that are far below, or three that are clearly below, only these count, and the
/// estimate begins again.
class ClockEstimator {
 public:
  /// Exchanges that ended before they began, or more than k_window_s before the newest one, are ignored.
  void add(const ClockExchange& exchange);

  /// The other clock at a moment of this one, usually now; nullopt before the first exchange.
  std::optional<ClockEstimate> estimate(Stamp local) const;

  /// The time to wait before the next question: short at the beginning and after a step, until the offset is
  /// known, then a fifth of a second.
  double wanted_interval_s() const;

  static constexpr double k_window_s = 100;   ///< older exchanges are dropped
  static constexpr std::size_t k_most = 512;  ///< at most so many are kept

 private:
  // An exchange in seconds since begin_, with base_ subtracted from the offset.
  struct Sample {
    double asked_s, arrived_s;
    double there_s;  // the delay there plus the offset
    double back_s;   // the delay back minus the offset
  };
  // The estimate for newest_s_.
  struct Fit {
    double offset_s = 0, rate = 0;
    double variance = 0, covariance = 0, rate_variance = 0;  // for offset_s and rate
    double there_s = 0, back_s = 0;  // the lines: the smallest there_s and back_s of Sample
    double scale_s = 0;              // how far the smallest delays are above the line, in the mean
    double window_s = k_window_s;    // how old the exchanges of the next fit may be
    double round_trip_s() const { return there_s + back_s; }
  };
  struct RatePrior {
    double mean = 0, stddev = 50e-6;  // two quartz clocks differ by 100 ppm at most
  };

  // How far an exchange is below the lines; at most one is greater than 0. Both are 0 if it is below both:
  // then the path has become shorter.
  struct Depth {
    double there_s = 0, back_s = 0;
    double most_s() const { return there_s > back_s ? there_s : back_s; }
  };

  Sample sample_of(const ClockExchange& exchange) const;
  Depth depth_of(const Sample& sample) const;
  double largest_depth_s(const Sample& sample) const;
  void begin_again(std::size_t exchanges, double offset_s);
  void drop_old();
  Fit fitted() const;

  Stamp begin_;
  std::chrono::nanoseconds base_{0};
  std::deque<Sample> samples_;
  double newest_s_ = 0;
  RatePrior prior_;
  Fit fit_;
  std::optional<Sample> odd_;  // the last exchange, if it contradicts those before; it is not in samples_
  int lower_there_ = 0, lower_back_ = 0;  // how many exchanges in a row are below that line
  int steps_ = 0;
};

}  // namespace limn::nodes
