#include "scene/files/exr_image.h"

#include "core/program_library.h"

namespace limn::scene {
namespace {

// OpenEXR would lengthen every start of the program.
constexpr ProgramLibrary k_library = {.file = "liblimn_exr.so",
                                      .variable = "LIMN_EXR",
                                      .purpose = "the reader and writer of OpenEXR",
                                      .build_package = "libopenexr-dev"};

using Decode = void(std::string_view, const std::string&, Result<cv::Mat>*);
using Encode = void(const cv::Mat&, const std::string&, std::string*);

}  // namespace

Result<cv::Mat> decode_exr(std::string_view bytes, const std::string& name) {
  LIMN_TRY(void* function, library_function(k_library, "limn_decode_exr"));
  Result<cv::Mat> image = cv::Mat();
  reinterpret_cast<Decode*>(function)(bytes, name, &image);
  return image;
}

Result<std::string> encode_exr(const cv::Mat& image, const std::string& comment) {
  LIMN_CHECK(image.type() == CV_32FC3);
  LIMN_TRY(void* function, library_function(k_library, "limn_encode_exr"));
  std::string bytes;
  reinterpret_cast<Encode*>(function)(image, comment, &bytes);
  return bytes;
}

}  // namespace limn::scene
