#include "nodes/to_wire.h"

#include <algorithm>
#include <iterator>
#include <list>
#include <type_traits>

#include "limn_room.h"
#include "nodes/packed_image.h"

namespace limn::nodes {
namespace {

std::int64_t nanoseconds_of(Stamp at) { return at.time_since_epoch().count(); }

// Fills structs of limn_room.idl. Owns the memory of their lists.
class WireFilling {
 public:
  void fill(const Message& message, const Sender& from, std::shared_ptr<const void>* out);

 private:
  template <class Wire>
  std::shared_ptr<Wire> begun(const Sender& from) {
    auto wire = std::make_shared<Wire>();
    text(from.node, &wire->node);
    wire->run = from.run;
    return wire;
  }

  // The engine does not change a sample that it sends.
  static void text(const std::string& in, char** out) { *out = const_cast<char*>(in.c_str()); }
  static void size(const cv::Size& in, limn_v1_Size* out) { *out = {in.width, in.height}; }
  static void vector(const Eigen::Vector3d& in, limn_v1_Vector3* out) { std::copy_n(in.data(), 3, out->xyz); }
  static void pose(const Pose& in, limn_v1_Pose* out);
  static void bytes(const std::string& in, dds_sequence_octet* out);
  static void marker(const MarkerName& in, limn_v1_Marker* out);
  static void marker(const tracker::Detection& in, limn_v1_DetectedMarker* out);
  static void ball(const tracker::Ball& in, limn_v1_DetectedBall* out);

  template <class Sequence>
  auto* allocated(std::size_t count, Sequence* out);
  template <class Items, class Sequence, class Put>
  void list(const Items& items, Sequence* out, Put put);
  template <class Item, class Sequence, class Put>
  void optional(const std::optional<Item>& item, Sequence* out, Put put);
  void numbers(const double* in, std::size_t count, dds_sequence_double* out);
  void image(const cv::Mat& in, limn_v1_PackedImage* out);
  void imager(const Imager& in, limn_v1_Imager* out);
  void part(const scene::PosedPart& in, limn_v1_PosedPart* out);
  void light(const scene::RoomLight& in, limn_v1_RoomLight* out);
  void posed(const scene::PosedScene& in, limn_v1_PosedScene* out);
  void line(const scene::DrawnLine& in, limn_v1_DrawnLine* out);
  static void track(const Track& in, limn_v1_Track* out);

  void overlay(const projector::SplitOverlay& in, limn_v1_Overlay* out);
  void overlay(const projector::GridOverlay& in, limn_v1_Overlay* out);
  void overlay(const projector::RingOverlay& in, limn_v1_Overlay* out);
  void overlay(const projector::WordOverlay& in, limn_v1_Overlay* out);
  void overlay(const projector::SignOverlay& in, limn_v1_Overlay* out);

  void message(const Offer& in, limn_v1_Offer* out);
  void message(const Setup& in, limn_v1_Setup* out);
  void message(const Moment& in, limn_v1_Moment* out);
  void message(const ScreenImage& in, limn_v1_ScreenImage* out);
  void message(const ClockRequest& in, limn_v1_ClockRequest* out);
  void message(const ClockAnswer& in, limn_v1_ClockAnswer* out);
  void message(const Order& in, limn_v1_Order* out);
  void message(const Answer& in, limn_v1_Answer* out);
  void message(const Health& in, limn_v1_Health* out);
  void message(const Detections& in, limn_v1_Detections* out);

  std::list<std::shared_ptr<void>> memory_;
};

template <class Sequence>
auto* WireFilling::allocated(std::size_t count, Sequence* out) {
  using Item = std::remove_pointer_t<decltype(out->_buffer)>;
  const auto items = std::make_shared<std::vector<Item>>(count);
  memory_.push_back(items);
  out->_buffer = items->data();
  out->_length = out->_maximum = static_cast<std::uint32_t>(count);
  out->_release = false;
  return items->data();
}

template <class Items, class Sequence, class Put>
void WireFilling::list(const Items& items, Sequence* out, Put put) {
  auto* to = allocated(items.size(), out);
  for (const auto& item : items) put(item, to++);
}

template <class Item, class Sequence, class Put>
void WireFilling::optional(const std::optional<Item>& item, Sequence* out, Put put) {
  auto* to = allocated(item ? 1 : 0, out);
  if (item) put(*item, to);
}

void WireFilling::numbers(const double* in, std::size_t count, dds_sequence_double* out) {
  std::copy_n(in, count, allocated(count, out));
}

void WireFilling::bytes(const std::string& in, dds_sequence_octet* out) {
  out->_buffer = reinterpret_cast<std::uint8_t*>(const_cast<char*>(in.data()));
  out->_length = out->_maximum = static_cast<std::uint32_t>(in.size());
  out->_release = false;
}

void WireFilling::pose(const Pose& in, limn_v1_Pose* out) {
  out->rotation[0] = in.rotation.w();
  out->rotation[1] = in.rotation.x();
  out->rotation[2] = in.rotation.y();
  out->rotation[3] = in.rotation.z();
  std::copy_n(in.translation.data(), 3, out->translation);
}

void WireFilling::marker(const MarkerName& in, limn_v1_Marker* out) {
  text(in.family, &out->family);
  text(in.id, &out->id);
}

void WireFilling::image(const cv::Mat& in, limn_v1_PackedImage* out) {
  const std::vector<std::uint8_t> bytes = packed(in);
  size(in.size(), &out->size);
  out->channels = in.empty() ? 0 : static_cast<std::uint8_t>(in.channels());
  std::copy(bytes.begin(), bytes.end(), allocated(bytes.size(), &out->packed));
}

void WireFilling::imager(const Imager& in, limn_v1_Imager* out) {
  text(in.name, &out->name);
  size({in.width, in.height}, &out->size);
  text(in.lens.model.name(), &out->lens.model);
  numbers(in.lens.values.data(), in.lens.values.size(), &out->lens.values);
  pose(in.imager_from_world, &out->imager_from_world);
  out->spectrum = static_cast<std::uint8_t>(in.sees);
}

void WireFilling::track(const Track& in, limn_v1_Track* out) {
  text(in.body, &out->body);
  pose(in.world_from_body, &out->world_from_body);
  double* next = out->covariance;
  for (Eigen::Index row = 0; row < 6; ++row)
    for (Eigen::Index column = 0; column <= row; ++column) *next++ = in.covariance(row, column);
  out->marker_count = in.marker_count;
  out->rms_px = in.rms_px;
  out->captured_at = nanoseconds_of(in.captured_at);
  out->at = nanoseconds_of(in.at);
  out->tracking = static_cast<std::uint8_t>(in.tracking);
}

void WireFilling::part(const scene::PosedPart& in, limn_v1_PosedPart* out) {
  text(in.slot, &out->slot);
  text(in.variant, &out->variant);
  pose(in.world_from_part, &out->world_from_part);
  optional(in.material.base_colour, &out->material.base_colour, &WireFilling::vector);
  const auto number = [](double value, double* to) { *to = value; };
  optional(in.material.metallic, &out->material.metallic, number);
  optional(in.material.roughness, &out->material.roughness, number);
  optional(in.window, &out->window, [](const scene::GreyWindow& window, limn_v1_GreyWindow* to) {
    to->level = window.level;
    to->width = window.width;
  });
}

void WireFilling::light(const scene::RoomLight& in, limn_v1_RoomLight* out) {
  vector(in.d_up_world, &out->d_up_world);
  vector(in.below_rgb, &out->below_rgb);
  vector(in.above_rgb, &out->above_rgb);
  list(in.lamps, &out->lamps, [](const scene::RoomLight::Lamp& lamp, limn_v1_Lamp* to) {
    vector(lamp.d_world, &to->d_world);
    vector(lamp.strength_rgb, &to->strength_rgb);
  });
  out->image_strength = in.image_strength;
}

void WireFilling::posed(const scene::PosedScene& in, limn_v1_PosedScene* out) {
  optional(in.world_from_prototype, &out->world_from_prototype, &WireFilling::pose);
  list(in.parts, &out->parts, [this](const auto& item, auto* to) { part(item, to); });
  list(in.viewpoints, &out->viewpoints, [](const scene::Viewpoint& viewpoint, limn_v1_Viewpoint* to) {
    text(viewpoint.viewer, &to->viewer);
    vector(viewpoint.p_world, &to->p_world);
    to->weight = viewpoint.weight;
  });
  optional(in.light, &out->light, [this](const auto& item, auto* to) { light(item, to); });
  text(in.finish, &out->finish);
  optional(in.cut, &out->cut, [this](const scene::CutPlane& item, limn_v1_CutPlane* to) {
    vector(item.normal, &to->normal);
    to->offset_m = item.offset_m;
  });
  list(in.lines, &out->lines, &WireFilling::text);
  list(in.drawn, &out->drawn, [this](const auto& item, auto* to) { line(item, to); });
  out->deviation_layer = in.deviation.layer;
  out->deviation_tolerance_m = in.deviation.tolerance_m;
}

void WireFilling::line(const scene::DrawnLine& in, limn_v1_DrawnLine* out) {
  text(in.name, &out->name);
  vector(in.style.colour, &out->colour);
  out->width_m = in.style.width_m;
  out->is_closed = in.curve.is_closed;
  list(in.curve.points, &out->points, [](const scene::SurfacePoint& point, limn_v1_SurfacePoint* to) {
    vector(point.p, &to->p);
    vector(point.d_normal, &to->d_normal);
  });
}

void WireFilling::overlay(const projector::SplitOverlay& in, limn_v1_Overlay* out) {
  out->_d = limn_v1_OVERLAY_SPLIT;
  posed(in.left, &out->_u.split.left);
  out->_u.split.x_m = in.x_m;
}

void WireFilling::overlay(const projector::GridOverlay& /*in*/, limn_v1_Overlay* out) {
  out->_d = limn_v1_OVERLAY_GRID;
}

void WireFilling::overlay(const projector::RingOverlay& in, limn_v1_Overlay* out) {
  out->_d = limn_v1_OVERLAY_RING;
  limn_v1_Ring& ring = out->_u.ring;
  ring.projector = static_cast<std::uint32_t>(in.projector);
  pose(in.world_from_marker, &ring.world_from_marker);
  ring.size_m = in.size_m;
  std::copy_n(in.colour.val, 4, ring.colour);
  ring.strength = in.strength;
}

void WireFilling::overlay(const projector::WordOverlay& in, limn_v1_Overlay* out) {
  out->_d = limn_v1_OVERLAY_WORD;
  limn_v1_Word& word = out->_u.word;
  word.projector = static_cast<std::uint32_t>(in.projector);
  pose(in.world_from_marker, &word.world_from_marker);
  word.size_m = in.size_m;
  text(in.text, &word.text);
  word.strength = in.strength;
}

void WireFilling::overlay(const projector::SignOverlay& in, limn_v1_Overlay* out) {
  out->_d = limn_v1_OVERLAY_SIGN;
  limn_v1_Sign& sign = out->_u.sign;
  sign.projector = static_cast<std::uint32_t>(in.projector);
  image(in.image, &sign.image);
  optional(in.place, &sign.place, [](const projector::OverlayPlace& place, limn_v1_Place* to) {
    vector(place.p_corner, &to->p_corner);
    vector(place.d_right, &to->d_right);
    vector(place.d_down, &to->d_down);
  });
}

void WireFilling::message(const Moment& in, limn_v1_Moment* out) {
  const session::FrameDescription& frame = in.frame;
  const auto put_overlay = [this](const projector::Overlay& item, limn_v1_Overlay* to) {
    std::visit([&](const auto& one) { overlay(one, to); }, item);
  };
  out->setup = in.setup;
  out->number = frame.number;
  out->painted_at = nanoseconds_of(frame.painted_at);
  out->shown_at = nanoseconds_of(frame.shown_at);
  list(frame.tracks, &out->tracks, &WireFilling::track);
  posed(frame.posed, &out->posed);
  imager(frame.viewer, &out->viewer);
  list(frame.fading, &out->fading, [this](const session::FadingPart& item, limn_v1_FadingPart* to) {
    part(item.part, &to->part);
    to->share = item.share;
  });
  list(frame.gone, &out->gone, [this](const session::FadingScene& item, limn_v1_FadingScene* to) {
    posed(item.posed, &to->posed);
    to->share = item.share;
  });
  list(frame.on_surface, &out->on_surface, put_overlay);
  list(frame.signs, &out->signs, put_overlay);
  list(frame.loose, &out->loose, [](const MarkerName& item, limn_v1_Marker* to) { marker(item, to); });
  out->is_black = frame.is_black;
  out->is_moving = frame.is_moving;
  list(frame.arriving, &out->arriving, [this](const cv::Mat& map, auto* to) { image(map, to); });
}

void WireFilling::message(const Offer& in, limn_v1_Offer* out) {
  const auto device = [](const OfferedDevice& item, limn_v1_OfferedDevice* to) {
    text(item.name, &to->name);
    size(item.size, &to->size);
  };
  out->is_host = in.is_host;
  out->protocol = in.protocol;
  text(in.version, &out->version);
  text(in.renderer, &out->renderer);
  list(in.monitors, &out->monitors, device);
  list(in.cameras, &out->cameras, device);
  list(in.servers, &out->servers, &WireFilling::text);
  text(in.fingerprint, &out->fingerprint);
  text(in.token, &out->token);
}

void WireFilling::message(const Setup& in, limn_v1_Setup* out) {
  out->revision = in.revision;
  text(in.devices, &out->devices);
  list(in.files, &out->files, [](const SharedFile& item, limn_v1_SharedFile* to) {
    text(item.path, &to->path);
    text(item.sha256, &to->sha256);
    to->bytes = item.bytes;
  });
}

void WireFilling::message(const ScreenImage& in, limn_v1_ScreenImage* out) {
  text(in.to, &out->to);
  text(in.screen, &out->screen);
  out->number = in.number;
  bytes(in.left, &out->left);
  bytes(in.right, &out->right);
}

void WireFilling::message(const ClockRequest& in, limn_v1_ClockRequest* out) {
  text(in.to, &out->to);
  out->number = in.number;
  out->sent_at = nanoseconds_of(in.sent_at);
}

void WireFilling::message(const ClockAnswer& in, limn_v1_ClockAnswer* out) {
  text(in.to, &out->to);
  out->number = in.number;
  out->asked_at = nanoseconds_of(in.asked_at);
  out->received_at = nanoseconds_of(in.received_at);
  out->sent_at = nanoseconds_of(in.sent_at);
}

void WireFilling::message(const Order& in, limn_v1_Order* out) {
  text(in.to, &out->to);
  out->number = in.number;
  out->what = static_cast<std::uint8_t>(in.what);
  text(in.device, &out->device);
  bytes(in.image, &out->image);
  out->at = nanoseconds_of(in.at);
}

void WireFilling::message(const Answer& in, limn_v1_Answer* out) {
  text(in.to, &out->to);
  out->number = in.number;
  text(in.error, &out->error);
  size(in.size, &out->size);
  bytes(in.image, &out->image);
  out->at = nanoseconds_of(in.at);
}

void WireFilling::message(const Health& in, limn_v1_Health* out) {
  out->shown = in.shown;
  out->missed = in.missed;
  out->latency_s = in.latency_s;
  out->draw_ms = in.draw_ms;
  out->late_ms = in.late_ms;
  out->clock_offset_s = in.clock_offset_s;
  out->clock_stddev_s = in.clock_stddev_s;
  list(in.problems, &out->problems, &WireFilling::text);
  out->has_no_host = in.has_no_host;
  list(in.refreshes, &out->refreshes, [](const Refresh& item, limn_v1_Refresh* to) {
    *to = {nanoseconds_of(item.at), item.period_s};
  });
  list(in.screen_problems, &out->screen_problems, &WireFilling::text);
}

void WireFilling::marker(const tracker::Detection& in, limn_v1_DetectedMarker* out) {
  marker(in.marker, &out->marker);
  for (std::size_t i = 0; i < 4; ++i) {
    limn_v1_Corner& corner = out->corners[i];
    std::copy_n(in.corners_px[i].data(), 2, corner.px);
    std::copy_n(in.corner_covariance[i].data(), 4, corner.covariance);
    corner.is_visible = in.corner_visible[i];
  }
  out->score = in.score;
}

void WireFilling::ball(const tracker::Ball& in, limn_v1_DetectedBall* out) {
  vector(in.d_centre, &out->d_centre);
  out->half_angle = in.half_angle;
  std::copy_n(in.centre_px.data(), 2, out->centre_px);
  std::copy_n(in.centre_covariance.data(), 4, out->covariance);
  out->radius_px = in.radius_px;
  out->half_angle_stddev = in.half_angle_stddev;
  out->contrast = in.contrast;
  out->blur_px = in.blur_px;
}

void WireFilling::message(const Detections& in, limn_v1_Detections* out) {
  text(in.found.camera, &out->camera);
  out->setup = in.setup;
  out->captured_at = nanoseconds_of(in.found.captured_at);
  out->counted_by = in.found.run;
  list(in.found.detections, &out->markers,
       [](const tracker::Detection& item, limn_v1_DetectedMarker* to) { marker(item, to); });
  list(in.found.balls, &out->balls, &WireFilling::ball);
  list(in.found.controls, &out->controls, [this](const tracker::GestureReading& item, limn_v1_Gestures* to) {
    to->forward = item.forward;
    to->backward = item.backward;
    to->is_seen = item.is_seen;
    optional(item.hidden_since, &to->hidden_since,
             [](Stamp at, std::int64_t* since) { *since = nanoseconds_of(at); });
  });
}

template <class T>
struct WireOf;
template <>
struct WireOf<Offer> : std::type_identity<limn_v1_Offer> {};
template <>
struct WireOf<Setup> : std::type_identity<limn_v1_Setup> {};
template <>
struct WireOf<Moment> : std::type_identity<limn_v1_Moment> {};
template <>
struct WireOf<ScreenImage> : std::type_identity<limn_v1_ScreenImage> {};
template <>
struct WireOf<ClockRequest> : std::type_identity<limn_v1_ClockRequest> {};
template <>
struct WireOf<ClockAnswer> : std::type_identity<limn_v1_ClockAnswer> {};
template <>
struct WireOf<Order> : std::type_identity<limn_v1_Order> {};
template <>
struct WireOf<Answer> : std::type_identity<limn_v1_Answer> {};
template <>
struct WireOf<Health> : std::type_identity<limn_v1_Health> {};
template <>
struct WireOf<Detections> : std::type_identity<limn_v1_Detections> {};

void WireFilling::fill(const Message& in, const Sender& from, std::shared_ptr<const void>* out) {
  std::visit(
      [&](const auto& one) {
        using Kind = std::remove_cvref_t<decltype(one)>;
        if constexpr (!std::is_same_v<Kind, Departure>) {
          const auto wire = begun<typename WireOf<Kind>::type>(from);
          message(one, wire.get());
          *out = wire;
        }
      },
      in);
}

// A sample and the memory that it refers to.
struct FilledSample {
  WireFilling filling;
  std::shared_ptr<const void> sample;
};

}  // namespace

WireSample to_wire(const Message& message, const Sender& from) {
  const auto filled = std::make_shared<FilledSample>();
  filled->filling.fill(message, from, &filled->sample);
  LIMN_CHECK(filled->sample);
  return {static_cast<Topic>(message.index()), std::shared_ptr<const void>(filled, filled->sample.get())};
}

}  // namespace limn::nodes
