#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/result.h"
#include "session/frame_composer.h"
#include "session/recording.h"

namespace limn::session {

/// A frame composer that survives the loss of its GL context. An image that was drawn while the context was
/// lost is never shown: the last good images stay until all can be drawn again in a new context, which is
/// tried once a second.
class RecoveringComposer {
 public:
  /// How the loss of a GL context is noticed, and how the context is replaced.
  struct Drawing {
    std::function<bool()> is_lost;
    std::function<Status()> renew;  ///< called after all objects in the old context were destroyed
  };

  explicit RecoveringComposer(FrameComposer composer);

  /// Without this call a lost context is not noticed.
  void survive_losses(Drawing drawing) { drawing_ = std::move(drawing); }

  /// `setup`: what a composer in a new context is created for. `listener` gets the description before it is
  /// drawn. Returns a message for people, if there is one.
  std::optional<std::string> compose(const FrameInput& input,
                                     const SessionSetup& setup,
                                     const std::function<void(const FrameDescription&)>& listener);
  /// The last composed frame.
  const ComposedFrame& composed() const { return composed_; }

  /// Null while there is no GL context.
  FrameComposer* composer() { return composer_ ? &*composer_ : nullptr; }
  /// Continues with a composer for another scene or rig.
  void replace(FrameComposer composer) { composer_ = std::move(composer); }

 private:
  std::optional<std::string> compose_anew(const FrameInput& input, const SessionSetup& setup);

  Drawing drawing_;
  std::optional<FrameComposer> composer_;
  ComposedFrame composed_;
  Stamp renewed_at_;
};

}  // namespace limn::session
