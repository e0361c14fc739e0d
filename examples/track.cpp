// track CAMERA BODY.json RATE_HZ IMAGE…: follows a body through the images of a video and prints where it
// will be 20 ms after each, when a projector could show it.
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "limn/bodies.h"
#include "limn/error.h"
#include "limn/image.h"
#include "limn/markers.h"

int main(int count, char** words) try {
  if (count < 5) {
    std::fprintf(stderr, "track CAMERA BODY.json RATE_HZ IMAGE...\n");
    return 2;
  }
  const limn::Imager camera = limn::Imager::load(words[1]);
  const std::vector<limn::Body> bodies = {limn::load_body(words[2], "body")};
  const double interval_s = 1 / std::atof(words[3]);

  limn::Detector detector(limn::families_of(bodies));
  limn::Tracker tracker(bodies);
  for (int i = 4; i < count; ++i) {
    const double captured_at_s = (i - 4) * interval_s;
    const limn::Image image = limn::read_image(words[i], limn::PixelFormat::grey);
    const std::vector<limn::Marker> markers = detector.detect(image.view(), &camera);
    const limn::View view{&camera, markers};
    tracker.update({&view, 1}, captured_at_s);
    for (const limn::Track& track : tracker.predict(captured_at_s + 0.02)) {
      if (track.tracking == limn::Tracking::lost) continue;
      const auto& p = track.world_from_body.translation;
      std::printf("%.3f s: %s at (%.1f, %.1f, %.1f) mm by %d markers\n", track.at_s, track.body.c_str(),
                  1e3 * p[0], 1e3 * p[1], 1e3 * p[2], track.marker_count);
    }
  }
  return 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
