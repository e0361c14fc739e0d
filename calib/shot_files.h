#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::calib {

/// Whether name `a` comes before `b` when the numbers in them are compared as numbers: 2 before 10.
bool natural_less(const std::string& a, const std::string& b);

/// Names of directories or of files in `folder` that match `pattern` (* matches any text, ? any character),
/// in the order of natural_less.
std::vector<std::string> names_in(const std::filesystem::path& folder,
                                  const std::string& pattern,
                                  bool directories);

/// Where the photographs of another program are.
struct ShotPlaces {
  std::filesystem::path folder;
  /// Patterns of the pose directories' names, separated by commas. Where no directory matches, the folder is
  /// flat: it holds the images of all poses.
  std::string poses = "pose*";
  /// Pattern of the images' names; for several cameras one for each, separated by commas, each perhaps with
  /// the camera's name before it: `left_*.png,right_*.png`, `camera0=left_*,camera1=right_*`. A pattern may
  /// begin with a directory's: `left/*.png`. Files that are no images by their names' endings are left out.
  /// With one pattern, names that differ in a word such as cam0 and cam1, or left and right, are cameras'
  /// names.
  std::string shots = "*";
  std::vector<std::string> skip = {};  ///< names of poses to leave out; a name that no pose has is an error
};

/// The images of one pose: files[camera][k], in the order of their numbers.
struct ShotPose {
  std::string name;
  std::vector<std::vector<std::filesystem::path>> files;
};

struct ShotFiles {
  std::vector<std::string> cameras;  ///< their names: camera0 … unless --shots gives others
  std::vector<ShotPose> poses;       ///< in the order of natural_less
};

/// Finds the images of every pose and camera. In a flat folder the pose of an image is what remains of the
/// pattern's variable part without the image's number, which is the last number in it; it is another number
/// where only that gives every pose a number of images for which `is_possible` is true. A single series that
/// is several times as long as a possible one is cut into poses. Poses of several cameras belong together by
/// the same rest. Errors: no folder, no poses, no images, a pose of one camera that another lacks.
Result<ShotFiles> find_shots(const ShotPlaces& places, const std::function<bool(int)>& is_possible);

/// Finds photographs of which every camera has one for each pose: files[camera] is empty where a camera has
/// none. They are in pose folders (files[camera] then holds all images there), in one folder, where poses of
/// several cameras have the same text in place of the patterns' wildcards, or in a folder for each camera,
/// which gives its name. Errors: no folder, a pattern without photographs.
Result<ShotFiles> find_photographs(const ShotPlaces& places);

}  // namespace limn::calib
