#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"
#include "gui/gui_window.h"
#include "session/device_health.h"
#include "session/keys.h"
#include "session/operator_panel.h"
#include "session/remote_link.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/telemetry.h"

namespace limn::apps {

/// What the window shows of an invitation, with the codes that phones read.
OperatorView::Remote shown(const Invitation& invitation);

/// Where the operator of a session sits: its window and keys. Belongs to the session's thread; the session's
/// GL context stays current.
class OperatorConsole : public SessionClient {
 public:
  static Result<OperatorConsole> open(const device::Desktop& desktop, const scene::Scene& scene);

  /// From now on the window says how guests come in. The remote outlives this.
  void invite(RemoteLink* remote);

  /// What keys do; one slot is chosen for all of them.
  Keys& keys() { return keys_; }

  /// An image was shown.
  void shown(const ShownFrame& frame);
  /// Whether the window is to be drawn anew at the next serve(), with a screen's image.
  bool is_due() const { return window_.is_due(screen_s_); }
  /// Edits of keys and of the window go to the session; what cannot be done becomes a note. Draws the window
  /// when it is due. `screen`: its newest image; empty: as before. False: the operator ends the session.
  bool serve(
      Session* session, Telemetry* telemetry, const DeviceHealth& health, const cv::Mat& screen, Stamp now);

  void hear(const SessionMoment&) override {}  // serve() does both
  void tell(const SessionMoment& moment) override;
  bool wants_screen() const override { return is_due(); }
  bool ends_session() const override { return ends_session_; }

 private:
  OperatorConsole(GuiWindow window, const scene::Scene& scene) : window_(std::move(window)), keys_(scene) {}
  OperatorView view_of(const Session& session,
                       const Telemetry& telemetry,
                       const DeviceHealth& health,
                       Stamp now);
  std::vector<OperatorView::Device> devices_of(const DeviceHealth& health, Stamp now);

  GuiWindow window_;
  OperatorPanel panel_;
  Keys keys_;
  RemoteLink* remote_link_ = nullptr;
  std::optional<OperatorView::Remote> remote_;
  std::deque<ShownFrame> recent_;
  cv::Mat screen_;
  double screen_s_ = 0;  // what it cost
  bool ends_session_ = false;
  std::optional<Stamp> begun_at_;
  struct Pace {
    std::size_t images = 0;
    std::optional<double> per_second;
  };
  std::map<std::string, Pace> paces_;  // by device
  Stamp paced_at_;
};

}  // namespace limn::apps
