#pragma once

#include <vector>

#include "scene/room_image.h"
#include "validate/demo_page.h"
#include "validate/demo_room.h"

namespace limn::validate {

/// The light of a photographer's studio as a picture of the room, whose middle lies in front of the door.
scene::RoomImage studio(const Pose& world_from_door);

/// Photographs of the door in a dim room, before and after it is painted in light with its first finish,
/// which mirrors the scene's picture of the room, with the parts on it.
std::vector<DemoImage> painted_images(const DemoSubject& subject, const DimRoom& room);

}  // namespace limn::validate
