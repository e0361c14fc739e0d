#pragma once

#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "validate/hardware_report/open_devices.h"
#include "validate/hardware_report/questions.h"

namespace limn::validate {

/// Captures the board in this many placements into the folder of devices.captures(), as `limn calibrate`
/// does. Complete placements of an interrupted capture with the same devices are kept. A person is asked to
/// hold the board before each one; `questions` null: the virtual rig holds it.
Status capture_board(const OpenDevices& devices, int placements, Questions* questions);

/// What a camera shows of the board.
struct BoardInCamera {
  std::string camera;
  std::vector<int> corners;         ///< for each placement: how many corners were found
  std::vector<std::string> images;  ///< for each placement: the white image, relative to the captures folder
};
/// Searches the board in the captured placements. Error: an image is missing or damaged.
Result<std::vector<BoardInCamera>> find_captured_board(const calib::CaptureSet& captures, int placements);

/// Sentences about what is odd and what to do; empty: nothing is.
std::vector<std::string> odd_in(const std::vector<BoardInCamera>& cameras);

}  // namespace limn::validate
