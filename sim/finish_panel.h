#pragma once

#include <map>
#include <string>

namespace limn::sim {

/// Meshes with all textures of glTF's metallic-roughness materials, to judge looks by: file name -> glb
/// (metres). `panel`, a bowed board of 0.5 x 0.34 m as the prototype, x right, y up, z out of it, its middle
/// at the origin; `emblem`, a cushion to stand before it, and `plate`, a sheet that lies on the panel with
/// its middle on the panel's. config/scenes/finishes holds what this makes; a test compares them.
std::map<std::string, std::string> finish_panel_files();

}  // namespace limn::sim
