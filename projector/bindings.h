#pragma once

namespace limn::projector {

#include "projector/shaders/bindings.glsl"

}  // namespace limn::projector
