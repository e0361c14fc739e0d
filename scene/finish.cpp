#include "scene/finish.h"

#include <opencv2/imgproc.hpp>

#include "core/image_io.h"

namespace limn::scene {
namespace {

constexpr double k_largest_image_mm = 20000;  // as the largest prototype

double read_share(const ConfigNode& node, const char* key, double otherwise) {
  const auto found = node.find(key);
  if (!found) return otherwise;
  const double share = found->number();
  if (share < 0 || share > 1) found->problem(fmt::format("expected 0 to 1, found {}.", share));
  return share;
}

FinishImage read_finish_image(const ConfigNode& node) {
  node.only({"file", "size_mm", "prototype_from_image", "repeats"});
  FinishImage image;
  image.texture.file = node.at("file").path_inside().string();
  if (const auto repeats = node.find("repeats")) image.repeats = repeats->boolean();
  const auto pose = node.find("prototype_from_image");
  if (!pose && !node.find("size_mm")) return image;
  FinishImage::Projection projection;
  if (pose) projection.prototype_from_image = pose->pose();
  const ConfigNode size = node.at("size_mm");
  const auto sides = size.items();
  if (sides.size() == 2)
    projection.size_m =
        1e-3 * Eigen::Vector2d(sides[0].positive(k_largest_image_mm), sides[1].positive(k_largest_image_mm));
  else
    size.problem(fmt::format("expected width and height in mm, found {} numbers.", sides.size()));
  image.projection = projection;
  return image;
}

}  // namespace

Finish read_finish(const ConfigNode& node) {
  node.only(
      {"name", "base_colour", "metallic", "roughness", "clearcoat", "clearcoat_roughness", "mode", "image"});
  Finish finish;
  finish.name = node.at("name").text();
  if (finish.name.empty()) node.at("name").problem("expected a name, found an empty text.");
  const ConfigNode colour = node.at("base_colour");
  finish.base_colour = colour.vector3();
  if (finish.base_colour.minCoeff() < 0 || finish.base_colour.maxCoeff() > 1)
    colour.problem("expected linear light from 0 to 1 in red, green and blue.");
  finish.metallic = read_share(node, "metallic", 0);
  finish.roughness = read_share(node, "roughness", 1);
  finish.clearcoat = read_share(node, "clearcoat", 0);
  finish.clearcoat_roughness = read_share(node, "clearcoat_roughness", 0);
  if (const auto mode = node.find("mode")) finish.for_viewer = mode->choice({"surface", "view"}) == "view";
  if (const auto image = node.find("image")) finish.image = read_finish_image(*image);
  return finish;
}

Status load_finish_image(bool mesh_has_uvs, Finish* finish) {
  if (!finish->image) return {};
  Texture& texture = finish->image->texture;
  LIMN_TRY(texture.image, limn::read_image(texture.file, {.alpha = Alpha::kept}));
  if (texture.image.channels() == 1) cv::cvtColor(texture.image, texture.image, cv::COLOR_GRAY2BGR);
  if (finish->image->projection || mesh_has_uvs) return {};
  return error(
      "finish '{}': expected a prototype with texture coordinates for its image, found one without. Give the "
      "image's size_mm and prototype_from_image, or export the mesh with uv.",
      finish->name);
}

}  // namespace limn::scene
