#pragma once

#include <deque>
#include <map>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"
#include "device/gui/gui_window.h"
#include "session/device_health.h"
#include "session/operator_panel.h"
#include "session/remote_link.h"
#include "session/requests/keys.h"
#include "session/session.h"
#include "session/session_client.h"
#include "session/telemetry.h"

namespace limn::session {

/// The invitation as the window shows it, with QR codes for phones.
OperatorView::Remote remote_view(const Invitation& invitation);

/// The operator's window and keys. Belongs to the session's thread; the session's GL context stays current.
class OperatorConsole : public SessionClient {
 public:
  static Result<OperatorConsole> open(const device::Desktop& desktop, const scene::Scene& scene);

  /// From now on the window shows how guests connect. `remote` must outlive this object.
  void invite(RemoteLink* remote);

  /// The key bindings; all sources of keys share one chosen slot.
  Keys& keys() { return keys_; }

  /// To be called for each frame that was shown.
  void count_frame(const ShownFrame& frame);
  /// Whether the next serve() redraws the window and needs a screen's image.
  bool is_due() const { return window_.is_due(screen_s_); }
  /// Sends the edits of keys and of the window to the session; an edit that fails becomes a note. Draws the
  /// window when it is due. `screen`: the screen's newest image; empty: unchanged. False: the operator ends
  /// the session.
  bool serve(
      Session* session, Telemetry* telemetry, const DeviceHealth& health, const cv::Mat& screen, Stamp now);

  void apply_edits(const SessionMoment&) override {}  // serve() does both
  void publish_state(const SessionMoment& moment) override;
  bool wants_screen() const override { return panel_.shows_screen() && is_due(); }
  bool ends_session() const override { return ends_session_; }

 private:
  OperatorConsole(gui::GuiWindow window, const scene::Scene& scene)
      : window_(std::move(window)), keys_(scene) {}
  OperatorView view_of(const Session& session,
                       const Telemetry& telemetry,
                       const DeviceHealth& health,
                       Stamp now);
  std::vector<OperatorView::Device> devices_of(const DeviceHealth& health, Stamp now);

  gui::GuiWindow window_;
  OperatorPanel panel_;
  Keys keys_;
  RemoteLink* remote_link_ = nullptr;
  std::optional<OperatorView::Remote> remote_;
  std::deque<ShownFrame> recent_;
  cv::Mat screen_;
  double screen_s_ = 0;  // time to draw the screen's image
  bool ends_session_ = false;
  std::optional<Stamp> begun_at_;
  struct Pace {
    std::size_t images = 0;
    std::optional<double> per_second;
  };
  std::map<std::string, Pace> paces_;  // by device
  Stamp paced_at_;
};

}  // namespace limn::session
