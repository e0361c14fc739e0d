#pragma once

#include "exchange/exporter.h"

namespace limn::exchange {

/// Writes an archive of MPCDI 2.0 with every projector's points, shares and pose.
Exporter mpcdi_exporter();

}  // namespace limn::exchange
