#include "core/version.h"

namespace limn {

std::string_view version() { return LIMN_VERSION; }

}  // namespace limn
