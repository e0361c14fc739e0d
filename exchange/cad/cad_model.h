#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace limn::cad {

/// How surfaces become triangles.
struct Tessellation {
  /// The largest distance between a surface and its triangles. Up to 0.1 mm, small models are cut more
  /// finely: to 1/5000 of their diagonal, if that gives few enough triangles.
  double chord_mm = 0.1;
  double angle_deg = 20;  ///< The largest angle between the normals at the ends of a triangle's side.
  double solid_seconds =
      4;  ///< Processor time for a solid, and 20 ms a face; then a larger chord error is taken.
  std::size_t most_triangles =
      10'000'000;  ///< A model of more is refused, with the chord error that would do.
};

/// A linear colour with its opacity.
using Colour = std::array<float, 4>;

/// Triangles of one colour in metres, in the frame of their product.
struct CadPiece {
  Colour colour = {};
  std::vector<Eigen::Vector3f> positions = {};
  std::vector<Eigen::Vector3f> normals = {};  ///< The surface's own, per position.
  std::vector<std::array<std::uint32_t, 3>> triangles = {};
};

/// A solid, or the surfaces of a product without solids.
struct CadMesh {
  std::vector<CadPiece> pieces;
  double chord_error_mm = 0;  ///< The largest distance that was measured between surface and triangles.
  bool is_closed = true;
  std::size_t triangle_count() const;
};

/// A place at which a mesh stands.
struct CadNode {
  std::string name;                ///< The solid's or its product's name; never empty.
  std::vector<std::string> path;   ///< The names of the assemblies around it, outermost first.
  std::size_t mesh = 0;            ///< Index into CadModel::meshes.
  Eigen::Matrix4d file_from_mesh;  ///< In metres.
};

/// A file that the model was read from.
struct CadSource {
  std::string name;         ///< Relative to the first file's folder; the first one is the file itself.
  std::string fingerprint;  ///< fingerprint() of scene/files/fingerprint.h.
};

/// What a CAD file holds.
struct CadModel {
  std::string format;  ///< "STEP" or "IGES".
  std::string schema;  ///< "AP203", "AP214", "AP242", or as the file states it.
  std::string unit;    ///< The length unit that the file states, such as "INCH"; empty: none.
  double metres_per_unit = 1e-3;
  std::vector<CadMesh> meshes;
  std::vector<CadNode> nodes;
  std::vector<CadSource> sources;  ///< As they were before they were read.
  std::string changed_file;        ///< A source that was replaced while it was read; empty: none.
  std::vector<std::string> warnings;
  std::size_t triangle_count() const;  ///< A mesh counts at each of its places.
};

/// The smallest box around a node in the file's frame, m.
struct CadBox {
  Eigen::Vector3d low, high;
};
CadBox box_of(const CadModel& model, const CadNode& node);

}  // namespace limn::cad
