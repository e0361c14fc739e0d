#include "tests/nodes/random_messages.h"

#include <bit>
#include <cmath>
#include <random>

#include "tests/support/random.h"

namespace limn::test {
namespace {

using namespace nodes;

// Calls f with each field of a message's structs.
template <class F>
void fields(F& f, Sender& x) {
  f(x.node), f(x.run);
}
template <class F>
void fields(F& f, cv::Size& x) {
  f(x.width), f(x.height);
}
template <class F>
void fields(F& f, Pose& x) {
  f.unit(x.rotation), f(x.translation);
}
template <class F>
void fields(F& f, MarkerName& x) {
  f(x.family), f(x.id);
}
template <class F>
void fields(F& f, Lens& x) {
  f.lens(x);
}
template <class F>
void fields(F& f, Imager& x) {
  f(x.name), f(x.width), f(x.height), f(x.lens), f(x.imager_from_world), f.one_of(x.sees, 2);
}
template <class F>
void fields(F& f, Track& x) {
  f(x.body), f(x.world_from_body), f(x.covariance), f(x.marker_count), f(x.rms_px), f(x.captured_at), f(x.at),
      f.one_of(x.tracking, 3);
  x.covariance = Matrix6d(x.covariance.selfadjointView<Eigen::Lower>());  // half of it is sent
}
template <class F>
void fields(F& f, scene::MaterialOverride& x) {
  f(x.base_colour), f(x.metallic), f(x.roughness);
}
template <class F>
void fields(F& f, scene::GreyWindow& x) {
  f(x.level), f(x.width);
  x.level = std::remainder(x.level, 1e6);
  x.width = std::max(1.0, std::abs(std::remainder(x.width, 1e6)));  // above 0
}
template <class F>
void fields(F& f, scene::PosedPart& x) {
  f(x.slot), f(x.variant), f(x.world_from_part), f(x.material), f(x.window);
}
template <class F>
void fields(F& f, scene::Viewpoint& x) {
  f(x.viewer), f(x.p_world), f(x.weight);
}
template <class F>
void fields(F& f, scene::RoomLight::Lamp& x) {
  f(x.d_world), f(x.strength_rgb);
}
template <class F>
void fields(F& f, scene::RoomLight& x) {
  f(x.d_up_world), f(x.below_rgb), f(x.above_rgb), f(x.lamps), f(x.image_strength);
}
template <class F>
void fields(F& f, scene::CutPlane& x) {
  f.direction(x.normal), f(x.offset_m);
}
template <class F>
void fields(F& f, scene::SurfacePoint& x) {
  f(x.p), f(x.d_normal);
}
template <class F>
void fields(F& f, scene::DrawnLine& x) {
  f(x.name), f(x.style.colour), f(x.style.width_m), f(x.curve.is_closed), f(x.curve.points);
}
template <class F>
void fields(F& f, scene::PosedScene& x) {
  f(x.world_from_prototype), f(x.parts), f(x.viewpoints), f(x.light), f(x.finish), f(x.cut), f(x.lines),
      f(x.drawn), f(x.deviation.layer), f(x.deviation.tolerance_m);
}
template <class F>
void fields(F& f, session::FadingPart& x) {
  f(x.part), f(x.share);
}
template <class F>
void fields(F& f, session::FadingScene& x) {
  f(x.posed), f(x.share);
}
template <class F>
void fields(F& f, projector::SplitOverlay& x) {
  f(x.left), f(x.x_m);
}
template <class F>
void fields(F& /*f*/, projector::GridOverlay& /*x*/) {}
template <class F>
void fields(F& f, projector::RingOverlay& x) {
  f.index(x.projector), f(x.world_from_marker), f(x.size_m), f(x.strength);
  for (double& value : x.colour.val) f(value);
}
template <class F>
void fields(F& f, projector::WordOverlay& x) {
  f.index(x.projector), f(x.world_from_marker), f(x.size_m), f(x.text), f(x.strength);
}
template <class F>
void fields(F& f, projector::OverlayPlace& x) {
  f(x.p_corner), f(x.d_right), f(x.d_down);
}
template <class F>
void fields(F& f, projector::SignOverlay& x) {
  f.index(x.projector), f.image(x.image, 3), f(x.place);
}
template <class F>
void fields(F& f, session::FrameDescription& x) {
  f(x.number), f(x.painted_at), f(x.shown_at), f(x.tracks), f(x.posed), f(x.viewer), f(x.fading), f(x.gone),
      f(x.on_surface), f(x.signs), f(x.loose), f(x.is_black), f(x.is_moving), f(x.arriving);
}
template <class F>
void fields(F& f, OfferedDevice& x) {
  f(x.name), f(x.size);
}
template <class F>
void fields(F& f, SharedFile& x) {
  f.path(x.path), f.digest(x.sha256), f(x.bytes);
}
template <class F>
void fields(F& f, Offer& x) {
  f(x.is_host), f(x.protocol), f(x.version), f(x.renderer), f(x.monitors), f(x.cameras), f(x.servers),
      f(x.fingerprint), f(x.token);
}
template <class F>
void fields(F& f, Setup& x) {
  f(x.revision), f(x.devices), f(x.files);
}
template <class F>
void fields(F& f, Moment& x) {
  f(x.setup), f(x.frame);
}
template <class F>
void fields(F& f, ScreenImage& x) {
  f.machine(x.to), f(x.screen), f(x.number), f.bytes(x.left), f.bytes(x.right);
}
template <class F>
void fields(F& f, ClockRequest& x) {
  f.machine(x.to), f(x.number), f(x.sent_at);
}
template <class F>
void fields(F& f, ClockAnswer& x) {
  f.machine(x.to), f(x.number), f(x.asked_at), f(x.received_at), f(x.sent_at);
}
template <class F>
void fields(F& f, Order& x) {
  f.machine(x.to), f(x.number), f.one_of(x.what, 5), f(x.device), f.bytes(x.image), f(x.at);
}
template <class F>
void fields(F& f, Answer& x) {
  f.machine(x.to), f(x.number), f(x.error), f(x.size), f.bytes(x.image), f(x.at);
}
template <class F>
void fields(F& f, Refresh& x) {
  f(x.at), f(x.period_s);
}
template <class F>
void fields(F& f, Health& x) {
  f(x.shown), f(x.missed), f(x.latency_s), f(x.draw_ms), f(x.late_ms), f(x.clock_offset_s),
      f(x.clock_stddev_s), f(x.problems), f(x.has_no_host), f(x.refreshes), f(x.screen_problems);
}
template <class F>
void fields(F& f, tracker::Detection& x) {
  f(x.marker), f.share(x.score);
  for (std::size_t i = 0; i < 4; ++i)
    f.pixel(x.corners_px[i]), f.covariance(x.corner_covariance[i]), f(x.corner_visible[i]);
}
template <class F>
void fields(F& f, tracker::Ball& x) {
  f.direction(x.d_centre), f.share(x.half_angle), f.pixel(x.centre_px), f.covariance(x.centre_covariance),
      f.share(x.radius_px), f.share(x.half_angle_stddev), f(x.contrast), f(x.blur_px);
}
template <class F>
void fields(F& f, tracker::GestureReading& x) {
  f(x.forward), f(x.backward), f(x.is_seen), f(x.hidden_since);
}
template <class F>
void fields(F& f, Detections& x) {
  f(x.setup), f(x.found.camera), f(x.found.captured_at), f(x.found.run), f(x.found.detections),
      f(x.found.balls), f(x.found.controls);
}
template <class F>
void fields(F& /*f*/, Departure& /*x*/) {}

// Fills all fields with random values.
class Filling {
 public:
  Filling(std::uint64_t seed, std::string to) : rng_(seed), to_(std::move(to)) {}

  void operator()(bool& x) { x = below(2) == 1; }
  void operator()(int& x) { x = static_cast<int>(below(2000)); }
  void operator()(std::uint64_t& x) { x = rng_(); }
  void operator()(double& x) {
    x = std::ldexp(uniform(rng_, -1, 1), static_cast<int>(below(2000)) - 1060);  // some are denormal
    if (below(10) == 0) x = -0.0;
  }
  void operator()(Stamp& x) { x = Stamp(std::chrono::nanoseconds(static_cast<std::int64_t>(rng_()))); }
  void operator()(std::string& x) {
    x.clear();
    for (std::uint64_t n = below(12); n > 0; --n)
      x += static_cast<char>(1 + below(255));  // any byte but zero
  }
  template <int Rows, int Columns>
  void operator()(Eigen::Matrix<double, Rows, Columns>& x) {
    for (double& value : x.reshaped()) (*this)(value);
  }
  template <class T>
  void operator()(std::vector<T>& x) {
    x.resize(below(4));
    for (T& item : x) (*this)(item);
  }
  void operator()(std::vector<scene::RoomLight::Lamp>& x) {
    x.resize(below(5));
    for (auto& item : x) (*this)(item);
  }
  template <class T>
  void operator()(std::optional<T>& x) {
    x.reset();
    if (below(3) > 0) (*this)(x.emplace());
  }
  void operator()(projector::Overlay& x) {
    const std::array<projector::Overlay, 5> kinds = {projector::SplitOverlay{}, projector::GridOverlay{},
                                                     projector::RingOverlay{}, projector::WordOverlay{},
                                                     projector::SignOverlay{}};
    x = kinds[below(5)];
    std::visit([this](auto& one) { fields(*this, one); }, x);
  }
  void operator()(cv::Mat& x) { image(x, 1); }
  template <class T>
  void operator()(T& x) {
    fields(*this, x);
  }

  void unit(Eigen::Quaterniond& x) {
    x.coeffs() = Eigen::Vector4d(uniform(rng_, -1, 1), uniform(rng_, -1, 1), uniform(rng_, -1, 1),
                                 uniform(rng_, -1, 1));
    x.coeffs() /= x.norm() * (1 + 1e-15 * static_cast<double>(below(9)));  // not normalized to the last bit
  }
  void lens(Lens& x) {
    x = Lens::create("LENSMODEL_OPENCV4", {uniform(rng_, 1, 1e4), uniform(rng_, 1, 1e4), 640.25,
                                           uniform(rng_, 0, 1e3), uniform(rng_, -1, 1), 0.125, -0.0, 1e-300})
            .value();
  }
  template <class Enum>
  void one_of(Enum& x, std::uint64_t count) {
    x = static_cast<Enum>(below(count));
  }
  void index(std::size_t& x) { x = below(64); }
  void share(double& x) { x = uniform(rng_, 1e-9, 1); }
  void direction(Eigen::Vector3d& x) {
    x = Eigen::Vector3d(uniform(rng_, -1, 1), uniform(rng_, -1, 1), uniform(rng_, 0.1, 1)).normalized();
  }
  void pixel(Eigen::Vector2d& x) { x = {uniform(rng_, -10, 4000), uniform(rng_, -10, 3000)}; }
  void covariance(Eigen::Matrix2d& x) {
    const Eigen::Matrix2d root{{uniform(rng_, 0.1, 1), uniform(rng_, -1, 1)}, {0, uniform(rng_, 0.1, 1)}};
    x = root * root.transpose();
    x(0, 1) *= 1 + 1e-15 * static_cast<double>(below(9));  // not symmetric to the last bit
  }
  void image(cv::Mat& x, int channels) {
    x = cv::Mat();
    if (below(4) == 0) return;
    x = cv::Mat(1 + static_cast<int>(below(30)), 1 + static_cast<int>(below(30)),
                CV_MAKETYPE(CV_8U, channels));
    const std::uint64_t levels = 1 + below(3);  // few levels give runs of equal pixels
    for (auto* at = x.data; at != x.data + x.total() * x.elemSize(); ++at)
      *at = static_cast<std::uint8_t>(255 - below(levels));
  }
  void bytes(std::string& x) {
    x.resize(below(300));
    for (char& byte : x) byte = static_cast<char>(below(256));
  }
  void machine(std::string& x) { x = to_; }
  void path(std::string& x) { x = "scene/part-" + std::to_string(below(1000)) + ".glb"; }
  void digest(std::string& x) {
    x.clear();
    while (x.size() < 64) x += "0123456789abcdef"[below(16)];
  }

 private:
  std::uint64_t below(std::uint64_t end) { return rng_() % end; }
  std::mt19937_64 rng_;
  std::string to_;
};

// Writes all fields as text.
class Printing {
 public:
  std::string text;

  void operator()(bool& x) { text += x ? "true " : "false "; }
  void operator()(int& x) { text += std::to_string(x) + " "; }
  void operator()(std::uint64_t& x) { text += std::to_string(x) + " "; }
  void operator()(double& x) { text += fmt::format("{:x} ", std::bit_cast<std::uint64_t>(x)); }
  void operator()(Stamp& x) { text += std::to_string(x.time_since_epoch().count()) + " "; }
  void operator()(std::string& x) { text += std::to_string(x.size()) + ":" + x + " "; }
  template <int Rows, int Columns>
  void operator()(Eigen::Matrix<double, Rows, Columns>& x) {
    for (double& value : x.reshaped()) (*this)(value);
  }
  template <class T>
  void operator()(std::vector<T>& x) {
    text += "[" + std::to_string(x.size()) + " ";
    for (T& item : x) (*this)(item);
    text += "] ";
  }
  template <class T>
  void operator()(std::optional<T>& x) {
    text += x ? "some " : "none ";
    if (x) (*this)(*x);
  }
  void operator()(projector::Overlay& x) {
    text += "kind " + std::to_string(x.index()) + " ";
    std::visit([this](auto& one) { fields(*this, one); }, x);
  }
  void operator()(cv::Mat& x) { image(x, 0); }
  template <class T>
  void operator()(T& x) {
    fields(*this, x);
  }

  void unit(Eigen::Quaterniond& x) {
    for (double& value : x.coeffs()) (*this)(value);
  }
  void lens(Lens& x) {
    text += x.model.name() + " ";
    (*this)(x.values);
  }
  template <class Enum>
  void one_of(Enum& x, std::uint64_t /*count*/) {
    text += std::to_string(static_cast<int>(x)) + " ";
  }
  void index(std::size_t& x) { text += std::to_string(x) + " "; }
  void share(double& x) { (*this)(x); }
  template <class Vector>
  void direction(Vector& x) {
    (*this)(x);
  }
  template <class Vector>
  void pixel(Vector& x) {
    (*this)(x);
  }
  template <class Matrix>
  void covariance(Matrix& x) {
    (*this)(x);
  }
  void image(cv::Mat& x, int /*channels*/) {
    text += fmt::format("{}x{} {} ", x.cols, x.rows, x.empty() ? 0 : x.type());
    for (int row = 0; row < x.rows; ++row)
      text.append(x.ptr<char>(row), static_cast<std::size_t>(x.cols) * x.elemSize());
  }
  void bytes(std::string& x) { (*this)(x); }
  void machine(std::string& x) { (*this)(x); }
  void path(std::string& x) { (*this)(x); }
  void digest(std::string& x) { (*this)(x); }
};

}  // namespace

Message random_message(std::size_t kind, std::uint64_t seed, const std::string& to) {
  const std::array<Message, 10> kinds = {Offer{},       Setup{}, Moment{}, ScreenImage{}, ClockRequest{},
                                         ClockAnswer{}, Order{}, Answer{}, Health{},      Detections{}};
  Message message = kinds.at(kind);
  Filling filling(seed, to);
  std::visit([&](auto& one) { fields(filling, one); }, message);
  return message;
}

std::string to_text(const Message& message) {
  Message copy = message;
  Printing printing;
  printing.text = "message " + std::to_string(message.index()) + " ";
  std::visit([&](auto& one) { fields(printing, one); }, copy);
  return printing.text;
}

Moment moment_of_size(std::size_t bytes, std::uint64_t number) {
  constexpr std::size_t k_track_bytes = 408;
  Moment moment;
  moment.frame.number = number;
  moment.frame.tracks.resize(bytes / k_track_bytes);
  for (Track& track : moment.frame.tracks) track.body = "a body";
  return moment;
}

}  // namespace limn::test
