#include "session/session_output.h"

#include <nlohmann/json.hpp>

#include "core/csv.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"

namespace limn::session {
namespace {

void print_summary(const nlohmann::ordered_json& json) {
  for (const auto& [key, value] : json.items()) {
    if (value.is_object())
      print_out("{}: median {:.3f}, 95 % {:.3f}, 99 % {:.3f}\n", key, value["median"].get<double>(),
                value["p95"].get<double>(), value["p99"].get<double>());
    else if (value.is_number())
      print_out("{}: {}\n", key, json_text(value));
  }
}

}  // namespace

Result<SessionOutput> SessionOutput::open(const std::filesystem::path& out,
                                          const std::filesystem::path& record,
                                          SessionSetup* setup) {
  LIMN_TRY(Telemetry telemetry, Telemetry::create(out));
  SessionOutput output(std::move(telemetry));
  output.out_ = out;
  if (!out.empty()) {
    LIMN_TRY(output.poses_,
             AppendLog::create(out / "poses.csv", "shown_at_s,slot,variant,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"));
  }
  if (!record.empty()) {
    LIMN_TRY(output.recorder_, Recorder::create(record, *setup));
    const std::filesystem::path project = setup->scene.folder;  // looks are still kept in the project
    LIMN_TRY(*setup, load_setup(record));
    setup->scene.folder = project;
  }
  return output;
}

void SessionOutput::add_frame(const ShownFrame& frame, const ComposedFrame& composed) {
  telemetry_.add(frame);
  if (poses_.is_open()) add_poses(composed);
  if (const auto message = poses_.take_message()) telemetry_.note(composed.shown_at, *message);
  if (!recorder_ || recording_error_reported_) return;
  const auto ended = recorder_->ended();
  if (!ended) return;
  recording_error_reported_ = true;
  telemetry_.note(composed.shown_at, "the recording ended: " + *ended);
  log_warning("live: the recording ended at {:.2f} s: {}. The session goes on.",
              seconds_of(composed.shown_at), *ended);
}

// Poses are in the prototype's frame if it has a pose, otherwise in the world frame.
void SessionOutput::add_poses(const ComposedFrame& composed) {
  const Pose from_world =
      composed.posed.world_from_prototype ? composed.posed.world_from_prototype->inverse() : Pose{};
  for (const scene::PosedPart& part : composed.posed.parts) {
    const Pose pose = from_world * part.world_from_part;
    const Eigen::Vector3d mm = 1e3 * pose.translation;
    const Eigen::Quaterniond& q = pose.rotation;
    poses_.add(fmt::format("{:.6f},{},{},{:.4f},{:.4f},{:.4f},{:.8f},{:.8f},{:.8f},{:.8f}\n",
                           seconds_of(composed.shown_at), csv_field(part.slot), csv_field(part.variant),
                           mm.x(), mm.y(), mm.z(), q.w(), q.x(), q.y(), q.z()),
               composed.shown_at);
  }
}

Status SessionOutput::close(Session* session, bool as_json) {
  poses_.flush();
  session->store().finish();
  session->report_unwritten(session->composed().shown_at);
  const Status recorded = recorder_ ? recorder_->finish() : Status();
  nlohmann::ordered_json json = {{"schema", "limn.live/1"}};
  json.update(telemetry_.summary());
  const Status written = write_end(session, json);
  if (as_json)
    print_out("{}\n", json_text(json, 2));
  else
    print_summary(json);
  return written ? recorded : written;
}

// Writes the files that a session leaves in its folder.
Status SessionOutput::write_end(Session* session, const nlohmann::ordered_json& json) const {
  if (out_.empty()) return {};
  for (std::size_t i = 0; i < session->composed().projectors.size(); ++i) {
    const EyeImages images = session->composed().images(i);
    const std::string name = "projector-" + session->setup().rig.projectors[i].name;
    LIMN_TRY_STATUS(write_png(out_ / (name + ".png"), images.left));
    if (images.is_stereo()) LIMN_TRY_STATUS(write_png(out_ / (name + "-right.png"), images.right));
  }
  if (const cv::Mat screen = session->screen(); !screen.empty())
    LIMN_TRY_STATUS(write_png(out_ / "screen.png", screen));
  LIMN_TRY_STATUS(write_file(out_ / "session.json", json_text(json, 2) + "\n"));
  return telemetry_.write_page(out_ / "session.html", "Limn session");
}

}  // namespace limn::session
