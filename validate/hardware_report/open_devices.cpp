#include "validate/hardware_report/open_devices.h"

#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "core/data_folder.h"
#include "core/image_writer.h"
#include "device/v4l2_listing.h"
#include "nodes/remote_devices.h"
#include "sim/virtual_rig.h"
#include "tracker/marker_image.h"
#include "validate/hardware_report/questions.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/device_backend.h"
#include "wizard/capture/virtual_backend.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::validate {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct OpenDevices::Impl {
  Impl() noexcept(false) {}  // defaults of its members allocate
  calib::CaptureSet captures;
  wizard::WizardBackend backend;
  ordered_json settings;
  // What the backend refers to.
  wizard::Plan plan;
  std::optional<device::Desktop> desktop;
  std::unique_ptr<device::DeviceOpener> opener;
  std::unique_ptr<wizard::DeviceBackend> real;
  std::unique_ptr<sim::VirtualRig> rig;
  std::unique_ptr<ImageWriter> writer;
};

namespace {

ordered_json settings_of(const device::CameraSource& camera) {
  ordered_json json = {{"width", camera.size().width},
                       {"height", camera.size().height},
                       {"description", camera.description()}};
  for (const device::CameraSetting& setting : camera.settings()) {
    ordered_json& one = json[to_text(setting.name)];
    one = {{"requested", setting.asked}};
    if (setting.found) one["found"] = *setting.found;
    if (!setting.problem.empty()) one["problem"] = setting.problem;
  }
  return json;
}

// What a camera of the kernel offers; null for others.
ordered_json offers_of(const std::string& source) {
  const std::string kind = "v4l2:";
  if (!source.starts_with(kind)) return {};
  const auto listing = device::v4l2_listing(source.substr(kind.size()));
  if (!listing) return listing.message();
  ordered_json json = {{"modes", ordered_json::array()}, {"controls", ordered_json::object()}};
  for (const device::V4l2Mode& mode : listing->modes)
    json["modes"].push_back(fmt::format("{} {}x{} at {:g} frames per second", mode.format, mode.width,
                                        mode.height, fmt::join(mode.rates, ", ")));
  for (const device::V4l2Control& control : listing->controls)
    json["controls"][control.name] = fmt::format("{} ({} to {}, default {})", control.value, control.minimum,
                                                 control.maximum, control.default_value);
  return json;
}

// Ends a wait for images when a person has interrupted it.
void make_interruptible(wizard::WizardBackend* backend) {
  backend->capture.grab = [grab = backend->capture.grab](int camera) -> Result<cv::Mat> {
    if (is_interrupted()) return error("it was interrupted.");
    return grab(camera);
  };
  backend->flashes = [flashes = backend->flashes](int projector, int camera) {
    wizard::FlashDevices devices = flashes(projector, camera);
    devices.next = [next = devices.next]() -> Result<Frame> {
      if (is_interrupted()) return error("it was interrupted.");
      return next();
    };
    return devices;
  };
}

}  // namespace

std::unique_ptr<device::DeviceOpener> opener_here(const device::Desktop* desktop) {
  return std::make_unique<nodes::RoomOpener>(nullptr, desktop);
}

OpenDevices::OpenDevices(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OpenDevices::~OpenDevices() = default;
const calib::CaptureSet& OpenDevices::captures() const { return impl_->captures; }
const wizard::WizardBackend& OpenDevices::backend() const { return impl_->backend; }
const ordered_json& OpenDevices::settings() const { return impl_->settings; }

Result<std::unique_ptr<OpenDevices>> OpenDevices::open(const device::Devices& named,
                                                       const std::string& board_text,
                                                       const fs::path& captures,
                                                       const OpenerFor& opener) {
  LIMN_TRY(const calib::Board board, calib::Board::parse(board_text));
  auto open = std::make_unique<Impl>();
  if (auto desktop = device::Desktop::open()) open->desktop = *desktop;
  open->opener = opener(open->desktop ? &*open->desktop : nullptr);
  LIMN_TRY(wizard::DeviceBackend::Devices devices, wizard::open_devices(named, open->opener.get()));
  for (const auto& camera : devices.cameras) open->settings[camera->name()] = settings_of(*camera);
  for (const device::CameraConfig& camera : named.cameras)
    if (ordered_json offers = offers_of(camera.source); !offers.is_null())
      open->settings[camera.name]["offers"] = std::move(offers);
  open->captures = calib::plan_captures(captures, wizard::captured_devices(devices.cameras, devices.infrared),
                                        wizard::captured_devices(devices.projectors), board);
  open->writer = std::make_unique<ImageWriter>();
  open->real = std::make_unique<wizard::DeviceBackend>(std::move(devices), board, nullptr);
  open->backend = open->real->backend(open->writer.get());
  make_interruptible(&open->backend);
  return std::unique_ptr<OpenDevices>(new OpenDevices(std::move(open)));
}

Result<std::unique_ptr<OpenDevices>> OpenDevices::open_virtual(const fs::path& captures) {
  LIMN_TRY(const fs::path file, data_file("config/plans/bench.json"));
  auto open = std::make_unique<Impl>();
  LIMN_TRY(open->plan, wizard::load_plan(file));
  const wizard::Plan& plan = open->plan;
  LIMN_TRY(sim::World world, sim::load_world(plan.world, tracker::marker_image));
  open->rig = std::make_unique<sim::VirtualRig>(std::move(world),
                                                sim::VirtualRigOptions{.grab_waits_for_light = false});
  LIMN_TRY(open->captures, wizard::plan_virtual_captures(plan, *open->rig, captures));
  open->rig->remove_prototype();
  open->writer = std::make_unique<ImageWriter>();
  open->backend = wizard::virtual_backend(plan, open->rig.get(), open->writer.get());
  make_interruptible(&open->backend);
  return std::unique_ptr<OpenDevices>(new OpenDevices(std::move(open)));
}

}  // namespace limn::validate
