#include "session/frame_composer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "session/overlays.h"
#include "session/feedback.h"
#include "core/screen_encoding.h"

namespace limn::apps {
namespace {

constexpr double k_sign = 0.7;  // display value of signs: bright ones could hide markers from cameras
constexpr double k_gamma = k_display_gamma;  // near enough to mix what fades
const cv::Scalar k_background(40, 36, 34);   // of views: a dark room
const cv::Scalar k_green(90, 220, 90), k_amber(40, 170, 255), k_red(60, 60, 255), k_blue(255, 190, 110);
constexpr double k_glide_s = 0.1;  // in which a guest's eye is followed to a third of its way
constexpr const char* k_still_eye = "the scene's own";
// Of the corners of the prototype's box: less is not shown. An eighth of a pixel where 1280 light a metre.
constexpr double k_stays_m = 0.1e-3;
constexpr double k_other_waiting = 0.4;  // light of those that are not next, as a share

// base + share of what `with` adds to it, in linear light.
cv::Mat mixed(const cv::Mat& base, const cv::Mat& with, double share) {
  std::array<float, 256> light{};
  for (int i = 0; i < 256; ++i)
    light[static_cast<std::size_t>(i)] = static_cast<float>(std::pow(i / 255.0, k_gamma));
  cv::Mat out(base.size(), base.type());
  const auto bytes = [](const cv::Mat& m, int row) { return m.ptr<std::uint8_t>(row); };
  for (int row = 0; row < base.rows; ++row) {
    const std::uint8_t *a = bytes(base, row), *b = bytes(with, row);
    std::uint8_t* c = out.ptr<std::uint8_t>(row);
    for (int i = 0; i < 3 * base.cols; ++i) {
      if (a[i] == b[i]) {
        c[i] = a[i];
        continue;
      }
      const double sum = light[a[i]] + share * (light[b[i]] - light[a[i]]);
      c[i] = cv::saturate_cast<std::uint8_t>(255 * std::pow(sum, 1 / k_gamma));
    }
  }
  return out;
}

Imager moved_eye(Imager imager, double right_m) {
  imager.imager_from_world.translation.x() -= right_m;
  return imager;
}

// A prototype that stands still trembles by what its markers are measured to; it stays where it was shown, so
// that what is known of its surface need not be found again.
void keep_still(const std::optional<Pose>& shown,
                const Eigen::AlignedBox3d& box,
                std::vector<Track>* tracks) {
  if (!shown || box.isEmpty()) return;
  for (Track& track : *tracks) {
    if (track.body != "prototype") continue;
    double most_m = 0;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d p = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
      most_m = std::max(most_m, (track.world_from_body * p - *shown * p).norm());
    }
    if (most_m < k_stays_m) track.world_from_body = *shown;
  }
}

// What a guest is called among the viewers.
std::string guest_eye(const std::string& guest) { return "guest " + guest; }

}  // namespace

std::vector<LooseMarker> waiting_markers(const scene::Scene& scene,
                                         const scene::ShowState& show_state,
                                         const Percepts& watched) {
  std::vector<LooseMarker> waiting;
  for (const LooseMarker& loose : watched.loose) {
    bool carries = false;
    for (std::size_t i = 0; i < scene.slots.size(); ++i)
      carries |= scene::slot_marker(scene, show_state, i) == loose.marker;
    if (!carries && seconds_between(loose.still_since, watched.captured_at) >= k_lies_after_s)
      waiting.push_back(loose);
  }
  return waiting;
}

Result<FrameComposer> FrameComposer::create(const scene::Scene& scene, const Rig& rig, const ComposeOptions& options) {
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, rig));
  return FrameComposer(scene, rig, std::move(renderer), options);
}

FrameComposer::FrameComposer(const scene::Scene& scene,
                 const Rig& rig,
                 projector::Renderer renderer,
                 const ComposeOptions& options)
    : scene_(scene),
      rig_(rig),
      renderer_(std::move(renderer)),
      options_(options),
      bodies_(scene::bodies(scene)),
      shadows_(rig),
      drifts_(rig),
      d_up_world_(rig.cameras.empty()
                      ? Eigen::Vector3d(0, -1, 0)
                      : rig.cameras[0].imager_from_world.rotation.inverse() * Eigen::Vector3d(0, -1, 0)) {
  renderer_.set_quick_motion(true);
  if (scene.prototype)
    for (const Eigen::Vector3f& p : scene.prototype->mesh.positions) prototype_box_.extend(p.cast<double>());
  for (const Imager& projector : rig.projectors)
    painted_.projectors.emplace_back(projector.height, projector.width, CV_8UC3, cv::Scalar::all(0));
}

// Where the scene's own eye stands still: its only viewer if that is fixed, the first camera's without
// viewers. Null: viewers move, or share an eye.
const Imager* FrameComposer::still_viewer() const {
  if (scene_.viewers.size() == 1 && scene_.viewers[0].fixed) return &*scene_.viewers[0].fixed;
  return scene_.viewers.empty() ? &stand_in() : nullptr;
}

// Looks until somebody is seen.
const Imager& FrameComposer::stand_in() const {
  return rig_.cameras.empty() ? rig_.projectors[0] : rig_.cameras[0];
}

// Of guests whose tablets have seen markers lately: of the one who is followed, else of the scene's viewers.
std::vector<scene::Viewpoint> FrameComposer::guests_eyes(const scene::ShowState& show_state,
                                             std::span<const TabletViewpoint> places,
                                             Stamp now) const {
  std::vector<scene::Viewpoint> eyes;
  const auto add = [&](const TabletViewpoint& place, double weight) {
    if (seconds_between(place.at, now) < k_guest_place_lasts_s)
      eyes.push_back({guest_eye(place.guest), place.p_eye_world, weight});
  };
  for (const TabletViewpoint& place : places)
    if (place.guest == show_state.viewer) add(place, 1);
  if (!eyes.empty()) return eyes;
  for (const TabletViewpoint& place : places)
    if (const scene::Viewer* viewer = scene_.find_tablet(place.guest)) add(place, viewer->weight);
  return eyes;
}

// A guest's eye is known some ten times a second: between, and where it trembles, it is followed smoothly.
void FrameComposer::glide(std::vector<scene::Viewpoint>* guests, double seconds) {
  const double step = 1 - std::exp(-seconds / k_glide_s);
  for (scene::Viewpoint& eye : *guests)
    for (const scene::Viewpoint& before : gliding_)
      if (before.viewer == eye.viewer) eye.p_world = before.p_world + step * (eye.p_world - before.p_world);
  gliding_ = *guests;
}

// The scene's own viewer if it stands still, else one at the eye that all viewers share, which moves calmly;
// a guest's, alone, while one is followed.
Imager FrameComposer::viewer_for(const scene::PosedScene& posed, std::vector<scene::Viewpoint> guests, Stamp at) {
  const Imager* still = still_viewer();
  is_away_ |= !guests.empty();
  if (still && !is_away_) return *still;
  const double seconds = eye_at_ == Stamp{} ? 0 : std::max(0.0, seconds_between(eye_at_, at));
  eye_at_ = std::max(eye_at_, at);
  glide(&guests, seconds);
  const auto p_middle = scene::middle_of(scene_, posed);
  if (!p_middle) return painted_.viewer.width > 0 ? painted_.viewer : still ? *still : stand_in();
  const scene::Viewpoint waiting{k_still_eye,
                           (still ? *still : stand_in()).imager_from_world.inverse().translation};
  std::vector<scene::Viewpoint> eyes = posed.viewpoints;
  if (still) eyes = {waiting};
  if (!painted_.follows.empty()) eyes.clear();
  eyes.insert(eyes.end(), guests.begin(), guests.end());
  if (shared_viewpoint_.shares.empty() && (still || eyes.empty()))
    shared_viewpoint_ = scene::updated_viewpoint({}, std::span(&waiting, 1), *p_middle, 0);
  shared_viewpoint_ = scene::updated_viewpoint(shared_viewpoint_, eyes, *p_middle, seconds);
  const bool is_back = guests.empty() && std::none_of(shared_viewpoint_.shares.begin(), shared_viewpoint_.shares.end(),
                                                      [](const auto& share) {
                                                        return share.viewer.empty();  // of one who is gone
                                                      });
  if (is_back) is_away_ = false;
  if (is_back && still) {
    shared_viewpoint_ = {};
    eye_at_ = {};
    return *still;
  }
  const Eigen::Vector3d p_eye = *shared_viewpoint_.p_world();
  if (is_away_) painted_.p_guest_eye_world = p_eye;
  if (shared_viewpoint_.leader == k_still_eye && !still) return stand_in();
  const auto viewer = scene::viewer_at(p_eye, scene_, posed, d_up_world_);
  return viewer ? *viewer : still ? *still : stand_in();
}

const ComposedFrame& FrameComposer::paint(const Percepts& watched,
                              const scene::ShowState& show_state,
                              Stamp now,
                              Stamp shown_at,
                              std::span<const TabletViewpoint> places) {
  painted_.painted_at = now;
  painted_.shown_at = shown_at;
  if (show_state.frozen && !show_state.blackout && !is_black_) return painted_;
  is_black_ = show_state.blackout;
  painted_.tracks = scene::assign_tracks(
      scene_, show_state,
      tracker::predicted(watched.motions, shown_at, options_.prediction, options_.motion, now));
  keep_still(last_.world_from_prototype, prototype_box_, &painted_.tracks);
  painted_.posed = scene::compose_scene(scene_, show_state, painted_.tracks);
  note_changes(painted_.posed, show_state, shown_at);
  std::vector<scene::Viewpoint> guests = guests_eyes(show_state, places, now);
  const bool is_followed = guests.size() == 1 && guests[0].viewer == guest_eye(show_state.viewer);
  painted_.follows = is_followed ? show_state.viewer : "";
  painted_.p_guest_eye_world.reset();
  painted_.viewer = viewer_for(painted_.posed, std::move(guests), shown_at);
  const Imager& viewer = painted_.viewer;
  const bool refill = options_.refill && rig_.projectors.size() > 1;
  if (refill) shadows_.look(watched, painted_.posed, shown_, &renderer_);
  const std::vector<LooseMarker> waiting = waiting_markers(scene_, show_state, watched);
  std::vector<Body> bodies = bodies_;
  for (const LooseMarker& loose : watched.loose)
    bodies.push_back({scene::loose_body(loose.marker), {{loose.marker, loose_size_m(scene_), Pose()}}});
  for (std::size_t i = 0; i < rig_.projectors.size(); ++i) {
    cv::Mat& image = painted_.projectors[i];
    if (show_state.blackout) {
      image = cv::Mat::zeros(image.size(), image.type());
      continue;
    }
    image = lit_for(i, show_state, viewer, shown_at);
    if (options_.marker_light != tracker::MarkerLight::as_is) {
      const cv::Mat mask = tracker::marker_mask(rig_.projectors[i], bodies, painted_.tracks);
      image = tracker::with_marker_light(image, mask, options_.marker_light);
    }
  }
  if (!show_state.blackout) {
    draw_feedback(show_state);
    draw_waiting(waiting);
  }
  shown_.add(painted_.projectors, shown_at);
  return painted_;
}

cv::Mat FrameComposer::free_surface(std::size_t projector) {
  cv::Mat points = renderer_.surface_points(projector, painted_.posed);
  points.setTo(cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()),
               tracker::marker_mask(rig_.projectors[projector], bodies_, painted_.tracks));
  return points;
}

cv::Mat FrameComposer::screen(const Percepts& watched, const scene::ShowState& show_state, scene::Screen what) {
  using enum scene::Screen;
  if (what == off || watched.frames.empty() || watched.frames[0].image.empty()) return {};
  const cv::Mat& seen = watched.frames[0].image;
  const cv::Mat behind = options_.is_linear_camera ? srgb_image(seen) : seen;
  if (what == camera) return behind;
  const Stamp at = watched.frames[0].captured_at;
  std::vector<Track> tracks = scene::assign_tracks(
      scene_, show_state, tracker::predicted(watched.motions, at, options_.prediction, options_.motion));
  keep_still(last_.world_from_prototype, prototype_box_, &tracks);
  const scene::PosedScene posed = scene::compose_scene(scene_, show_state, tracks);
  if (what == rest) {
    const double seconds = treated_at_ == Stamp{} ? 0 : std::max(0.0, seconds_between(treated_at_, at));
    policies_ = projector::updated_policies(policies_, renderer_.coverage(posed, rig_.cameras[0]), seconds);
    treated_at_ = at;
  }
  const cv::Mat image = screen_of(behind, posed, what, policies_);
  const auto left = scene::left_of_split(scene_, show_state);
  if (!left || what == stereo) return image;
  const Imager& eye = what == view && painted_.viewer.width > 0 ? painted_.viewer : rig_.cameras[0];
  const auto line = split_line(eye, posed, prototype_box_, show_state.split_mm);
  if (!line) return image;
  const scene::PosedScene other = scene::compose_scene(scene_, *left, tracks);
  const auto policies = what == rest ? projector::updated_policies({}, renderer_.coverage(other, rig_.cameras[0]), 0)
                                       : std::vector<projector::CompositePolicy>();
  return split_along(*line, screen_of(behind, other, what, policies), image);
}

cv::Mat FrameComposer::screen_of(const cv::Mat& behind,
                           const scene::PosedScene& posed,
                           scene::Screen what,
                           std::span<const projector::CompositePolicy> policies) {
  if (what == scene::Screen::full) return renderer_.composite(0, behind, posed, projector::Composite::full);
  if (what == scene::Screen::rest) return renderer_.composite(0, behind, posed, policies);
  const Imager viewer = painted_.viewer.width > 0 ? painted_.viewer : rig_.cameras[0];
  if (what == scene::Screen::view) return renderer_.view(viewer, posed, k_background);
  const double half = 0.5e-3 * options_.stereo_mm;
  const cv::Mat eyes[2] = {renderer_.view(moved_eye(viewer, -half), posed, k_background),
                           renderer_.view(moved_eye(viewer, half), posed, k_background)};
  cv::Mat both;
  cv::hconcat(eyes, 2, both);
  return both;
}

// Which parts have gone since the last image, and which show another variant.
void FrameComposer::note_changes(const scene::PosedScene& posed, const scene::ShowState& show_state, Stamp at) {
  const auto find = [](const scene::PosedScene& where, const std::string& slot) {
    return std::find_if(where.parts.begin(), where.parts.end(),
                        [&](const scene::PosedPart& part) { return part.slot == slot; });
  };
  for (const scene::PosedPart& part : last_.parts)
    if (find(posed, part.slot) == posed.parts.end()) fading_[part.slot] = {part, at};
  for (const scene::PosedPart& part : posed.parts) fading_.erase(part.slot);
  if (posed.world_from_prototype)
    gone_.reset();
  else if (last_.world_from_prototype)
    gone_ = {last_, at};
  std::erase_if(fading_, [&](const auto& entry) {
    return seconds_between(entry.second.lost_at, at) > std::max(options_.fade_s, options_.lost_s);
  });
  for (std::size_t i = 0; i < scene_.slots.size(); ++i) {
    const std::string& slot = scene_.slots[i].name;
    const std::string& variant = show_state.slots[i].variant;
    const auto shown = variants_.find(slot);
    if (shown != variants_.end() && shown->second != variant) labels_[slot] = {variant, at};
    variants_[slot] = variant;
  }
  std::erase_if(
      labels_, [&](const auto& entry) { return seconds_between(entry.second.since, at) > options_.label_s; });
  last_ = posed;
}

void FrameComposer::look_for_drift(const Percepts& watched) {
  drifts_.look(watched, painted_.posed, shown_, &renderer_);
}

// A projector's image of the parts, of those that fade only a share.
cv::Mat FrameComposer::lit(std::size_t projector, const scene::PosedScene& posed, const Imager& viewer, Stamp at) {
  cv::Mat image = renderer_.projector_image(projector, posed, viewer);
  if (gone_) {
    const double share = 1 - seconds_between(gone_->lost_at, at) / options_.fade_s;
    return share <= 0 ? image
                      : mixed(image, renderer_.projector_image(projector, gone_->posed, viewer), share);
  }
  for (const auto& [slot, fading] : fading_) {
    const double share = 1 - seconds_between(fading.lost_at, at) / options_.fade_s;
    if (share <= 0) continue;
    scene::PosedScene with = posed;
    with.parts.push_back(fading.part);
    image = mixed(image, renderer_.projector_image(projector, with, viewer), share);
  }
  return image;
}

// A projector's image with the show state's aids: another look left of a line, a grid.
cv::Mat FrameComposer::lit_for(std::size_t projector,
                         const scene::ShowState& show_state,
                         const Imager& viewer,
                         Stamp at) {
  cv::Mat image = lit(projector, painted_.posed, viewer, at);
  const auto left = scene::left_of_split(scene_, show_state);
  if (!painted_.posed.world_from_prototype || (!left && !show_state.grid)) return image;
  const cv::Mat points = renderer_.surface_points(projector, painted_.posed);
  if (left) {
    const scene::PosedScene other = scene::compose_scene(scene_, *left, painted_.tracks);
    image = split_at(points, prototype_box_.center().x() + 1e-3 * show_state.split_mm,
                       renderer_.projector_image(projector, other, viewer), image);
  }
  if (show_state.grid) draw_grid(points, renderer_.blend(projector, painted_.posed), &image);
  return image;
}

// The projector that reaches a marker best; null when none does.
const Imager* FrameComposer::best_projector(const Pose& world_from_marker) const {
  const Imager* best = nullptr;
  double most = 0;
  for (const Imager& projector : rig_.projectors) {
    const double cosine = head_on(projector, world_from_marker);
    if (cosine <= most) continue;
    most = cosine;
    best = &projector;
  }
  return best;
}

void FrameComposer::draw_feedback(const scene::ShowState& show_state) {
  for (const Track& track : painted_.tracks) {
    const auto body =
        std::find_if(bodies_.begin(), bodies_.end(), [&](const Body& b) { return b.name == track.body; });
    if (body == bodies_.end()) continue;
    const auto fading = fading_.find(track.body);
    const auto label = labels_.find(track.body);
    for (const BodyMarker& marker : body->markers) {
      const Pose world_from_marker = track.world_from_body * marker.body_from_marker;
      const Imager* projector = best_projector(world_from_marker);
      if (!projector) continue;
      cv::Mat* image = &painted_.projectors[static_cast<std::size_t>(projector - rig_.projectors.data())];
      if (fading != fading_.end()) {
        const double age = seconds_between(fading->second.lost_at, painted_.shown_at) / options_.lost_s;
        draw_ring(*projector, world_from_marker, marker.size_m, k_red, k_sign * std::max(0.0, 1 - age),
                  image);
      } else if (show_state.marker_states && track.tracking != TrackingState::lost) {
        const cv::Scalar& colour = track.tracking == TrackingState::measured ? k_green : k_amber;
        draw_ring(*projector, world_from_marker, marker.size_m, colour, k_sign, image);
      }
      if (label != labels_.end()) {
        const double age = seconds_between(label->second.since, painted_.shown_at) / options_.label_s;
        draw_word(*projector, world_from_marker, marker.size_m, label->second.text,
                  k_sign * std::min(1.0, 3 * (1 - age)), image);
      }
    }
  }
}

void FrameComposer::draw_waiting(std::span<const LooseMarker> waiting) {
  for (const LooseMarker& loose : waiting) {
    const Imager* projector = best_projector(loose.world_from_marker);
    if (!projector) continue;
    const double share = &loose == &waiting.back() ? 1 : k_other_waiting;
    draw_ring(*projector, loose.world_from_marker, loose_size_m(scene_), k_blue, k_sign * share,
              &painted_.projectors[static_cast<std::size_t>(projector - rig_.projectors.data())]);
  }
}

}  // namespace limn::apps
