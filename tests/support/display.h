#pragma once

#include <cstdlib>

namespace limn::test {

/// Whether there is an X server. Tests that send keys and clicks to a window need it.
inline bool has_x_server() { return std::getenv("DISPLAY") != nullptr; }

/// Whether there is a desktop, X or Wayland. Tests that only open a window need it.
inline bool has_desktop() { return has_x_server() || std::getenv("WAYLAND_DISPLAY"); }

}  // namespace limn::test
