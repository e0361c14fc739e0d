#pragma once

#include "exchange/exporter.h"

namespace limn::exchange {

/// Writes a floating-point image for each projector: the points that its pixels light.
Exporter warp_exporter();

}  // namespace limn::exchange
