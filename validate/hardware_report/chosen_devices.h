#pragma once

#include <map>
#include <string>

#include "device/devices_file.h"
#include "validate/hardware_report/private_words.h"
#include "validate/hardware_report/questions.h"
#include "validate/hardware_report/report.h"

namespace limn::validate {

/// The devices that a report measures.
struct ChosenDevices {
  device::Devices named = {};  ///< no camera: the virtual rig
  std::string board;
  std::map<std::string, std::string> renamed = {};  ///< private names of devices -> what they are called here

  bool is_virtual() const { return named.cameras.empty(); }
};

/// The devices of the file, or what is plugged in, by questions; without a camera the virtual rig. A camera
/// without a projector gets an offscreen one. Error: the file has no camera or no projector; interrupted.
Result<ChosenDevices> choose_devices(const ReportOptions& options,
                                     const ReportCommands& commands,
                                     Questions* questions);

/// Gives devices whose names are private other ones (camera0, projector0), and adds the names to the words.
void rename_private(ChosenDevices* devices, PrivateWords* words);

/// A number that is another one for other devices, board or rig. It is made with this machine's id, so that
/// nobody can find an address by trying.
std::string devices_mark(const ChosenDevices& devices, const std::filesystem::path& rig);

}  // namespace limn::validate
