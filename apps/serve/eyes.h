#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/tablet/onlooker.h"

namespace limn::apps {

/// Who draws pictures for guests: the live composite, and the window into a tablet's own pictures. They
/// return at once and answer every call exactly once, on another thread, at the latest when these functions
/// are destroyed. All may be empty: there are none.
struct Eyes {
  using Seen = Onlooker::Seen;
  using Answer = std::function<void(Seen)>;
  std::function<void(const Session&)> know;  ///< at every picture of the session, on its thread
  std::function<void(const Onlooker::Window&, std::vector<std::uint8_t> jpeg, Answer)> look;
  std::function<void(Answer)> room;
};

/// An onlooker's, which lives as long as they do.
inline Eyes eyes_of(std::unique_ptr<Onlooker> onlooker) {
  const std::shared_ptr<Onlooker> shared = std::move(onlooker);
  return {[shared](const Session& session) { shared->know(session); },
          [shared](const Onlooker::Window& window, std::vector<std::uint8_t> jpeg, Eyes::Answer answer) {
            shared->look(window, std::move(jpeg), std::move(answer));
          },
          [shared](Eyes::Answer answer) { shared->room(std::move(answer)); }};
}

}  // namespace limn::apps
