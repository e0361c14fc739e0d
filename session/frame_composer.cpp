#include "session/frame_composer.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/names.h"
#include "projector/overlays/marker_signs.h"
#include "session/deviation/deviation_signs.h"
#include "session/drawing/card_slice.h"
#include "session/stillness.h"

namespace limn::session {
namespace {

// Display value of rings and words, as a share; brighter ones could hide markers from cameras.
constexpr double k_sign = 0.7;
const cv::Scalar k_green(90, 220, 90), k_amber(40, 170, 255), k_red(60, 60, 255), k_blue(255, 190, 110);
constexpr double k_other_waiting = 0.4;  // strength of the rings of waiting markers that are not next

Eigen::AlignedBox3d box_of(const scene::Scene& scene) {
  Eigen::AlignedBox3d box;
  if (scene.prototype)
    for (const Eigen::Vector3f& p : scene.prototype->mesh.positions) box.extend(p.cast<double>());
  return box;
}

// Whether both give the same light but for lines.
bool has_no_motion(const FrameDescription& a, const FrameDescription& b) {
  const auto is_steady = [](const FrameDescription& frame) {
    return frame.fading.empty() && frame.gone.empty();
  };
  const auto is_same_map = [](const cv::Mat& map, const cv::Mat& other) {
    return map.size() == other.size() && (map.empty() || cv::norm(map, other, cv::NORM_INF) == 0);
  };
  return is_steady(a) && is_steady(b) && is_same_without_lines(a.posed, b.posed) &&
         is_same(a.viewer.imager_from_world, b.viewer.imager_from_world) &&
         std::ranges::equal(a.arriving, b.arriving, is_same_map);
}

}  // namespace

std::vector<cv::Mat> ComposedFrame::eye_images() const {
  std::vector<cv::Mat> out = projectors;
  for (const cv::Mat& image : right_eyes)
    if (!image.empty()) out.push_back(image);
  return out;
}

std::vector<EyeImages> with_overlays(const ComposedFrame& composed,
                                     const Rig& rig,
                                     std::span<const projector::Overlay> overlays) {
  std::vector<EyeImages> out;
  for (std::size_t i = 0; i < composed.projectors.size(); ++i) {
    out.push_back(composed.images(i));
    if (overlays.empty()) continue;
    for (cv::Mat* image : {&out[i].left, &out[i].right}) {
      if (image->empty()) continue;
      *image = image->clone();
      draw(overlays, {i, rig.projectors[i], composed.posed, image});
    }
  }
  return out;
}

std::vector<LooseMarker> waiting_markers(const scene::Scene& scene,
                                         const scene::ShowState& show_state,
                                         const Percepts& percepts) {
  std::vector<LooseMarker> waiting;
  for (const LooseMarker& loose : percepts.loose) {
    bool carries = false;
    for (std::size_t i = 0; i < scene.slots.size(); ++i)
      carries |= scene::slot_marker(scene, show_state, i) == loose.marker;
    if (!carries && seconds_between(loose.still_since, percepts.captured_at) >= k_lies_after_s)
      waiting.push_back(loose);
  }
  return waiting;
}

Result<FrameComposer> FrameComposer::create(const scene::Scene& scene,
                                            const Rig& rig,
                                            const ComposeOptions& options) {
  std::unique_ptr<const Subject> subject(new Subject{scene, rig, scene::PartBoxes(scene)});
  LIMN_TRY(FrameDrawer drawer, FrameDrawer::create(&subject->scene, &subject->rig, draw_options(options)));
  return FrameComposer(std::move(subject), std::move(drawer), options);
}

FrameComposer::FrameComposer(std::unique_ptr<const Subject> subject,
                             FrameDrawer drawer,
                             const ComposeOptions& options)
    : subject_(std::move(subject)),
      drawer_(std::move(drawer)),
      options_(options),
      prototype_box_(box_of(subject_->scene)),
      viewpoints_(&subject_->scene, &subject_->rig),
      fading_(options),
      screens_(&subject_->scene, &subject_->rig, options, prototype_box_, &subject_->part_boxes),
      shadows_(subject_->rig),
      drifts_(subject_->rig) {
  for (const Imager& projector : subject_->rig.projectors)
    composed_.projectors.emplace_back(projector.height, projector.width, CV_8UC3, cv::Scalar::all(0));
  composed_.right_eyes.resize(composed_.projectors.size());
}

const ComposedFrame& FrameComposer::compose(const FrameInput& input) {
  describe(input);
  return draw();
}

const FrameDescription& FrameComposer::describe(const FrameInput& input) {
  frame_.painted_at = composed_.painted_at = input.times.now;
  frame_.shown_at = composed_.shown_at = input.times.shown_at;
  const scene::ShowState& show_state = input.show_state;
  is_held_ = show_state.frozen && !show_state.blackout && !frame_.is_black;
  if (is_held_) return frame_;

  // Poses of the parts, fades, viewpoint, shadows on the prototype.
  const FrameDescription before = std::exchange(frame_, {});
  frame_.painted_at = input.times.now;
  frame_.shown_at = input.times.shown_at;
  frame_.is_black = show_state.blackout;
  frame_.tracks = input.tracks;
  keep_still(fading_.faded().world_from_prototype, prototype_box_, &frame_.tracks);
  frame_.posed = scene::compose_scene(subject_->scene, show_state, frame_.tracks);
  keep_parts_still(fading_.faded(), subject_->part_boxes, &frame_.posed);
  if (const auto p_middle = scene::middle_of(subject_->scene, frame_.posed))
    keep_cut_still(fading_.faded(), *p_middle, &frame_.posed);
  fading_.note(subject_->scene, frame_.posed, show_state, input.times.shown_at);
  frame_.deviation = show_state.deviation.is_shown ? show_state.deviation.layer : nullptr;
  frame_.fading = fading_.fading_parts(input.times.shown_at);
  frame_.gone = fading_.gone_scene(input.times.shown_at);
  select_viewpoint(input);
  if (options_.refill && subject_->rig.projectors.size() > 1)
    shadows_.update(input.percepts, frame_.posed, shown_, &drawer_.renderer());
  frame_.arriving = arriving_light(input.dark_projectors);

  for (const LooseMarker& loose : input.percepts.loose) frame_.loose.push_back(loose.marker);
  frame_.on_surface = surface_overlays(show_state);
  if (!frame_.is_black) frame_.signs = marker_overlays(input);
  frame_.is_moving = !has_no_motion(before, frame_);
  return frame_;
}

const ComposedFrame& FrameComposer::draw() {
  if (is_held_) return composed_;
  composed_.tracks = frame_.tracks;
  composed_.posed = frame_.posed;
  draw_projectors();
  std::vector<cv::Mat> light;
  for (std::size_t i = 0; i < composed_.projectors.size(); ++i)
    light.push_back(mean_light(composed_.images(i)));
  shown_.add(light, frame_.shown_at);
  return composed_;
}

// What shadows leave, and nothing from dark projectors.
std::vector<cv::Mat> FrameComposer::arriving_light(std::span<const std::string> dark_projectors) const {
  std::vector<cv::Mat> maps = shadows_.maps();
  for (const std::string& name : dark_projectors) {
    const Imager* projector = find_named(subject_->rig.projectors, name);
    if (!projector) continue;
    maps.resize(subject_->rig.projectors.size());
    maps[static_cast<std::size_t>(projector - subject_->rig.projectors.data())] =
        cv::Mat(1, 1, CV_8U, cv::Scalar(0));
  }
  return maps;
}

void FrameComposer::draw_projectors() {
  for (std::size_t i = 0; i < composed_.projectors.size(); ++i) {
    const EyeImages images = drawer_.image(frame_, i);
    composed_.projectors[i] = images.left;
    composed_.right_eyes[i] = images.right;
  }
}

void FrameComposer::select_viewpoint(const FrameInput& input) {
  const SelectedViewpoint& selected = viewpoints_.select(frame_.posed, input);
  frame_.viewer = composed_.viewer = selected.viewer;
  composed_.follows = selected.follows;
  composed_.p_guest_eye_world = selected.p_guest_eye_world;
}

// The split view (another look left of a line), the grid, and slices on the section's card.
std::vector<projector::Overlay> FrameComposer::surface_overlays(const scene::ShowState& show_state) const {
  std::vector<projector::Overlay> out;
  if (!frame_.posed.world_from_prototype || show_state.blackout) return out;
  if (frame_.deviation) add_deviation_marks(show_state, &out);
  if (const auto left = scene::left_of_split(subject_->scene, show_state))
    out.push_back(projector::SplitOverlay{scene::compose_scene(subject_->scene, *left, frame_.tracks),
                                          prototype_box_.center().x() + 1e-3 * show_state.split_mm});
  if (show_state.grid) out.push_back(projector::GridOverlay{});
  const auto& section = subject_->scene.section;
  const auto card = std::ranges::find(frame_.tracks, scene::section_body(), &Track::body);
  if (section && show_state.section.is_on && card != frame_.tracks.end() &&
      card->tracking != TrackingState::lost) {
    const Pose world_from_card = card->world_from_body * section->marker_from_plane;
    if (const auto projector = best_projector(world_from_card))
      for (projector::Overlay& sign : card_overlays(subject_->scene, frame_.posed, world_from_card,
                                                    *projector, subject_->rig.projectors.size()))
        out.push_back(std::move(sign));
  }
  return out;
}

// A ring and the millimetres at each place where the deviation is largest.
void FrameComposer::add_deviation_marks(const scene::ShowState& show_state,
                                        std::vector<projector::Overlay>* out) const {
  const Pose& world_from_prototype = *frame_.posed.world_from_prototype;
  const Eigen::Vector3d d_up = world_from_prototype.rotation.inverse() * show_state.d_up_world;
  for (const DeviationSign& sign : deviation_signs(*frame_.deviation, prototype_box_, d_up)) {
    const Pose world_from_mark = world_from_prototype * sign.prototype_from_mark;
    const auto projector = best_projector(world_from_mark);
    if (!projector) continue;
    out->push_back(
        projector::RingOverlay{*projector, world_from_mark, sign.size_m, cv::Scalar::all(255), k_sign});
    if (sign.place) out->push_back(projector::SignOverlay{*projector, sign.image, *sign.place});
  }
}

// Rings where a part was lost, for tracking states and for markers that wait for a part, and names of
// variants.
std::vector<projector::Overlay> FrameComposer::marker_overlays(const FrameInput& input) const {
  std::vector<projector::Overlay> out;
  const Stamp at = frame_.shown_at;
  for (const Track& track : frame_.tracks) {
    const std::optional<Stamp> lost_at = fading_.lost_at(track.body);
    const PartFading::Label* label = fading_.label(track.body);
    for (const SignPlace& place : sign_places(track)) {
      projector::RingOverlay ring{place.projector, place.world_from_marker, place.size_m, k_red, k_sign};
      if (lost_at) {
        ring.strength *= std::max(0.0, 1 - seconds_between(*lost_at, at) / options_.lost_s);
        out.push_back(ring);
      } else if (input.show_state.marker_states && track.tracking != TrackingState::lost) {
        ring.colour = track.tracking == TrackingState::measured ? k_green : k_amber;
        out.push_back(ring);
      }
      if (label) {
        const double age = seconds_between(label->since, at) / options_.label_s;
        out.push_back(projector::WordOverlay{place.projector, place.world_from_marker, place.size_m,
                                             label->text, k_sign * std::min(1.0, 3 * (1 - age))});
      }
    }
  }
  const std::vector<LooseMarker> waiting = waiting_markers(subject_->scene, input.show_state, input.percepts);
  for (const LooseMarker& loose : waiting) {
    const double share = &loose == &waiting.back() ? 1 : k_other_waiting;
    if (const auto projector = best_projector(loose.world_from_marker))
      out.push_back(projector::RingOverlay{*projector, loose.world_from_marker,
                                           scene::first_marker_size_m(subject_->scene), k_blue,
                                           k_sign * share});
  }
  return out;
}

// At each marker of the body, and in the middle of a constellation, facing the first projector that reaches
// it.
std::vector<FrameComposer::SignPlace> FrameComposer::sign_places(const Track& track) const {
  std::vector<SignPlace> places;
  if (const Body* body = find_named(drawer_.bodies(), track.body))
    for (const BodyMarker& marker : body->markers) {
      const Pose world_from_marker = track.world_from_body * marker.body_from_marker;
      if (const auto projector = best_projector(world_from_marker))
        places.push_back({*projector, world_from_marker, marker.size_m});
    }
  const Constellation* balls = find_named(drawer_.constellations(), track.body);
  const std::vector<Imager>& projectors = subject_->rig.projectors;
  for (std::size_t i = 0; balls && i < projectors.size(); ++i) {
    const Pose facing(projectors[i].imager_from_world.rotation.inverse(), track.world_from_body.translation);
    if (!(projector::head_on(projectors[i], facing) > 0)) continue;
    places.push_back({i, facing, 2 * reach_of(*balls)});
    break;
  }
  return places;
}

// The projector whose light meets a marker most directly; nullopt when none reaches it.
std::optional<std::size_t> FrameComposer::best_projector(const Pose& world_from_marker) const {
  std::optional<std::size_t> best;
  double most = 0;
  const std::vector<Imager>& projectors = subject_->rig.projectors;
  for (std::size_t i = 0; i < projectors.size(); ++i) {
    const double cosine = projector::head_on(projectors[i], world_from_marker);
    if (cosine <= most) continue;
    most = cosine;
    best = i;
  }
  return best;
}

void FrameComposer::check_drift(const Percepts& percepts) {
  drifts_.compare(percepts, composed_.posed, drawer_.bodies(), drawer_.constellations(), composed_.tracks,
                  shown_, &drawer_.renderer());
}

EyeImages FrameComposer::screen(const Percepts& percepts,
                                std::span<const Track> tracks,
                                const scene::ShowState& show_state,
                                const ScreenRequest& request) {
  std::vector<TrackedFrame> cameras;
  for (const Frame& frame : percepts.frames) {
    const bool is_seen_by_one = cameras.size() == percepts.screen_camera;
    std::vector<Track> at_frame;
    if (is_seen_by_one)
      at_frame.assign(tracks.begin(), tracks.end());
    else if (request.for_two_eyes)
      at_frame = predicted_at(percepts, options_, frame.captured_at);
    cameras.push_back({frame, scene::assign_tracks(subject_->scene, show_state, at_frame)});
    keep_still(fading_.faded().world_from_prototype, prototype_box_, &cameras.back().tracks);
  }
  const bool shows_deviation = show_state.deviation.is_shown && show_state.deviation.layer;
  if (shows_deviation) drawer_.use_deviation(show_state.deviation.layer);
  EyeImages images = screens_.images({cameras, show_state, viewpoints_.selected().viewer, fading_.faded()},
                                     request, &drawer_.renderer());
  if (shows_deviation && request.what != scene::Screen::camera)
    for (cv::Mat* image : {&images.left, &images.right})
      if (!image->empty())
        *image = with_legend(*image, *show_state.deviation.layer, show_state.deviation.tolerance_m);
  return images;
}

cv::Mat FrameComposer::free_surface(std::size_t projector) {
  cv::Mat points = drawer_.renderer().surface_points(projector, composed_.posed);
  points.setTo(cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()),
               drawer_.carrier_mask(projector, composed_.tracks));
  return points;
}

}  // namespace limn::session
