#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "sim/world.h"

namespace limn::sim {

/// How one projector lights one sample: everything that is needed for its light except the image shown.
struct ProjectorView {
  float u = 0, v = 0;  ///< Pixel, by the true lens.
  float gain = 0;      ///< Unshadowed share x cosine of incidence / distance², 1/m².
  float depth = 1;     ///< Along the projector's axis, m.
};

/// What a camera's pixels see. It is traced once for each geometry; other projected images only need lookups.
/// Sample i < width * height is the first sample of pixel i; further samples of pixels on edges follow,
/// sorted by pixel. All arrays have the same length and order.
struct Samples {
  int camera = 0;
  int width = 0;
  int height = 0;
  std::vector<std::int32_t> pixel;       ///< Row * width + column.
  std::vector<float> weight;             ///< Share of the pixel; the weights of one pixel sum to 1.
  std::vector<std::int16_t> object;      ///< Index into World::objects; -1: nothing was hit.
  std::vector<Eigen::Vector3f> p_world;  ///< Mean hit point.
  std::vector<Eigen::Vector3f> n_world;  ///< Unit normal towards the camera.
  std::vector<Eigen::Vector3f> albedo;   ///< Linear BGR.
  std::vector<float> grey;               ///< Weight x mean albedo: what a grey camera sees.
  std::vector<float> room_light;         ///< Illuminance by the room.
  std::vector<std::vector<ProjectorView>> projectors;  ///< One entry for each projector.
  std::size_t size() const { return pixel.size(); }
};

/// How finely a camera's pixels are traced. Less is faster.
struct TraceEffort {
  /// Sub-samples of a pixel on an edge, a power of two, at most 32. The edge's position is then known to half
  /// a pixel divided by this.
  int edge_samples = 32;
  int lamp_points = 12;  ///< Points of a lamp's disc, from which its soft shadows are made.
  bool operator==(const TraceEffort&) const = default;
};

/// Traces the pixels of a camera. Pixels on silhouettes, texture edges and shadow edges get sub-samples,
/// merged where they agree. Surfaces are diffuse; light bounces once.
Samples trace(const World& world, int camera, const TraceEffort& effort = {});

/// Traces a camera of a world that changes little from frame to frame. If only poses of objects have changed,
/// only those parts of the image are traced again that the change can affect: where the objects may be seen,
/// and where their shadows fall.
class ViewTracer {
 public:
  explicit ViewTracer(int camera);
  ~ViewTracer();
  ViewTracer(ViewTracer&&) noexcept;
  ViewTracer& operator=(ViewTracer&&) noexcept;

  /// What trace() gives for this world, but for rounding. Valid until the next call.
  const Samples& samples(const World& world, const TraceEffort& effort = {});
  /// How many pixels the last call of samples() traced.
  std::size_t traced_pixels() const;

 private:
  struct Impl;
  int camera_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::sim
