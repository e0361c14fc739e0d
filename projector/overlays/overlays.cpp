#include "projector/overlays/overlays.h"

#include <array>
#include <opencv2/imgproc.hpp>

#include "projector/overlays/grid_and_split.h"
#include "projector/overlays/marker_signs.h"

namespace limn::projector {
namespace {

// A sign is drawn this many times larger and then made smaller, so that its edges are smooth.
constexpr int k_sign_finer = 3;

// Draws one overlay after the other into a projector's image.
class OverlayPen {
 public:
  explicit OverlayPen(const OverlayTarget& target) : target_(target) {}

  void operator()(const SplitOverlay& split) {
    if (!target_.renderer) return;
    const cv::Mat& surface = points();
    const cv::Mat left = target_.renderer->projector_image(target_.projector, split.left, *target_.viewer);
    *target_.image = split_at(surface, split.x_m, left, *target_.image);
  }
  void operator()(const GridOverlay&) {
    if (!target_.renderer) return;
    const cv::Mat& surface = points();
    draw_grid(surface, target_.renderer->blend(target_.projector, target_.posed), target_.image);
  }
  void operator()(const RingOverlay& ring) {
    if (ring.projector != target_.projector) return;
    draw_ring(target_.imager, ring.world_from_marker, ring.size_m, ring.colour, ring.strength, target_.image);
  }
  void operator()(const WordOverlay& word) {
    if (word.projector != target_.projector) return;
    draw_word(target_.imager, word.world_from_marker, word.size_m, word.text, word.strength, target_.image);
  }
  void operator()(const SignOverlay& sign) {
    if (sign.projector != target_.projector) return;
    if (sign.place) {
      if (const auto& world_from_prototype = target_.posed.world_from_prototype)
        draw_pairing_overlay(sign.image, *sign.place, target_.imager, *world_from_prototype, target_.image);
      return;
    }
    const cv::Rect middle(
        {(target_.image->cols - sign.image.cols) / 2, (target_.image->rows - sign.image.rows) / 2},
        sign.image.size());
    sign.image.copyTo((*target_.image)(middle));
  }

 private:
  // The point of the prototype that each pixel illuminates.
  const cv::Mat& points() {
    if (!points_) points_ = target_.renderer->surface_points(target_.projector, target_.posed);
    return *points_;
  }

  const OverlayTarget& target_;
  std::optional<cv::Mat> points_;
};

}  // namespace

void draw(std::span<const Overlay> overlays, const OverlayTarget& target) {
  OverlayPen pen(target);
  for (const Overlay& overlay : overlays) std::visit(pen, overlay);
}

void draw_pairing_overlay(const cv::Mat& sign,
                          const OverlayPlace& place,
                          const Imager& projector,
                          const Pose& world_from_prototype,
                          cv::Mat* image) {
  std::array<cv::Point2f, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const double right = i == 1 || i == 2, down = i >= 2;
    const auto px = projector.project(world_from_prototype *
                                      (place.p_corner + right * place.d_right + down * place.d_down));
    if (!px) return;
    corners[i] = cv::Point2f(static_cast<float>(px->x()), static_cast<float>(px->y()));
  }
  const cv::Rect box = cv::boundingRect(corners) & cv::Rect({}, image->size());
  if (box.empty()) return;
  for (cv::Point2f& corner : corners) corner -= cv::Point2f(cv::Point(box.tl()));
  const float width = static_cast<float>(sign.cols) - 0.5F, height = static_cast<float>(sign.rows) - 0.5F;
  const std::array<cv::Point2f, 4> from = {
      {{-0.5F, -0.5F}, {width, -0.5F}, {width, height}, {-0.5F, height}}};
  const cv::Mat turn = cv::getPerspectiveTransform(from.data(), corners.data());
  // Many of the sign's pixels fall on one pixel of the image: it is drawn larger and made smaller, so that
  // edges are smooth.
  const cv::Mat larger = (cv::Mat_<double>(3, 3) << k_sign_finer, 0, 0.5 * (k_sign_finer - 1),  //
                          0, k_sign_finer, 0.5 * (k_sign_finer - 1),                            //
                          0, 0, 1);
  cv::Mat cover(sign.size(), CV_8U, cv::Scalar(255)), drawn, share;
  cv::warpPerspective(sign, drawn, larger * turn, box.size() * k_sign_finer, cv::INTER_LINEAR,
                      cv::BORDER_REPLICATE);  // else the edge fades, also between signs side by side
  cv::warpPerspective(cover, share, larger * turn, box.size() * k_sign_finer, cv::INTER_NEAREST);
  cv::resize(drawn, drawn, box.size(), 0, 0, cv::INTER_AREA);
  cv::resize(share, share, box.size(), 0, 0, cv::INTER_AREA);
  drawn.copyTo((*image)(box), share > 127);
}

}  // namespace limn::projector
