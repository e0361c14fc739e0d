#include "core/camera_files/camera_entries.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <set>

namespace limn {
namespace {

using Entry = CameraEntry;

// Keys as plain_name writes them. Each row: programs that write it, or their documentation's examples.
const std::map<std::string, Entry, std::less<>>& entry_table() {
  static const std::map<std::string, Entry, std::less<>> table = [] {
    std::map<std::string, Entry, std::less<>> all;
    const auto add = [&](Entry entry, std::initializer_list<const char*> names) {
      for (const char* name : names) all[name] = entry;
    };
    add(Entry::matrix, {"cameramatrix",
                        "cammatrix",
                        "cammtx",
                        "cameramat",
                        "cammat",
                        "mtx",
                        "k",
                        "m",
                        "kmat",
                        "kmatrix",
                        "matrixk",
                        "intrinsic",
                        "intrinsics",
                        "intrinsicmatrix",
                        "intrinsicsmatrix",
                        "intrinsicmat",
                        "intrinsicparameters",
                        "intrinsicparams",
                        "cameraintrinsic",
                        "cameraintrinsics",
                        "cameraintrinsicmatrix",
                        "cameraintrinsicsmatrix",
                        "calibrationmatrix",
                        "projectionparameters"});
    add(Entry::distortion,
        {"distortioncoefficients",
         "distortioncoefficient",
         "distortioncoeffs",
         "distortioncoeff",
         "distortioncoefs",
         "distortioncoef",
         "distcoefficients",
         "distcoeffs",
         "distcoeff",
         "distcoefs",
         "distcoef",
         "dist",
         "d",
         "distortion",
         "distortions",
         "distortionvector",
         "distortionvec",
         "distvec",
         "distvector",
         "distortionparameters",
         "distortionparams",
         "distortionparam",
         "distparams",
         "distparam",
         "cameradistortion",
         "cameradistortions",
         "cameradistcoeffs",
         "cameradistortioncoefficients",
         "cameradistortioncoeffs",
         "lensdistortion",
         "lensdistortioncoefficients",
         "coeffs",
         "coefficients",
         "kdist",
         "intrinsicdistortion",
         "cameraextrinsics"});  // PhotonVision called the coefficients "extrinsics" before 2024
    add(Entry::width,
        {"imagewidth", "imgwidth", "camerawidth", "framewidth", "width", "w", "resolutionx", "cols"});
    add(Entry::height,
        {"imageheight", "imgheight", "cameraheight", "frameheight", "height", "h", "resolutiony", "rows"});
    add(Entry::size,
        {"imagesize", "imgsize", "imsize", "framesize", "camerasize", "imageresolution", "cameraresolution",
         "calibrationresolution", "resolution", "size", "dim", "dimensions"});
    add(Entry::shape, {"imageshape", "imgshape", "frameshape", "shape"});
    add(Entry::model, {"distortionmodel", "distortiontype", "cameramodel", "cameratype", "lensmodel",
                       "lenstype", "modeltype", "projectionmodel", "projectiontype", "model"});
    add(Entry::binning, {"binningx", "binningy"});
    add(Entry::region, {"roi"});
    add(Entry::from_previous, {"tcncnm1"});
    return all;
  }();
  return table;
}

// Names of single numbers and what Limn calls them.
const std::map<std::string, std::string, std::less<>>& value_table() {
  static const std::map<std::string, std::string, std::less<>> table = [] {
    std::map<std::string, std::string, std::less<>> all = {
        {"ppx", "cx"}, {"ppy", "cy"}, {"u0", "cx"},      {"v0", "cy"},     {"mu", "mu"},
        {"mv", "mv"},  {"xi", "xi"},  {"taux", "tau_x"}, {"tauy", "tau_y"}};
    for (const char* name : {"fx", "fy", "cx", "cy", "skew", "p1", "p2", "k1", "k2", "k3", "k4", "k5", "k6",
                             "s1", "s2", "s3", "s4", "f"})
      all[name] = name;
    return all;
  }();
  return table;
}

bool has_list(const DataNode& node) {
  if (!node.is_text()) return true;
  const auto numbers = numbers_in(node);
  return numbers && numbers->size() > 1;
}

bool contains_any(std::string_view text, std::initializer_list<const char*> parts) {
  return std::ranges::any_of(parts,
                             [&](const char* part) { return text.find(part) != std::string_view::npos; });
}

bool is_truth(const DataNode& node) {
  static const std::set<std::string, std::less<>> words = {"0", "1", "true", "false", "yes", "no"};
  return node.is_text() && words.contains(plain_name(node.text));
}

// A part of the lens under a name that is not in the tables, also a misspelled one.
bool looks_like_distortion(std::string_view name, const DataNode& node) {
  if (is_truth(node)) return false;  // an option of the calibration
  if (contains_any(name, {"std", "error", "err", "deviation", "variance", "covar", "uncertain", "distance",
                          "undist", "distrib", "distinct"}))
    return false;
  if (contains_any(name, {"distort", "fisheye", "radial", "tangential", "coef"})) return true;
  return name.find("dist") != std::string_view::npos && has_list(node);
}

std::optional<CameraEntryName> exact_entry(std::string_view name, const DataNode& node) {
  if (node.is_text() && !has_list(node)) {
    if (const auto value = value_table().find(name); value != value_table().end())
      return CameraEntryName{Entry::value, "", value->second};
  }
  if (name.find("fisheye") != std::string_view::npos && is_truth(node))
    return CameraEntryName{Entry::is_fisheye, "", ""};
  // A "type" may be anything; only the name of a lens model counts.
  if (name == "type" && node.is_text() && lens_word(node.text)) return CameraEntryName{Entry::model, "", ""};
  const auto found = entry_table().find(name);
  if (found == entry_table().end()) return std::nullopt;
  const bool has_maps = node.is_list() && !node.items.empty() && node.items[0].is_map();
  if (has_maps) return std::nullopt;  // several cameras
  if (name == "cameraextrinsics") {   // in other programs a pose
    const DataNode* data = node.find("data");
    if (!data || data->items.size() > 14) return std::nullopt;
  }
  const bool is_short =
      name.size() == 1 && (found->second == Entry::matrix || found->second == Entry::distortion);
  if (is_short && !has_list(node)) return std::nullopt;
  return CameraEntryName{found->second, "", ""};
}

}  // namespace

std::string plain_name(std::string_view key) {
  std::string plain;
  for (const char c : key)
    if (std::isalnum(static_cast<unsigned char>(c)))
      plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return plain;
}

std::optional<CameraEntryName> camera_entry(std::string_view key, const DataNode& node) {
  const std::string name = plain_name(key);
  if (auto entry = exact_entry(name, node)) return entry;
  for (const std::string camera :
       {"left", "right", "cam0", "cam1", "cam2", "cam3", "camera0", "camera1", "camera2", "0", "1",
        "2",    "3",     "4",    "5",    "6",    "7",    "8",       "9",       "l",       "r"}) {
    if (name.size() <= camera.size()) continue;
    for (const bool is_at_end : {true, false}) {
      if (is_at_end ? !name.ends_with(camera) : !name.starts_with(camera)) continue;
      const std::string rest =
          is_at_end ? name.substr(0, name.size() - camera.size()) : name.substr(camera.size());
      auto entry = exact_entry(rest, node);
      if (!entry || entry->entry == Entry::value) continue;
      const bool is_lens = entry->entry == Entry::matrix || entry->entry == Entry::distortion;
      if (is_lens ? has_list(node) : camera.size() > 1) {
        entry->camera = camera;
        return entry;
      }
    }
  }
  if (looks_like_distortion(name, node)) return CameraEntryName{Entry::unknown_distortion, "", ""};
  return std::nullopt;
}

std::optional<LensWord> lens_word(std::string_view text) {
  static const std::map<std::string, LensWord, std::less<>> table = [] {
    std::map<std::string, LensWord, std::less<>> all;
    const auto add = [&](LensWord word, std::initializer_list<const char*> names) {
      for (const char* name : names) all[name] = word;
    };
    add(LensWord::neutral, {"pinhole", "perspective", "projective"});
    add(LensWord::none, {"none", "", "null", "rectified", "nodistortion", "undistorted", "noneorrectified"});
    add(LensWord::opencv, {"plumbbob",
                           "radtan",
                           "radtan4",
                           "radtan5",
                           "radtan8",
                           "radialtangential",
                           "radialtan",
                           "brown",
                           "brownconrady",
                           "opencv",
                           "opencv4",
                           "opencv5",
                           "opencv8",
                           "opencv12",
                           "fullopencv",
                           "rational",
                           "rationalpolynomial",
                           "thinprism",
                           "standard",
                           "polynomial",
                           "pinholeradtan",
                           "pinholeradtan8",
                           "pinholebrownconrady",
                           "pinholeplumbbob"});
    add(LensWord::fisheye, {"equidistant", "equi", "fisheye", "kannalabrandt", "kannalabrandt4",
                            "kannalabrandt8", "kb", "kb4", "kb8", "opencvfisheye", "pinholeequi",
                            "pinholeequidistant", "fisheyeequidistant", "pinholefisheye"});
    add(LensWord::inverse, {"inversebrownconrady", "modifiedbrownconrady"});
    return all;
  }();
  std::string name = plain_name(text);
  for (const std::string prefix : {"rs2distortion", "distortion", "lensmodel"})
    if (name.starts_with(prefix)) name.erase(0, prefix.size());
  const auto found = table.find(name);
  return found == table.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace limn
