#pragma once

#include "core/imager.h"
#include "core/result.h"
#include "remote/api/messages.h"
#include "scene/actions.h"

namespace limn::remote {

/// The edit (draw_line or move_line) for points in a camera's image: rays in the prototype's frame, which is
/// the world of `over_prototype`. Points that the lens has no ray for are left out. Error: none has one.
Result<scene::Edit> stroke_edit(const StrokeMessage& message, const Imager& over_prototype);

}  // namespace limn::remote
