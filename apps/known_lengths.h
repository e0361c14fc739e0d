#pragma once

#include <vector>

#include "calib/judge/known_length.h"
#include "core/rig.h"

namespace limn::apps {

/// The markers of the lengths as the tracker finds them in every camera's white pictures of every pose; the
/// first projector's that shows one. An unknown family is an error.
Result<std::vector<calib::SeenMark>> seen_marks(const calib::Captures& captures,
                                                const Rig& rig,
                                                const std::vector<calib::KnownLength>& lengths);

/// The lengths of capture.json and of the command line.
Result<std::vector<calib::KnownLength>> known_lengths(const calib::Captures& captures,
                                                      const std::vector<std::string>& options);

}  // namespace limn::apps
