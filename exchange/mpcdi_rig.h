#pragma once

#include <string>

#include "core/result.h"
#include "core/rig.h"
#include "exchange/mpcdi.h"

namespace limn::exchange {

/// The projectors that are described by a pinhole or by one of Limn's lenses; their world frame is the
/// coordinate frame of `file`. Error: there is none.
Result<Rig> mpcdi_rig(const Mpcdi& mpcdi, const std::string& file);

}  // namespace limn::exchange
