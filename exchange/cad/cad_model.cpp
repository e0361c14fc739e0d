#include "exchange/cad/cad_model.h"

#include <limits>

namespace limn::cad {

std::size_t CadMesh::triangle_count() const {
  std::size_t count = 0;
  for (const CadPiece& piece : pieces) count += piece.triangles.size();
  return count;
}

std::size_t CadModel::triangle_count() const {
  std::size_t count = 0;
  for (const CadNode& node : nodes) count += meshes[node.mesh].triangle_count();
  return count;
}

CadBox box_of(const CadModel& model, const CadNode& node) {
  constexpr double k_far = std::numeric_limits<double>::infinity();
  CadBox box{Eigen::Vector3d::Constant(k_far), Eigen::Vector3d::Constant(-k_far)};
  const Eigen::Matrix3d turn = node.file_from_mesh.topLeftCorner<3, 3>();
  const Eigen::Vector3d shift = node.file_from_mesh.topRightCorner<3, 1>();
  for (const CadPiece& piece : model.meshes[node.mesh].pieces) {
    for (const Eigen::Vector3f& p : piece.positions) {
      const Eigen::Vector3d placed = turn * p.cast<double>() + shift;
      box.low = box.low.cwiseMin(placed);
      box.high = box.high.cwiseMax(placed);
    }
  }
  return box;
}

}  // namespace limn::cad
