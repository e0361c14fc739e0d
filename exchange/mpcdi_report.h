#pragma once

#include <nlohmann/json_fwd.hpp>

#include "exchange/mpcdi.h"

namespace limn::exchange {

/// A report of what an MPCDI file holds (limn.import/1).
nlohmann::ordered_json mpcdi_report(const Mpcdi& mpcdi);

}  // namespace limn::exchange
