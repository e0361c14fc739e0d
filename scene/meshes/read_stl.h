#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads an STL file, binary or ASCII, whatever its first word is. Bytes behind the last facet are ignored.
/// Colours of facets are read in the way of VisCAM (RGB, valid where bit 15 is set) and, with COLOR= in the
/// header, of Materialise Magics (BGR, valid where bit 15 is not set); they are taken as sRGB. Errors: a
/// file that ends inside a facet, fewer facets than the header says.
Result<MeshContent> read_stl(const std::filesystem::path& path);

}  // namespace limn::scene
