#pragma once

namespace limn::projector {

#include "shaders/bindings.glsl"

}  // namespace limn::projector
