#include "exchange/roomalive_rig.h"

#include <Eigen/Core>
#include <cmath>

#include "core/camera_files/camera_description.h"
#include "exchange/rig_devices.h"
#include "exchange/rig_entries.h"

namespace limn::exchange {
namespace {

// Kinect 2's colour images, the only ones that the toolkit uses.
constexpr int k_colour_width = 1920, k_colour_height = 1080;

// "d5p1:double" is "double".
std::string_view without_prefix(std::string_view key) {
  const auto colon = key.find(':');
  return colon == std::string_view::npos ? key : key.substr(colon + 1);
}

const DataNode* member_of(const DataNode& node, std::string_view name) {
  for (std::size_t i = 0; i < node.keys.size(); ++i)
    if (without_prefix(node.keys[i]) == name) return &node.items[i];
  return nullptr;
}

Result<RigEntry> member_entry(const RigEntry& outer, const std::string& name) {
  const DataNode* node = member_of(*outer.node, name);
  if (!node) return rig_entry_error(outer, fmt::format("expected the element {}, found none.", name));
  return RigEntry{outer.path + "." + name, node};
}

// A matrix that is stored column by column, of exactly this size.
Result<Eigen::MatrixXd> matrix_by_columns(const RigEntry& outer,
                                          const std::string& name,
                                          int rows,
                                          int columns) {
  LIMN_TRY(const RigEntry entry, member_entry(outer, name));
  const auto problem = [&](const std::string& found) {
    return rig_entry_error(entry,
                           fmt::format("expected {} x {} finite numbers (ValuesByColumn), found {}. Was "
                                       "the ensemble calibrated?",
                                       rows, columns, found));
  };
  const DataNode* lists = member_of(*entry.node, "ValuesByColumn");
  if (!lists) return problem("none");
  if (lists->items.size() != static_cast<std::size_t>(columns))
    return problem(fmt::format("{} columns", lists->items.size()));
  Eigen::MatrixXd matrix(rows, columns);
  for (int column = 0; column < columns; ++column) {
    const DataNode& list = lists->items[static_cast<std::size_t>(column)];
    if (list.items.size() != static_cast<std::size_t>(rows))
      return problem(fmt::format("a column of {}", list.items.size()));
    for (int row = 0; row < rows; ++row) {
      const DataNode& item = list.items[static_cast<std::size_t>(row)];
      const auto number = item.is_text() ? limn::number_in(item.text) : std::nullopt;
      if (!number || !std::isfinite(*number)) return problem(fmt::format("'{}'", item.text.substr(0, 40)));
      matrix(row, column) = *number;
    }
  }
  return matrix;
}

Result<Pose> pose_by_columns(const RigEntry& outer, const std::string& name) {
  LIMN_TRY(const Eigen::MatrixXd matrix, matrix_by_columns(outer, name, 4, 4));
  LIMN_TRY(const RigEntry entry, member_entry(outer, name));
  if ((matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > 1e-6)
    return rig_entry_error(entry, "expected the last row 0 0 0 1, found another.");
  LIMN_TRY(const Eigen::Quaterniond rotation, rotation_in(entry, matrix.topLeftCorner<3, 3>()));
  LIMN_TRY(const Eigen::Vector3d translation, translation_in(entry, matrix.topRightCorner<3, 1>()));
  return Pose(rotation, translation);
}

// Limn's axes (x right, y down) from RoomAlive's (x left, y up).
Pose turned_axes() { return Pose(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d::Zero()); }

// Lens of a device whose pixel (u, v) counts to the left and up: Limn's is (last_u - u, last_v - v).
Status read_lens_entries(const RigEntry& device,
                         const std::string& matrix_name,
                         const std::string& distortion_name,
                         const Eigen::Vector2d& last,
                         CameraDescription* out) {
  LIMN_TRY(out->matrix, matrix_by_columns(device, matrix_name, 3, 3));
  LIMN_TRY(const Eigen::MatrixXd distortion, matrix_by_columns(device, distortion_name, 2, 1));
  out->matrix_entry = device.path + "." + matrix_name;
  out->distortion_entry = device.path + "." + distortion_name;
  out->matrix(0, 2) = last.x() - out->matrix(0, 2);
  out->matrix(1, 2) = last.y() - out->matrix(1, 2);
  // RoomAlive's k1 and k2 are OpenCV's; a half turn does not change a radial distortion.
  if (!distortion.isZero(0)) out->coefficients = {distortion(0, 0), distortion(1, 0), 0, 0};
  return {};
}

Result<CameraDescription> read_kinect(const RigEntry& device) {
  CameraDescription camera;
  camera.width = k_colour_width;
  camera.height = k_colour_height;
  LIMN_TRY(const RigEntry calibration, member_entry(device, "calibration"));
  // The Kinect's images are mirrored, so that column u of the file is u; the row is height - v. Limn's image
  // is the one that is not mirrored, whose column is width - 1 - u.
  LIMN_TRY_STATUS(read_lens_entries(calibration, "colorCameraMatrix", "colorLensDistortion",
                                    Eigen::Vector2d(k_colour_width - 1.0, k_colour_height), &camera));
  LIMN_TRY(const Pose colour_from_depth, pose_by_columns(calibration, "depthToColorTransform"));
  LIMN_TRY(const Pose world_from_depth, pose_by_columns(device, "pose"));
  camera.imager_from_world = turned_axes() * colour_from_depth * world_from_depth.inverse();
  return camera;
}

Result<int> side_of(const RigEntry& device, const std::string& name) {
  LIMN_TRY(const RigEntry entry, member_entry(device, name));
  const auto number = entry.node->is_text() ? limn::number_in(entry.node->text) : std::nullopt;
  return side_in_pixels(entry, number.value_or(0));
}

Result<CameraDescription> read_ensemble_projector(const RigEntry& device) {
  CameraDescription projector;
  LIMN_TRY(projector.width, side_of(device, "width"));
  LIMN_TRY(projector.height, side_of(device, "height"));
  // The calibration's image points are (width - column, height - row) of the decoded columns and rows.
  LIMN_TRY_STATUS(read_lens_entries(device, "cameraMatrix", "lensDistortion",
                                    Eigen::Vector2d(projector.width, projector.height), &projector));
  LIMN_TRY(const Pose world_from_projector, pose_by_columns(device, "pose"));
  projector.imager_from_world = turned_axes() * world_from_projector.inverse();
  return projector;
}

}  // namespace

bool is_roomalive(const DataNode& root) { return member_of(root, "ProjectorCameraEnsemble") != nullptr; }

Result<RigFile> read_roomalive(const DataNode& root, const RigFileOptions& options) {
  const RigEntry ensemble{"ProjectorCameraEnsemble", member_of(root, "ProjectorCameraEnsemble")};
  if (options.units && *options.units != scene::LengthUnit::metre)
    return usage_error("--units {}: expected m or no --units, because RoomAlive's lengths are metres.",
                       scene::to_text(*options.units));
  RigFile file;
  file.program = "RoomAlive Toolkit";
  for (const bool is_projector : {false, true}) {
    LIMN_TRY(const RigEntry list, member_entry(ensemble, is_projector ? "projectors" : "cameras"));
    if (list.node->items.empty()) return rig_entry_error(list, "expected at least one device, found none.");
    for (std::size_t i = 0; i < list.node->items.size(); ++i) {
      const RigEntry entry{fmt::format("{}.{}", list.path, i), &list.node->items[i]};
      LIMN_TRY(CameraDescription device, is_projector ? read_ensemble_projector(entry) : read_kinect(entry));
      LIMN_TRY_STATUS(add_device(&device, is_projector, options, &file));
    }
  }
  move_world_to_first_camera(&file.rig);
  file.remarks.push_back(
      "the Kinect's colour images are mirrored; turn them over from left to right before Limn reads them");
  return file;
}

}  // namespace limn::exchange
