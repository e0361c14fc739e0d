#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/data_tree.h"

namespace limn {

/// What an entry of a camera file means, whatever the program that wrote it calls it.
enum class CameraEntry {
  matrix,      ///< The camera matrix, or the list fx, fy, cx, cy.
  distortion,  ///< The list of distortion coefficients.
  value,       ///< A single number: fx, cy, k1, p2, skew …
  width,
  height,      ///< One side of the image, in pixels.
  size,        ///< Width and height.
  shape,       ///< Height and width, as numpy has them.
  model,       ///< The name of the lens model.
  is_fisheye,  ///< Whether the coefficients are those of a fisheye lens.
  binning,
  region,             ///< ROS: how the image differs from the calibrated one.
  from_previous,      ///< Kalibr: the pose relative to the previous camera.
  unknown_distortion  ///< Looks like a part of the lens, but is none of the above.
};

struct CameraEntryName {
  CameraEntry entry = CameraEntry::matrix;
  std::string camera;  ///< "1", "left" … where the key says which camera it belongs to; empty: the only one.
  std::string value;   ///< For `value`: fx, fy, cx, cy, skew, k1 … k6, p1, p2, s1 … s4.
};

/// The meaning of a key; nullopt: it has nothing to do with the lens. The node decides where a name has two
/// meanings (K1: a matrix; k1: a number).
std::optional<CameraEntryName> camera_entry(std::string_view key, const DataNode& node);

/// What a lens model's name says about the coefficients.
enum class LensWord {
  neutral,  ///< "pinhole": nothing.
  none,     ///< There is no distortion.
  opencv,
  fisheye,
  inverse  ///< RealSense's inverse model, which is OpenCV's only where all coefficients are 0.
};

/// Nullopt: Limn does not know this model.
std::optional<LensWord> lens_word(std::string_view text);

/// Letters and digits alone, in lower case.
std::string plain_name(std::string_view key);

}  // namespace limn
