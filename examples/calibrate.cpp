// calibrate CAPTURES OUT [BOARD]: calibrates projectors and cameras from a captures folder, or with the
// board's name (charuco:8x6:40mm) cameras from photographs of it. Ends with 1 if the result should not be
// used.
#include <cstdio>

#include "limn/calibration.h"
#include "limn/error.h"

int main(int count, char** words) try {
  if (count != 3 && count != 4) {
    std::fprintf(stderr, "calibrate CAPTURES OUT [BOARD]\n");
    return 2;
  }
  limn::SolveOptions options;
  if (count == 4) {
    options.cameras_only = true;
    options.board = words[3];
  }
  options.progress = [](const limn::Progress& progress) {
    std::fprintf(stderr, "%s %d/%d\n", progress.stage.c_str(), progress.done, progress.total);
    return true;  // false would stop
  };
  const limn::Calibration calibration = limn::solve(words[1], words[2], options);

  std::printf("%s\n", calibration.explanation.c_str());
  for (const limn::DeviceQuality& device : calibration.devices)
    std::printf("%s: %.3f px, %d points\n", device.name.c_str(), device.rms_px, device.points);
  std::printf("held-out %.3f px\n", calibration.held_out_rms_px);
  for (const limn::Fault& fault : calibration.faults) std::printf("%s\n", fault.text.c_str());
  for (const std::string& sentence : calibration.advice) std::printf("%s\n", sentence.c_str());
  return calibration.verdict == limn::Verdict::reject ? 1 : 0;
} catch (const limn::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
