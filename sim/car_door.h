#pragma once

#include <map>
#include <string>

#include "scene/scene.h"

namespace limn::sim {

/// The project's own prototype: a clay-like car-door panel, 0.6 x 0.4 m with 0.1 m of relief (barrel, swage
/// line, handle recess), eight AprilTag plates, a rear-view mirror in three variants (slot "mirror") and a
/// trim line on the surface (slot "trim"), and two finishes. Frame: x right (towards the rear of the car), y
/// up, z out of the door towards the viewer; the origin is in the panel's middle. config/scenes/door holds
/// the files made from this; a test compares them.
scene::Scene car_door_scene();

/// Where the slots' markers stand on the door: slot name -> prototype_from_marker. They are not part of the
/// scene, because designers move them; the worlds in config/ start with these poses.
std::map<std::string, Pose> car_door_slot_places();

/// The files of the scene's folder: file name -> content (scene.json and the meshes as glb).
std::map<std::string, std::string> car_door_files();

}  // namespace limn::sim
