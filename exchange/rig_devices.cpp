#include "exchange/rig_devices.h"

namespace limn::exchange {
namespace {

Status settle_size(const std::string& name,
                   bool is_projector,
                   const RigFileOptions& options,
                   CameraDescription* device) {
  const char* option = is_projector ? "--projector" : "--camera-size";
  const auto& given = is_projector ? options.projector_size : options.camera_size;
  if (!given && device->width > 0) return {};
  if (!given)
    return usage_error(
        "{}: expected its size in pixels, which the file does not hold. Give it as {} 1280x800.", name,
        option);
  const auto [width, height] = *given;
  if (!(width >= 1 && width <= k_max_side && height >= 1 && height <= k_max_side))
    return usage_error("{}: expected sides from 1 to {} pixels, found {}x{}.", option, k_max_side, width,
                       height);
  if (device->width > 0 && (device->width != width || device->height != height))
    return usage_error("{} {}x{}: expected the size {}x{} that the file holds for {}.", option, width, height,
                       device->width, device->height, name);
  device->width = width;
  device->height = height;
  return {};
}

}  // namespace

Status add_device(CameraDescription* device,
                  bool is_projector,
                  const RigFileOptions& options,
                  RigFile* file) {
  std::vector<Imager>& devices = is_projector ? file->rig.projectors : file->rig.cameras;
  const std::string name = fmt::format("{}{}", is_projector ? "projector" : "camera", devices.size());
  LIMN_TRY_STATUS(settle_size(name, is_projector, options, device));
  LIMN_TRY(Imager imager, limn::imager_of(device));
  imager.name = name;
  for (const std::string& remark : device->remarks) file->remarks.push_back(name + ": " + remark);
  devices.push_back(std::move(imager));
  return {};
}

void move_world_to_first_camera(Rig* rig) {
  if (rig->cameras.empty()) return;
  const Pose old_world_from_first = rig->cameras[0].imager_from_world.inverse();
  for (auto* devices : {&rig->cameras, &rig->projectors})
    for (Imager& device : *devices)
      device.imager_from_world = device.imager_from_world * old_world_from_first;
  rig->cameras[0].imager_from_world = Pose();
}

}  // namespace limn::exchange
