#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/append_log.h"
#include "core/result.h"
#include "device/devices_file.h"
#include "nodes/file_offer.h"
#include "nodes/room.h"
#include "session/session_client.h"

namespace limn::nodes {

/// The first line of RoomHost's log.
inline constexpr std::string_view k_frames_log_header = "frame,projector,fingerprint\n";

/// The host's part of a session in a room: sends the setup whenever scene or rig change, and each frame's
/// description before it is drawn here.
class RoomHost final : public session::SessionClient {
 public:
  /// `devices`: those of the session; the nodes need to know theirs. `files` and `room` are borrowed.
  /// `work`: a folder for copies of the session's files. `setup` becomes what the nodes will read, to the
  /// last bit. `log`: gets a line with the fingerprint of each image that a node has to show
  /// (k_frames_log_header). Error: the files cannot be copied.
  static Result<std::unique_ptr<RoomHost>> open(Room* room,
                                                FileOffer* files,
                                                const device::Devices& devices,
                                                const std::filesystem::path& work,
                                                AppendLog log,
                                                session::SessionSetup* setup);

  void apply_edits(const session::SessionMoment& moment) override;
  void note_description(const session::FrameDescription& frame) override;
  void publish_state(const session::SessionMoment& moment) override;
  /// A refresh of the displays at nodes.
  Stamp light_at(Stamp expected) const override;

 private:
  RoomHost(Room* room, FileOffer* files, std::string devices, std::filesystem::path work, AppendLog log)
      : room_(room),
        files_(files),
        devices_(std::move(devices)),
        work_(std::move(work)),
        log_(std::move(log)) {}
  void log_images(const session::Session& session, Stamp at);
  void send_black();
  // Copies, lists and hashes the files of a setup, on any thread.
  static Result<std::vector<SharedFile>> shared_files(FileOffer* files,
                                                      const session::SessionSetup& setup,
                                                      const std::filesystem::path& folder);
  void send_shared(const session::SessionMoment& moment);
  Status send_setup(std::uint64_t revision, Result<std::vector<SharedFile>> files);
  std::filesystem::path folder_of(std::uint64_t revision) const;

  Room* room_;
  FileOffer* files_;
  std::string devices_;  // those at nodes, as text
  std::filesystem::path work_;
  AppendLog log_;
  std::vector<std::string> projectors_;  // that nodes have
  Setup setup_;
  std::uint64_t frames_ = 0;
  std::shared_ptr<const scene::DeviationLayer> deviation_;  // what nodes have or will have
  session::FrameDescription last_;                          // the last one that was sent
  std::uint64_t revisions_ = 1;
  std::future<Result<std::vector<SharedFile>>> sharing_;  // what is to be sent next
  bool shares_deviation_only_ = false;                    // whether that is the deviation, else a whole setup
  int scenes_ = 1;                                        // Session::scenes() of the setup that was sent
  std::set<std::string> nodes_;                           // that the session's devices are plugged into
  std::set<std::string> absent_;                          // those that cannot be heard now
  std::set<std::string> problems_;                        // that were reported and hold still
};

/// Waits for a host that is in the room already: `wait_s`, or shorter if a node is there that has none.
/// Error: there is one; it is named.
Status check_no_other_host(const Room& room, double wait_s);

}  // namespace limn::nodes
