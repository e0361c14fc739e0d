#include "session/recovering_composer.h"

namespace limn::session {
namespace {

constexpr double k_renew_every_s = 1;

}  // namespace

RecoveringComposer::RecoveringComposer(FrameComposer composer)
    : composer_(std::move(composer)), composed_(composer_->composed()) {}

std::optional<std::string> RecoveringComposer::compose(
    const FrameInput& input,
    const SessionSetup& setup,
    const std::function<void(const FrameDescription&)>& listener) {
  if (composer_) {
    const FrameDescription& frame = composer_->describe(input);
    if (listener) listener(frame);
    composer_->draw();
  }
  if (!composer_ || (drawing_.is_lost && drawing_.is_lost())) return compose_anew(input, setup);
  composed_ = composer_->composed();
  return std::nullopt;
}

std::optional<std::string> RecoveringComposer::compose_anew(const FrameInput& input,
                                                            const SessionSetup& setup) {
  if (!composer_ && seconds_between(renewed_at_, input.times.now) < k_renew_every_s) return std::nullopt;
  const bool was_drawing = composer_.has_value();
  composer_.reset();
  renewed_at_ = input.times.now;
  Status renewed = drawing_.renew();
  if (renewed) {
    auto composer = FrameComposer::create(setup.scene, setup.rig, setup.paint);
    if (composer) {
      composer_ = std::move(*composer);
      composed_ = composer_->compose(input);
    } else {
      renewed = composer.error();
    }
  }
  if (renewed) return "the graphics driver was reset; all images were drawn again";
  if (!was_drawing) return std::nullopt;
  return fmt::format("the graphics driver was reset; the last images stay until drawing works again: {}",
                     renewed.message());
}

}  // namespace limn::session
