#include "core/camera_files/imager_file.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/camera_files/artoolkit_file.h"
#include "core/camera_files/cahvor_file.h"
#include "core/camera_files/camera_description.h"
#include "core/camera_files/camera_document.h"
#include "core/camera_files/camera_entries.h"
#include "core/camera_files/foreign_camera.h"
#include "core/cameramodel.h"
#include "core/data_tree.h"
#include "core/file.h"
#include "core/log.h"
#include "core/names.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

struct CameraPath {
  fs::path file;
  std::string camera;  // empty: the only one
};

// FILE or FILE:NAME; a file with a colon in its name is a file.
CameraPath split_path(const fs::path& path) {
  const std::string text = path.string();
  const auto colon = text.rfind(':');
  std::error_code ignored;
  if (colon == std::string::npos || fs::exists(path, ignored) || !fs::exists(text.substr(0, colon), ignored))
    return {path, ""};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

std::string first_keys(const DataNode& root) {
  constexpr std::size_t k_most = 8;
  std::vector<std::string> keys(
      root.keys.begin(), root.keys.begin() + static_cast<std::ptrdiff_t>(std::min(root.keys.size(), k_most)));
  for (std::string& key : keys) key = key.substr(0, 40);
  return root.is_map() ? "the entries " + joined_names(keys) : std::string("something else");
}

bool is_named(const CameraDescription& camera, const std::string& name) {
  const auto is_same = [&](const std::string& other) { return plain_name(other) == plain_name(name); };
  return is_same(camera.name) || std::ranges::any_of(camera.also_named, is_same);
}

Result<CameraDescription> chosen_camera(const std::vector<CameraDescription>& cameras,
                                        const CameraPath& path) {
  std::vector<CameraDescription> fitting;
  for (const CameraDescription& camera : cameras)
    if (path.camera.empty() || is_named(camera, path.camera)) fitting.push_back(camera);
  if (fitting.size() == 1) return fitting[0];
  std::vector<std::string> listed;
  for (const CameraDescription& camera : cameras)
    listed.push_back(camera.width > 0 ? fmt::format("{} ({}x{})", camera.name, camera.width, camera.height)
                                      : camera.name);
  const std::string names = joined_names(listed);
  if (path.camera.empty())
    return error("expected one camera, found {}: {}. Name one of them: {}:{}", cameras.size(), names,
                 path.file.filename().string(), cameras[0].name);
  return error("expected one camera of the name '{}', found {} of {}.", path.camera, fitting.size(), names);
}

Result<Imager> read_document(const std::string& bytes, const CameraPath& path) {
  const auto root = parse_data(bytes);
  if (!root) return error("expected a camera file: {}", root.message());
  LIMN_TRY(const auto cameras, cameras_in(*root));
  if (cameras.empty())
    return error(
        "expected a camera (camera_matrix and distortion_coefficients, or what ROS, Kalibr, PhotonVision and "
        "ORB-SLAM call "
        "them), a .cameramodel, a .cahvor or ARToolKit's camera_para.dat, found {}.",
        first_keys(*root));
  LIMN_TRY(CameraDescription camera, chosen_camera(cameras, path));
  LIMN_TRY(Imager imager, imager_of(&camera));
  for (const std::string& remark : camera.remarks) log_info("{}: {}", path.file.string(), remark);
  return imager;
}

Result<Imager> read_imager(const std::string& bytes, const CameraPath& path) {
  if (const auto foreign = foreign_format(bytes))
    return error("expected a camera file, found {}, which Limn does not read. {}", foreign->name,
                 foreign->help);
  if (path.file.extension() == ".dat" || artoolkit_version(bytes)) return read_artoolkit(bytes);
  if (is_cahvor(bytes)) return read_cahvor(bytes);
  return read_document(bytes, path);
}

}  // namespace

Result<Imager> load_imager(const fs::path& path) {
  const CameraPath chosen = split_path(path);
  if (chosen.file.extension() == ".cameramodel") return load_cameramodel(chosen.file);
  LIMN_TRY(const std::string bytes, read_file(chosen.file));
  if (bytes.find("'lensmodel'") != std::string::npos) return load_cameramodel(chosen.file);
  auto imager = read_imager(bytes, chosen);
  if (!imager) return error("{}: {}", chosen.file.string(), imager.message());
  if (imager->name.empty()) imager->name = chosen.file.stem().string();
  return imager;
}

}  // namespace limn
