#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "validate/demo_page.h"
#include "validate/demo_room.h"

namespace limn::validate {

/// Adds to the door's scene what the images below show: lines of light, and a section of its first slot.
Status add_clay_work(scene::Scene* scene);

/// Lines of light on the door: section lines, a text and a dimension.
std::vector<DemoImage> line_images(const DemoSubject& subject, const DimRoom& room);

/// A plane that cuts the mirror open, in light, and the door, too, in a view for a screen.
std::vector<DemoImage> cut_images(const DemoSubject& subject, const DimRoom& room);

/// The deviation of a door whose clay is not as its CAD: scanned by the virtual rig with the calibrated rig
/// (captures in `folder`, which is removed again), compared, and painted on the clay.
Result<std::vector<DemoImage>> deviation_images(const DemoSubject& subject,
                                                const std::filesystem::path& folder);

}  // namespace limn::validate
