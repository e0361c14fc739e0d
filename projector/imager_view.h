#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "projector/contact_shadow.h"
#include "projector/parts_passes.h"
#include "projector/projector_view.h"
#include "projector/renderer.h"

namespace limn::projector {

/// For each part, the weight with which a composite also draws what projected light can show: one byte for
/// each owner, 255 is all.
class CompositeWeights final : public Bindable {
 public:
  /// All weights are 0.
  CompositeWeights() = default;
  explicit CompositeWeights(Composite what);
  /// A slot without a policy gets 0. `slots`: the slot names in the order of owners, from owner 1 on.
  CompositeWeights(std::span<const CompositePolicy> policies, std::span<const std::string> slots);
  /// Binds Resource::composite_weights.
  void bind(const Use& use) const override { use.program.set_bits("u_composite_weights", bytes_); }
  bool operator==(const CompositeWeights& other) const { return bytes_ == other.bytes_; }

 private:
  std::array<GLuint, 64> bytes_ = {};
};

/// Draws the parts as cameras, viewers and virtual cameras see them.
class ImagerView {
 public:
  static Result<ImagerView> create(const Shared& shared, const scene::Scene& scene);

  /// As Renderer::set_smoothing and set_contact_shadow.
  void set_smoothing(const Smoothing& smoothing) { smoothing_ = smoothing; }
  Status set_contact_shadow(const scene::Scene* scene);

  /// Kind of composite. Each kind has its own cache.
  enum class Kind { rest, full, each };
  /// As Renderer::composite, view, coverage and illuminated_patches.
  cv::Mat composite(const Imager& camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    Kind kind,
                    const CompositeWeights& weights);
  cv::Mat view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background);
  std::vector<PartCoverage> coverage(const scene::PosedScene& posed, const Imager& viewer);
  IlluminatedPatches illuminated_patches(const Imager& imager, const scene::PosedScene& posed, int side_px);

  const std::vector<std::string>& slot_names() const { return slot_names_; }

 private:
  // The parts last drawn for an imager.
  struct Overlay {
    Imager imager;
    bool is_view = false;
    Kind kind = Kind::rest;
    CompositeWeights weights;
    std::optional<scene::PosedScene> posed;  // The scene that was drawn; empty: nothing valid.
    std::vector<PlacedRun> runs;             // The meshes that were drawn.
    std::vector<cv::Rect> places;            // Rectangles that may contain parts; all else is 0.
    Canvas parts;
    GlName behind;  // The background image.
    Canvas out;

    bool is_valid_for(const Imager& imager_now,
                      const scene::PosedScene& posed_now,
                      const CompositeWeights& weights_now) const;
    // Whether pixels without a mesh that changed look as before.
    bool keeps_other_pixels(const Imager& imager_now,
                            const scene::PosedScene& posed_now,
                            const CompositeWeights& weights_now) const;
  };
  explicit ImagerView(const Shared& shared) : shared_(shared) {}
  Overlay& overlay_of(const Imager& imager, bool is_view, Kind kind);
  void draw_parts(const Imager& imager,
                  const scene::PosedScene& posed,
                  const CompositeWeights& weights,
                  Overlay* overlay);
  cv::Mat lay_over(const cv::Mat& bgr,
                   const Imager& imager,
                   const scene::PosedScene& posed,
                   const CompositeWeights& weights,
                   Overlay* overlay);

  Shared shared_;
  std::vector<std::string> slot_names_;
  PartsPasses parts_passes_;
  FullscreenPass composite_pass_, coverage_pass_, illuminated_patches_pass_;
  std::optional<ContactShadow> contact_shadow_;
  bool has_contact_shadow_ = false;
  Smoothing smoothing_;
  std::vector<Overlay> overlays_;
};

}  // namespace limn::projector
