#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

#include "core/imager.h"
#include "scene/posed_scene.h"

namespace limn::projector {

/// Boxes (the prototype's frame, m) around the light of what differs between the drawn lines of two scenes.
/// Nullopt: something else differs, or so much that a whole image is drawn sooner.
std::optional<std::vector<Eigen::AlignedBox3d>> changed_lines(const scene::PosedScene& before,
                                                              const scene::PosedScene& now);

/// The part of a projector's image that such boxes can light, with pixels whose smoothing they change. Empty:
/// they are beside the image. Nullopt: a box has no pixel, for example behind the projector.
std::optional<cv::Rect> rect_around(const std::vector<Eigen::AlignedBox3d>& boxes,
                                    const Pose& world_from_prototype,
                                    const Imager& projector);

}  // namespace limn::projector
