#pragma once

/// Embree, versions 3 and 4: queries of rays with one interface. Only this header knows which version it is.
/// Embree 4 takes arguments instead of a context, and has no streams of rays; packets of eight replace them.

#if __has_include(<embree4/rtcore.h>)  // sim/CMakeLists.txt prefers version 4, too
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cstddef>
#include <span>

namespace limn::sim::embree {

#if RTC_VERSION_MAJOR >= 4

/// Finds the first hit of a ray.
inline void intersect(RTCScene scene, RTCRayHit& query) { rtcIntersect1(scene, &query); }

constexpr std::size_t k_packet = 8;

/// Copies rays to a packet. Lanes without a ray, and empty rays, are switched off in `is_valid`.
template <typename Query, typename RayOf>
void fill(RTCRay8& packet, int (&is_valid)[k_packet], std::span<Query> queries, RayOf ray_of) {
  for (std::size_t i = 0; i < k_packet; ++i) {
    const RTCRay& ray = ray_of(queries[std::min(i, queries.size() - 1)]);
    is_valid[i] = i < queries.size() && ray.tnear <= ray.tfar ? -1 : 0;
    packet.org_x[i] = ray.org_x;
    packet.org_y[i] = ray.org_y;
    packet.org_z[i] = ray.org_z;
    packet.tnear[i] = ray.tnear;
    packet.dir_x[i] = ray.dir_x;
    packet.dir_y[i] = ray.dir_y;
    packet.dir_z[i] = ray.dir_z;
    packet.time[i] = ray.time;
    packet.tfar[i] = ray.tfar;
    packet.mask[i] = ray.mask;
    packet.id[i] = ray.id;
    packet.flags[i] = ray.flags;
  }
}

/// Finds the first hits of rays that are similar to their neighbours.
inline void intersect_coherent(RTCScene scene, std::span<RTCRayHit> queries) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  for (std::size_t first = 0; first < queries.size(); first += k_packet) {
    const auto part = queries.subspan(first, std::min(k_packet, queries.size() - first));
    alignas(32) int is_valid[k_packet];
    RTCRayHit8 packet{};
    fill(packet.ray, is_valid, part, [](const RTCRayHit& query) -> const RTCRay& { return query.ray; });
    std::fill_n(packet.hit.geomID, k_packet, RTC_INVALID_GEOMETRY_ID);
    rtcIntersect8(is_valid, scene, &packet, &arguments);
    for (std::size_t i = 0; i < part.size(); ++i) {
      part[i].ray.tfar = packet.ray.tfar[i];
      part[i].hit.u = packet.hit.u[i];
      part[i].hit.v = packet.hit.v[i];
      part[i].hit.primID = packet.hit.primID[i];
      part[i].hit.geomID = packet.hit.geomID[i];
    }
  }
}

/// Sets `tfar` of blocked rays to -infinity; the rays are similar to their neighbours.
inline void occlude_coherent(RTCScene scene, std::span<RTCRay> queries) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  for (std::size_t first = 0; first < queries.size(); first += k_packet) {
    const auto part = queries.subspan(first, std::min(k_packet, queries.size() - first));
    alignas(32) int is_valid[k_packet];
    RTCRay8 packet{};
    fill(packet, is_valid, part, [](const RTCRay& query) -> const RTCRay& { return query; });
    rtcOccluded8(is_valid, scene, &packet, &arguments);
    for (std::size_t i = 0; i < part.size(); ++i) part[i].tfar = packet.tfar[i];
  }
}

#else

/// Finds the first hit of a ray.
inline void intersect(RTCScene scene, RTCRayHit& query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
}

/// Finds the first hits of rays that are similar to their neighbours.
inline void intersect_coherent(RTCScene scene, std::span<RTCRayHit> queries) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect1M(scene, &context, queries.data(), static_cast<unsigned>(queries.size()), sizeof(RTCRayHit));
}

/// Sets `tfar` of blocked rays to -infinity; the rays are similar to their neighbours.
inline void occlude_coherent(RTCScene scene, std::span<RTCRay> queries) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded1M(scene, &context, queries.data(), static_cast<unsigned>(queries.size()), sizeof(RTCRay));
}

#endif

}  // namespace limn::sim::embree
