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
  /// Resource::albedo.
  void bind(const Use& use) const override;

 private:
  GlName relative_;  // over its mean
  float mean_ = 0;
};

/// How wanted colours become light (compensation.h), for shaders/balance.glsl.
class LightBalance final : public Bindable {
 public:
  static Result<LightBalance> create(const scene::Scene& scene);

  const LightOptions& options() const { return options_; }
  const PrototypeAlbedo& albedo() const { return albedo_; }
  /// False when they were so already. Compensation::measured needs measure() before.
  bool set_options(const LightOptions& options);
  /// Takes a measured surface to the GPU; the scene then remembers what its camera saw. Error, and nothing
  /// changes: a surface that shows nothing.
  Status measure(const MeasuredSurface& surface, const Rig& rig, SceneCache* scene, CanvasPool* canvases);
  /// Before the first drawing with the prototype in its place: finds the level of light that most of it can
  /// reach.
  void find_level(const Rig& rig, const scene::PosedScene& posed);
  /// Resource::light_balance.
  void bind(const Use& use) const override;

 private:
  LightBalance(const scene::Scene& scene, FullscreenPass irradiance);

  FullscreenPass irradiance_;
  LightOptions options_;
  std::optional<scene::Prototype> prototype_;
  PrototypeAlbedo albedo_;
  std::optional<SurfaceMixing> surface_;     // its layers are on the GPU
  std::optional<double> level_by_geometry_;  // of the first place that the prototype had
  GlName mixing_;
};

}  // namespace limn::projector
