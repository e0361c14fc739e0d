#pragma once

#include <span>

#include "nodes/messages.h"

namespace limn::nodes {

/// The moment near `expected` at which displays refresh, so that the light of a frame that is planned for it
/// appears then: the first refresh that is not earlier than a quarter of a period before `expected`, which
/// keeps most of a period to draw in. The displays with the slowest rate count; those that are not in step
/// are met in their middle. Without any, and where what they state cannot be, the result is `expected`.
Stamp refresh_near(Stamp expected, std::span<const Refresh> displays);

}  // namespace limn::nodes
