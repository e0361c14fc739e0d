#include "projector/misalignment_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/median.h"
#include "projector/light_levels.h"

namespace limn::projector {
namespace {

constexpr int k_width = 640;               // approximate width of the images that are compared
constexpr int k_cell = 24;                 // side of a cell, pixels of these images
constexpr int k_reach = 24;                // largest shift, pixels of these images
constexpr int k_most_cells = 60;           // cells that are compared in a frame
constexpr double k_least_contrast = 0.02;  // standard deviation of a cell's light, as a share of white
constexpr double k_most_change = 0.2;      // recent change of a cell's light, as a share of its contrast
// A projector's share of a cell's contrast, below which the cell is not used for it.
constexpr double k_least_share = 0.2;
// Loss of correlation for each pixel of displacement. Along straight edges many displacements fit equally
// well; the smallest is the most likely.
constexpr float k_cost_of_px = 0.0005F;
constexpr double k_memory_s = 2;

cv::Size size_of(const Imager& imager, int side_px) {
  return {std::max(1, imager.width / side_px), std::max(1, imager.height / side_px)};
}

double stddev(const cv::Mat& m) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(m, mean, deviation);
  return deviation[0];
}

// For each window of a cell's size in `region`, the sum of products with `cell`. The result is indexed by the
// shift from the predicted to the found place: light that lies too far right has a positive column.
cv::Mat products(const cv::Mat& region, const cv::Mat& cell) {
  cv::Mat sums, by_shift;
  cv::matchTemplate(region, cell, sums, cv::TM_CCORR);
  cv::flip(sums, by_shift, -1);
  return by_shift;
}

// Sums over the windows, indexed in the same way.
cv::Mat sums(const cv::Mat& region) {
  cv::Mat whole, by_shift;
  cv::boxFilter(region, whole, CV_32F, {k_cell, k_cell}, {0, 0}, false);
  cv::flip(whole({0, 0, region.cols - k_cell + 1, region.rows - k_cell + 1}), by_shift, -1);
  return by_shift;
}

Displacement best(const cv::Mat& map, const cv::Mat& gains, double contrast, double px) {
  if (!(contrast > 0)) return {};
  cv::Mat likely = map.clone();
  for (int y = 0; y < map.rows; ++y)
    for (int x = 0; x < map.cols; ++x)
      likely.at<float>(y, x) -= static_cast<float>(contrast) * k_cost_of_px *
                                std::hypot(static_cast<float>(x - k_reach), static_cast<float>(y - k_reach));
  cv::Point at;
  cv::minMaxLoc(likely, nullptr, nullptr, nullptr, &at);
  const double most = map.at<float>(at);
  const auto vertex = [&](int dx, int dy) {
    const cv::Point one(at.x - dx, at.y - dy), other(at.x + dx, at.y + dy);
    const cv::Rect inside(0, 0, map.cols, map.rows);
    if (!inside.contains(one) || !inside.contains(other)) return 0.0;
    const double a = map.at<float>(one), b = most, c = map.at<float>(other);
    return a - 2 * b + c < 0 ? 0.5 * (a - c) / (a - 2 * b + c) : 0.0;
  };
  return {px * Eigen::Vector2d(at.x - k_reach + vertex(1, 0), at.y - k_reach + vertex(0, 1)), most / contrast,
          map.at<float>(k_reach, k_reach) / contrast, contrast, gains.at<float>(at)};
}

}  // namespace

MisalignmentDetector::MisalignmentDetector(const Rig& rig, std::size_t camera)
    : imager_(rig.cameras.at(camera)),
      side_px_(std::max(1, cvRound(1.0 * imager_.width / k_width))),
      light_of_levels_(projector::light_of_levels(rig, imager_.name)) {
  for (const Imager& projector : rig.projectors)
    lights_.push_back({light_of_display(rig, projector.name), {}});
  for (std::size_t i = 0; i <= lights_.size(); ++i) {
    current_.push_back(empty_sum());
    total_.push_back(empty_sum());
  }
}

void MisalignmentDetector::place(IlluminatedPatches patches) {
  LIMN_CHECK(patches.side_px == side_px_ && patches.by_projector.size() == lights_.size());
  patches_ = std::move(patches);
  cells_.clear();
  std::vector<double> depths;
  const Pose imager_from_prototype = imager_.imager_from_world * patches_.prototype_from_world.inverse();
  for (const cv::Vec4f& p : cv::Mat_<cv::Vec4f>(patches_.points))
    if (p[3] > 0) depths.push_back((imager_from_prototype * Eigen::Vector3d(p[0], p[1], p[2])).z());
  if (depths.empty()) return;
  mm_per_px_ = 1e3 * median(std::move(depths)) / imager_.lens.fx();
}

// The predicted light of a projector in the camera's image.
cv::Mat MisalignmentDetector::predicted_light(std::size_t projector, const cv::Mat& image) const {
  const cv::Mat& patch_light = patches_.by_projector[projector];
  if (image.empty()) return cv::Mat::zeros(patch_light.size(), CV_32F);
  cv::Mat light, channels[4], out;
  cv::LUT(image, lights_[projector].table, light);
  cv::split(patch_light, channels);
  cv::remap(luminance(light), out, channels[0], channels[1], cv::INTER_LINEAR);
  return out.mul(channels[2]);
}

void MisalignmentDetector::begin(const Frame& frame,
                                 std::span<const cv::Mat> shown,
                                 std::span<const cv::Mat> before,
                                 const cv::Mat& avoid) {
  LIMN_CHECK(frame.image.cols == imager_.width && frame.image.rows == imager_.height);
  LIMN_CHECK(avoid.size() == frame.image.size() && avoid.type() == CV_8U);
  LIMN_CHECK(shown.size() == lights_.size() && before.size() == lights_.size());
  cells_.clear();
  if (patches_.points.empty()) return;
  const cv::Size size = size_of(imager_, side_px_);
  cv::Mat light, usable, reached(size, CV_32F, cv::Scalar(0)), was(size, CV_32F, cv::Scalar(0));
  cv::LUT(frame.image, light_of_levels_, light);
  if (light.channels() == 3) light = luminance(light);
  const cv::Rect whole(0, 0, size.width * side_px_, size.height * side_px_);
  cv::resize(light(whole), frame_, size, 0, 0, cv::INTER_AREA);
  cv::Mat is(size, CV_32F, cv::Scalar(0));
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    lights_[i].predicted = predicted_light(i, shown[i]);
    is += lights_[i].predicted;
    was += predicted_light(i, before[i]);
    cv::Mat irradiance;
    cv::extractChannel(patches_.by_projector[i], irradiance, 2);
    reached += irradiance;
  }
  cv::Mat left_out;
  cv::resize(avoid(whole), left_out, size, 0, 0, cv::INTER_AREA);
  usable = (reached > 0) & (left_out == 0);
  white_ = cv::mean(reached, usable)[0];
  std::vector<std::pair<double, cv::Rect>> found;
  for (int y = k_reach; y + k_cell + k_reach <= size.height; y += k_cell)
    for (int x = k_reach; x + k_cell + k_reach <= size.width; x += k_cell) {
      const cv::Rect cell(x, y, k_cell, k_cell);
      if (cv::countNonZero(usable(cell)) < cell.area()) continue;
      const double contrast = stddev(is(cell));
      if (contrast < k_least_contrast * white_) continue;
      if (stddev(is(cell) - was(cell)) > k_most_change * contrast) continue;
      found.emplace_back(contrast, cell);
    }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  if (found.size() > k_most_cells) found.erase(found.begin(), found.end() - k_most_cells);
  for (const auto& [contrast, cell] : found) cells_.push_back(cell);
  for (Sum& sum : current_) sum = empty_sum();
  const double passed_s = compared_at_ == Stamp{} ? 0 : seconds_between(compared_at_, frame.captured_at);
  const double kept = std::exp(-std::max(0.0, passed_s) / k_memory_s);
  for (Sum& sum : total_) sum = {sum.map * kept, sum.gains * kept, sum.contrast * kept};
  compared_at_ = frame.captured_at;
}

bool MisalignmentDetector::compare(int cells) {
  if (cells_.empty()) return false;
  for (; cells > 0 && !cells_.empty(); --cells) {
    compare_cell(cells_.back());
    cells_.pop_back();
  }
  if (!cells_.empty()) return false;
  for (std::size_t i = 0; i < total_.size(); ++i) {
    total_[i].map += current_[i].map;
    total_[i].gains += current_[i].gains;
    total_[i].contrast += current_[i].contrast;
  }
  return true;
}

// Correlates the frame F with the sum of A, shifted, and B, not shifted. A is one projector's light and B
// that of the others, or A is all light.
void MisalignmentDetector::compare_cell(const cv::Rect& cell) {
  const cv::Rect around(cell.x - k_reach, cell.y - k_reach, cell.width + 2 * k_reach,
                        cell.height + 2 * k_reach);
  const double area = cell.area();
  const auto centred = [](const cv::Mat& m) -> cv::Mat { return m - cv::mean(m)[0]; };
  const cv::Mat f = centred(frame_(cell));
  cv::Mat all = cv::Mat::zeros(around.size(), CV_32F);
  for (const Light& light : lights_) all += light.predicted(around);
  const cv::Rect inner(k_reach, k_reach, k_cell, k_cell);
  const double contrast = stddev(all(inner)), f_norm = cv::norm(f);
  const auto add = [&](const cv::Mat& a, const cv::Mat& b, double share, Sum* sum) {
    const double weight = share * contrast / white_;
    sum->contrast += weight;
    if (f_norm <= 0) return;
    const cv::Mat b_centred = centred(b);
    const cv::Mat a_sums = sums(a);
    cv::Mat variance = sums(a.mul(a)) - a_sums.mul(a_sums) / area;
    variance += 2 * products(a, b_centred) + b_centred.dot(b_centred);
    const cv::Mat covariance = products(a, f) + f.dot(b_centred);
    // Keeps a shift into the dark from having a high correlation.
    const double least = std::pow(0.1 * contrast, 2) * area;
    cv::Mat norm;
    cv::sqrt(cv::max(variance, least), norm);
    const cv::Mat correlation = covariance / norm / f_norm;
    sum->map += weight * correlation;
    sum->gains += contrast / white_ * (correlation - correlation.at<float>(k_reach, k_reach));
  };
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    const cv::Mat& own = lights_[i].predicted;
    const cv::Mat others = all(inner) - own(cell);
    const double own_contrast = stddev(own(cell)), share = own_contrast / (own_contrast + stddev(others));
    if (share > k_least_share) add(own(around), others, share, &current_[i]);
  }
  add(all, cv::Mat::zeros(cell.size(), CV_32F), 1, &current_.back());
}

MisalignmentDetector::Sum MisalignmentDetector::empty_sum() {
  const cv::Size shifts(2 * k_reach + 1, 2 * k_reach + 1);
  return {cv::Mat(shifts, CV_32F, cv::Scalar(0)), cv::Mat(shifts, CV_32F, cv::Scalar(0)), 0};
}

LightDisplacements MisalignmentDetector::displacements() const {
  LightDisplacements out;
  for (const Sum& sum : total_) out.projectors.push_back(best(sum.map, sum.gains, sum.contrast, side_px_));
  out.all = out.projectors.back();
  out.projectors.pop_back();
  out.mm_per_px = mm_per_px_;
  return out;
}

}  // namespace limn::projector
