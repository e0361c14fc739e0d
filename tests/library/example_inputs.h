#pragma once

#include <filesystem>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "core/rig.h"

/// What the examples of the library work on; all files are small.
namespace limn::test {

/// 640 x 480, a little distorted, at the world's origin.
Imager example_camera();
/// Two markers of 80 mm, 120 mm apart.
Body example_body();
/// Where the body is at image `i` of the video.
Pose world_from_example_body(int i);
/// The video's image `i`, 8-bit grey.
cv::Mat example_image(int i);
/// A camera and a projector in front of the door of config/scenes/door.
Rig example_rig();
inline constexpr const char* k_example_board = "charuco:8x6:40mm";

/// camera0.cameramodel, body.json, and the video's images image0.png … image(count-1).png.
void write_example_video(const std::filesystem::path& folder, int count);
/// Photographs of k_example_board: photo0.png …
void write_example_photographs(const std::filesystem::path& folder, int count);
/// rig/ of example_rig(), and poses.json for config/scenes/door.
void write_example_scene(const std::filesystem::path& folder);
/// captures/ of a curved surface of half a metre without noise, rig/ of its camera and projector, surface.ply
/// (m, the prototype's frame), and start.json, which is a centimetre off.
void write_example_scan(const std::filesystem::path& folder);
/// Where the surface stands in the rig's world.
Pose world_from_example_surface();
/// Its height at a point of its frame, m.
double example_height(double x, double y);

}  // namespace limn::test
