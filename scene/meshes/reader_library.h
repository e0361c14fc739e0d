#pragma once

#include "core/program_library.h"

namespace limn::scene {

/// The shared library with assimp and Draco (scene/meshes/readers/), which would lengthen every start of the
/// program.
inline constexpr ProgramLibrary k_reader_library = {.file = "liblimn_meshes.so",
                                                    .variable = "LIMN_MESHES",
                                                    .purpose = "the readers of further mesh formats",
                                                    .build_package = "libassimp-dev"};

}  // namespace limn::scene
