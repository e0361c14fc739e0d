#pragma once

#include "scene/finish.h"
#include "scene/meshes/mesh.h"

namespace limn::remote {

/// A prototype's mesh in a finish, for the page's 3D view, which knows materials alone. An image is mixed
/// with the colour; a decal that is projected is left out.
scene::Mesh painted_mesh(scene::Mesh mesh, const scene::Finish& finish);

}  // namespace limn::remote
