#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/imager.h"
#include "scene/posed_scene.h"
#include "sim/ray_scene.h"
#include "sim/reference_brdf.h"
#include "sim/reference_lines.h"
#include "sim/world.h"

namespace limn::sim {

/// Parts in an image: linear light (CV_32FC3, BGR) and the share of each pixel that they cover (CV_32F). Both
/// are means over the pixel's area, so light is already multiplied by cover.
struct PartImage {
  cv::Mat light;
  cv::Mat cover;
};

/// What each pixel's centre shows. `front` (CV_16S) is the index of the visible part, -1 for none;
/// `contested` (CV_8U) is 255 where the ray hits a part and something else, so that their depth order
/// matters.
struct DepthOrder {
  cv::Mat front;
  cv::Mat contested;
};

/// A ray tracer that computes which light should fall on the prototype, and how the parts look in an imager.
/// It is the reference for projector/: it follows the same conventions (scene/scene.h, shaders/shading.glsl),
/// but shares no code with it. Only the prototype occludes and casts shadows. Borrows the world and its
/// scene's meshes, which must outlive it unchanged.
class ReferenceRenderer {
 public:
  /// `view` parts are drawn for `viewer`. If no room light is given, the lamp that shades the parts stands
  /// beside the viewer.
  ReferenceRenderer(const World& world, const scene::PosedScene& parts, const Imager& viewer);

  /// The light that projector `index` should give if it were the only one. For each point that a pixel
  /// lights: the colour of the view part that the viewer sees in front of it, else that of the surface part
  /// within 2 mm of it, else that of the prototype's line of light or finish.
  PartImage projector_image(std::size_t index) const;

  /// The parts as an imager sees them, without those that the prototype hides, over the prototype's lines of
  /// light and its finish. If no room light is known, the lamp moves with the imager.
  PartImage parts_image(const Imager& imager) const;

  DepthOrder depth_order(const Imager& imager) const;

 private:
  struct Part {
    RayScene rays;
    const scene::Mesh* mesh;
    bool on_surface;
    int owner;  // the slot's index + 1
    Pose part_from_world;
    bool is_cut;
    std::vector<bool> closed;  // for each triangle, whether its piece closes; only of a part that is cut
    const scene::Volume* volume = nullptr;  // what its cap shows; null: none
    scene::GreyWindow window = {};
  };
  struct Sample {
    int part = -1;
    Eigen::Vector3f light = Eigen::Vector3f::Zero();
  };
  struct Nearest {
    int part = -1;
    Hit hit;
    std::optional<Eigen::Vector3d> p_cap = {};  // where a cap is met; then `hit` has no triangle
  };
  template <class SampleAt>
  static PartImage averaged(const Imager& imager, const SampleAt& sample_at);

  SurfaceMaterial finish_at(const Hit& hit, const Eigen::Vector3d& p) const;
  Sample finish_sample(const Hit& hit,
                       const Ray& ray,
                       const Eigen::Vector3d& p_eye,
                       const PartsLight& light) const;
  Nearest first_of(std::size_t part, const Ray& ray) const;
  Hit first_kept(const Part& part, const Ray& ray, int* windings) const;
  Eigen::Vector3f cap_colour(const Part& part, const Eigen::Vector3d& p) const;
  Sample paint_sample(const Hit& hit,
                      const Ray& ray,
                      const Eigen::Vector3d& p_eye,
                      const PartsLight& light) const;
  static SurfaceMaterial material_at(const Part& part, const Hit& hit);
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
  const scene::Finish* finish_ = nullptr;  // null: none
  std::optional<scene::CutPlane> cut_;     // in the world
  ReferenceLines lines_;
  Pose prototype_from_world_;
  Eigen::Vector3d p_viewer_;
  PartsLight light_;
};

}  // namespace limn::sim
