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
#include "scene/deviation_layer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// Which pixels of the parts a composite draws over the camera's image.
enum class Composite {
  rest,  ///< Only what projected light cannot show, and one or two pixels beside it. The camera's image
         ///< already shows the rest.
  full   ///< The whole parts.
};

struct CompositePolicy;

/// Anti-aliasing of the edges of parts.
struct Smoothing {
  /// Samples for each pixel on an edge: 8, or 4 in half the time for small and compressed images.
  int samples = 8;
  /// Smallest difference between neighbours that counts as an edge, as a fraction of full light.
  double least_step = 0.02;
};

/// How one part is shown to a viewer.
struct PartCoverage {
  std::string slot;
  std::string variant;
  /// Pixels that see the part; those hidden by the prototype or another part do not count.
  int viewer_pixels = 0;
  double on_surface_share = 0;   ///< Share of these that projected light shows; 0 when there are none.
  double off_surface_share = 0;  ///< Share of these that only the screen can show.
  cv::Mat mask;                  ///< CV_8UC1 in the viewer's image: 255 projected, 128 screen, 0 none.
};

/// Draws a scene for a rig: projector images, composites over camera images, coverage. For every pixel the
/// ray of the true (distorted) lens is intersected exactly with triangles. An image of triangle ids,
/// rasterised from the same position, says which triangles to test. Belongs to the GL context (4.5 core) that
/// is current when it is created; that context must be current at every call and at destruction. Poses,
/// materials and light may change from call to call; what did not change is not drawn again.
class Renderer {
 public:
  /// Copies scene and rig to the GPU. Error: no current GL context of version 4.5, a driver that refuses
  /// shaders, or more triangles than it holds. When the context is lost (device::GlContext::is_lost), destroy
  /// the renderer, then the context, and create both anew: only caches are lost.
  static Result<Renderer> create(const scene::Scene& scene, const Rig& rig);
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;
  ~Renderer();

  /// Sets how colours become light, from the next image on. The default is LightOptions(). `surface` is
  /// needed for Compensation::measured. Error: a surface that does not fit the rig, or that no projector lit;
  /// then nothing changes.
  Status set_light(const LightOptions& options, const MeasuredSurface* surface = nullptr);

  /// Sets which share of projector `index`'s light arrives, from the next image on (ShadowDetector estimates
  /// it): 0 … 1 over its image, CV_32FC1 or CV_8UC1 (255 is all) of any size, interpolated between the
  /// centres of its cells. Empty, the default: all light arrives. Where light is blocked, the other
  /// projectors that reach the point give it. The blocked projector keeps at most 7 % of the light, so that
  /// cameras see when the shadow goes. Where no other projector reaches the point, it gives its full light.
  void set_occlusion(std::size_t index, const cv::Mat& map);

  /// Sets the deviation from the CAD that is drawn while PosedScene::deviation names its number: below the
  /// parts, instead of a finish, in light of its own that lamps do not shade. A layer for another mesh is not
  /// drawn. Use another number for another layer.
  void set_deviation(const scene::DeviationLayer& layer);

  /// Sets the smoothing of composites and views, from the next one on.
  void set_smoothing(const Smoothing& smoothing);

  /// When on, projectors' images are anti-aliased with 4 samples instead of 8, from the next one on: for
  /// frames in which something moves. Off by default. Has no effect with LightOptions::even_black.
  void set_quick_motion(bool wanted);

  /// Turns on contact shadows: view parts of `scene` (the one given to create) darken the prototype around
  /// them in composites and views (ContactShadow). Null, the default: off. Projector images stay the same,
  /// because light cannot darken. The first call takes some 0.2 s for each variant. Error: the driver's
  /// message.
  Status set_contact_shadow(const scene::Scene* scene);

  /// The image for projector `index` of the rig: CV_8UC3, BGR display values by its measured response (gamma
  /// 2.2 without one). `view` parts are drawn as seen from the viewer's position, also outside the viewer's
  /// image; elsewhere it shows the prototype's finish, or is black. Light is shared with the other projectors
  /// that reach the same point, so that the sum in linear light is the part's colour, compensated as
  /// set_light says.
  cv::Mat projector_image(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);

  /// The same image, kept on the GPU: draws it if anything has changed, and returns the name of its texture
  /// (GL_RGBA8 of the projector's size, first row first; alpha holds clipped()). It keeps its contents until
  /// the next call with this index.
  unsigned draw_projector(std::size_t index, const scene::PosedScene& posed, const Imager& viewer);

  /// Turns the timing of GPU passes on or off. It costs a little.
  void time_passes(bool wanted);
  /// Times of all passes since the last call, in their order. Waits for the GPU.
  std::vector<PassTime> pass_times();

  /// Where the last projector_image of `index` could not give the wanted light. CV_8UC1: 255 it should be
  /// brighter, 128 darker, 0 not clipped.
  cv::Mat clipped(std::size_t index) const;

  /// CV_32FC3: the prototype's point (its own frame, m) that each pixel of the projector lights; NaN where it
  /// lights none.
  cv::Mat surface_points(std::size_t index, const scene::PosedScene& posed);

  /// For ShadowDetector and MisalignmentDetector: divides the image of camera `camera` into square patches of
  /// `side_px` pixels and says which light falls on each. Call it again when the prototype has moved.
  IlluminatedPatches illuminated_patches(std::size_t camera, const scene::PosedScene& posed, int side_px);

  /// CV_32FC2, for each pixel of the projector. Channel 0: its share of the light at the prototype's point
  /// that it lights (the shares of all projectors that reach a point sum to one). Channel 1: light above its
  /// own black, as a share of its white, that replaces the black level of projectors that do not reach the
  /// point. 0 where it lights no point.
  cv::Mat blend(std::size_t index, const scene::PosedScene& posed);

  /// Draws the parts into a camera's own (distorted) image, which is 8-bit grey or BGR of the camera's size.
  /// The result is sRGB BGR.
  cv::Mat composite(std::size_t camera, const cv::Mat& image, const scene::PosedScene& posed, Composite what);

  /// The same with a policy for each slot (projector/composite_policy.h). A slot without a policy is drawn as
  /// `rest`.
  cv::Mat composite(std::size_t camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    std::span<const CompositePolicy> policies);

  /// The same for a camera outside the rig, such as a guest's tablet, whose pose changes with each image.
  cv::Mat composite(const Imager& camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    Composite what);
  cv::Mat composite(const Imager& camera,
                    const cv::Mat& image,
                    const scene::PosedScene& posed,
                    std::span<const CompositePolicy> policies);

  /// The prototype (in its albedo or its finish) and the parts as a person or a virtual camera sees them,
  /// sRGB BGR, over a plain `background`.
  cv::Mat view(const Imager& imager, const scene::PosedScene& posed, const cv::Scalar& background);

  /// How each posed part can be shown. A viewer pixel of a part counts as projected if the ray through its
  /// centre, continued behind the part, meets the prototype where at least one projector reaches it. A
  /// surface part more than 2 mm off the prototype does not count as projected.
  std::vector<PartCoverage> coverage(const scene::PosedScene& posed, const Imager& viewer);

 private:
  struct Impl;
  explicit Renderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::projector
