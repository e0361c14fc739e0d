#pragma once

#include <map>
#include <string>

#include "scene/scene.h"

namespace limn::sim {

/// The project's own prototype: a clay-like car-door panel, 0.6 x 0.4 m with 0.1 m of relief (barrel, swage
/// line, handle recess), eight AprilTag plates, a rear-view mirror in three variants (slot "mirror") and a
/// trim line on the surface (slot "trim"). Frame: x right (towards the rear of the car), y up, z out of the
/// door towards the onlooker; origin in the panel's middle. config/scenes/door holds what this makes; a test
/// compares them.
scene::Scene car_door_scene();

/// Where the slots' markers stand on the door: prototype_from_marker by slot. They are no part of the scene,
/// for designers move them; the worlds of config/ start with these.
std::map<std::string, Pose> car_door_slot_places();

/// The scene's folder: file name -> content (scene.json and the meshes as glb).
std::map<std::string, std::string> car_door_files();

}  // namespace limn::sim
