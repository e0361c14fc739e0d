#pragma once

#include <string>

namespace limn::validate {

/// The result of one test of `limn doctor`.
struct Finding {
  enum class State { works, fails, note };  ///< A note is about something that was not asked for.
  std::string area;                         ///< packages, clock, gl, displays, cameras, devices or room
  std::string name;
  State state = State::works;
  std::string text;
  std::string advice;  ///< What to do; empty where nothing is to be done.
};

}  // namespace limn::validate
