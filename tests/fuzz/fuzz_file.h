#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "core/imager.h"

namespace limn::test {

/// The bytes as a file of this name in a folder of this process (in memory where the system has such).
std::filesystem::path fuzzed_file(const std::uint8_t* bytes, std::size_t size, const std::string& name);

/// A message for a person: it names the file. Throws otherwise.
void check_message(const std::string& message, const std::filesystem::path& file);

/// What holds for every camera that a reader lets through: sizes and values that the rest can work with, and
/// rays that go there and back. Throws otherwise.
void check_imager(const Imager& imager);

/// Reads the bytes as a camera file of this name and checks the camera, or the message.
void check_camera(const std::uint8_t* bytes, std::size_t size, const std::string& name);

}  // namespace limn::test

/// libFuzzer's entry: a target reads the bytes, and throws or dies where it should not.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size);
