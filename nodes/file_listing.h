#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// The most that a setup may have.
constexpr std::size_t k_max_files = 4096;
constexpr std::uint64_t k_max_bytes = 4ull << 30;

/// Files are sent in pieces of this size, bytes; the last one of a file is shorter. A piece delays a frame's
/// description by at most 10 ms on a network of 100 Mbit/s.
constexpr std::size_t k_piece_bytes = 128 << 10;
/// The pieces of a file, and the size of one of them.
std::uint64_t piece_count(std::uint64_t file_bytes);
std::size_t piece_size(std::uint64_t file_bytes, std::uint64_t piece);

/// Checks that all files can be laid out inside of one folder. Error: too many or too large files, a path
/// that is absolute, leaves the folder, is there twice or is a file and a folder, or a wrong SHA-256.
Status check_listing(const std::vector<SharedFile>& files);

/// The paths and sizes of all files in a folder and the folders inside, sorted by path, without their
/// SHA-256. Error: as above, a link to something outside, or something that is neither a file nor a folder.
Result<std::vector<SharedFile>> list_files(const std::filesystem::path& folder);

}  // namespace limn::nodes
