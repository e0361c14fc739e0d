#include "tests/fuzz/fuzz_file.h"

#include <unistd.h>

#include "core/camera_files/imager_file.h"
#include "core/file.h"
#include "core/log.h"
#include "core/utf8.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;

class OwnFolder {
 public:
  OwnFolder() {
    const fs::path memory = "/dev/shm";
    std::error_code ignored;
    std::string name =
        (fs::is_directory(memory, ignored) ? memory : fs::temp_directory_path()) / "limn-fuzz-XXXXXX";
    LIMN_CHECK(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~OwnFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

fs::path fuzzed_file(const std::uint8_t* bytes, std::size_t size, const std::string& name) {
  static const OwnFolder folder;
  const fs::path path = folder.path() / name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  LIMN_CHECK(file != nullptr);
  const bool written = std::fwrite(bytes, 1, size, file) == size;
  LIMN_CHECK(std::fclose(file) == 0 && written);
  return path;
}

void check_message(const std::string& message, const fs::path& file) {
  LIMN_CHECK(message.find(file.filename().string()) != std::string::npos);
}

void check_message(const std::string& message) {
  LIMN_CHECK(message.find("expected") != std::string::npos);
  LIMN_CHECK(is_utf8(message));
}

void check_imager(const Imager& imager) {
  LIMN_CHECK(imager.width >= 0 && imager.width <= 16384 && imager.height >= 0 && imager.height <= 16384);
  LIMN_CHECK(static_cast<int>(imager.lens.values.size()) == imager.lens.model.value_count());
  LIMN_CHECK(imager.lens.fx() > 0 && imager.lens.fy() > 0);
  LIMN_CHECK(imager.imager_from_world.is_finite());
  for (const double share : {0.0, 0.5, 1.0}) {
    const auto ray = imager.ray({share * imager.width, share * imager.height});
    if (ray) imager.project(ray->p_origin + ray->d);
  }
}

void check_camera(const std::uint8_t* bytes, std::size_t size, const std::string& name) {
  set_log_level(LogLevel::warning);
  const fs::path file = fuzzed_file(bytes, size, name);
  const auto imager = load_imager(file);
  if (imager)
    check_imager(*imager);
  else
    check_message(imager.message(), file);
}

}  // namespace limn::test
