#pragma once

#include <filesystem>
#include <opencascade/TDF_Label.hxx>
#include <opencascade/TDocStd_Document.hxx>
#include <opencascade/XCAFPrs_Style.hxx>
#include <opencascade/gp_Trsf.hxx>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/cad/cad_model.h"

namespace limn::cad {

/// A product of a document at one place.
struct Leaf {
  TDF_Label product = {};
  std::string name = {};               ///< The product's; empty when the file has none.
  std::string key = {};                ///< Two leaves with the same key look the same.
  std::vector<std::string> path = {};  ///< The names of the assemblies around it, outermost first.
  gp_Trsf placed = {};                 ///< Takes the product's coordinates to those of the file, mm.
  XCAFPrs_Style style = {};            ///< For faces without a colour of their own.
  std::optional<Colour> whole = {};    ///< The colour of this place, which replaces all others.
};

/// All products of a document that are no assemblies, at each of their places.
struct Leaves {
  std::vector<Leaf> all;
  int hidden = 0;  ///< Those that the file hides are left out.
};
/// Error: they are too many; `path` is the file, for the message.
Result<Leaves> leaves_of(const Handle(TDocStd_Document) & document, const std::filesystem::path& path);

/// The linear colour of a style; grey where it has none.
Colour colour_of(const XCAFPrs_Style& style);

}  // namespace limn::cad
