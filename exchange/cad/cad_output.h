#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"
#include "exchange/cad/cad_model.h"

namespace limn::cad {

/// What a CAD file becomes.
enum class TakenAs {
  part,     ///< One file with everything.
  parts,    ///< A file for each solid at each place.
  variants  ///< A file for each solid, at the first of its places.
};
inline constexpr EnumNames<TakenAs, 3> k_taken_as{{"part", "parts", "variants"}};

/// A GLB that was written.
struct WrittenPart {
  std::string name;
  std::filesystem::path file;
};

struct WrittenParts {
  std::vector<WrittenPart> parts;
  std::vector<std::string> warnings;
};

/// Writes the model into the file `out` (as one part), or into files of the folder `out`, named after the
/// solids, all of them or none. All files are in the frame of the CAD file, so that together they stand as in
/// the assembly. Files that an earlier run made of a CAD file of the same name are replaced; those of them
/// that no solid replaces stay, with a warning. Error: another file has the name of a solid.
Result<WrittenParts> write_parts(const CadModel& model,
                                 TakenAs as,
                                 const Tessellation& how,
                                 const std::filesystem::path& out);

/// The report limn.cad/1 (docs/formats.md).
nlohmann::ordered_json cad_report(const CadModel& model,
                                  const Tessellation& how,
                                  const WrittenParts& written);

}  // namespace limn::cad
