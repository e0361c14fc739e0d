// An image that a guest's tablet sends: it is decoded or refused, and a decoded one is localised.
#include "remote/tablet/tablet_image.h"
#include "remote/tablet/tablet_localizer.h"
#include "tests/fuzz/fuzz_file.h"
#include "tracker/family.h"

namespace {

using namespace limn;

// A body with four markers around the origin, and a body with one marker beside it.
std::vector<Body> bodies() {
  std::vector<Body> out = {{"prototype", {}}, {"mirror", {}}};
  for (int i = 0; i < 4; ++i) {
    Pose place;
    place.translation = {0.1 * (i % 2) - 0.05, 0.1 * (i / 2) - 0.05, 0.01 * i};
    out[0].markers.push_back({{"apriltag_36h11", std::to_string(i)}, 0.04, place});
  }
  out[1].markers.push_back({{"aruco_4x4_50", "0"}, 0.04, Pose()});
  return out;
}

std::vector<Track> tracks() {
  Track prototype, mirror;
  prototype.body = "prototype";
  mirror.body = "mirror";
  mirror.world_from_body.translation = {0.1, 0.1, 0};
  return {prototype, mirror};
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static const std::vector<Body> known = bodies();
  static const std::vector<Track> where = tracks();
  static const tracker::Families families = tracker::Families::load(tracker::families_of(known)).value();
  const auto image = remote::decode_tablet_image({bytes, size});
  if (!image) {
    LIMN_CHECK(image.message().find("expected") != std::string::npos);
    return 0;
  }
  LIMN_CHECK(image->type() == CV_8UC3 && std::max(image->cols, image->rows) <= remote::k_drawn_side);
  remote::TabletLocalizer localizer(families);
  for (int i = 0; i < 2; ++i) {  // the second time with the learned lens
    const remote::TabletPose found = localizer.localize(*image, known, where);
    localizer.update_intrinsics();
    LIMN_CHECK(found.view.has_value() == found.why.empty());
    LIMN_CHECK(std::isfinite(found.focal_stddev_px) && found.focal_stddev_px > 0);
    if (!found.view) continue;
    LIMN_CHECK(found.markers > 0 && std::isfinite(found.rms_px));
    LIMN_CHECK(found.view->imager_from_world.is_finite());
    LIMN_CHECK(Lens::create(found.view->lens.model.name(), found.view->lens.values).ok());
    for (const Track& moved : found.moved)
      LIMN_CHECK(moved.world_from_body.is_finite() && moved.covariance.allFinite());
  }
  for (const calib::IntrinsicsEstimate& lens : localizer.lenses()) LIMN_CHECK(lens.is_sound());
  return 0;
}
