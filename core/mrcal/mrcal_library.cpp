#include "core/mrcal.h"
#include "core/program_library.h"

LIMN_LIBRARY_VERSION(LIMN_VERSION)

extern "C" __attribute__((visibility("default"))) const limn::MrcalFunctions* limn_mrcal_functions() {
  static const limn::MrcalFunctions functions = {
      .lensmodel_type_from_name = &mrcal_lensmodel_type_from_name,
      .lensmodel_from_name = &mrcal_lensmodel_from_name,
      .lensmodel_metadata = &mrcal_lensmodel_metadata,
      .lensmodel_num_params = &mrcal_lensmodel_num_params,
      .knots_for_splined_models = &mrcal_knots_for_splined_models,
      .project = &mrcal_project,
      .project_pinhole = &mrcal_project_pinhole,
      .unproject = &mrcal_unproject,
      .write_cameramodel_file = &mrcal_write_cameramodel_file,
  };
  return &functions;
}
