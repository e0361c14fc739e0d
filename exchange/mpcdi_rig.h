#pragma once

#include <string>

#include "core/result.h"
#include "core/rig.h"
#include "exchange/mpcdi.h"

namespace limn::apps {

/// The projectors that a pinhole, or a lens of Limn's, describes; their world is the frame of `file`. Error:
/// there is none.
Result<Rig> mpcdi_rig(const Mpcdi& mpcdi, const std::string& file);

}  // namespace limn::apps
