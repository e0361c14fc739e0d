#pragma once

#include <filesystem>
#include <opencascade/NCollection_DataMap.hxx>
#include <opencascade/TDocStd_Document.hxx>
#include <opencascade/TopTools_ShapeMapHasher.hxx>
#include <opencascade/TopoDS_Shape.hxx>
#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/cad/cad_model.h"
#include "exchange/cad/progress_lines.h"

namespace limn::cad {

/// The names of single shapes of a product: solids, surface models, curves.
using ShapeNames = NCollection_DataMap<TopoDS_Shape, std::string, TopTools_ShapeMapHasher>;

/// A CAD file in OpenCASCADE's document (XDE), whose shapes are in millimetres, with what the document does
/// not keep.
struct OcctDocument {
  Handle(TDocStd_Document) document;
  std::string format = {}, schema = {}, unit = {};  ///< As CadModel's.
  double metres_per_unit = 1e-3;
  std::vector<CadSource> sources = {};  ///< The file and those that it refers to, before they were read.
  ShapeNames shape_names = {};          ///< The document itself names only products.
  std::string unread = {};              ///< Kinds of shapes that are in the file but are not read.
  std::vector<std::string> warnings = {};
};

/// "a STEP file", "an IGES file".
std::string a_file(const std::string& format);

/// An empty document.
Handle(TDocStd_Document) new_document();

/// Reads a STEP or IGES file, in the format that its name ends in, and the STEP files below its folder that
/// it refers to. Errors: not readable, damaged, without shapes, an assembly that contains itself, a reference
/// to a file elsewhere.
Result<OcctDocument> read_document(const std::filesystem::path& path, ProgressLines* progress);

}  // namespace limn::cad
