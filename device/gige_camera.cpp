#include "device/gige_camera.h"

#include "core/program_library.h"

namespace limn::device {
namespace {

// Aravis and what it needs would lengthen every start of the program.
constexpr ProgramLibrary k_library = {.file = "liblimn_gige.so",
                                      .variable = "LIMN_GIGE",
                                      .purpose = "the driver of GigE cameras",
                                      .build_package = "libaravis-dev"};

using OpenCamera = void(const std::string&, const GigeCameraOptions&, Result<std::unique_ptr<CameraSource>>*);
using ListCameras = void(std::vector<std::string>*);

}  // namespace

Result<std::unique_ptr<CameraSource>> open_gige_camera(const std::string& id,
                                                       const GigeCameraOptions& options) {
  LIMN_TRY(void* function, library_function(k_library, "limn_open_gige_camera"));
  Result<std::unique_ptr<CameraSource>> camera = std::unique_ptr<CameraSource>();
  reinterpret_cast<OpenCamera*>(function)(id, options, &camera);
  return camera;
}

Result<std::vector<std::string>> gige_cameras() {
  LIMN_TRY(void* function, library_function(k_library, "limn_gige_cameras"));
  std::vector<std::string> ids;
  reinterpret_cast<ListCameras*>(function)(&ids);
  return ids;
}

}  // namespace limn::device
