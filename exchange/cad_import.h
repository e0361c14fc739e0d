#pragma once

#include <filesystem>
#include <string>

#include "core/enum_names.h"
#include "core/result.h"
#include "scene/files/cad_program.h"

namespace limn::exchange {

/// What a CAD file becomes: one part, a part for each solid at each place, or a variant for each solid.
enum class CadTakenAs { part, parts, variants };
inline constexpr EnumNames<CadTakenAs, 3> k_cad_taken_as{{"part", "parts", "variants"}};

struct CadImportOptions {
  std::filesystem::path file;  ///< STEP or IGES.
  std::filesystem::path out;   ///< The .glb to write; a folder for parts and variants.
  CadTakenAs as = CadTakenAs::part;
  double chord_mm = 0.1, angle_deg = 20;
  double minutes = 10;   ///< Time that limn-cad may take.
  double memory_gb = 2;  ///< Memory that it may take.
  bool json = false;     ///< Print limn.cad/1.
};

/// `limn import cad`: writes a CAD file's solids as GLB, in metres and in the file's frame, and prints what
/// it holds. Errors: as run_limn_cad() of scene/files/cad_program.h; a name that does not fit `as`.
Status import_cad(const CadImportOptions& options);

}  // namespace limn::exchange
