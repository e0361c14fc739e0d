#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/result.h"
#include "session/frame_composer.h"
#include "session/recording.h"

namespace limn::apps {

/// A frame composer that outlives its GL context: what is drawn while the context is lost is never shown, the
/// last good images stay, and all is drawn anew in the next context, tried once a second.
class RecoveringComposer {
 public:
  /// How a GL context that the driver took away is noticed, and replaced by another.
  struct Drawing {
    std::function<bool()> is_lost;
    std::function<Status()> renew;  ///< called when nothing lives in the old one any more
  };

  explicit RecoveringComposer(FrameComposer composer);

  /// Without it a lost context is not noticed.
  void survive_losses(Drawing drawing) { drawing_ = std::move(drawing); }

  /// `setup`: what a painter in another context is made for. Returns what people are to be told.
  std::optional<std::string> compose(const FrameInput& input, const SessionSetup& setup);
  /// What was painted last.
  const ComposedFrame& painted() const { return painted_; }

  /// Null while there is nothing to draw with.
  FrameComposer* composer() { return composer_ ? &*composer_ : nullptr; }
  /// Goes on with a painter for another scene or rig.
  void replace(FrameComposer composer) { composer_ = std::move(composer); }

 private:
  std::optional<std::string> compose_anew(const FrameInput& input, const SessionSetup& setup);

  Drawing drawing_;
  std::optional<FrameComposer> composer_;
  ComposedFrame painted_;
  Stamp renewed_at_;
};

}  // namespace limn::apps
