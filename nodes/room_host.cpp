#include "nodes/room_host.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <thread>

#include "core/log.h"
#include "core/names.h"
#include "nodes/refresh.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

template <class Config>
std::vector<Config> at_nodes(const std::vector<Config>& devices) {
  std::vector<Config> out;
  std::ranges::copy_if(devices, std::back_inserter(out),
                       [](const Config& device) { return !device.host.empty(); });
  return out;
}

}  // namespace

Result<std::unique_ptr<RoomHost>> RoomHost::open(Room* room,
                                                 FileOffer* files,
                                                 const device::Devices& devices,
                                                 const fs::path& work,
                                                 AppendLog log,
                                                 session::SessionSetup* setup) {
  const auto displays = at_nodes(devices.displays);
  const auto cameras = at_nodes(devices.cameras);
  std::unique_ptr<RoomHost> out(
      new RoomHost(room, files, device::devices_text(cameras, displays), work, std::move(log)));
  for (const device::DisplayConfig& display : displays) {
    out->nodes_.insert(display.host);
    if (find_named(setup->rig.projectors, display.name)) out->projectors_.push_back(display.name);
  }
  for (const device::CameraConfig& camera : cameras) out->nodes_.insert(camera.host);
  const fs::path folder = out->folder_of(out->revisions_);
  LIMN_TRY_STATUS(out->send_setup(out->revisions_, shared_files(files, *setup, folder)));
  LIMN_TRY(setup->rig, load_rig(folder / "rig"));
  return out;
}

fs::path RoomHost::folder_of(std::uint64_t revision) const {
  return work_ / fmt::format("setup-{}", revision);
}

Result<std::vector<SharedFile>> RoomHost::shared_files(FileOffer* files,
                                                       const session::SessionSetup& setup,
                                                       const fs::path& folder) {
  LIMN_TRY_STATUS(session::save_setup(setup, folder));
  return files->share(folder);
}

Status RoomHost::send_setup(std::uint64_t revision, Result<std::vector<SharedFile>> files) {
  if (!files) return files.error();
  setup_.revision = revision;
  setup_.files = std::move(*files);
  setup_.devices = devices_;
  return room_->send(setup_);
}

void RoomHost::note_description(const session::FrameDescription& frame) {
  Moment moment{revisions_, frame};
  moment.frame.number = ++frames_;  // a composer counts anew after a change of the scene
  if (const Status sent = room_->send(moment); !sent) log_warning("room: {}", sent.message());
  last_ = std::move(moment.frame);
}

// Light that must go off does not wait until the next frame is described. That one, which is black too, has
// the same number.
void RoomHost::send_black() {
  Moment moment{revisions_, last_};
  moment.frame.number = frames_ + 1;
  moment.frame.is_black = last_.is_black = true;
  moment.frame.shown_at = now();
  if (const Status sent = room_->send(moment); !sent) log_warning("room: {}", sent.message());
}

// Tells people which machines come, go and fail.
void RoomHost::apply_edits(const session::SessionMoment& moment) {
  if (moment.session.show_state().blackout && frames_ > 0 && !last_.is_black) send_black();
  std::set<std::string> problems;
  for (const std::string& name : nodes_) {
    const std::optional<Machine> node = room_->find(name);
    if (!node && absent_.insert(name).second)
      moment.session.warn(moment.at, fmt::format("{} is not in the room; its devices are missing", name));
    if (node && absent_.erase(name) > 0)
      moment.telemetry.note(moment.at, fmt::format("{} is in the room", name));
    if (!node || !node->health) continue;
    for (const std::string& problem : node->health->problems)
      problems.insert(fmt::format("{}: {}", name, problem));
    for (const std::string& problem : node->health->screen_problems)
      problems.insert(fmt::format("{}: {}", name, problem));
  }
  for (std::string& problem : room_->problems()) problems.insert(std::move(problem));
  for (const std::string& problem : problems)
    if (!problems_.contains(problem)) moment.session.warn(moment.at, problem);
  problems_ = std::move(problems);
}

// What has been shared meanwhile. Frames belong to a setup that has only another deviation from the CAD from
// now on, so that nodes show them without a break.
void RoomHost::send_shared(const session::SessionMoment& moment) {
  if (!sharing_.valid() || sharing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  auto files = sharing_.get();
  if (files && shares_deviation_only_) {
    std::vector<SharedFile> all = setup_.files;
    std::erase_if(all, [](const SharedFile& file) { return file.path == session::k_deviation_file; });
    all.insert(all.end(), files->begin(), files->end());
    files = std::move(all);
    ++revisions_;
  }
  if (const Status sent = send_setup(revisions_, std::move(files)); !sent)
    moment.session.warn(moment.at, fmt::format("the nodes did not get the change: {}", sent.message()));
}

void RoomHost::publish_state(const session::SessionMoment& moment) {
  if (log_.is_open() && moment.shown) log_images(moment.session, moment.at);
  send_shared(moment);
  const auto& deviation = moment.session.show_state().deviation.layer;
  const bool is_same_scene = moment.session.scenes() == scenes_;
  if (sharing_.valid() || (is_same_scene && deviation == deviation_)) return;
  scenes_ = moment.session.scenes();
  deviation_ = deviation;
  shares_deviation_only_ = is_same_scene;
  if (is_same_scene) {
    if (!deviation) return;  // frames say that it is not shown
    sharing_ = std::async(
        std::launch::async,
        [files = files_, deviation, folder = folder_of(revisions_ + 1)]() -> Result<std::vector<SharedFile>> {
          std::error_code ignored;
          fs::remove_all(folder, ignored);
          LIMN_TRY_STATUS(session::save_deviation(*deviation, folder));
          return files->share(folder);
        });
    return;
  }
  // Frames are already made for the new setup; nodes wait for it with their last images.
  ++revisions_;
  session::SessionSetup setup = moment.session.setup();
  setup.deviation = deviation;
  sharing_ = std::async(std::launch::async,
                        [files = files_, setup = std::move(setup), folder = folder_of(revisions_)] {
                          return shared_files(files, setup, folder);
                        });
}

Stamp RoomHost::light_at(Stamp expected) const {
  std::vector<Refresh> refreshes;
  for (const Machine& machine : room_->machines())
    if (machine.health && nodes_.contains(machine.sender.node))
      refreshes.insert(refreshes.end(), machine.health->refreshes.begin(), machine.health->refreshes.end());
  return refresh_near(expected, refreshes);
}

void RoomHost::log_images(const session::Session& session, Stamp at) {
  const std::vector<Imager>& projectors = session.setup().rig.projectors;
  for (const std::string& name : projectors_) {
    const auto index = static_cast<std::size_t>(find_named(projectors, name) - projectors.data());
    const EyeImages images = session.composed().images(index);
    const std::array<cv::Mat, 2> eyes = {images.left, images.right};
    log_.add(fmt::format("{},{},{:016x}\n", frames_, name, session::fingerprint(eyes)), at);
  }
}

Status check_no_other_host(const Room& room, double wait_s) {
  constexpr double k_least_s = 0.3;
  const Stamp begun = now();
  const auto has_no_host = [](const Machine& machine) {
    return machine.health && machine.health->has_no_host;
  };
  while (seconds_between(begun, now()) < wait_s) {
    if (const auto host = room.host())
      return error(
          "room: expected no host in it, found {}. A room has one host: end limn live or limn calibrate "
          "there, or "
          "start limn node here.",
          host->sender.node);
    if (seconds_between(begun, now()) > k_least_s && std::ranges::any_of(room.machines(), has_no_host)) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return {};
}

}  // namespace limn::nodes
