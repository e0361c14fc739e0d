#pragma once

// mrcal's C interface, versions 2.2 to 2.4. All files of Limn include mrcal through this header, so that what
// differs between versions stands here.
// - The headers of 2.2 and 2.4 are C without `extern "C"`.
// - 2.2 declares mrcal's structs in mrcal.h, 2.4 in mrcal-types.h; mrcal.h includes that.

extern "C" {
#include <mrcal/mrcal.h>
}

#include "core/result.h"

namespace limn {

/// The functions of mrcal's library that the program uses. They are in a shared library of their own
/// (core/mrcal/), because mrcal and what it needs, LAPACK and SuiteSparse among others, would lengthen every
/// start of the program.
struct MrcalFunctions {
  decltype(&::mrcal_lensmodel_type_from_name) lensmodel_type_from_name;
  decltype(&::mrcal_lensmodel_from_name) lensmodel_from_name;
  decltype(&::mrcal_lensmodel_metadata) lensmodel_metadata;
  decltype(&::mrcal_lensmodel_num_params) lensmodel_num_params;
  decltype(&::mrcal_knots_for_splined_models) knots_for_splined_models;
  decltype(&::mrcal_project) project;
  decltype(&::mrcal_project_pinhole) project_pinhole;
  decltype(&::mrcal_unproject) unproject;
  decltype(&::mrcal_write_cameramodel_file) write_cameramodel_file;
};

/// Loads them at the first call. Error: the shared library is not there, or a library that it needs is not
/// installed.
Result<const MrcalFunctions*> mrcal_functions();

}  // namespace limn
