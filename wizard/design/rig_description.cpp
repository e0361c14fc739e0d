#include "wizard/design/rig_description.h"

#include <cmath>

#include "core/config.h"
#include "wizard/design/sight_lines.h"

namespace limn::design {
namespace {

using Eigen::Vector3d;

// Direction from the volume's centre to a position that is turned by these angles to the right and up from
// the front (-y).
Vector3d direction_of(const ConfigNode& node) {
  const double right = k_degree * node.at("right_deg").number(), up = k_degree * node.at("up_deg").number();
  return {std::sin(right) * std::cos(up), -std::cos(right) * std::cos(up), std::sin(up)};
}

// The imager's position: eye_m, or relative to the volume's centre.
Vector3d place_of(const ConfigNode& node, const Vector3d& p_centre) {
  const auto from = node.find("from");
  if (!from) return node.at("eye_m").vector3();
  if (node.find("eye_m")) from->problem("expected eye_m or from, found both.");
  from->only({"distance_m", "right_deg", "up_deg"});
  return p_centre + from->at("distance_m").positive() * direction_of(*from);
}

Imager imager_of(const ConfigNode& node, const Vector3d& p_centre) {
  Imager imager;
  imager.name = node.at("name").text();
  const auto [width, height] = node.at("size").image_size(16);
  imager.width = width;
  imager.height = height;
  double focal = 1;
  const auto fov = node.find("fov_deg"), throw_ratio = node.find("throw");
  if (fov.has_value() == throw_ratio.has_value()) {
    node.problem(
        "expected either fov_deg (horizontal) or throw (distance / image width), found both or none.");
  } else if (fov) {
    const double degrees = fov->positive();
    if (degrees >= 150) fov->problem(fmt::format("expected less than 150 degrees, found {}.", degrees));
    focal = imager.width / (2 * std::tan(degrees * k_degree / 2));
  } else {
    focal = throw_ratio->positive() * imager.width;
  }
  const auto shift = node.find("shift");
  const double cy = (imager.height - 1) / 2.0 + (shift ? shift->number() : 0) * imager.height;
  imager.lens =
      Lens::create("LENSMODEL_OPENCV4", {focal, focal, (imager.width - 1) / 2.0, cy, 0, 0, 0, 0}).value();
  const Vector3d p_eye = place_of(node, p_centre);
  const auto target = node.find("target_m");
  const Vector3d p_target = target ? target->vector3() : p_centre;
  if ((p_target - p_eye).norm() < 0.01) {
    node.problem("expected a target at some distance from the imager, found both in one place.");
  } else {
    imager.imager_from_world = upright_looking_at(p_eye, p_target);
  }
  return imager;
}

void read_noise(const ConfigNode& root, DescribedRig* described) {
  const auto noise = root.find("noise");
  if (!noise) return;
  noise->only({"corner_px", "match_px", "marker_px"});
  if (const auto px = noise->find("corner_px")) described->corner_px = px->positive();
  if (const auto px = noise->find("match_px")) described->match_px = px->positive();
  if (const auto px = noise->find("marker_px")) described->marker_px = px->positive();
}

}  // namespace

Result<DescribedRig> load_described(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.described/1"));
  const ConfigNode root = config.root();
  root.only(
      {"schema", "volume", "board", "poses", "noise", "marker_mm", "room_lux", "cameras", "projectors"});
  DescribedRig described;
  const ConfigNode volume = root.at("volume");
  volume.only({"centre_m", "size_m", "front"});
  described.p_centre = volume.at("centre_m").vector3();
  described.size_m = volume.at("size_m").vector3();
  if (!(described.size_m.minCoeff() > 0)) volume.at("size_m").problem("expected three positive sizes.");
  if (const auto front = volume.find("front")) {
    front->only({"right_deg", "up_deg"});
    described.d_front = direction_of(*front);
  }
  const auto board = calib::Board::parse(root.at("board").text());
  if (!board) root.at("board").problem(board.message());
  if (board) described.board = *board;
  if (const auto poses = root.find("poses")) {
    described.poses = poses->integer();
    if (described.poses < 4 || described.poses > 60)
      poses->problem(fmt::format("expected 4 to 60 placements of the board, found {}.", described.poses));
  }
  if (const auto marker = root.find("marker_mm")) described.marker_m = marker->positive() / 1000;
  if (const auto lux = root.find("room_lux")) described.room_lux = lux->positive();
  read_noise(root, &described);
  for (const ConfigNode& node : root.at("cameras").items()) {
    node.only({"name", "size", "fov_deg", "throw", "eye_m", "from", "target_m"});
    described.rig.cameras.push_back(imager_of(node, described.p_centre));
  }
  for (const ConfigNode& node : root.at("projectors").items()) {
    node.only({"name", "size", "fov_deg", "throw", "shift", "eye_m", "from", "target_m", "lumens"});
    described.rig.projectors.push_back(imager_of(node, described.p_centre));
    const auto lumens = node.find("lumens");
    described.lumens.push_back(lumens ? lumens->positive() : 0);
  }
  if (described.rig.cameras.empty()) root.at("cameras").problem("expected at least one camera, found none.");
  if (described.rig.projectors.empty())
    root.at("projectors").problem("expected at least one projector, found none.");
  LIMN_TRY_STATUS(config.status());
  return described;
}

}  // namespace limn::design
