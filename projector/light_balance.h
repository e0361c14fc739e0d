#pragma once

#include <Eigen/Core>
#include <optional>

#include "projector/canvas.h"
#include "projector/compensation.h"
#include "projector/pass.h"
#include "projector/scene_cache.h"

namespace limn::projector {

/// The prototype's albedo on the GPU.
class PrototypeAlbedo final : public Bindable {
 public:
  explicit PrototypeAlbedo(const scene::Prototype& prototype);
  /// Binds Resource::albedo.
  void bind(const Use& use) const override;

 private:
  GlName relative_;  // Divided by its mean.
  float mean_ = 0;
};

/// The compensation of colours (compensation.h), for shaders/balance.glsl.
class LightBalance final : public Bindable {
 public:
  static Result<LightBalance> create(const scene::Scene& scene);

  const LightOptions& options() const { return options_; }
  const PrototypeAlbedo& albedo() const { return albedo_; }
  /// Returns false when nothing changes. Compensation::measured needs an earlier call of measure().
  bool set_options(const LightOptions& options);
  /// Uploads a measured surface, and makes the scene keep the ids that its camera sees. Error: no projector
  /// lit the surface; then nothing changes.
  Status measure(const MeasuredSurface& surface, const Rig& rig, SceneCache* scene, CanvasPool* canvases);
  /// Computes the default of LightOptions::level. To be called before the first drawing in which the
  /// prototype is placed.
  void find_level(const Rig& rig, const scene::PosedScene& posed);
  /// Binds Resource::light_balance.
  void bind(const Use& use) const override;

 private:
  LightBalance(const scene::Scene& scene, FullscreenPass irradiance);

  FullscreenPass irradiance_;
  LightOptions options_;
  std::optional<scene::Prototype> prototype_;
  PrototypeAlbedo albedo_;
  std::optional<SurfaceMixing> surface_;     // Its layers are kept only on the GPU.
  std::optional<double> level_by_geometry_;  // For the first pose of the prototype.
  GlName mixing_;
};

}  // namespace limn::projector
