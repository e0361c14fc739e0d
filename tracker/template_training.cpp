#include "tracker/template_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/names.h"
#include "tracker/candidates.h"
#include "tracker/identify.h"
#include "tracker/quad_check.h"
#include "tracker/refine.h"
#include "tracker/square_to_quad.h"
#include "tracker/threshold.h"

namespace limn::tracker {
namespace {

constexpr int k_min_contrast = 32;      // levels: training images have good contrast
constexpr double k_min_search_px = 20;  // side; smaller frames cannot be read
constexpr double k_min_value_px = 2;    // two pixels for each value
// Grey levels: identify's smallest, a fifteenth of black to white.
constexpr double k_min_deviation = 15;

double area(const std::array<Eigen::Vector2d, 4>& q) {
  const Eigen::Vector2d a = q[2] - q[0];
  const Eigen::Vector2d b = q[3] - q[1];
  return 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
}

Eigen::Vector2d centre(const std::array<Eigen::Vector2d, 4>& q) { return 0.25 * (q[0] + q[1] + q[2] + q[3]); }

bool contains(const std::array<Eigen::Vector2d, 4>& q, const Eigen::Vector2d& px) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d side = q[(i + 1) % 4] - q[i];
    const Eigen::Vector2d to = px - q[i];
    if (side.x() * to.y() - side.y() * to.x() < 0) return false;
  }
  return true;
}

// `border`: its width as share of the side.
std::vector<RefinedQuad> frames_in(const cv::Mat& grey, double border) {
  Threshold threshold;
  CornerCodes codes;
  QuadFinder finder;
  WorkerTeam alone(1);
  threshold.apply(grey, {k_min_contrast}, codes, alone);
  EdgeRefiner refiner;
  std::vector<RefinedQuad> frames;
  finder.find(codes, {k_min_search_px}, [&](const Quad& quad) {
    if (!may_be_marker(grey, quad, k_min_contrast, border)) return;
    const auto refined = refiner.refine(grey, quad, k_min_contrast, nullptr);
    if (refined && has_dark_border(grey, *refined, border)) frames.push_back(*refined);
  });
  std::sort(frames.begin(), frames.end(), [](const RefinedQuad& a, const RefinedQuad& b) {
    return area(a.corners_px) > area(b.corners_px);
  });
  std::vector<RefinedQuad> outer;
  for (const RefinedQuad& frame : frames)
    if (std::none_of(outer.begin(), outer.end(), [&](const RefinedQuad& other) {
          return contains(other.corners_px, centre(frame.corners_px));
        }))
      outer.push_back(frame);
  return outer;
}

// The frame with corner 0 nearest to the image's top left.
RefinedQuad upright(const RefinedQuad& frame) {
  std::size_t first = 0;
  for (std::size_t i = 1; i < 4; ++i)
    if (frame.corners_px[i].sum() < frame.corners_px[first].sum()) first = i;
  RefinedQuad turned = frame;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t from = (i + first) % 4;
    turned.corners_px[i] = frame.corners_px[from];
    turned.outside_level[i] = frame.outside_level[from];
    turned.inside_level[i] = frame.inside_level[from];
  }
  return turned;
}

Error several(const std::vector<RefinedQuad>& frames) {
  std::vector<std::string> places;
  for (const RefinedQuad& frame : frames) {
    const Eigen::Vector2d at = centre(frame.corners_px);
    places.push_back(
        fmt::format("({:.0f}, {:.0f}) {:.0f} px wide", at.x(), at.y(), std::sqrt(area(frame.corners_px))));
  }
  return error(
      "expected one black frame, found {}: at {}. Crop the image to the marker that is to be trained.",
      frames.size(), joined_names(places));
}

// The upright inside of the frame, one pixel for each value, as the mean over the value's area.
cv::Mat rectified(const cv::Mat& image, const RefinedQuad& frame, double border, double side_px) {
  const int size = TrainedTemplate::k_size;
  // Places along each value.
  const int fine = std::clamp(static_cast<int>(std::ceil((1 - 2 * border) * side_px / size)), 4, 16);
  const int count = size * fine;
  const SquareToQuad px_from_square(frame.corners_px);
  cv::Mat x(count, count, CV_32F), y(count, count, CV_32F);
  for (int row = 0; row < count; ++row)
    for (int column = 0; column < count; ++column) {
      const auto inner = [&](int i) { return border + (1 - 2 * border) * (i + 0.5) / count; };
      const Eigen::Vector2d px = px_from_square.at(inner(column), inner(row));
      x.at<float>(row, column) = static_cast<float>(px.x());
      y.at<float>(row, column) = static_cast<float>(px.y());
    }
  cv::Mat seen, values;
  cv::remap(image, seen, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::resize(seen, values, {size, size}, 0, 0, cv::INTER_AREA);
  return values;
}

double mean(const std::array<double, 4>& levels) {
  return 0.25 * (levels[0] + levels[1] + levels[2] + levels[3]);
}

double deviation(const TrainedTemplate& trained) {
  double sum = 0, squares = 0;
  const std::size_t count = trained.bgr[0].size();
  for (std::size_t i = 0; i < count; ++i) {
    const double grey = (trained.bgr[0][i] + trained.bgr[1][i] + trained.bgr[2][i]) / 3.0;
    sum += grey;
    squares += grey * grey;
  }
  const double middle = sum / static_cast<double>(count);
  return std::sqrt(std::max(0.0, squares / static_cast<double>(count) - middle * middle));
}

}  // namespace

Result<TrainedTemplate> train_template(const cv::Mat& image, double pattern_ratio) {
  const double border = 0.5 * (1 - pattern_ratio);
  const cv::Mat grey = to_grey(image);
  const std::vector<RefinedQuad> frames = frames_in(grey, border);
  if (frames.empty())
    return error(
        "expected a black square frame on white, {:.3g} of its side wide all around, found none. Photograph "
        "the "
        "marker upright, sharp, with white paper around it. A frame of another width: limn markers --train "
        "--pattern-ratio (the inside's width as share of the frame's).",
        border);
  if (frames.size() > 1) return several(frames);
  const RefinedQuad frame = upright(frames.front());
  TrainedTemplate trained;
  trained.corners_px = frame.corners_px;
  trained.side_px = std::sqrt(area(frame.corners_px));
  const double least_px = k_min_value_px * TrainedTemplate::k_size / pattern_ratio;
  if (trained.side_px < least_px)
    return error(
        "the frame is {:.0f} px wide, expected at least {:.0f} (two pixels for each value). Photograph it "
        "from nearer.",
        trained.side_px, least_px);
  const cv::Mat values = rectified(image, frame, border, trained.side_px);
  const double black = mean(frame.inside_level);
  const double scale = 255 / (mean(frame.outside_level) - black);
  const int channels = values.channels();
  for (std::size_t colour = 0; colour < 3; ++colour)
    for (int i = 0; i < values.rows * values.cols; ++i) {
      const int level = values.data[i * channels + (channels == 1 ? 0 : static_cast<int>(colour))];
      trained.bgr[colour].push_back(cv::saturate_cast<std::uint8_t>(scale * (level - black)));
    }
  if (const double found = deviation(trained); found < k_min_deviation)
    return error(
        "the frame's inside is uniform (its grey values have a standard deviation of {:.0f} of 255), "
        "expected a pattern (at least {:.0f})",
        found, k_min_deviation);
  return trained;
}

std::string template_text(const TrainedTemplate& trained) {
  const int size = TrainedTemplate::k_size;
  std::string text;
  for (int turns = 0; turns < 4; ++turns) {
    for (const auto& values : trained.bgr) {
      cv::Mat block(size, size, CV_8UC1);
      std::copy(values.begin(), values.end(), block.data);
      for (int i = 0; i < turns; ++i) cv::rotate(block, block, cv::ROTATE_90_COUNTERCLOCKWISE);
      for (int row = 0; row < size; ++row) {
        for (int column = 0; column < size; ++column)
          text += fmt::format("{:4}", block.at<std::uint8_t>(row, column));
        text += "\n";
      }
    }
    text += "\n";
  }
  return text;
}

}  // namespace limn::tracker
