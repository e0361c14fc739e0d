#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "core/append_log.h"
#include "core/result.h"
#include "session/recording.h"
#include "session/session.h"
#include "session/telemetry.h"

namespace limn::session {

/// Everything that a session writes while it runs.
class SessionOutput {
 public:
  /// `out`: folder for telemetry.csv and poses.csv. `record`: folder for the recording. Empty: none. With a
  /// recording, `setup` becomes what a replay will read, to the last bit.
  static Result<SessionOutput> open(const std::filesystem::path& out,
                                    const std::filesystem::path& record,
                                    SessionSetup* setup);

  Telemetry& telemetry() { return telemetry_; }
  Recorder* recorder() { return recorder_.get(); }  ///< null without a recording

  const std::filesystem::path& out() const { return out_; }  ///< empty: none

  /// To be called for each shown frame. Reports once if the recording has ended.
  void add_frame(const ShownFrame& frame, const ComposedFrame& composed);

  /// Waits for the recording; writes session.json, session.html, the last images; prints the summary.
  Status close(Session* session, bool as_json);

 private:
  explicit SessionOutput(Telemetry telemetry) : telemetry_(std::move(telemetry)) {}
  void add_poses(const ComposedFrame& composed);
  Status write_end(Session* session, const nlohmann::ordered_json& json) const;

  std::filesystem::path out_;
  Telemetry telemetry_;
  AppendLog poses_;
  std::unique_ptr<Recorder> recorder_;
  bool recording_error_reported_ = false;
};

}  // namespace limn::session
