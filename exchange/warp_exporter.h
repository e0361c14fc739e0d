#pragma once

#include "exchange/exporter.h"

namespace limn::apps {

/// A floating-point image for each projector: the point that each of its pixels lights.
Exporter warp_exporter();

}  // namespace limn::apps
