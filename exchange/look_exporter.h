#pragma once

#include "exchange/exporter.h"

namespace limn::exchange {

/// Writes an image for each variant of each placed slot, as the viewer sees it over black.
Exporter look_exporter();

}  // namespace limn::exchange
