#include <cmath>
#include <limits>
#include <new>

#include "core/program_library.h"
#include "sim/embree/embree.h"
#include "sim/ray_tracer.h"

namespace limn::sim {
namespace {

constexpr float k_infinity = std::numeric_limits<float>::infinity();

RTCRay ray_between(const Eigen::Vector3f& from, const Eigen::Vector3f& d, float near, float far) {
  RTCRay ray{};
  ray.org_x = from.x();
  ray.org_y = from.y();
  ray.org_z = from.z();
  ray.tnear = near;
  ray.dir_x = d.x();
  ray.dir_y = d.y();
  ray.dir_z = d.z();
  ray.tfar = far;
  ray.mask = ~0U;
  return ray;
}

RTCRayHit query_for(const RTCRay& ray) {
  RTCRayHit query{};
  query.ray = ray;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  return query;
}

TracedHit traced(const RTCRayHit& found) {
  if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {static_cast<int>(found.hit.geomID), static_cast<int>(found.hit.primID), found.hit.u, found.hit.v,
          found.ray.tfar};
}

// Embree keeps its last error until it is asked. Threads that cannot be started for want of memory are an
// unknown error to it.
void check_memory(RTCDevice device) {
  const RTCError problem = rtcGetDeviceError(device);
  if (problem == RTC_ERROR_OUT_OF_MEMORY || (device == nullptr && problem == RTC_ERROR_UNKNOWN))
    throw std::bad_alloc();
  LIMN_CHECK(device != nullptr && problem == RTC_ERROR_NONE);
}

class EmbreeTracer : public RayTracer {
 public:
  explicit EmbreeTracer(bool moves) : device_(rtcNewDevice("threads=2")) {
    check_memory(device_);
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, moves ? RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_ROBUST);
  }
  EmbreeTracer(const EmbreeTracer&) = delete;
  EmbreeTracer& operator=(const EmbreeTracer&) = delete;
  ~EmbreeTracer() override {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }

  void add_mesh(std::span<const Eigen::Vector3f> positions,
                std::span<const std::array<std::uint32_t, 3>> triangles) override {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions.data(), 0,
                               sizeof(Eigen::Vector3f), positions.size());
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles.data(), 0,
                               sizeof(triangles[0]), triangles.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_, geometry, meshes_++);
    rtcReleaseGeometry(geometry);
  }
  void update_mesh(std::size_t mesh) override {
    const RTCGeometry geometry = rtcGetGeometry(scene_, static_cast<unsigned>(mesh));
    rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry);
  }
  void commit() override {
    rtcCommitScene(scene_);
    check_memory(device_);
  }

  TracedHit first_hit(const Eigen::Vector3f& from, const Eigen::Vector3f& d, float near) const override {
    RTCRayHit query = query_for(ray_between(from, d, near, k_infinity));
    embree::intersect(scene_, query);
    return traced(query);
  }
  void first_hits(const Eigen::Vector3f& from,
                  std::span<const Eigen::Vector3f> d,
                  std::span<TracedHit> hits) const override {
    std::vector<RTCRayHit> queries(d.size());
    for (std::size_t i = 0; i < d.size(); ++i) {
      const bool usable = d[i].allFinite();
      queries[i] = query_for(
          ray_between(from, usable ? d[i] : Eigen::Vector3f::UnitZ(), 0, usable ? k_infinity : -1.0F));
    }
    embree::intersect_coherent(scene_, queries);
    for (std::size_t i = 0; i < d.size(); ++i) hits[i] = traced(queries[i]);
  }
  void reached(const Eigen::Vector3f& from,
               std::span<const Eigen::Vector3f> p,
               float gap,
               std::span<std::uint8_t> reached) const override {
    std::vector<RTCRay> queries(p.size());
    for (std::size_t i = 0; i < p.size(); ++i) {
      const Eigen::Vector3f towards = p[i] - from;
      const float distance = towards.norm();
      const bool usable = std::isfinite(distance) && distance > 0;
      queries[i] = ray_between(from, usable ? Eigen::Vector3f(towards / distance) : Eigen::Vector3f::UnitZ(),
                               0, usable ? distance - gap : -1.0F);
    }
    embree::occlude_coherent(scene_, queries);
    for (std::size_t i = 0; i < p.size(); ++i) reached[i] = queries[i].tfar >= 0 ? 1 : 0;
  }

 private:
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  unsigned meshes_ = 0;
};

}  // namespace
}  // namespace limn::sim

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) limn::sim::RayTracer* limn_make_ray_tracer(bool moves) {
  return new limn::sim::EmbreeTracer(moves);
}
