#include "session/drawing/card_slice.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/names.h"
#include "scene/volume_part.h"

namespace limn::session {
namespace {

constexpr double k_texel_m = 5e-4;        // about a projector's pixel on a table
constexpr int k_most_texels_along = 800;  // a larger card has larger texels
constexpr int k_tile = 80;                // texels along a sign: 40 mm, over which a lens hardly bends lines

// A volume that the card may show.
struct Shown {
  const scene::Volume* volume = nullptr;
  scene::GreyWindow window;
  Eigen::Affine3d voxel_from_card;
};

std::vector<Shown> shown_volumes(const scene::Scene& scene,
                                 const scene::PosedScene& posed,
                                 const Pose& world_from_card) {
  std::vector<Shown> out;
  for (const scene::PosedPart& part : posed.parts) {
    const scene::Slot* slot = scene.find_slot(part.slot);
    const scene::Variant* variant = slot ? find_named(slot->variants, part.variant) : nullptr;
    if (!variant || !variant->volume || !scene.section->cuts(part.slot)) continue;
    const Pose part_from_card = part.world_from_part.inverse() * world_from_card;
    out.push_back({variant->volume.get(), scene::shown_window(*variant, part.window),
                   variant->volume->part_from_voxel.inverse() * Eigen::Affine3d(part_from_card.matrix())});
  }
  return out;
}

// The value at p, linear between the centres of voxels; nullopt outside of the voxels.
std::optional<double> value_at(const scene::Volume& volume, const Eigen::Vector3d& p_voxel) {
  const Eigen::Array3d last = Eigen::Array3d(volume.size[0], volume.size[1], volume.size[2]) - 1;
  if (!((p_voxel.array() >= -0.5) && (p_voxel.array() <= last + 0.5)).all()) return std::nullopt;
  const Eigen::Array3d at = p_voxel.array().max(0).min(last), low = at.min(last - 1).floor(),
                       share = at - low;
  const std::size_t row = static_cast<std::size_t>(volume.size[0]),
                    layer = row * static_cast<std::size_t>(volume.size[1]);
  const float* first = volume.values.data() + static_cast<std::size_t>(low[0]) +
                       row * static_cast<std::size_t>(low[1]) + layer * static_cast<std::size_t>(low[2]);
  const auto along_x = [&](std::size_t offset) {
    const double a = static_cast<double>(first[offset]), b = static_cast<double>(first[offset + 1]);
    return a + share[0] * (b - a);
  };
  const auto along_y = [&](std::size_t offset) {
    const double a = along_x(offset), b = along_x(offset + row);
    return a + share[1] * (b - a);
  };
  const double a = along_y(0), b = along_y(layer);
  return a + share[2] * (b - a);
}

// Its levels are display values: grey of a window is perceived brightness, which projectors show for them.
std::uint8_t level_at(const std::vector<Shown>& all, const Eigen::Vector3d& p_card) {
  for (const Shown& shown : all)
    if (const auto value = value_at(*shown.volume, shown.voxel_from_card * p_card)) {
      const double grey = 0.5 + (*value - shown.window.level) / shown.window.width;
      return static_cast<std::uint8_t>(std::lround(255 * std::clamp(grey, 0.0, 1.0)));
    }
  return 0;
}

cv::Mat slice_image(const std::vector<Shown>& all, const Eigen::Vector2d& size_m) {
  const double texel_m = std::max(k_texel_m, size_m.maxCoeff() / k_most_texels_along);
  const int columns = std::max(1, static_cast<int>(std::lround(size_m.x() / texel_m))),
            rows = std::max(1, static_cast<int>(std::lround(size_m.y() / texel_m)));
  cv::Mat image(rows, columns, CV_8UC3);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector3d p_card(size_m.x() * ((column + 0.5) / columns - 0.5),
                                   size_m.y() * ((row + 0.5) / rows - 0.5), 0);
      image.at<cv::Vec3b>(row, column) = cv::Vec3b::all(level_at(all, p_card));
    }
  return image;
}

}  // namespace

std::vector<projector::Overlay> card_overlays(const scene::Scene& scene,
                                              const scene::PosedScene& posed,
                                              const Pose& world_from_card,
                                              std::size_t projector,
                                              std::size_t projectors) {
  std::vector<projector::Overlay> out;
  if (!scene.section || !scene.section->card_size_m || !posed.world_from_prototype) return out;
  const std::vector<Shown> all = shown_volumes(scene, posed, world_from_card);
  if (all.empty()) return out;
  const Eigen::Vector2d size_m = *scene.section->card_size_m;
  const Pose prototype_from_card = posed.world_from_prototype->inverse() * world_from_card;
  // The rectangle from (x, y) to (x + width, y + height), as shares of the card.
  const auto place = [&](double x, double y, double width, double height) {
    return projector::OverlayPlace{
        prototype_from_card * Eigen::Vector3d(size_m.x() * (x - 0.5), size_m.y() * (y - 0.5), 0),
        prototype_from_card.rotation * Eigen::Vector3d(size_m.x() * width, 0, 0),
        prototype_from_card.rotation * Eigen::Vector3d(0, size_m.y() * height, 0)};
  };
  for (std::size_t i = 0; i < projectors; ++i)
    if (i != projector)
      out.push_back(projector::SignOverlay{i, cv::Mat::zeros(8, 8, CV_8UC3), place(0, 0, 1, 1)});
  const cv::Mat image = slice_image(all, size_m);
  for (int row = 0; row < image.rows; row += k_tile)
    for (int column = 0; column < image.cols; column += k_tile) {
      const cv::Rect tile = cv::Rect(column, row, k_tile, k_tile) & cv::Rect(0, 0, image.cols, image.rows);
      out.push_back(
          projector::SignOverlay{projector, image(tile).clone(),
                                 place(1.0 * tile.x / image.cols, 1.0 * tile.y / image.rows,
                                       1.0 * tile.width / image.cols, 1.0 * tile.height / image.rows)});
    }
  return out;
}

}  // namespace limn::session
