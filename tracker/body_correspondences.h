#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "tracker/detection.h"
#include "tracker/pose_fit.h"

namespace limn::tracker {

/// Residuals beyond this many standard deviations count linearly, for example a corner under a finger.
constexpr double k_huber = 3;

/// What one camera detected at one moment.
struct View {
  const Imager* camera = nullptr;
  std::span<const Detection> detections;
};

/// One marker of a body in one view, with all detections there that carry its name.
struct MarkerCorrespondences {
  const BodyMarker* marker = nullptr;
  const Imager* camera = nullptr;
  std::vector<const Detection*> detections;
  std::vector<std::array<PointObservation, 4>> corners;  ///< One entry for each detection.
};

/// A body's markers in the images of one moment. Borrows bodies, cameras and detections.
using BodyCorrespondences = std::vector<MarkerCorrespondences>;

BodyCorrespondences correspondences(const Body& body, std::span<const View> views);

/// The corners that a body's pose is computed from. Where a marker was found twice in an image, these are the
/// corners of the detection that agrees best with the pose.
struct ChosenCorners {
  std::vector<PointObservation> observations;
  int marker_count = 0;
};
ChosenCorners corners_at(const BodyCorrespondences& correspondences, const Pose& world_from_body);

enum class Minima { all, predicted };

/// The local minima of the body's robust reprojection error, at most two, likeliest first. The second is the
/// other branch of the planar ambiguity, where there is one. Every marker proposes both of its branches as
/// starts. If one of the `predicted` poses leads to a minimum that explains the corners, only the largest
/// marker proposes starts; with Minima::predicted no marker does.
std::vector<PoseFit> minima(const BodyCorrespondences& correspondences,
                            std::span<const Pose> predicted = {},
                            Minima wanted = Minima::all);

/// Whether a detection is this marker. File names are compared without their folders.
bool is_marker(const MarkerName& found, const MarkerName& wanted);

}  // namespace limn::tracker
