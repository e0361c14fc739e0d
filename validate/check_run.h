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

namespace limn::apps {

/// One check while it is judged. What several measures need is made once, when it is first asked for.
class CheckRun {
 public:
  /// `check` must stay as long as this is used.
  explicit CheckRun(const Check& check);
  /// Makes the renderer; a GL context must be current.
  Status open();

  const Check& check() const { return check_; }
  /// The stage that a renderer can answer for: the true rig and the bare, white prototype in the dark;
  /// projectors with a gamma of 2.2 and none of the other effects.
  const sim::World& world() const { return world_; }
  projector::Renderer& renderer() { return *renderer_; }
  bool asks_for(const std::string& measure) const { return asked_.contains(measure); }

  /// What this renderer draws for the projectors, for the check's viewer.
  std::vector<cv::Mat> drawn_by(projector::Renderer& renderer, const scene::PosedScene& posed) const;
  /// What the projectors get of the check's parts.
  const std::vector<cv::Mat>& projector_images();
  /// The scene's prototype with one part instead of the scene's own, and where that is.
  std::pair<scene::Scene, scene::PosedScene> shown_instead(const scene::Mesh& mesh, scene::Mode mode) const;
  /// That, drawn by a renderer of its own.
  Result<std::vector<cv::Mat>> drawn_instead(const scene::Mesh& mesh, scene::Mode mode) const;
  /// Even light over the whole prototype.
  scene::Mesh coat() const;

  /// The ray-traced images of the parts.
  sim::ReferenceRenderer reference() const { return {world_, check_.posed, check_.viewer}; }
  /// Those of the projectors.
  const std::vector<sim::PartImage>& aims();
  /// The viewer's eye.
  const ReferenceView& eye();
  /// The viewer's eye with k_finer x k_finer rays a pixel, for light that is to be even.
  const ReferenceView& fine_eye();
  /// What each projector reaches of it.
  const std::vector<cv::Mat>& fine_reaches();

  /// Camera 0 as the renderer has it. Error: the world has none.
  Result<const Imager*> camera(const std::string& measure) const;
  /// The error of a measure that finds nothing to measure.
  Error nothing_to_judge(const std::string& measure, const std::string& expected) const;

  void set(const std::string& measure, double value) { values_[measure] = value; }
  double value(const std::string& measure) const { return values_.at(measure); }
  void add(CheckImage image) { images_.push_back(std::move(image)); }
  /// All that was measured of what the check asks for.
  CheckResult result() &&;

 private:
  const Check& check_;
  sim::World world_;
  std::set<std::string> asked_;
  std::optional<projector::Renderer> renderer_;
  std::vector<cv::Mat> projector_images_;
  std::vector<sim::PartImage> aims_;
  std::optional<ReferenceView> eye_, fine_eye_;
  std::vector<cv::Mat> fine_reaches_;
  std::map<std::string, double> values_;
  std::vector<CheckImage> images_;
};

constexpr double k_coat = 0.5;  // light of the coat; a whole display value to 0.1 % of light
constexpr int k_finer = 2;  // rays a side of a viewer's pixel for even light: a ray sees a projector's pixel,
                            // narrower than the viewer's, and would skip others
constexpr float k_whole = 0.999F;  // of a viewer's pixel

}  // namespace limn::apps
