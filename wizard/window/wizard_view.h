#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/judge/assess.h"
#include "calib/observations.h"
#include "wizard/capture/exposure_check.h"
#include "wizard/steps.h"

namespace limn::apps {

/// Where in an imager's image boards were seen: counts in cells of a grid over the image, row by row.
struct SeenCells {
  int columns = 0, rows = 0;
  std::vector<int> counts;
  /// Share of the cells with at least one.
  double share() const;
};

/// The cells of one imager: points of `px` in an image of width x height, `columns` across.
SeenCells cells_of(const std::vector<Eigen::Vector2d>& px, int width, int height, int columns = 24);

/// What the wizard's window shows at a moment.
struct WizardView {
  struct Step {
    WizardState state = WizardState::waits;
    std::string words = {};  ///< what came of it
  };
  struct Camera {
    std::string name;
    int width = 0, height = 0;
    cv::Mat image = {};                         ///< newest, 8-bit grey or BGR; empty: none yet
    std::vector<Eigen::Vector2d> corners = {};  ///< of the board, as last found
    std::vector<Eigen::Vector2d> target =
        {};  ///< outline of where to hold the board; empty: not in this image
    SeenCells seen = {};
  };
  struct Projector {
    std::string name;
    int width = 0, height = 0;
    SeenCells seen = {};
  };
  struct Judged {
    std::string pose;
    std::optional<double> held_out_px, predicted_mm;  ///< none: no rig yet
  };
  std::array<Step, k_wizard_steps> steps;  ///< in the order of WizardStep
  std::vector<ExposureReading> light;      ///< as the exposure step saw it
  std::vector<Camera> cameras;
  std::vector<Projector> projectors;
  int pose = 0, poses = 0;  ///< number of the pose in work, of how many planned
  std::string place;        ///< where to hold the board, in words
  bool is_capturing = false;
  int images = 0, images_of = 0;  ///< of this pose
  std::vector<Judged> judged;
  std::string advice;  ///< whether more poses help
  std::vector<calib::Fault> faults;
  bool has_rig = false;
  bool awaits_prototype = false;
  std::string verdict;  ///< in words, once there is a rig
  calib::Verdict worth = calib::Verdict::reject;
  std::vector<std::string> to_do;     ///< the report's advice
  std::vector<calib::ErrorMap> maps;  ///< of the rig
  bool is_leaving = false, is_over = false;
  std::string failure;  ///< why it ended without a rig; empty: it did not
};

}  // namespace limn::apps
