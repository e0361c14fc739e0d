#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "projector/contact_shadow.h"
#include "projector/parts_layer.h"
#include "projector/projector_view.h"
#include "projector/renderer.h"

namespace limn::projector {

/// How much of what light can show of each part a composite draws: a byte an owner, in 255ths.
class CompositeWeights final : public Bindable {
 public:
  /// Nothing of it.
  CompositeWeights() = default;
  explicit CompositeWeights(Composite what);
  /// Of one that is not among the treatments nothing. `slots`: by owner, from the first on.
  CompositeWeights(std::span<const CompositePolicy> policies, std::span<const std::string> slots);
  /// Resource::composite_weights.
  void bind(const Use& use) const override { use.program.set_bits("u_whole", bytes_); }
  bool operator==(const CompositeWeights& other) const { return bytes_ == other.bytes_; }

 private:
  std::array<GLuint, 64> bytes_ = {};
};

/// Draws what cameras, viewers and virtual cameras see of the parts.
class ImagerView {
 public:
  /// `looks`: what is defined where looks are drawn.
  static Result<ImagerView> create(const Shared& shared, const scene::Scene& scene, Defines looks);

  /// Renderer::set_smoothing and set_contact_shadow.
  void set_smoothing(const Smoothing& smoothing) { smoothing_ = smoothing; }
  Status set_contact_shadow(const scene::Scene* scene);

  /// Which composite it is: drawn anew only where that has changed.
  enum class Kind { rest, full, each };
  /// Renderer::composite, view, coverage and illuminated_patches.
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
  // What was laid over an imager's images.
  struct Overlay {
    Imager imager;
    bool is_view = false;
    Kind kind = Kind::rest;
    CompositeWeights weights;
    std::optional<scene::PosedScene> posed;  // of the parts
    std::vector<cv::Rect> places;            // where there may be some
    Canvas parts;
    GlName behind;  // the image
    Canvas out;

    bool shows(const Imager& imager_now,
               const scene::PosedScene& posed_now,
               const CompositeWeights& weights_now) const;
  };
  explicit ImagerView(const Shared& shared) : shared_(shared) {}
  Overlay& overlay_of(const Imager& imager, bool is_view, Kind kind);
  void draw_parts(const Imager& imager, const scene::PosedScene& posed, Overlay* overlay);
  cv::Mat lay_over(const cv::Mat& bgr,
                   const Imager& imager,
                   const scene::PosedScene& posed,
                   const CompositeWeights& weights,
                   Overlay* overlay);

  Shared shared_;
  std::vector<std::string> slot_names_;
  PartsLayer parts_layer_;
  FullscreenPass composite_pass_, coverage_pass_, lit_pass_;
  std::optional<ContactShadow> contact_shadow_;
  bool has_contact_shadow_ = false;
  Smoothing smoothing_;
  std::vector<Overlay> overlays_;
};

}  // namespace limn::projector
