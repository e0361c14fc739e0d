#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/rig.h"
#include "projector/light_balance.h"
#include "projector/light_passes.h"
#include "projector/scene_cache.h"

namespace limn::projector {

/// What the renderer's views share. Each member outlives the views.
struct Shared {
  const Rig& rig;
  SceneCache& scene;
  LightBalance& balance;
  CanvasPool& canvases;
  PassTimes& times;
};

/// Draws the projectors' images, and data about their pixels.
class ProjectorView {
 public:
  static Result<ProjectorView> create(const Shared& shared);

  /// Links the programs for Compensation::measured. Must be called before drawing with it; further calls do
  /// nothing.
  Status link_measured();
  /// As Renderer::set_quick_motion.
  void set_quick_motion(bool wanted) { quick_motion_ = wanted; }
  /// Marks all images as outdated, so that they are drawn again.
  void invalidate();

  /// As Renderer::draw_projector, projector_image, clipped, surface_points and blend.
  GLuint draw(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);
  cv::Mat image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);
  cv::Mat clipped(std::size_t index) const { return cached_images_.at(index).clipped; }
  cv::Mat surface_points(std::size_t index, const scene::PosedScene& posed);
  cv::Mat blend(std::size_t index, const scene::PosedScene& posed);

 private:
  // What the centres of a projector's pixels see, and their blending shares (shaders/hit_cache.glsl).
  class HitCache final : public Bindable {
   public:
    HitCache() = default;
    HitCache(int width, int height);
    // Whether the contents belong to another stamp.
    bool is_outdated(GLuint stamp) const { return filled_at_ != stamp; }
    // Called before and after a drawing with this stamp.
    void begin(GLuint stamp) { stamp_ = stamp; }
    void end() { filled_at_ = stamp_; }
    void bind(const Use& use) const override;

   private:
    GlName hits_, shares_;
    GLuint stamp_ = 0, filled_at_ = 0;
  };
  // A projector's last image.
  struct CachedImage {
    Canvas display;
    HitCache hit_cache;
    scene::PosedScene posed;
    Pose imager_from_world;  // the viewer's pose
    cv::Mat image, clipped;  // read back from the GPU on demand
    bool is_current = false;
    bool is_quick = false;
    bool is_painted = false;  // SceneCache::is_painted()

    bool is_valid_for(const scene::PosedScene& posed_now, const Imager& viewer) const;
    void mark_valid_for(const scene::PosedScene& posed_now, const Imager& viewer);
  };

  explicit ProjectorView(const Shared& shared)
      : shared_(shared), cached_images_(shared.rig.projectors.size()) {}
  bool is_quick() const;
  const Smoothing& smoothing(bool is_quick) const;
  Status link_light(bool by_measurement, bool is_painted);
  LightPasses& light_passes();
  void find_places(std::size_t index, const Imager& viewer);
  cv::Rect changed_rect(std::size_t index, const scene::PosedScene& posed, const Imager& viewer) const;
  void draw_light(std::size_t index, const Canvas& light, const Resources& resources);
  void draw_display(std::size_t index,
                    const cv::Rect& changed,
                    const Canvas& light,
                    const Resources& resources);

  Shared shared_;
  // By compensation (1: by measurement), and by the prototype's paint (1: it has a finish or lines); linked
  // on demand.
  std::array<std::array<std::optional<LightPasses>, 2>, 2> light_passes_;
  ComputePass response_pass_;
  FullscreenPass points_pass_, blend_pass_;
  std::vector<GlName> responses_;
  std::vector<CachedImage> cached_images_;
  bool quick_motion_ = false;
  PlacesByMode light_places_;  // places of the projector drawn last
  std::vector<cv::Rect> view_places_, surface_places_;
};

}  // namespace limn::projector
