#include "core/camera_files/foreign_camera.h"

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

namespace limn {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view k_numpy_help =
    "Convert it in Python: json.dump({'camera_matrix': K.tolist(), 'distortion_coefficients': D.tolist(), "
    "'image_width': W, 'image_height': H}, open('camera.json', 'w')).";
constexpr std::string_view k_opencv_help =
    "Write its values as an OpenCV file: camera_matrix [fx, 0, cx, 0, fy, cy, 0, 0, 1], "
    "distortion_coefficients [k1, k2, "
    "p1, p2, k3], image_width, image_height.";
constexpr std::string_view k_colmap_help =
    "Write its values as an OpenCV file: camera_matrix [fx, 0, cx - 0.5, 0, fy, cy - 0.5, 0, 0, 1] (its "
    "pixel (0, 0) is a "
    "corner), distortion_coefficients [k1, k2, p1, p2], or for OPENCV_FISHEYE [k1, k2, k3, k4] and "
    "fisheye_model: 1.";

struct Start {
  std::string_view bytes;
  ForeignFormat format;
};

// How binary files start.
const std::vector<Start>& binary_starts() {
  static const std::vector<Start> starts = {
      {"\x93NUMPY"sv, {"a numpy array (.npy)", k_numpy_help}},
      {"PK\x03\x04"sv, {"a numpy archive (.npz) or another Zip archive", k_numpy_help}},
      {"\x80\x02"sv, {"a Python pickle", k_numpy_help}},
      {"\x80\x03"sv, {"a Python pickle", k_numpy_help}},
      {"\x80\x04"sv, {"a Python pickle", k_numpy_help}},
      {"\x80\x05"sv, {"a Python pickle", k_numpy_help}},
      {"MATLAB 5.0"sv,
       {"a MATLAB file (.mat)",
        "In MATLAB: [K, D, size] = cameraIntrinsicsToOpenCV(params), then write them as an OpenCV file "
        "(camera_matrix, distortion_coefficients, image_width, image_height)."}},
      {"\x89HDF"sv, {"an HDF5 file (MATLAB 7.3 and others)", k_opencv_help}},
      {"\x89PNG"sv, {"an image (PNG)", "Name a camera file, not an image."}},
      {"\xff\xd8\xff"sv, {"an image (JPEG)", "Name a camera file, not an image."}},
      {"\x1f\x8b"sv, {"a compressed file (gzip)", "Unpack it first."}},
      {"SQLite format"sv, {"a database of COLMAP or ROS 2", "Export the camera to a text file."}},
      {"#ROSBAG"sv,
       {"a ROS bag", "Write the message: rostopic echo -n 1 -b FILE /camera_info > camera.yaml."}},
  };
  return starts;
}

struct Words {
  std::vector<std::string_view> all;  // the format has all of them
  ForeignFormat format;
};

// Words that only one format has, in text.
const std::vector<Words>& format_words() {
  static const std::vector<Words> words = {
      {{"!!python/object"}, {"objects of numpy that PyYAML wrote", k_numpy_help}},
      {{"# Camera list with one line of data per camera"}, {"COLMAP's cameras.txt", k_colmap_help}},
      {{"# Bundle file"}, {"a Bundler file", k_opencv_help}},
      {{"# oST version"},
       {"an INI file of ROS's camera_calibration (ost.txt)",
        "Convert it: rosrun camera_calibration_parsers convert ost.ini ost.yaml."}},
      {{"Calibration results", "reprojection error"},
       {"a report of Kalibr", "Use the camchain.yaml beside it."}},
      {{"<photoscan"}, {"an Agisoft Metashape file", "In Metashape: export the calibration as OpenCV XML."}},
      {{"<calibration>", "<projection>"},
       {"an Agisoft Metashape calibration",
        "In Metashape: export the calibration as OpenCV XML (Tools, Camera Calibration)."}},
      {{"<lensdatabase"}, {"a Lensfun file", "Calibrate the camera with limn calibrate."}},
      {{"<x:xmpmeta"}, {"an Adobe lens profile", "Calibrate the camera with limn calibrate."}},
      {{"<MPCDI"}, {"an MPCDI file", "Read it with limn import."}},
      {{"CameraModelCRT"},
       {"a project of calib.io's Calibrator", "Export the cameras from it as OpenCV YAML."}},
      {{"\"sfm_data_version\""}, {"an OpenMVG scene", k_colmap_help}},
      {{"\"fl_x\""}, {"a transforms.json of nerfstudio or instant-ngp", k_colmap_help}},
      {{"\"projection_type\"", "\"focal"},
       {"an OpenSfM camera_models.json",
        "Multiply its focal length by the larger side of the image, and write an OpenCV file (camera_matrix, "
        "distortion_coefficients)."}},
      {{"\"CalibrationInformation\""}, {"a calibration of the Azure Kinect", k_opencv_help}},
      {{"\"limn.rig/1\""}, {"a rig of Limn", "Use the NAME.cameramodel beside it."}},
      {{"\"schema\"", "\"limn."}, {"another file of Limn", "Use a NAME.cameramodel."}},
      {{"Focus:foc:"}, {"a HALCON camera file", k_opencv_help}},
  };
  return words;
}

struct Line {
  std::regex pattern;
  ForeignFormat format;
};

// Lines of formats that have no words of their own.
const std::vector<Line>& format_lines() {
  constexpr auto k_options = std::regex::multiline | std::regex::optimize;
  static const std::vector<Line> lines = {
      {std::regex(
           R"(^[ \t]*[0-9]+ (SIMPLE_|FULL_)?(PINHOLE|RADIAL|OPENCV|FOV|THIN_PRISM)(_FISHEYE)? [0-9]+ [0-9]+ )",
           k_options),
       {"COLMAP's cameras.txt", k_colmap_help}},
      {std::regex(R"(^(fc|kc|KK|fc_left|KK_left) *= *\[)", k_options),
       {"a Calib_Results.m of the Caltech MATLAB toolbox",
        "Write an OpenCV file: camera_matrix [fc(1), alpha_c*fc(1), cc(1), 0, fc(2), cc(2), 0, 0, 1], "
        "distortion_coefficients kc, image_width nx, image_height ny."}},
      {std::regex(R"(^\[(LEFT|RIGHT)_CAM_)", k_options),
       {"a calibration of a ZED camera (.conf)", k_opencv_help}},
      {std::regex(R"(^\[\[?[A-Za-z_][A-Za-z0-9_.: -]*\]\]?[ \t\r]*$)", k_options),
       {"an INI or TOML file", k_opencv_help}},
  };
  return lines;
}

}  // namespace

std::optional<ForeignFormat> foreign_format(std::string_view bytes) {
  for (const Start& start : binary_starts())
    if (bytes.starts_with(start.bytes)) return start.format;
  for (const Words& words : format_words()) {
    const auto has = [&](std::string_view word) { return bytes.find(word) != std::string_view::npos; };
    if (std::ranges::all_of(words.all, has)) return words.format;
  }
  const std::string start(bytes.substr(0, 2000));
  for (const Line& line : format_lines())
    if (std::regex_search(start, line.pattern)) return line.format;
  return std::nullopt;
}

}  // namespace limn
