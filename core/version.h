#pragma once

#include <string_view>

namespace limn {

/// The version of this build, "X.Y.Z", as the top CMakeLists.txt states it.
std::string_view version();

}  // namespace limn
