#pragma once

#include <optional>
#include <span>

#include "calib/surface/range_view.h"
#include "scene/meshes/scan_surface.h"

namespace limn::calib {

/// The surface near a point as measured by all views, weighted by their variances. Views whose surface is
/// further than `reach` from the point along the normal, or turned by more than 60 degrees from the most
/// accurate view's normal, see another surface there. nullopt when no view sees one.
std::optional<SurfaceSample> surface_sample(std::span<const RangeView> views,
                                            const Eigen::Vector3d& p_world,
                                            double reach);

/// How far two views' surfaces are apart where both have one: root mean square and median of the absolute
/// distance, m, over at most `samples` points of the first. `count` 0: they share nothing. Points where a
/// view has no surface within `reach` are skipped.
struct Agreement {
  int count = 0;
  double rms_m = 0, median_m = 0, median_sigmas = 0;
};
Agreement agreement(const RangeView& a, const RangeView& b, double reach, int samples = 2000);

/// Merges all views to one cloud: where several see the surface, the points of the most accurate one stay,
/// each moved along its normal to the weighted mean of all.
scene::ScanSurface fused_points(std::span<const RangeView> views);

/// Merges all views to one triangle mesh: signed distances along the normals, averaged over the views on a
/// sparse grid of `voxel_m` around the points (Curless and Levoy 1996), its zero surface by naive surface
/// nets (Gibson 1998: one vertex in each cell that the surface crosses, one quadrilateral for each edge);
/// every vertex is then moved to the views' weighted mean. Pieces below `least_area_m2` are removed.
scene::ScanSurface fused_mesh(std::span<const RangeView> views, double voxel_m, double least_area_m2);

/// The median distance of neighbouring points over all views, m; 0 without any.
double point_spacing(std::span<const RangeView> views);

}  // namespace limn::calib
