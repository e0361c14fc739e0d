#include "tracker/body_pose.h"

namespace limn::tracker {

std::optional<Track> world_from_body(const Body& body, std::span<const View> views, Stamp captured_at) {
  const BodyCorrespondences seen = correspondences(body, views);
  const std::vector<PoseFit> fits = minima(seen);
  if (fits.empty()) return std::nullopt;
  const PoseFit& fit = fits.front();
  Track track;
  track.body = body.name;
  track.world_from_body = fit.world_from_body;
  track.covariance = fit.covariance;
  track.marker_count = corners_at(seen, fit.world_from_body).marker_count;
  track.rms_px = fit.rms_px;
  track.captured_at = track.at = captured_at;
  return track;
}

}  // namespace limn::tracker
