#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "core/imager.h"
#include "core/result.h"

namespace limn::test {

/// Writes the bytes to a file of this name in a folder of this process (in memory, if the system has
/// /dev/shm).
std::filesystem::path fuzzed_file(const std::uint8_t* bytes, std::size_t size, const std::string& name);

/// Checks a message for people: it must name the file. Throws otherwise.
void check_message(const std::string& message, const std::filesystem::path& file);

/// Checks a message about bytes that are no file: it must say what was expected, in UTF-8. Throws otherwise.
void check_message(const std::string& message);

/// Checks a reader's answer: a value, or a message that names the file. Throws otherwise.
template <class Value>
void check_read(const Result<Value>& read, const std::filesystem::path& file) {
  if (!read) check_message(read.message(), file);
}

/// Checks a camera that a reader accepted: sizes and values must be usable, and rays must survive a round
/// trip. Throws otherwise.
void check_imager(const Imager& imager);

/// Reads the bytes as a camera file of this name and checks the camera, or the message.
void check_camera(const std::uint8_t* bytes, std::size_t size, const std::string& name);

}  // namespace limn::test

/// libFuzzer's entry point. A target reads the bytes; an exception or a crash is a finding.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size);
