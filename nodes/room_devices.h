#pragma once

#include <span>

#include "core/result.h"
#include "core/rig.h"
#include "device/devices_file.h"
#include "nodes/room.h"

namespace limn::nodes {

/// The rig's devices as the nodes offer them, where there is only one reading: for each projector exactly one
/// monitor of its size, and for one camera exactly one camera. Monitors that fit no projector are left alone.
/// Error: it lists what is offered for each device.
Result<device::Devices> offered_devices(std::span<const Machine> machines, const Rig& rig);

/// As offered_devices(), with the machines that can be heard within this time. Returns as soon as there is a
/// reading.
Result<device::Devices> wait_for_devices(const Room& room, const Rig& rig, double limit_s);

}  // namespace limn::nodes
