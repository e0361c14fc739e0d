#include "calib/temporary_folder.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

namespace limn::calib {

namespace fs = std::filesystem;

Result<TemporaryFolder> TemporaryFolder::create() {
  std::error_code problem;
  const fs::path parent = fs::temp_directory_path(problem);
  std::string name = ((problem ? fs::path("/tmp") : parent) / "limn-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr)
    return error("{}: cannot make a temporary folder there: {}. Set TMPDIR to a folder with free space.",
                 name, std::strerror(errno));
  return TemporaryFolder(fs::path(name));
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace limn::calib
