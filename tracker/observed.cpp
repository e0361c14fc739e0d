#include "tracker/observed.h"

#include "tracker/body_pose.h"

namespace limn::tracker {

std::vector<Track> observed(std::span<const Body> bodies,
                            std::span<const Detection> detections,
                            const Imager& camera,
                            Stamp captured_at) {
  std::vector<Track> tracks;
  const View view{&camera, detections};
  for (const Body& body : bodies)
    if (auto track = world_from_body(body, std::span(&view, 1), captured_at))
      tracks.push_back(std::move(*track));
  return tracks;
}

}  // namespace limn::tracker
