#pragma once

#include <string_view>

namespace limn {

/// The version of this build, "X.Y.Z", from the top CMakeLists.txt.
std::string_view version();

}  // namespace limn
