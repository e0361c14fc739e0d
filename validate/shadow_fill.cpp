#include "validate/shadow_fill.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "projector/renderer.h"
#include "session/projection_history.h"
#include "session/shadow_watch.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "validate/metrics.h"

namespace limn::validate {
namespace {

constexpr double k_period_s = 1 / 30.0;  // between the light of two frames
constexpr int k_dark_frames = 2;         // at the start, because a session begins without parts
constexpr int k_still_frames = 30;
constexpr int k_stay_frames = 6, k_move_frames = 5, k_gone_frames = 6;
constexpr int k_allowed_frames = 3;    // from the start of a shadow until it must be filled
constexpr float k_least_loss = 0.05F;  // share of a pixel's light; a smaller loss is not a shadow
constexpr int k_least_pixels = 100;    // smallest number of pixels of a shadow
constexpr int k_blur_px = 5;           // pixels of the viewer's image over which light is averaged
constexpr int k_fade_px = 9;           // pixels; nearer to its end, light fades over a projector's last pixel
constexpr float k_least_light =
    0.1F;  // share of the brightest light; flashes on darker pixels are not visible
constexpr float k_edge_share =
    0.1F;  // share of the light between neighbours; above it, differences between projectors' pixels show
constexpr double k_skin_bgr[] = {0.28, 0.40, 0.62};

// Adds the responses as limn solve would measure them.
void add_responses(const sim::World& world, Rig* rig) {
  for (std::size_t i = 0; i < rig->projectors.size(); ++i) {
    const sim::ProjectorEffects& effects = world.projector_effects[i];
    ProjectorResponse response{rig->projectors[i].name, {}, {}, {}};
    std::vector<double>* curves[] = {&response.blue, &response.green, &response.red};
    for (int c = 0; c < 3; ++c)
      for (int v = 0; v < 256; ++v) curves[c]->push_back(sim::light_share(effects, c, v / 255.0));
    response.black_level = Measurement{effects.black_level, 0};
    response.vignetting = Vignetting{Eigen::Vector2d::Zero(), -effects.vignetting, 0, 0};
    rig->responses.push_back(response);
  }
  for (std::size_t i = 0; i < rig->cameras.size(); ++i) {
    const sim::CameraEffects& effects = world.camera_effects[i];
    CameraResponse response;
    response.camera = rig->cameras[i].name;
    for (int v = 0; v < 256; ++v) {
      const double level = std::max(0.0, (v - effects.black_level) / (255 - effects.black_level));
      response.light.push_back(effects.srgb ? linear_from_srgb(level) : level);
    }
    rig->camera_responses.push_back(response);
  }
}

sim::Object hand_object(const Pose& world_from_hand, double width_m, double height_m) {
  sim::Object object = sim::sheet("hand", width_m, height_m, {}, world_from_hand);
  object.albedo = {k_skin_bgr[0], k_skin_bgr[1], k_skin_bgr[2]};
  return object;
}

// The world with the hand at some position, or without it, as traced for the cameras and the viewpoint.
struct Traced {
  std::vector<sim::Samples> cameras;
  sim::Samples viewer;
};

class ShadowFillSession {
 public:
  ShadowFillSession(const sim::World& world,
                    const scene::PosedScene& posed,
                    const Imager& viewer,
                    const Hand& hand,
                    std::uint64_t seed)
      : world_(world), posed_(posed), viewer_(viewer), hand_(hand), seed_(seed) {}

  Result<ShadowFillReading> run(const scene::Scene& scene) {
    Rig rig = world_.rig;
    rig.responses.clear();
    rig.camera_responses.clear();
    add_responses(world_, &rig);
    LIMN_TRY(renderer_, projector::Renderer::create(scene, rig));
    LIMN_TRY_STATUS(renderer_->set_light({.compensation = projector::Compensation::geometry}));
    shadows_.emplace(rig);
    const Traced free = traced(std::nullopt);
    projected_.resize(rig.projectors.size());
    for (int k = 0; k < k_dark_frames; ++k) monitor(free);
    draw();
    first_ = projected_;
    before_ = light(free, projected_);
    ShadowFillReading reading;
    for (int k = 0; k < k_still_frames; ++k) {
      monitor(free);
      draw();
      reading.still_levels = std::max(reading.still_levels, worst_difference(projected_, first_));
    }
    const Traced there = traced(0.0);
    LIMN_TRY_STATUS(find_lost(there));
    since_ = cv::Mat(before_.size(), CV_32S, cv::Scalar(0));
    for (int k = 0; k < k_stay_frames; ++k) step(there, "stays", &reading);
    reading.before = before_;
    reading.lost = light(there, first_);
    reading.refilled = light(there, projected_);
    for (int k = 1; k <= k_move_frames; ++k) step(traced(k * hand_.step_m), "moves", &reading);
    for (int k = 0; k < k_gone_frames; ++k) {
      step(free, "gone", &reading);
      if (k > k_allowed_frames)
        reading.back_levels = std::max(reading.back_levels, worst_difference(projected_, first_));
    }
    return reading;
  }

 private:
  // The pose of the hand after it moved this far, across the light and upwards.
  Pose world_from_hand(double moved_m) const {
    const Imager& projector = world_.rig.projectors[hand_.projector];
    const Eigen::Vector3d p_light = projector.imager_from_world.inverse().translation;
    const Eigen::Vector3d p_target = world_.world_from_prototype * hand_.p_target;
    Pose pose = looking_at(p_light, p_target, Eigen::Vector3d::UnitZ()).inverse();
    pose.translation = p_light + hand_.at * (p_target - p_light) +
                       pose.rotation * Eigen::Vector3d(moved_m, -0.3 * moved_m, 0);
    return pose;
  }

  Traced traced(std::optional<double> moved_m) const {
    sim::World world = world_;
    if (moved_m)
      world.objects.push_back(hand_object(world_from_hand(*moved_m), hand_.width_m, hand_.height_m));
    Traced out;
    for (std::size_t i = 0; i < world.rig.cameras.size(); ++i)
      out.cameras.push_back(sim::trace(world, static_cast<int>(i)));
    world.rig.cameras = {viewer_};
    world.camera_effects = {sim::CameraEffects{.colour = true}};
    out.viewer = sim::trace(world, 0);
    std::fill(out.viewer.room_light.begin(), out.viewer.room_light.end(), 0.0F);
    return out;
  }

  // Does what the frame loop does after showing an image: every camera takes a frame of it, and shadows are
  // detected as in a session.
  void monitor(const Traced& traced) {
    const Stamp at = shifted(Stamp{}, static_cast<double>(frames_ + 1) * k_period_s);
    history_.add(projected_, at);
    session::Percepts percepts;
    for (std::size_t i = 0; i < traced.cameras.size(); ++i)
      percepts.frames.push_back({world_.rig.cameras[i].name,
                                 sim::photograph(world_, traced.cameras[i], projected_, seed_ + frames_),
                                 at});
    shadows_->update(percepts, posed_, history_, &*renderer_);
    const std::vector<cv::Mat>& maps = shadows_->maps();
    for (std::size_t i = 0; i < maps.size(); ++i) renderer_->set_occlusion(i, maps[i]);
    ++frames_;
  }

  void draw() {
    projected_.clear();
    for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i)
      projected_.push_back(renderer_->projector_image(i, posed_, viewer_));
  }

  // The projectors' light on the prototype as seen from the viewpoint; 0 elsewhere.
  cv::Mat light(const Traced& traced, const std::vector<cv::Mat>& shown) const {
    sim::World world = world_;
    world.rig.cameras = {viewer_};
    world.camera_effects = {sim::CameraEffects{.colour = true}};
    cv::Mat out = sim::ideal_light(world, traced.viewer, shown);
    out.setTo(0, ~whole(traced.viewer));
    return out;
  }

  // Mask of the pixels that see the prototype and nothing else.
  cv::Mat whole(const sim::Samples& samples) const {
    cv::Mat out(samples.height, samples.width, CV_8U, cv::Scalar(255));
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const std::int16_t object = samples.object[k];
      const bool is_prototype = object >= 0 && static_cast<std::size_t>(object) < world_.objects.size() &&
                                world_.objects[static_cast<std::size_t>(object)].name == "prototype";
      if (!is_prototype) out.data[samples.pixel[k]] = 0;
    }
    return out;
  }

  // The light of the pixels, and where light is lost that other projectors can give.
  struct Loss {
    cv::Mat wanted, without;  // CV_32F: without a hand; with it, without shadow fill
    cv::Mat where;
  };
  Loss loss(const Traced& traced) const {
    Loss out{grey(before_), grey(light(traced, first_)), {}};
    std::vector<cv::Mat> others;
    for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i) {
      const Imager& projector = world_.rig.projectors[i];
      others.emplace_back();
      if (i != hand_.projector)
        others.back() = cv::Mat(projector.height, projector.width, CV_8UC3, cv::Scalar::all(255));
    }
    out.where = (out.wanted - out.without > k_least_loss * out.wanted) & is_light(out.wanted) &
                whole(traced.viewer) & (grey(light(traced, others)) > out.wanted);
    return out;
  }

  static cv::Mat grey(const cv::Mat& light) {
    cv::Mat out;
    cv::transform(light, out, cv::Matx13f::all(1.0F / 3));
    return out;
  }

  // Averages over some pixels, because another projector's pixels are at other positions and more or less
  // sharp.
  static cv::Mat blurred(const cv::Mat& grey) {
    cv::Mat out;
    cv::blur(grey, out, {k_blur_px, k_blur_px});
    return out;
  }

  Status find_lost(const Traced& traced) const {
    const int lost = cv::countNonZero(loss(traced).where);
    if (lost >= k_least_pixels) return {};
    return error(
        "refill: expected a hand whose shadow, as seen by the viewer, other projectors can light, found {} "
        "such pixels. Move the hand.",
        lost);
  }

  // One frame with the hand as traced: measures what is shown, then lets the cameras see it.
  void step(const Traced& traced, const std::string& phase, ShadowFillReading* reading) {
    const cv::Mat actual = light(traced, projected_);
    const Loss lost = loss(traced);
    cv::Mat since(since_.size(), CV_32S, cv::Scalar(0));
    cv::Mat(since_ + 1).copyTo(since, lost.where);
    since_ = since;
    const cv::Mat old = since_ > k_allowed_frames;
    ShadowFillFrame frame{phase, back_share(lost, actual, lost.where), flash(traced, actual),
                          worst_difference(projected_, first_)};
    if (cv::countNonZero(old) >= k_least_pixels)
      reading->share = std::min(reading->share, back_share(lost, actual, old));
    reading->flash = std::max(reading->flash, frame.flash);
    reading->frames.push_back(frame);
    monitor(traced);
    draw();
  }

  static double back_share(const Loss& lost, const cv::Mat& actual, const cv::Mat& where) {
    const cv::Mat wanted = blurred(lost.wanted), without = blurred(lost.without);
    const cv::Mat back = cv::max(0.0, cv::min(blurred(grey(actual)), wanted) - without);
    const double all = cv::mean(cv::Mat(wanted - without), where)[0];
    return all > 0 ? cv::mean(back, where)[0] / all : 1;
  }

  // The largest light above that without the hand, away from edges and from where all light ends.
  double flash(const Traced& traced, const cv::Mat& actual) const {
    cv::Mat wanted = blurred(grey(before_)), found = blurred(grey(actual)), highest, lowest, where;
    const cv::Mat around = cv::getStructuringElement(cv::MORPH_RECT, {k_fade_px, k_fade_px});
    cv::dilate(wanted, highest, around);
    cv::erode(wanted, lowest, around);
    cv::erode(whole(traced.viewer) & is_light(wanted), where, around);
    where &= highest - lowest < k_edge_share * wanted;
    double worst = 0;
    cv::minMaxLoc(found / wanted - 1, nullptr, &worst, nullptr, nullptr, where);
    return std::max(0.0, worst);
  }

  static cv::Mat is_light(const cv::Mat& wanted) {
    double brightest = 0;
    cv::minMaxLoc(wanted, nullptr, &brightest);
    return wanted > k_least_light * brightest;
  }

  const sim::World& world_;
  const scene::PosedScene& posed_;
  const Imager& viewer_;
  const Hand& hand_;
  std::uint64_t seed_;
  std::uint64_t frames_ = 0;
  std::optional<projector::Renderer> renderer_;
  session::ProjectionHistory history_;
  std::optional<session::ShadowWatch> shadows_;
  std::vector<cv::Mat> projected_, first_;
  cv::Mat before_;
  cv::Mat since_;  // CV_32S: number of frames that each pixel has been in the shadow
};

}  // namespace

Result<ShadowFillReading> measure_shadow_fill(const sim::World& world,
                                              const scene::Scene& scene,
                                              const scene::PosedScene& posed,
                                              const Imager& viewer,
                                              const Hand& hand,
                                              std::uint64_t seed) {
  return ShadowFillSession(world, posed, viewer, hand, seed).run(scene);
}

}  // namespace limn::validate
