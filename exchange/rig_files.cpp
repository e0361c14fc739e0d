#include "exchange/rig_files.h"

#include <algorithm>

#include "core/camera_files/camera_document.h"
#include "core/camera_files/camera_entries.h"
#include "core/camera_files/foreign_camera.h"
#include "core/data_tree.h"
#include "core/file.h"
#include "core/names.h"
#include "exchange/mpcdi_reader.h"
#include "exchange/mpcdi_rig.h"
#include "exchange/rig_devices.h"
#include "exchange/rig_entries.h"
#include "exchange/roomalive_rig.h"

namespace limn::exchange {
namespace {

using Keys = std::vector<std::string>;  // spellings of one entry

// What a program calls the entries of one device; empty: its files do not hold this.
struct DeviceKeys {
  Keys matrix, distortion;
  std::string width, height;
  std::string shape;  // height and width, as numpy has them
};

// A program that writes one camera and one projector.
struct PairFormat {
  std::string program;
  DeviceKeys camera, projector;
  Keys rotation, translation;  // projector_from_camera
};

const std::vector<PairFormat>& pair_formats() {
  static const std::vector<PairFormat> formats = {
      {"procam-calibration",
       {{"cam_int"}, {"cam_dist"}, "", "", "img_shape"},
       {{"proj_int"}, {"proj_dist"}, "", "", ""},
       {"rotation", "roration"},  // older versions misspell it
       {"translation"}},
      {"SLStudio",
       {{"Kc"}, {"kc"}, "frameWidth", "frameHeight", ""},
       {{"Kp"}, {"kp"}, "screenResX", "screenResY", ""},
       {"Rp"},
       {"Tp"}},
      {"procamcalib",
       {{"cam_K"}, {"cam_kc"}, "", "", ""},
       {{"proj_K"}, {"proj_kc", "proj_Kc"}, "", "", ""},
       {"R"},
       {"T"}},
  };
  return formats;
}

const DataNode* item_of(const DataNode& map, const Keys& keys) {
  for (const std::string& key : keys)
    if (const DataNode* item = map.find(key)) return item;
  return nullptr;
}

// The outermost map that satisfies a condition; null when there is none.
template <class Condition>
const DataNode* map_where(const DataNode& node, const Condition& condition) {
  if (node.is_map() && condition(node)) return &node;
  for (const DataNode& item : node.items)
    if (const DataNode* found = map_where(item, condition)) return found;
  return nullptr;
}

Result<RigEntry> pair_entry(const DataNode& map, const Keys& keys, const std::string& beside) {
  for (const std::string& key : keys)
    if (const DataNode* node = map.find(key)) return RigEntry{key, node};
  return error("{}: expected this entry beside {}, found none.", keys[0], beside);
}

Result<int> side_at(const RigEntry& entry) {
  LIMN_TRY(const std::vector<double> numbers, vector_in(entry));
  return side_in_pixels(entry, numbers.size() == 1 ? numbers[0] : 0);
}

Status read_pair_size(const DataNode& map, const DeviceKeys& keys, CameraDescription* device) {
  const DataNode* width = keys.width.empty() ? nullptr : map.find(keys.width);
  const DataNode* height = keys.height.empty() ? nullptr : map.find(keys.height);
  if (width && height) {
    LIMN_TRY(device->width, side_at({keys.width, width}));
    LIMN_TRY(device->height, side_at({keys.height, height}));
  }
  const DataNode* shape = keys.shape.empty() ? nullptr : map.find(keys.shape);
  if (!shape) return {};
  const RigEntry entry{keys.shape, shape};
  LIMN_TRY(const std::vector<double> numbers, vector_in(entry));
  if (numbers.size() != 2 && numbers.size() != 3)  // the third is the number of channels
    return rig_entry_error(
        entry, fmt::format("expected the image's height and width, found {} numbers.", numbers.size()));
  LIMN_TRY(device->height, side_in_pixels(entry, numbers[0]));
  LIMN_TRY(device->width, side_in_pixels(entry, numbers[1]));
  return {};
}

Result<CameraDescription> read_pair_device(const DataNode& map, const DeviceKeys& keys) {
  CameraDescription device;
  LIMN_TRY(const RigEntry matrix, pair_entry(map, keys.matrix, "the others"));
  LIMN_TRY(const RigEntry distortion, pair_entry(map, keys.distortion, matrix.path));
  LIMN_TRY(device.matrix, matrix_in(matrix));
  LIMN_TRY(device.coefficients, vector_in(distortion));
  device.matrix_entry = matrix.path;
  device.distortion_entry = distortion.path;
  if (std::ranges::all_of(device.coefficients, [](double value) { return value == 0; }))
    device.coefficients.clear();
  LIMN_TRY_STATUS(read_pair_size(map, keys, &device));
  return device;
}

// second_from_first of a pair.
Result<Pose> pair_pose(const RigEntry& rotation, const RigEntry& translation, const RigFileOptions& options) {
  LIMN_TRY(const Eigen::Matrix3d matrix, matrix_in(rotation));
  LIMN_TRY(const Eigen::Quaterniond turn_of_second, rotation_in(rotation, matrix));
  LIMN_TRY(const std::vector<double> numbers, vector_in(translation));
  if (numbers.size() != 3)
    return rig_entry_error(translation, fmt::format("expected 3 numbers, found {}.", numbers.size()));
  if (!options.units)
    return usage_error(
        "{}: expected the unit of its lengths, which is that of the calibration board and not in the file. "
        "Give it as --units mm (or cm, m, in, ft).",
        translation.path);
  const Eigen::Vector3d metres =
      scene::metres_per_unit(*options.units) * Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  LIMN_TRY(const Eigen::Vector3d checked, translation_in(translation, metres));
  return Pose(turn_of_second, checked);
}

Result<RigFile> read_pair(const PairFormat& format, const DataNode& map, const RigFileOptions& options) {
  RigFile file;
  file.program = format.program;
  LIMN_TRY(CameraDescription camera, read_pair_device(map, format.camera));
  LIMN_TRY(CameraDescription projector, read_pair_device(map, format.projector));
  LIMN_TRY(const RigEntry rotation, pair_entry(map, format.rotation, projector.matrix_entry));
  LIMN_TRY(const RigEntry translation, pair_entry(map, format.translation, rotation.path));
  LIMN_TRY(projector.imager_from_world, pair_pose(rotation, translation, options));
  LIMN_TRY_STATUS(add_device(&camera, false, options, &file));
  LIMN_TRY_STATUS(add_device(&projector, true, options, &file));
  return file;
}

// ---- OpenCV's stereo calibration ----

const Keys k_rotation_names = {
    "r",       "rot",     "rmat",    "rotation", "rotationmatrix", "stereorotation",
    "stereor", "rstereo", "matrixr", "rmatrix",  "extrinsicsr",    "extrinsicr"};
const Keys k_translation_names = {
    "t",           "trans",     "tvec",    "translation",       "translationvector", "stereot",
    "rstereot",    "tstereo",   "vectort", "translationmatrix", "stereotranslation", "tvector",
    "extrinsicst", "extrinsict"};

std::optional<RigEntry> entry_named(const DataNode& map, const Keys& names) {
  for (std::size_t i = 0; i < map.keys.size(); ++i)
    if (std::ranges::find(names, plain_name(map.keys[i])) != names.end())
      return RigEntry{map.keys[i], &map.items[i]};
  return std::nullopt;
}

bool is_right(const CameraDescription& camera) {
  return plain_name(camera.name).find("right") != std::string::npos ||
         std::ranges::find(camera.also_named, "right") != camera.also_named.end();
}

Result<RigFile> read_stereo(std::vector<CameraDescription> cameras,
                            const DataNode& map,
                            const RigFileOptions& options) {
  RigFile file;
  file.program = "OpenCV stereo";
  if (is_right(cameras[0]) && !is_right(cameras[1])) std::swap(cameras[0], cameras[1]);
  LIMN_TRY(cameras[1].imager_from_world,
           pair_pose(*entry_named(map, k_rotation_names), *entry_named(map, k_translation_names), options));
  const bool has_projector = options.projector_size.has_value();
  // An image size that both devices share is the camera's.
  if (has_projector) cameras[1].width = cameras[1].height = 0;
  cameras[0].imager_from_world = Pose();
  LIMN_TRY_STATUS(add_device(&cameras[0], false, options, &file));
  LIMN_TRY_STATUS(add_device(&cameras[1], has_projector, options, &file));
  return file;
}

// ---- the kinds of files ----

std::string first_entries(const DataNode& root) {
  // XML has one outermost element.
  const DataNode& map =
      root.is_map() && root.items.size() == 1 && root.items[0].is_map() ? root.items[0] : root;
  if (!map.is_map()) return "something else";
  constexpr std::size_t k_most = 8;
  Keys keys;
  for (const std::string& key : map.keys)
    if (keys.size() < k_most) keys.push_back(key.substr(0, 40));
  return "the entries " + joined_names(keys);
}

Result<RigFile> read_rig_document(const DataNode& root, const RigFileOptions& options) {
  if (is_roomalive(root)) return read_roomalive(root, options);
  for (const PairFormat& format : pair_formats()) {
    const DataNode* map = map_where(root, [&](const DataNode& node) {
      return item_of(node, format.camera.matrix) && item_of(node, format.projector.matrix);
    });
    if (map) return read_pair(format, *map, options);
  }
  const DataNode* pose = map_where(root, [](const DataNode& node) {
    return entry_named(node, k_rotation_names) && entry_named(node, k_translation_names);
  });
  LIMN_TRY(std::vector<CameraDescription> cameras, cameras_in(root));
  if (pose && cameras.size() == 2) return read_stereo(std::move(cameras), *pose, options);
  if (pose && cameras.empty())
    return error(
        "expected two cameras beside the rotation and translation, found {}. Give the file with the cameras, "
        "too: limn import rig intrinsics.yml extrinsics.yml.",
        first_entries(root));
  if (!pose && cameras.size() == 2)
    return error(
        "expected the rotation R and the translation T beside the two cameras, found {}. Give the file with "
        "them, too: limn import rig intrinsics.yml extrinsics.yml.",
        first_entries(root));
  return error(
      "expected a rig of procam-calibration (cam_int, proj_int), SLStudio (Kc, Kp), procamcalib (cam_K, "
      "proj_K), RoomAlive (ProjectorCameraEnsemble), OpenCV's stereo calibration (two cameras, R and T) or "
      "MPCDI, found {}{}.",
      first_entries(root), cameras.empty() ? std::string() : fmt::format(" with {} cameras", cameras.size()));
}

Result<RigFile> read_poses_of_mpcdi(const std::filesystem::path& path, const RigFileOptions& options) {
  if (options.units || options.camera_size || options.projector_size)
    return usage_error("{}: expected no --units, --camera-size or --projector, which MPCDI states itself.",
                       path.string());
  LIMN_TRY(const Mpcdi mpcdi, read_mpcdi(path, MpcdiParts::poses));
  RigFile file;
  LIMN_TRY(file.rig, mpcdi_rig(mpcdi, path.string()));
  file.program = fmt::format("MPCDI {}", mpcdi.version);
  file.remarks = mpcdi.remarks;
  return file;
}

bool is_mpcdi(const std::filesystem::path& path, const std::string& bytes) {
  return (bytes.compare(0, 2, "PK") == 0 && path.extension() != ".npz") ||
         bytes.find("<MPCDI") != std::string::npos || bytes.find("<mpcdi") != std::string::npos;
}

Result<DataNode> parse_rig_file(const std::string& bytes) {
  if (const auto foreign = foreign_format(bytes))
    return error("expected a rig of another program, found {}, which Limn does not read.", foreign->name);
  auto root = parse_data(bytes);
  if (!root) return error("expected YAML, JSON or XML: {}", root.message());
  return root;
}

// The entries of both files as one map.
DataNode merged(const std::vector<DataNode>& roots) {
  if (roots.size() == 1) return roots[0];
  DataNode map;
  map.kind = DataNode::Kind::map;
  for (const DataNode& root : roots) {
    const bool is_wrapped = root.is_map() && root.items.size() == 1 && root.items[0].is_map();
    const DataNode& inner = is_wrapped && root.keys[0] == "opencv_storage" ? root.items[0] : root;
    map.keys.insert(map.keys.end(), inner.keys.begin(), inner.keys.end());
    if (inner.is_map()) map.items.insert(map.items.end(), inner.items.begin(), inner.items.end());
  }
  return map;
}

}  // namespace

Result<RigFile> read_rig_files(const std::vector<std::filesystem::path>& files,
                               const RigFileOptions& options) {
  LIMN_CHECK(!files.empty());
  std::string names;
  std::vector<DataNode> roots;
  for (const std::filesystem::path& path : files) {
    if (!names.empty()) names += ", ";
    names += path.string();
    LIMN_TRY(const std::string bytes, read_file(path));
    if (is_mpcdi(path, bytes)) {
      if (files.size() == 1) return read_poses_of_mpcdi(path, options);
      return usage_error("{}: expected this MPCDI file alone, found {} files.", path.string(), files.size());
    }
    auto root = parse_rig_file(bytes);
    if (!root) return error("{}: {}", path.string(), root.message());
    roots.push_back(std::move(*root));
  }
  auto file = read_rig_document(merged(roots), options);
  if (!file) return Error{fmt::format("{}: {}", names, file.message()), file.error().wrong_usage};
  return file;
}

}  // namespace limn::exchange
