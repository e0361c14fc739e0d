#pragma once

#include <map>
#include <string>

namespace limn::sim {

/// Meshes that use all textures of glTF's metallic-roughness materials, for testing the shading: file name ->
/// glb (metres). `panel` is the prototype, a curved board of 0.5 x 0.34 m with its middle at the origin; x
/// right, y up, z out of it. `emblem` is a cushion that stands in front of it. `plate` is a sheet that lies
/// on the panel, middle on middle. config/scenes/finishes holds these files; a test compares them.
std::map<std::string, std::string> finish_panel_files();

}  // namespace limn::sim
