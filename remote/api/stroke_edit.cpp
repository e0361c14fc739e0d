#include "remote/api/stroke_edit.h"

#include <fmt/format.h>

namespace limn::remote {

Result<scene::Edit> stroke_edit(const StrokeMessage& message, const Imager& over_prototype) {
  const Eigen::Vector3d p = 1e3 * over_prototype.imager_from_world.inverse().translation;
  std::string value = fmt::format("rays {:.4f} {:.4f} {:.4f}", p.x(), p.y(), p.z());
  int count = 0;
  for (const Eigen::Vector2d& px : message.px) {
    const auto ray = over_prototype.ray(px);
    if (!ray) continue;
    // 1e-8 at a distance of some metres is far below a micrometre.
    value += fmt::format(" {:.8f} {:.8f} {:.8f}", ray->d.x(), ray->d.y(), ray->d.z());
    ++count;
  }
  if (count == 0) return error("px: expected points in the picture, found none.");
  return scene::make_edit(message.moves ? scene::ActionId::move_line : scene::ActionId::draw_line,
                          message.line, value);
}

}  // namespace limn::remote
