#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/judge/assess.h"
#include "calib/observations.h"
#include "wizard/capture/exposure_check.h"
#include "wizard/steps.h"

namespace limn::wizard {

/// Where boards were seen in an imager's image: a count for each cell of a grid over the image, row by row.
struct SeenCells {
  int columns = 0, rows = 0;
  std::vector<int> counts;
  /// Share of the cells with a count of at least one.
  double share() const;
};

/// Counts the points `px` of an image of width x height; `columns` is the number of cells across.
SeenCells cells_of(const std::vector<Eigen::Vector2d>& px, int width, int height, int columns = 24);

/// The content of the wizard's window at one moment.
struct WizardView {
  struct Step {
    WizardState state = WizardState::waits;
    std::string words = {};  ///< the result, or the state, as text
  };
  struct Camera {
    std::string name;
    int width = 0, height = 0;
    cv::Mat image = {};                         ///< newest image, 8-bit grey or BGR; empty: none yet
    std::vector<Eigen::Vector2d> corners = {};  ///< corners of the board as last found
    /// Outline of the board where it should be held; empty: not in this image.
    std::vector<Eigen::Vector2d> target = {};
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
  calib::Board board = {};
  bool asks_for_size = false;  ///< whether nobody has measured the board yet, whose text may be wrong
  std::array<Step, k_wizard_steps> steps;  ///< in the order of WizardStep
  std::vector<ExposureReading> light;      ///< results of the exposure step
  std::vector<Camera> cameras;
  std::vector<Projector> projectors;
  int pose = 0, poses = 0;  ///< index of the current pose; number of planned poses
  std::string place;        ///< where to hold the board, as text
  bool is_capturing = false;
  int images = 0, images_of = 0;  ///< images of this pose: captured, and needed in all
  std::vector<Judged> judged;
  std::string advice;  ///< whether more poses help
  std::vector<calib::Fault> faults;
  bool has_rig = false;
  bool awaits_prototype = false;
  std::string verdict;  ///< as a sentence, once there is a rig
  calib::Verdict worth = calib::Verdict::reject;
  std::vector<std::string> to_do;     ///< the report's advice
  std::vector<calib::ErrorMap> maps;  ///< predicted errors of the rig
  bool is_leaving = false, is_over = false;
  std::string failure;  ///< why the run failed; empty: it did not
};

}  // namespace limn::wizard
