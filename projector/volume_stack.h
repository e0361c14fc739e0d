#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "core/result.h"
#include "projector/gl.h"
#include "scene/scene.h"

namespace limn::projector {

/// A volume in a VolumeStack, and how it is shown.
struct StackedVolume {
  int index = -1;  ///< -1: there is none.
  scene::GreyWindow window = {};
  bool operator==(const StackedVolume&) const = default;
};

/// The volumes of a scene on the GPU: one 3D texture in which they lie on top of each other, and for each
/// part (owner) where it lies in the texture (shaders/cap.glsl). A scene without a section shows no slices;
/// then it is empty.
class VolumeStack {
 public:
  /// Error: together they are larger than the driver's 3D textures, or than 2 GiB.
  static Status check_fits(const scene::Scene& scene);
  explicit VolumeStack(const scene::Scene& scene);

  bool is_empty() const { return volumes_.empty(); }
  /// The volume of a variant, with the window that people chose, if any.
  StackedVolume find(const std::string& slot,
                     const std::string& variant,
                     const std::optional<scene::GreyWindow>& chosen) const;

  /// Forgets the places of all parts; there are `owners` of them.
  void begin(int owners);
  /// States where the volume of a part is.
  void place(int owner, const StackedVolume& shown, const Pose& owner_from_scene);
  /// Uploads the places.
  void upload();
  void bind() const;

 private:
  struct Entry {
    scene::GreyWindow window;  // that of the scene or its file
    Eigen::Affine3d texture_from_part;
    Eigen::Vector3d lower, upper;  // the centres of its outermost texels
  };
  struct GpuPlace {
    Eigen::Vector4f rows[3];  // their products with (p, 1), scene frame, are the texture coordinates
    Eigen::Vector4f lower =
        Eigen::Vector4f::Zero();  // least coordinates; w: 1 / width of the window, 0: no volume
    Eigen::Vector4f upper = Eigen::Vector4f::Zero();  // greatest coordinates; w: the value that is black
  };
  std::vector<Entry> volumes_;
  std::map<std::string, std::map<std::string, int>> indices_;  // by slot and variant
  std::vector<GpuPlace> gpu_places_;
  GlName texels_, places_, place_texels_;
};

}  // namespace limn::projector
