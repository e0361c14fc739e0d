#include "remote/projected_code.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "remote/pairing_overlay.h"

namespace limn::remote {
namespace {

constexpr double k_code_share = 0.5;  // the code's share of the image's shorter side, without a prototype
constexpr std::chrono::milliseconds k_search_interval{300}, k_search_timeout{2000};
constexpr int k_pin_px = 360;            // width of the PIN's sign before it is placed
constexpr double k_least_pin_px = 50;    // smallest width of the PIN's sign in the projector's image
constexpr int k_dark = 8;                // display value; brighter pixels belong to a part
constexpr int k_code_module_px = 12;     // module of the code before it is placed
constexpr double k_least_module_px = 2;  // smallest module in the projector's image that phones read
constexpr double k_code_light = 0.75;    // display value; full white would outshine everything else

// A place on the prototype without markers and, if there is room, without parts.
std::optional<projector::OverlayPlace> free_place(session::Session* session,
                                                  std::size_t projector,
                                                  cv::Size shape,
                                                  double least_px) {
  cv::Mat points = session->free_surface(projector);
  if (points.empty() || shape.empty()) return std::nullopt;
  const Rig& rig = session->setup().rig;
  const Imager& imager = rig.projectors[projector];
  const Pose& world_from_prototype = *session->composed().posed.world_from_prototype;
  const Eigen::Vector3d d_up_world =
      (rig.cameras.empty() ? imager : rig.cameras[0]).imager_from_world.rotation.inverse() *
      Eigen::Vector3d(0, -1, 0);
  const auto place = [&](const cv::Mat& free) {
    return overlay_place(imager, world_from_prototype, free,
                         world_from_prototype.rotation.inverse() * d_up_world, shape, least_px);
  };
  cv::Mat parts, free = points.clone();
  cv::cvtColor(session->composed().projectors[projector], parts, cv::COLOR_BGR2GRAY);
  free.setTo(cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()), parts > k_dark);
  const auto beside = place(free);
  return beside ? beside : place(points);
}

}  // namespace

void ProjectedCode::show(const std::string& projector,
                         Text text,
                         std::function<void(Clock::time_point until)> on_shown) {
  end();
  projector_ = projector;
  text_ = std::move(text);
  on_shown_ = std::move(on_shown);
}

void ProjectedCode::end() {
  projector_.clear();
  requested_at_ = searched_at_ = shown_until_ = std::nullopt;
  sign_ = cv::Mat();
  place_.reset();
}

// Starts the code's time when there is a place for it. After k_search_timeout it starts without one, since
// the prototype may not be tracked. Returns whether the code is shown.
bool ProjectedCode::start_if_due(session::Session* session, std::size_t projector) {
  if (shown_until_) return true;
  const auto now = Clock::now();
  if (!requested_at_) {
    requested_at_ = now;
    sign_ = k_code_light * pairing_code_image(text_.url, text_.pin, text_.role, k_code_module_px);
  }
  if (searched_at_ && now - *searched_at_ < k_search_interval) return false;
  searched_at_ = now;
  place_ = free_place(session, projector, sign_.size(), k_least_module_px * sign_.cols / k_code_module_px);
  if (!place_ && now - *requested_at_ < k_search_timeout) return false;
  if (!place_) {
    const cv::Mat smaller = k_code_light * pin_image(text_.pin, text_.role, k_pin_px);
    place_ = free_place(session, projector, smaller.size(), k_least_pin_px);
    if (place_) sign_ = smaller;
  }
  shown_until_ = now + duration_;
  on_shown_(*shown_until_);
  return true;
}

std::vector<projector::Overlay> ProjectedCode::overlays(session::Session* session) {
  const std::vector<Imager>& projectors = session->setup().rig.projectors;
  const auto imager = std::find_if(projectors.begin(), projectors.end(),
                                   [&](const Imager& p) { return p.name == projector_; });
  if (imager == projectors.end() || session->show_state().blackout) return {};
  const auto projector = static_cast<std::size_t>(imager - projectors.begin());
  if (!start_if_due(session, projector)) return {};
  if (Clock::now() >= *shown_until_) end();
  if (sign_.empty()) return {};
  projector::SignOverlay overlay{projector, sign_, place_};
  if (!place_) {
    const int module_px = static_cast<int>(k_code_share * std::min(imager->width, imager->height) *
                                           k_code_module_px / sign_.cols);
    if (module_px < 1) return {};
    const double scale = 1.0 * module_px / k_code_module_px;
    cv::resize(sign_, overlay.image, {}, scale, scale, cv::INTER_AREA);
  }
  return {overlay};
}

}  // namespace limn::remote
