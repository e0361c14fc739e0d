#pragma once

#include <filesystem>

#include "device/devices_file.h"
#include "validate/hardware_report/private_words.h"

namespace limn::validate {

/// Adds what is known of this machine and its user: host names, names of the user, the home folder, network
/// addresses, serial numbers of USB devices, the machine's id. `root`: where /etc and /sys are.
void add_machine(PrivateWords* words, const std::filesystem::path& root = "/");

/// Adds what the devices' configuration says: addresses, logins and serial numbers in the cameras' sources,
/// names of other machines, folders of images.
void add_devices(PrivateWords* words, const device::Devices& devices);

/// Adds the folder that a path which a person named is in.
void add_folder_of(PrivateWords* words, const std::filesystem::path& path);

}  // namespace limn::validate
