#pragma once

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/constellation.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/stereo.h"
#include "projector/renderer.h"
#include "scene/scene.h"
#include "session/drawing/frame_description.h"
#include "tracker/marker_light.h"

namespace limn::session {

struct DrawOptions {
  tracker::MarkerLight marker_light = tracker::MarkerLight::keep_out;
  double stereo_mm = 63;  ///< between the eyes of a person before a projector in stereo
  /// Projectors whose images are drawn for each eye of the viewer, by name.
  std::vector<std::string> stereo_projectors = {};
  /// The programs for lines of light are compiled with the first images of the prototype. Otherwise the first
  /// line waits for that: for seconds where no GPU draws.
  bool prepares_lines = false;
};

/// Draws projector images from frame descriptions: a pure function of description, scene, rig and options. A
/// GL context must be current at every call and at destruction.
class FrameDrawer {
 public:
  /// Borrows scene and rig. Error: Renderer::create's.
  static Result<FrameDrawer> create(const scene::Scene* scene, const Rig* rig, const DrawOptions& options);

  /// A projector's image, CV_8UC3; for a projector in stereo, one for each eye.
  EyeImages image(const FrameDescription& frame, std::size_t projector);

  /// Where a projector's light falls on markers and balls of the scene, CV_8UC1 (tracker::marker_mask).
  cv::Mat carrier_mask(std::size_t projector, std::span<const Track> tracks) const;

  /// Uploads the deviation that frames show from now on, if it is another one; null: nothing changes.
  void use_deviation(const std::shared_ptr<const scene::DeviationLayer>& layer);

  projector::Renderer& renderer() { return renderer_; }
  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<Constellation>& constellations() const { return constellations_; }

 private:
  FrameDrawer(const scene::Scene* scene,
              const Rig* rig,
              const DrawOptions& options,
              projector::Renderer renderer);
  void prepare_lines(const FrameDescription& frame, std::size_t projector);
  void apply_arriving_light(const std::vector<cv::Mat>& maps);
  cv::Mat drawn(const FrameDescription& frame, std::size_t projector, const Imager& eye);
  cv::Mat faded_image(const FrameDescription& frame, std::size_t projector, const Imager& eye);
  cv::Mat with_marker_light(const cv::Mat& image, const FrameDescription& frame, std::size_t projector) const;
  cv::Mat mask_of(std::size_t projector, std::span<const Body> bodies, std::span<const Track> tracks) const;

  const scene::Scene* scene_;
  const Rig* rig_;
  DrawOptions options_;
  projector::Renderer renderer_;
  std::vector<Body> bodies_;
  std::vector<Constellation> constellations_;
  // How many images have lines prepared; the second one, because drivers compile some programs anew when a
  // bare prototype was drawn in between.
  int to_prepare_ = 0;
  bool has_infrared_ = false;                               // whether a camera sees no projected light
  std::vector<cv::Mat> arriving_;                           // the maps that the renderer has
  std::shared_ptr<const scene::DeviationLayer> deviation_;  // the layer that it has; null: none
};

}  // namespace limn::session
