#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/imager.h"
#include "scene/posed_scene.h"
#include "sim/ray_scene.h"
#include "sim/reference_brdf.h"
#include "sim/world.h"

namespace limn::sim {

/// Parts in an image: linear light (CV_32FC3, BGR) and the share of each pixel that they cover (CV_32F). The
/// mean over the pixel's area, so light is already multiplied by cover.
struct PartImage {
  cv::Mat light;
  cv::Mat cover;
};

/// What each pixel's centre shows: `front` (CV_16S) is the index of the part seen, -1 where none is;
/// `contested` (CV_8U) is 255 where the ray meets a part and something else, so that their order matters.
struct DepthOrder {
  cv::Mat front;
  cv::Mat contested;
};

/// What the parts of a posed scene ask for, by rays: which light is to fall on the prototype, how the parts
/// look over an image. The judge of what projector/ draws; it follows the same conventions (scene/scene.h,
/// shaders/look.glsl) in code of its own. Only the prototype hides and shadows.
/// Borrows the world and its scene's meshes, which must outlive it unchanged.
class ReferenceRenderer {
 public:
  /// `viewer` is whose eye `view` parts are drawn for, and beside whom the lamp stands that shades parts
  /// where neither they nor the scene name a room's light.
  ReferenceRenderer(const World& world, const scene::PosedScene& parts, const Imager& viewer);

  /// The light that projector `index` is to give if it were alone: for each point that a pixel lights the
  /// colour of the view part that the viewer sees before it, else of the surface part within 2 mm of it.
  PartImage projector_image(std::size_t index) const;

  /// The parts as an imager sees them, those that the prototype hides left out; where no room's light is
  /// known the shading lamp stands with the imager.
  PartImage parts_image(const Imager& imager) const;

  DepthOrder depth_order(const Imager& imager) const;

 private:
  struct Part {
    RayScene rays;
    const scene::Mesh* mesh;
    bool on_surface;
  };
  struct Sample {
    int part = -1;
    Eigen::Vector3f light = Eigen::Vector3f::Zero();
  };
  struct Nearest {
    int part = -1;
    Hit hit;
  };
  template <class SampleAt>
  static PartImage averaged(const Imager& imager, const SampleAt& sample_at);

  Nearest nearest_part(const Ray& ray) const;
  bool is_hidden(const Nearest& nearest, const Ray& ray, const Hit& behind) const;
  Eigen::Vector3f radiance_along(const Eigen::Vector3d& d,
                                 const Nearest& nearest,
                                 const PartsLight& light) const;
  Eigen::Vector3f radiance_on_surface(const Nearest& nearest, const Eigen::Vector3d& d_normal) const;
  Sample view_sample(const Eigen::Vector3d& p, const Eigen::Vector3d& n_face) const;
  Sample surface_sample(const Eigen::Vector3d& p, const Eigen::Vector3d& n) const;
  Sample light_along(const Ray& ray) const;
  Sample parts_along(const Ray& ray, const PartsLight& light) const;

  const World& world_;
  RayScene prototype_;
  std::vector<Part> parts_;
  Eigen::Vector3d p_eye_;
  PartsLight light_;
};

}  // namespace limn::sim
