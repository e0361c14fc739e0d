#include "tracker/body_estimate.h"

#include "tracker/body_pose.h"

namespace limn::tracker {

std::vector<Track> observed(std::span<const Body> bodies, std::span<const View> views, Stamp captured_at) {
  std::vector<Track> tracks;
  for (const Body& body : bodies)
    if (auto track = world_from_body(body, views, captured_at)) tracks.push_back(std::move(*track));
  return tracks;
}

}  // namespace limn::tracker
