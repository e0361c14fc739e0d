#include "nodes/from_wire.h"

#include <algorithm>
#include <span>

#include "limn_room.h"
#include "nodes/message_check.h"
#include "nodes/packed_image.h"

namespace limn::nodes {
namespace {

template <class Sequence>
auto items_of(const Sequence& sequence) {
  return std::span(sequence._buffer, sequence._length);
}

// Reads structs of limn_room.idl. Keeps the first problem, so that callers need no check after each value.
class WireReading {
 public:
  Status status() const { return status_; }

  template <class Wire>
  Sender sender(const Wire& in) {
    Sender from{text(in.node), in.run};
    if (!is_node_name(from.node)) refuse(error("node: expected a machine's name, found something else."));
    return from;
  }

  Offer message(const limn_v1_Offer& in);
  Setup message(const limn_v1_Setup& in);
  Moment message(const limn_v1_Moment& in);
  ScreenImage message(const limn_v1_ScreenImage& in);
  ClockRequest message(const limn_v1_ClockRequest& in);
  ClockAnswer message(const limn_v1_ClockAnswer& in);
  Order message(const limn_v1_Order& in);
  Answer message(const limn_v1_Answer& in);
  Health message(const limn_v1_Health& in);
  Detections message(const limn_v1_Detections& in);

 private:
  void refuse(Error problem) {
    if (status_) status_ = std::move(problem);
  }

  template <class Enum>
  Enum enumerator(int value, Enum last, const char* field) {
    if (value < 0 || value > static_cast<int>(last))
      refuse(error("{}: expected a number from 0 to {}, found {}.", field, static_cast<int>(last), value));
    return static_cast<Enum>(value);
  }

  template <class Sequence, class Read>
  static auto list(const Sequence& in, Read read) {
    std::vector<decltype(read(*in._buffer))> out;
    out.reserve(in._length);
    for (const auto& item : items_of(in)) out.push_back(read(item));
    return out;
  }
  template <class Sequence, class Read>
  static auto optional(const Sequence& in, Read read) {
    using Item = decltype(read(*in._buffer));
    return in._length > 0 ? std::optional<Item>(read(*in._buffer)) : std::nullopt;
  }

  static std::string text(const char* in) { return in ? in : ""; }
  static std::string bytes(const dds_sequence_octet& in) { return {in._buffer, in._buffer + in._length}; }
  static Stamp stamp(std::int64_t nanoseconds) { return Stamp(std::chrono::nanoseconds(nanoseconds)); }
  static cv::Size size(const limn_v1_Size& in) { return {in.width, in.height}; }
  static Eigen::Vector3d vector(const limn_v1_Vector3& in) { return Eigen::Vector3d(in.xyz); }
  static Pose pose(const limn_v1_Pose& in);
  static MarkerName marker(const limn_v1_Marker& in) { return {text(in.family), text(in.id)}; }
  static scene::PosedPart part(const limn_v1_PosedPart& in);
  static scene::RoomLight light(const limn_v1_RoomLight& in);
  static scene::DrawnLine line(const limn_v1_DrawnLine& in);
  static scene::PosedScene posed(const limn_v1_PosedScene& in);
  static tracker::Detection detection(const limn_v1_DetectedMarker& in);
  static tracker::Ball ball(const limn_v1_DetectedBall& in);
  static OfferedDevice device(const limn_v1_OfferedDevice& in) { return {text(in.name), size(in.size)}; }
  Track track(const limn_v1_Track& in);
  Imager imager(const limn_v1_Imager& in);
  cv::Mat image(const limn_v1_PackedImage& in);
  projector::Overlay overlay(const limn_v1_Overlay& in);

  Status status_;
};

// Not by Pose's constructor, which normalizes the quaternion and so may change its last bit.
Pose WireReading::pose(const limn_v1_Pose& in) {
  Pose out;
  out.rotation = Eigen::Quaterniond(in.rotation[0], in.rotation[1], in.rotation[2], in.rotation[3]);
  out.translation = Eigen::Vector3d(in.translation);
  return out;
}

Track WireReading::track(const limn_v1_Track& in) {
  Track out;
  out.body = text(in.body);
  out.world_from_body = pose(in.world_from_body);
  const double* next = in.covariance;
  for (Eigen::Index row = 0; row < 6; ++row)
    for (Eigen::Index column = 0; column <= row; ++column)
      out.covariance(row, column) = out.covariance(column, row) = *next++;
  out.marker_count = in.marker_count;
  out.rms_px = in.rms_px;
  out.captured_at = stamp(in.captured_at);
  out.at = stamp(in.at);
  out.tracking = enumerator(in.tracking, TrackingState::lost, "track.tracking");
  return out;
}

Imager WireReading::imager(const limn_v1_Imager& in) {
  Imager out;
  out.name = text(in.name);
  out.width = in.size.width;
  out.height = in.size.height;
  out.imager_from_world = pose(in.imager_from_world);
  out.sees = enumerator(in.spectrum, Spectrum::infrared, "viewer.spectrum");
  const auto values = items_of(in.lens.values);
  auto lens = Lens::create(text(in.lens.model), {values.begin(), values.end()});
  if (lens)
    out.lens = std::move(*lens);
  else
    refuse(lens.error());
  return out;
}

cv::Mat WireReading::image(const limn_v1_PackedImage& in) {
  auto out = unpacked(items_of(in.packed), size(in.size), in.channels);
  if (!out) refuse(out.error());
  return out ? std::move(*out) : cv::Mat();
}

scene::PosedPart WireReading::part(const limn_v1_PosedPart& in) {
  const auto number = [](double value) { return value; };
  scene::PosedPart out{text(in.slot), text(in.variant), pose(in.world_from_part), {}};
  out.material.base_colour = optional(in.material.base_colour, &WireReading::vector);
  out.material.metallic = optional(in.material.metallic, number);
  out.material.roughness = optional(in.material.roughness, number);
  out.window = optional(in.window, [](const limn_v1_GreyWindow& window) {
    return scene::GreyWindow{window.level, window.width};
  });
  return out;
}

scene::RoomLight WireReading::light(const limn_v1_RoomLight& in) {
  scene::RoomLight out;
  out.d_up_world = vector(in.d_up_world);
  out.below_rgb = vector(in.below_rgb);
  out.above_rgb = vector(in.above_rgb);
  out.lamps = list(in.lamps, [](const limn_v1_Lamp& lamp) {
    return scene::RoomLight::Lamp{vector(lamp.d_world), vector(lamp.strength_rgb)};
  });
  out.image_strength = in.image_strength;
  return out;
}

scene::DrawnLine WireReading::line(const limn_v1_DrawnLine& in) {
  scene::DrawnLine out;
  out.name = text(in.name);
  out.style = {vector(in.colour), in.width_m};
  out.curve.is_closed = in.is_closed;
  out.curve.points = list(in.points, [](const limn_v1_SurfacePoint& point) {
    return scene::SurfacePoint{vector(point.p), vector(point.d_normal)};
  });
  return out;
}

scene::PosedScene WireReading::posed(const limn_v1_PosedScene& in) {
  scene::PosedScene out;
  out.world_from_prototype = optional(in.world_from_prototype, &WireReading::pose);
  out.parts = list(in.parts, &WireReading::part);
  out.viewpoints = list(in.viewpoints, [](const limn_v1_Viewpoint& viewpoint) {
    return scene::Viewpoint{text(viewpoint.viewer), vector(viewpoint.p_world), viewpoint.weight};
  });
  out.light = optional(in.light, &WireReading::light);
  out.finish = text(in.finish);
  out.cut = optional(in.cut, [](const limn_v1_CutPlane& cut) {
    return scene::CutPlane{vector(cut.normal), cut.offset_m};
  });
  out.lines = list(in.lines, &WireReading::text);
  out.drawn = list(in.drawn, &WireReading::line);
  out.deviation = {in.deviation_layer, in.deviation_tolerance_m};
  return out;
}

projector::Overlay WireReading::overlay(const limn_v1_Overlay& in) {
  switch (in._d) {
    case limn_v1_OVERLAY_SPLIT:
      return projector::SplitOverlay{posed(in._u.split.left), in._u.split.x_m};
    case limn_v1_OVERLAY_GRID:
      return projector::GridOverlay{};
    case limn_v1_OVERLAY_RING: {
      const limn_v1_Ring& ring = in._u.ring;
      const cv::Scalar colour(ring.colour[0], ring.colour[1], ring.colour[2], ring.colour[3]);
      return projector::RingOverlay{ring.projector, pose(ring.world_from_marker), ring.size_m, colour,
                                    ring.strength};
    }
    case limn_v1_OVERLAY_WORD: {
      const limn_v1_Word& word = in._u.word;
      return projector::WordOverlay{word.projector, pose(word.world_from_marker), word.size_m,
                                    text(word.text), word.strength};
    }
    case limn_v1_OVERLAY_SIGN: {
      const limn_v1_Sign& sign = in._u.sign;
      const auto place = [](const limn_v1_Place& at) {
        return projector::OverlayPlace{vector(at.p_corner), vector(at.d_right), vector(at.d_down)};
      };
      return projector::SignOverlay{sign.projector, image(sign.image), optional(sign.place, place)};
    }
  }
  refuse(error("overlay: expected a known kind, found {}.", static_cast<int>(in._d)));
  return projector::GridOverlay{};
}

Moment WireReading::message(const limn_v1_Moment& in) {
  Moment out;
  out.setup = in.setup;
  session::FrameDescription& frame = out.frame;
  const auto read_overlay = [this](const limn_v1_Overlay& item) { return overlay(item); };
  frame.number = in.number;
  frame.painted_at = stamp(in.painted_at);
  frame.shown_at = stamp(in.shown_at);
  frame.tracks = list(in.tracks, [this](const limn_v1_Track& item) { return track(item); });
  frame.posed = posed(in.posed);
  frame.viewer = imager(in.viewer);
  frame.fading = list(in.fading, [](const limn_v1_FadingPart& item) {
    return session::FadingPart{part(item.part), item.share};
  });
  frame.gone = list(in.gone, [](const limn_v1_FadingScene& item) {
    return session::FadingScene{posed(item.posed), item.share};
  });
  frame.on_surface = list(in.on_surface, read_overlay);
  frame.signs = list(in.signs, read_overlay);
  frame.loose = list(in.loose, &WireReading::marker);
  frame.is_black = in.is_black;
  frame.is_moving = in.is_moving;
  frame.arriving = list(in.arriving, [this](const limn_v1_PackedImage& item) { return image(item); });
  return out;
}

Offer WireReading::message(const limn_v1_Offer& in) {
  Offer out;
  out.is_host = in.is_host;
  out.protocol = in.protocol;
  out.version = text(in.version);
  out.renderer = text(in.renderer);
  out.monitors = list(in.monitors, &WireReading::device);
  out.cameras = list(in.cameras, &WireReading::device);
  out.servers = list(in.servers, &WireReading::text);
  out.fingerprint = text(in.fingerprint);
  out.token = text(in.token);
  return out;
}

Setup WireReading::message(const limn_v1_Setup& in) {
  Setup out;
  out.revision = in.revision;
  out.devices = text(in.devices);
  out.files = list(in.files, [](const limn_v1_SharedFile& item) {
    return SharedFile{text(item.path), text(item.sha256), item.bytes};
  });
  return out;
}

ScreenImage WireReading::message(const limn_v1_ScreenImage& in) {
  return {text(in.to), text(in.screen), in.number, bytes(in.left), bytes(in.right)};
}

ClockRequest WireReading::message(const limn_v1_ClockRequest& in) {
  return {text(in.to), in.number, stamp(in.sent_at)};
}

ClockAnswer WireReading::message(const limn_v1_ClockAnswer& in) {
  return {text(in.to), in.number, stamp(in.asked_at), stamp(in.received_at), stamp(in.sent_at)};
}

Order WireReading::message(const limn_v1_Order& in) {
  Order out;
  out.to = text(in.to);
  out.number = in.number;
  out.what = enumerator(in.what, Order::What::preview, "what");
  out.device = text(in.device);
  out.image = bytes(in.image);
  out.at = stamp(in.at);
  return out;
}

Answer WireReading::message(const limn_v1_Answer& in) {
  Answer out;
  out.to = text(in.to);
  out.number = in.number;
  out.error = text(in.error);
  out.size = size(in.size);
  out.image = bytes(in.image);
  out.at = stamp(in.at);
  return out;
}

Health WireReading::message(const limn_v1_Health& in) {
  Health out;
  out.shown = in.shown;
  out.missed = in.missed;
  out.latency_s = in.latency_s;
  out.draw_ms = in.draw_ms;
  out.late_ms = in.late_ms;
  out.clock_offset_s = in.clock_offset_s;
  out.clock_stddev_s = in.clock_stddev_s;
  out.problems = list(in.problems, &WireReading::text);
  out.has_no_host = in.has_no_host;
  out.refreshes = list(in.refreshes, [](const limn_v1_Refresh& item) {
    return Refresh{stamp(item.at), item.period_s};
  });
  out.screen_problems = list(in.screen_problems, &WireReading::text);
  return out;
}

tracker::Detection WireReading::detection(const limn_v1_DetectedMarker& in) {
  tracker::Detection out;
  out.marker = marker(in.marker);
  for (std::size_t i = 0; i < 4; ++i) {
    out.corners_px[i] = Eigen::Vector2d(in.corners[i].px);
    out.corner_covariance[i] = Eigen::Matrix2d(in.corners[i].covariance);
    out.corner_visible[i] = in.corners[i].is_visible;
  }
  out.score = in.score;
  return out;
}

tracker::Ball WireReading::ball(const limn_v1_DetectedBall& in) {
  tracker::Ball out;
  out.d_centre = vector(in.d_centre);
  out.half_angle = in.half_angle;
  out.centre_px = Eigen::Vector2d(in.centre_px);
  out.centre_covariance = Eigen::Matrix2d(in.covariance);
  out.radius_px = in.radius_px;
  out.half_angle_stddev = in.half_angle_stddev;
  out.contrast = in.contrast;
  out.blur_px = in.blur_px;
  return out;
}

Detections WireReading::message(const limn_v1_Detections& in) {
  Detections out;
  out.setup = in.setup;
  out.found.camera = text(in.camera);
  out.found.captured_at = stamp(in.captured_at);
  out.found.run = in.counted_by;
  out.found.detections = list(in.markers, &WireReading::detection);
  out.found.balls = list(in.balls, &WireReading::ball);
  out.found.controls = list(in.controls, [](const limn_v1_Gestures& item) {
    return tracker::GestureReading{item.forward, item.backward, item.is_seen,
                                   optional(item.hidden_since, &WireReading::stamp)};
  });
  return out;
}

template <class Wire>
Result<Received> received(const void* sample, Stamp arrived_at) {
  const Wire& wire = *static_cast<const Wire*>(sample);
  WireReading reading;
  const Sender from = reading.sender(wire);
  Message message = reading.message(wire);
  LIMN_TRY_STATUS(reading.status());
  LIMN_TRY_STATUS(check_message(message));
  return Received{std::move(message), from, arrived_at};
}

}  // namespace

Result<Received> from_wire(Topic topic, const void* sample, Stamp arrived_at) {
  switch (topic) {
    case Topic::offer:
      return received<limn_v1_Offer>(sample, arrived_at);
    case Topic::setup:
      return received<limn_v1_Setup>(sample, arrived_at);
    case Topic::moment:
      return received<limn_v1_Moment>(sample, arrived_at);
    case Topic::screen_image:
      return received<limn_v1_ScreenImage>(sample, arrived_at);
    case Topic::clock_request:
      return received<limn_v1_ClockRequest>(sample, arrived_at);
    case Topic::clock_answer:
      return received<limn_v1_ClockAnswer>(sample, arrived_at);
    case Topic::order:
      return received<limn_v1_Order>(sample, arrived_at);
    case Topic::answer:
      return received<limn_v1_Answer>(sample, arrived_at);
    case Topic::health:
      return received<limn_v1_Health>(sample, arrived_at);
    case Topic::detections:
      return received<limn_v1_Detections>(sample, arrived_at);
  }
  return error("topic: expected a known one, found {}.", static_cast<int>(topic));
}

}  // namespace limn::nodes
