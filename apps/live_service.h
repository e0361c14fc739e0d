#pragma once

#include "device/service_notifier.h"
#include "session/device_session.h"
#include "session/session_client.h"

namespace limn::apps {

/// Reports a session to the service manager: READY=1 when a projector has shown its first image, WATCHDOG=1
/// from the frame loop (a loop that hangs sends none, and the manager starts the program again), STATUS=, and
/// STOPPING=1 at the end. A message that cannot be sent at once is tried again in the next turn.
class LiveService : public session::SessionClient {
 public:
  LiveService() : notifier_(device::ServiceNotifier::from_environment()) {}

  void apply_edits(const session::SessionMoment& moment) override;
  void publish_state(const session::SessionMoment& moment) override;
  /// The loop has ended; files are still being written.
  void stop() const { notifier_.send_within(0.5, "STOPPING=1"); }

 private:
  void report_status();

  device::ServiceNotifier notifier_;
  Stamp alive_at_;   // when WATCHDOG=1 was sent last
  Stamp status_at_;  // when STATUS= was sent last
  int frames_ = 0;   // shown since then
  bool is_ready_ = false;
};

/// Every open display becomes black, for the end of a session: what the desktop shows below may be bright. A
/// display that fails has no light anyway.
void darken(const session::SessionDevices& devices);

}  // namespace limn::apps
