#pragma once

#include <nlohmann/json_fwd.hpp>

#include "scene/section.h"

namespace limn::remote {

/// How a page draws a part that the section cuts (`cut` of docs/remote.md): the plane in the part's frame,
/// and the cap's colour and hatch. `owner` as across_hatch() takes it.
nlohmann::ordered_json part_cut_json(const scene::Section& section,
                                     const scene::CutPlane& plane_part,
                                     int owner);

}  // namespace limn::remote
