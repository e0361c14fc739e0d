#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "projector/compensation.h"
#include "projector/pass_times.h"
#include "projector/shadow_detector.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// What a composite draws of the parts over the camera's image.
enum class Composite {
  rest,  ///< only what light cannot show, and a pixel or two beside it: the image shows the rest already
  full   ///< the whole parts
};

struct CompositePolicy;

/// How smooth the edges of parts are drawn.
struct Smoothing {
  int samples = 8;  ///< of a pixel on an edge: 8, or 4 in half the time, for small and compressed images
  double least_step = 0.02;  ///< of full light between neighbours; a smaller one is no edge
};

/// How one part is shown to a viewer.
struct PartCoverage {
  std::string slot;
  std::string variant;
  int viewer_pixels = 0;         ///< that see the part, not hidden by the prototype or another part
  double on_surface_share = 0;   ///< of them, shown by projected light; 0 when there are none
  double off_surface_share = 0;  ///< of them, left to the screen
  cv::Mat mask;                  ///< CV_8UC1 in the viewer's image: 255 projected, 128 screen, 0 none
};

/// Draws a scene for a rig: projector images, composites over camera images, coverage. Every pixel is a
/// ray of the true (distorted) lens, met exactly with the triangles that a rasterised image from the same
/// eye lists around it. Belongs to the GL context (4.5 core) that is current when it is created; that context
/// must be current at every call and at destruction. Poses, materials and light may change from call to call;
/// what did not change is not drawn again.
class Renderer {
 public:
  /// Copies scene and rig to the GPU. Error: no current GL context of version 4.5, a driver that refuses
  /// shaders, or more triangles than it holds. When the context is lost (device::GlContext::is_lost) drop the
  /// renderer, then the context, and create both anew: nothing in here but caches is lost with them.
  static Result<Renderer> create(const scene::Scene& scene, const Rig& rig);
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// How light is balanced from the next image on; at first by the defaults of LightOptions. `surface` is
  /// needed for Compensation::measured. Error, and nothing changes: a surface that does not fit the rig or
  /// shows nothing.
  Status set_light(const LightOptions& options, const MeasuredSurface* surface = nullptr);

  /// How much of projector `index`'s light arrives (arriving.h estimates it), from the next image on: 0 … 1
  /// over its image, CV_32FC1 or CV_8UC1 (255 is all) of any size, interpolated between its cells' centres;
  /// empty: all of it, as at first. Where it is blocked the others that reach the point give its light, and
  /// it keeps at most 7 % of the light, to show when the shadow goes. Where no other reaches it shines on.
  void set_occlusion(std::size_t index, const cv::Mat& map);

  /// Of composites and views from the next one on.
  void set_smoothing(const Smoothing& smoothing);

  /// Wanted: a projector's image that differs from its last one, because something moves, has the edges of
  /// parts drawn by half the samples; the first call in which all is as it was draws it whole. Off at first,
  /// and while black is to be even: each image is whole.
  void set_quick_motion(bool wanted);

  /// View parts of `scene`, the one given to create, darken the prototype around them in composites and views
  /// (ContactShadow); null: they do not, as at first. Light cannot darken: projector images stay the same.
  /// Takes some 0.2 s for each variant the first time. Error: the driver's message.
  Status set_contact_shadow(const scene::Scene* scene);

  /// What projector `index` of the rig is to show, CV_8UC3 BGR display values by its measured response
  /// (gamma 2.2 without). `view` parts are drawn as seen from the viewer's eye, also beyond its image;
  /// black elsewhere. Light is shared with the other projectors that reach the same point, so that the sum in
  /// linear light is the part's colour, as set_light says.
  cv::Mat projector_image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);

  /// The same on the GPU alone: draws the image, if anything has changed since, and returns the name of its
  /// texture (GL_RGBA8 of the projector's size, first row first; alpha is for clipped()). It keeps its
  /// content until the next call with this index.
  unsigned draw_projector(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);

  /// Whether the GPU's time is taken, pass by pass. Costs a little.
  void time_passes(bool wanted);
  /// Of all passes since the last call, in their order; waits for the GPU.
  std::vector<PassTime> pass_times();

  /// Where the last projector_image of `index` could not give what was wanted, CV_8UC1: 255 it should be
  /// brighter, 128 darker, 0 all is well.
  cv::Mat clipped(std::size_t index) const;

  /// CV_32FC3: the prototype's point (its own frame, m) that each pixel of the projector lights; NaN where
  /// none.
  cv::Mat surface_points(std::size_t index, const scene::PosedScene& posed);

  /// The patches of camera `camera`'s image, `side_px` pixels a side, that light falls on: what
  /// ShadowDetector watches. Ask again when the prototype has moved.
  IlluminatedPatches illuminated_patches(std::size_t camera, const scene::PosedScene& posed, int side_px);

  /// CV_32FC2, for each pixel of the projector: its share of the light at the prototype's point that it
  /// lights (the shares of all that reach a point sum to one), and the light over its own black, as a share
  /// of its white, that makes up for the black of projectors that do not reach the point. 0 where none.
  cv::Mat blend(std::size_t index, const scene::PosedScene& posed);

  /// The parts drawn into a camera's own (distorted) image, 8-bit grey or BGR of the camera's size; sRGB
  /// BGR.
  cv::Mat composite(std::size_t camera, const cv::Mat& image, const scene::PosedScene& posed, Composite what);

  /// The same with each slot treated in its own way (projector/composite_policy.h); one that is not among the
  /// treatments by `rest`.
  cv::Mat composite(std::size_t camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    std::span<const CompositePolicy> policies);

  /// The same for an image of a camera that is not of the rig: a guest's, which is elsewhere in each.
  cv::Mat composite(const Imager& camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    Composite what);
  cv::Mat composite(const Imager& camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    std::span<const CompositePolicy> policies);

  /// The prototype (in its albedo) and the parts as an eye or a virtual camera sees them, sRGB BGR, over
  /// plain `background`.
  cv::Mat view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background);

  /// For each posed part, pixel by pixel (at pixel centres): does the ray behind it meet the prototype where
  /// at least one projector reaches it? A surface part more than 2 mm off the prototype counts as not.
  std::vector<PartCoverage> coverage(const scene::PosedScene& posed, const Imager& viewer);

 private:
  struct Impl;
  explicit Renderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::projector
