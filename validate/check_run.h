#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "projector/renderer.h"
#include "sim/reference_renderer.h"
#include "validate/check_file.h"
#include "validate/check_result.h"
#include "validate/reference_view.h"

namespace limn::validate {

/// One check while it is measured. Data that several measures need is computed once, when it is first needed.
class CheckRun {
 public:
  /// `check` must outlive this object.
  explicit CheckRun(const Check& check);
  /// Creates the renderer; a GL context must be current.
  Status open();

  const Check& check() const { return check_; }
  /// The world reduced to what a renderer can be responsible for: the true rig and the bare, white prototype
  /// in the dark; projectors with a gamma of 2.2 and none of the other effects.
  const sim::World& world() const { return world_; }
  projector::Renderer& renderer() { return *renderer_; }
  bool asks_for(const std::string& measure) const { return asked_.contains(measure); }

  /// The projector images that this renderer draws for the check's viewer.
  std::vector<cv::Mat> projector_images_by(projector::Renderer& renderer,
                                           const scene::PosedScene& posed) const;
  /// The projector images of the check's parts.
  const std::vector<cv::Mat>& projector_images();
  /// The scene's prototype with this mesh as its only part, and the poses of both.
  std::pair<scene::Scene, scene::PosedScene> scene_with_mesh(const scene::Mesh& mesh, scene::Mode mode) const;
  /// The projector images of scene_with_mesh(), drawn by a renderer of its own.
  Result<std::vector<cv::Mat>> projector_images_of(const scene::Mesh& mesh, scene::Mode mode) const;
  /// The prototype's mesh with a uniform material that emits even light.
  scene::Mesh coat() const;

  /// The ray tracer's renderer of the check's parts.
  sim::ReferenceRenderer reference() const { return {world_, check_.posed, check_.viewer}; }
  /// The ray-traced images of the projectors.
  const std::vector<sim::PartImage>& reference_projector_images();
  /// The view from the viewpoint.
  const ReferenceView& reference_view();
  /// The same view with k_finer x k_finer rays per pixel, for measures of even light.
  const ReferenceView& fine_reference_view();
  /// The share of each pixel of fine_reference_view() that each projector reaches.
  const std::vector<cv::Mat>& fine_reaches();

  /// Camera 0 as the renderer knows it. Error: the world has none.
  Result<const Imager*> camera(const std::string& measure) const;
  /// The error of a measure that finds nothing to measure.
  Error nothing_to_judge(const std::string& measure, const std::string& expected) const;

  void set(const std::string& measure, double value) { values_[measure] = value; }
  double value(const std::string& measure) const { return values_.at(measure); }
  void add(CheckImage image) { images_.push_back(std::move(image)); }
  /// The readings of everything that the check asks for.
  CheckResult result() &&;

 private:
  const Check& check_;
  sim::World world_;
  std::set<std::string> asked_;
  std::optional<projector::Renderer> renderer_;
  std::vector<cv::Mat> projector_images_;
  std::vector<sim::PartImage> reference_projector_images_;
  std::optional<ReferenceView> reference_view_, fine_reference_view_;
  std::vector<cv::Mat> fine_reaches_;
  std::map<std::string, double> values_;
  std::vector<CheckImage> images_;
};

constexpr double k_coat = 0.5;  // light of the coat; within 0.1 % of what a whole display value gives
// Rays per side of a viewer's pixel for even light. One ray sees only one projector pixel, which is smaller
// than the viewer's pixel, and would skip others.
constexpr int k_finer = 2;
constexpr float k_whole = 0.999F;  // share of a viewer's pixel that counts as all of it

}  // namespace limn::validate
