#pragma once

// Motions of a hand that moves a marker, generated.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/pose.h"
#include "tests/support/random.h"

namespace limn::test {

/// Reaches from place to place with rests between them: each reach has the smoothest jerk (Flash and Hogan,
/// "The coordination of arm movements", 1985), its duration grows with its length as Fitts' law has it.
/// `largest_m`: the longest reach; `tremor_m`: amplitude of a tremor of 8 to 12 Hz while the hand holds.
class Reaches {
 public:
  Reaches(const Pose& about, double largest_m, double tremor_m, double seconds, std::mt19937_64& rng)
      : tremor_m_(tremor_m), tremor_hz_(uniform(rng, 8, 12)) {
    Pose place = about;
    for (double at = 0; at < seconds;) {
      const double length = uniform(rng, 0.2, 1) * largest_m;
      Vector6d step = Vector6d::NullaryExpr([&](auto) { return uniform(rng, -1, 1); });
      step.tail<3>() *= length / step.tail<3>().norm();
      step.head<3>() *= 2 * length;  // 2 rad for each metre
      const Pose next{exp_rotation(step.head<3>()) * about.rotation,
                      about.translation + 0.5 * step.tail<3>()};
      const double duration = 0.3 + 0.15 * std::log2(1 + length / 0.01);
      legs_.push_back({at, duration, place, next});
      at += duration + uniform(rng, 0.2, 1.2);
      place = next;
    }
  }

  Pose at(double seconds) const {
    const Leg* leg = &legs_.front();
    for (const Leg& each : legs_) {
      if (each.begins > seconds) break;
      leg = &each;
    }
    const double s = std::clamp((seconds - leg->begins) / leg->duration, 0.0, 1.0);
    const double share = s * s * s * (10 - 15 * s + 6 * s * s);
    Pose pose = interpolated(leg->from, leg->to, share);
    const double turn = 2 * std::numbers::pi * tremor_hz_ * seconds;
    pose.translation +=
        tremor_m_ * Eigen::Vector3d(std::sin(turn), std::cos(1.07 * turn), std::sin(0.93 * turn));
    return pose;
  }

 private:
  struct Leg {
    double begins, duration;
    Pose from, to;
  };
  std::vector<Leg> legs_;
  double tremor_m_, tremor_hz_;
};

}  // namespace limn::test
