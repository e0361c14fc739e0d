#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/files/cad_program.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Whether a file of this name is a CAD file that limn-cad reads: STEP (.step, .stp) or IGES (.iges, .igs).
bool is_cad_name(const std::filesystem::path& path);

/// Whether a file of this name keeps what was made of a CAD file beside it (cad_as_glb).
bool is_cad_cache_name(const std::filesystem::path& path);

/// How a CAD file becomes triangles: exchange/cad/cad_model.h says what the numbers mean.
struct CadOptions {
  double chord_mm = 0.1, angle_deg = 20;
  CadLimits limits = {};
};

/// What is done about a CAD file that has to be read, which may take minutes.
struct CadWait {
  std::stop_token stop = {};  ///< Its reading ends with an error when this is requested.
  /// If given, the file is added here instead of being read, with an error that says that it is being read.
  std::vector<std::filesystem::path>* unread = nullptr;
};

/// A CAD file as triangles.
struct CadGlb {
  std::filesystem::path path;  ///< In metres.
  double metres_per_unit = 1;  ///< The unit that the CAD file states.
  std::vector<std::string> warnings;
};

/// The GLB of a CAD file. It is made by limn-cad and kept as `.FILE.glb` beside the file, or in the user's
/// cache folder where the file's folder cannot be written, until the file, a file that it refers to or the
/// options change. A file that cannot be read is not tried again until it, or a CAD file beside one that
/// refers to others, changes (`.FILE.failed`); what is not the file's fault, such as a program that does not
/// start, is tried again. Errors: no regular file; as run_limn_cad().
Result<CadGlb> cad_as_glb(const std::filesystem::path& file,
                          const CadOptions& options = {},
                          const CadWait& wait = {});

/// What the GLB's content is in the unit and with the warnings of the CAD file.
MeshContent with_cad_unit(MeshContent content, const CadGlb& glb);

/// Reads a CAD file as a mesh format. Only load_mesh() reads the GLB in a process of its own.
Result<MeshContent> read_cad(const std::filesystem::path& path);

}  // namespace limn::scene
