#include "device/video_reader.h"

#include "core/program_library.h"

namespace limn::device {

Result<std::unique_ptr<VideoReader>> make_video_reader() {
  LIMN_TRY(void* function, library_function({.file = "liblimn_video.so",
                                             .variable = "LIMN_VIDEO",
                                             .purpose = "the reader of videos and RTSP streams",
                                             .build_package = "libopencv-dev"},
                                            "limn_make_video_reader"));
  return std::unique_ptr<VideoReader>(reinterpret_cast<VideoReader* (*)()>(function)());
}

}  // namespace limn::device
