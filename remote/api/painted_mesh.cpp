#include "remote/api/painted_mesh.h"

#include <utility>

#include "core/photometric_response.h"

namespace limn::remote {
namespace {

// The finish's colour with the image over it, as an image without alpha.
cv::Mat flattened_image(const cv::Mat& image, const Eigen::Vector3d& base_rgb) {
  if (image.channels() != 4) return image;
  cv::Mat out(image.size(), CV_8UC3);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column) {
      const auto& over = image.at<cv::Vec4b>(row, column);
      for (int c = 0; c < 3; ++c) {
        const double light =
            base_rgb[2 - c] + over[3] / 255.0 * (linear_from_srgb(over[c] / 255.0) - base_rgb[2 - c]);
        out.at<cv::Vec3b>(row, column)[c] = cv::saturate_cast<std::uint8_t>(255 * srgb_from_linear(light));
      }
    }
  return out;
}

}  // namespace

scene::Mesh painted_mesh(scene::Mesh mesh, const scene::Finish& finish) {
  scene::Material material;
  material.base_colour = finish.base_colour.cast<float>();
  material.metallic = static_cast<float>(finish.metallic);
  material.roughness = static_cast<float>(finish.roughness);
  material.coat.factor = static_cast<float>(finish.clearcoat);
  material.coat.roughness = static_cast<float>(finish.clearcoat_roughness);
  if (const auto& image = finish.image; image && (image->repeats || !image->projection)) {
    if (const auto& projection = image->projection) {
      const Pose image_from_prototype = projection->prototype_from_image.inverse();
      mesh.uvs.clear();
      for (const Eigen::Vector3f& p : mesh.positions) {
        const Eigen::Vector3d p_image = image_from_prototype * p.cast<double>();
        const Eigen::Array2d uv = p_image.head<2>().cwiseQuotient(projection->size_m).array() + 0.5;
        mesh.uvs.push_back(uv.matrix().cast<float>());
      }
    }
    material.texture = flattened_image(image->texture.image, finish.base_colour);
    material.base_colour.setOnes();
  }
  mesh.materials = {material};
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  mesh.second_uvs.clear();
  mesh.tangents.clear();
  mesh.colours.clear();
  return mesh;
}

}  // namespace limn::remote
