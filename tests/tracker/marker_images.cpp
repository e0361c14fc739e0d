#include "tests/tracker/marker_images.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "tests/support/random.h"
#include "tracker/family.h"

namespace limn::test {
namespace {

// Samples of a pixel that an edge crosses: a Fibonacci lattice gives its coverage within 0.9 of 180 levels.
constexpr int k_samples = 233;
constexpr int k_lattice = 144;

// Intersects a camera direction with the marker's plane, in marker coordinates divided by its side (0 … 1
// inside).
struct MarkerPlane {
  Eigen::Matrix3d rotation;  // marker_from_camera
  Eigen::Vector3d origin;    // position of the camera, in marker coordinates
  double size_m;
  double bow, radius;
  explicit MarkerPlane(const PlacedMarker& placed)
      : rotation(placed.camera_from_marker.inverse().rotation_matrix()),
        origin(placed.camera_from_marker.inverse().translation),
        size_m(placed.size_m),
        bow(placed.bow),
        radius(placed.cylinder_radius) {}
  std::optional<Eigen::Vector2d> at(const Eigen::Vector3d& d_camera) const {
    const Eigen::Vector3d d = rotation * d_camera;
    if (radius > 0) return on_cylinder(origin / size_m, d);
    const double distance = -origin.z() / d.z();
    if (!(distance > 0)) return std::nullopt;
    const Eigen::Vector2d p = (origin + distance * d).head<2>() / size_m + Eigen::Vector2d(0.5, 0.5);
    return Eigen::Vector2d(p.x(), p.y() - 4 * bow * p.x() * (1 - p.x()));
  }
  // The first intersection of a ray from `from` with the cylinder around (0, y, radius), in sides.
  std::optional<Eigen::Vector2d> on_cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& d) const {
    const Eigen::Vector2d o(from.x(), from.z() - radius), way(d.x(), d.z());
    const double a = way.squaredNorm(), b = o.dot(way), c = o.squaredNorm() - radius * radius;
    const double root = b * b - a * c;
    if (!(root >= 0)) return std::nullopt;
    const double along = (-b - std::sqrt(root)) / a;
    if (!(along > 0)) return std::nullopt;
    const Eigen::Vector2d at = o + along * way;
    const double around = radius * std::atan2(at.x(), -at.y());
    return Eigen::Vector2d(around + 0.5, from.y() + along * d.y() + 0.5);
  }
};

// A place on the paper in marker coordinates; x and y in sides from the marker's middle.
Eigen::Vector3d on_paper(const PlacedMarker& placed, double x, double y) {
  const double r = placed.cylinder_radius;
  const Eigen::Vector3d place =
      r > 0 ? Eigen::Vector3d(r * std::sin(x / r), y, r * (1 - std::cos(x / r))) : Eigen::Vector3d(x, y, 0);
  return placed.size_m * place;
}

// The shear that a rolling shutter causes around a marker's centre.
struct RowMotion {
  Eigen::Vector2d px_a_row;
  double centre_row;
  RowMotion(const Lens& lens, const PlacedMarker& placed)
      : px_a_row(placed.row_motion),
        centre_row(lens.project(placed.camera_from_marker.translation).value().y()) {}
  Eigen::Vector2d still(const Eigen::Vector2d& seen) const {
    return seen - (seen.y() - centre_row) * px_a_row;
  }
  Eigen::Vector2d seen(const Eigen::Vector2d& still) const {
    return still + (still.y() - centre_row) / (1 - px_a_row.y()) * px_a_row;
  }
};

// The zone of a place along the marker: -2 and count + 1 beside the paper, -1 and count on its margin.
int zone_of(double place, double margin, int count) {
  if (place < -margin) return -2;
  if (place < 0) return -1;
  if (place > 1 + margin) return count + 1;
  return std::min(static_cast<int>(place * count), count);
}

// 1 for white, 0 for black, nullopt beside the paper.
std::optional<double> ink(const cv::Mat& cells, int column, int row) {
  if (std::min(column, row) < -1 || column > cells.cols || row > cells.rows) return std::nullopt;
  if (std::min(column, row) < 0 || column == cells.cols || row == cells.rows) return 1.0;
  return cells.at<std::uint8_t>(row, column) / 255.0;
}

MarkerDrawing drawing_of(const PlacedMarker& placed) {
  if (!placed.cells.empty()) return {placed.cells, 0};
  static std::map<std::string, MarkerDrawing> known;
  MarkerDrawing& drawing = known[placed.marker.text()];
  if (drawing.image.empty()) drawing = tracker::draw_whole_marker(placed.marker, 1).value();
  return drawing;
}

// The same with the size of everything that is printed instead of the square's.
PlacedMarker whole(PlacedMarker placed) {
  placed.size_m /= drawing_of(placed).square_share();
  return placed;
}

cv::Rect bounds(const Lens& lens, const PlacedMarker& placed, const cv::Size& size) {
  Eigen::Vector2d low(1e9, 1e9);
  Eigen::Vector2d high(-1e9, -1e9);
  const PlacedMarker paper = whole(placed);
  const RowMotion motion(lens, placed);
  const double half = 0.5 + placed.margin;
  for (const double y : {-half, half})
    for (int i = -4; i <= 4; ++i) {
      const Eigen::Vector2d px =
          motion.seen(lens.project(placed.camera_from_marker * on_paper(paper, 0.25 * i * half, y)).value());
      low = low.cwiseMin(px);
      high = high.cwiseMax(px);
    }
  // Sides may be curved in a lens's image.
  const Eigen::Vector2d bow = 0.05 * (high - low) + Eigen::Vector2d(2, 2);
  low -= bow;
  high += bow;
  const cv::Rect box(cv::Point(static_cast<int>(low.x()), static_cast<int>(low.y())),
                     cv::Point(static_cast<int>(high.x()) + 1, static_cast<int>(high.y()) + 1));
  return box & cv::Rect({}, size);
}

// Computes means over the areas of the pixels in one marker's box.
class MarkerPainter {
 public:
  MarkerPainter(const Lens& lens, const PlacedMarker& placed, const ImageOptions& options)
      : lens_(lens),
        placed_(placed),
        plane_(whole(placed)),
        options_(options),
        cells_(drawing_of(placed).image) {}

  void paint(cv::Mat& image, std::mt19937_64& rng) const {
    const cv::Rect box = bounds(lens_, placed_, image.size());
    const cv::Mat directions = directions_of(box);
    for (int y = 0; y < box.height; ++y)
      for (int x = 0; x < box.width; ++x)
        paint_pixel(image.at<float>(box.y + y, box.x + x), directions, x + 1, y + 1, rng);
  }

 private:
  const Lens& lens_;
  const PlacedMarker& placed_;
  MarkerPlane plane_;
  const ImageOptions& options_;
  cv::Mat cells_;

  // The directions of the box's pixels and of a frame one pixel wide around it; zero where the lens has none.
  cv::Mat directions_of(const cv::Rect& box) const {
    cv::Mat directions(box.height + 2, box.width + 2, CV_64FC3);
    const RowMotion motion(lens_, placed_);
    for (int y = 0; y < directions.rows; ++y)
      for (int x = 0; x < directions.cols; ++x) {
        const auto d = lens_.unproject(motion.still({box.x + x - 1, box.y + y - 1}));
        directions.at<cv::Vec3d>(y, x) = d ? cv::Vec3d(d->x(), d->y(), d->z()) : cv::Vec3d();
      }
    return directions;
  }

  static Eigen::Vector3d direction(const cv::Mat& directions, int x, int y) {
    const cv::Vec3d& d = directions.at<cv::Vec3d>(y, x);
    return {d[0], d[1], d[2]};
  }

  struct Zones {
    int column, row;
  };
  Zones zones_of(const Eigen::Vector2d& p) const {
    return {zone_of(p.x(), placed_.margin, cells_.cols), zone_of(p.y(), placed_.margin, cells_.rows)};
  }

  double level_of(const Zones& zones, double behind) const {
    const auto white = ink(cells_, zones.column, zones.row);
    return white ? options_.black + *white * (options_.white - options_.black) : behind;
  }

  // Within a pixel, directions are linear to far better than 1e-4 pixels.
  void paint_pixel(float& pixel, const cv::Mat& directions, int x, int y, std::mt19937_64& rng) const {
    const Eigen::Vector3d centre = direction(directions, x, y);
    const Eigen::Vector3d du = 0.5 * (direction(directions, x + 1, y) - direction(directions, x - 1, y));
    const Eigen::Vector3d dv = 0.5 * (direction(directions, x, y + 1) - direction(directions, x, y - 1));
    const double behind = pixel;
    Eigen::AlignedBox2d box;
    for (const auto& [u, v] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
      if (const auto p = plane_.at(centre + u * du + v * dv)) box.extend(*p);
    if (box.isEmpty()) return;
    const Zones low = zones_of(box.min());
    const Zones high = zones_of(box.max());
    const double level = level_of(low, behind);
    bool mixed = false;
    for (int row = low.row; row <= high.row; ++row)
      for (int column = low.column; column <= high.column; ++column)
        mixed |= level_of({column, row}, behind) != level;
    pixel = static_cast<float>(level);
    if (!mixed) return;
    std::uniform_real_distribution<double> phase(0, 1);
    const double u0 = phase(rng);
    const double v0 = phase(rng);
    double sum = 0;
    for (int i = 0; i < k_samples; ++i) {
      const double u = (i + u0) / k_samples - 0.5;
      const double v = std::fmod(v0 + static_cast<double>(i) * k_lattice / k_samples, 1.0) - 0.5;
      const auto p = plane_.at(centre + u * du + v * dv);
      sum += p ? level_of(zones_of(*p), behind) : behind;
    }
    pixel = static_cast<float>(sum / k_samples);
  }
};

int whole(std::mt19937_64& rng, int low, int high) {
  return std::uniform_int_distribution<int>(low, high)(rng);
}

}  // namespace

std::array<Eigen::Vector2d, 4> true_corners(const Lens& lens, const PlacedMarker& placed) {
  const std::array<Eigen::Vector3d, 4> corners = {on_paper(placed, -0.5, -0.5), on_paper(placed, 0.5, -0.5),
                                                  on_paper(placed, 0.5, 0.5), on_paper(placed, -0.5, 0.5)};
  std::array<Eigen::Vector2d, 4> px;
  const RowMotion motion(lens, placed);
  for (std::size_t i = 0; i < 4; ++i)
    px[i] = motion.seen(lens.project(placed.camera_from_marker * corners[i]).value());
  return px;
}

PlacedMarker placed(const Lens& lens,
                    const MarkerName& marker,
                    const Eigen::Vector2d& px,
                    double side_px,
                    double spin,
                    double tilt,
                    double tilt_direction) {
  PlacedMarker result;
  result.marker = marker;
  const Eigen::Vector3d d = lens.unproject(px).value();
  const double depth = lens.fx() * result.size_m / side_px;
  const Eigen::Vector3d axis(std::cos(tilt_direction), std::sin(tilt_direction), 0);
  result.camera_from_marker =
      Pose(exp_rotation(tilt * axis) * exp_rotation({0, 0, spin}), Eigen::Vector3d(d * depth / d.z()));
  return result;
}

cv::Mat light_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedMarker> markers,
                 const ImageOptions& options,
                 std::mt19937_64& rng) {
  cv::Mat light;
  background.convertTo(light, CV_32F);
  for (const PlacedMarker& marker : markers) MarkerPainter(lens, marker, options).paint(light, rng);
  return light;
}

cv::Mat noisy_grey(const cv::Mat& light, double noise_levels, std::mt19937_64& rng) {
  cv::Mat noisy = light.clone();
  if (noise_levels > 0) {
    std::normal_distribution<float> noise(0, static_cast<float>(noise_levels));
    for (int y = 0; y < noisy.rows; ++y)
      for (int x = 0; x < noisy.cols; ++x) noisy.at<float>(y, x) += noise(rng);
  }
  cv::Mat grey;
  noisy.convertTo(grey, CV_8U);  // rounds and saturates
  return grey;
}

cv::Mat image_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedMarker> markers,
                 const ImageOptions& options,
                 std::mt19937_64& rng) {
  cv::Mat light = light_of(lens, background, markers, options, rng);
  if (options.blur_px > 0) cv::GaussianBlur(light, light, {0, 0}, options.blur_px);
  return noisy_grey(light, options.noise_levels, rng);
}

cv::Mat plain(int width, int height, int grey) { return cv::Mat(height, width, CV_8UC1, cv::Scalar(grey)); }

cv::Mat nested_squares(int width, int height) {
  cv::Mat image = plain(width, height, 230);
  for (int y = 0; y + 60 <= height; y += 60)
    for (int x = 0; x + 60 <= width; x += 60)
      for (int inset = 2; inset < 28; inset += 3)
        cv::rectangle(image, cv::Rect(x + inset, y + inset, 60 - 2 * inset, 60 - 2 * inset),
                      cv::Scalar(inset % 2 ? 230 : 20), -1);
  return image;
}

cv::Mat checkerboard(int width, int height, int square) {
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(y, x) = (x / square + y / square) % 2 ? 20 : 230;
  return image;
}

cv::Mat noise(int width, int height, std::mt19937_64& rng) {
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(rng());
  return image;
}

cv::Mat clutter(int width, int height, std::mt19937_64& rng) {
  cv::Mat image = plain(width, height, 120);
  const double scale = width / 1280.0;
  const auto point = [&] { return cv::Point(whole(rng, 0, width), whole(rng, 0, height)); };
  const auto level = [&] { return cv::Scalar(whole(rng, 10, 245)); };
  const auto size = [&](double low, double high) {
    return static_cast<int>(scale * std::exp(uniform(rng, std::log(low), std::log(high))));
  };
  const int shapes = static_cast<int>(500 * scale * scale);
  for (int i = 0; i < shapes; ++i) {
    const cv::Point p = point();
    switch (whole(rng, 0, 4)) {
      case 0: {
        const cv::RotatedRect box(
            p, cv::Size2f(static_cast<float>(size(8, 200)), static_cast<float>(size(8, 200))),
            static_cast<float>(uniform(rng, 0, 180)));
        std::array<cv::Point2f, 4> corners;
        box.points(corners.data());
        std::vector<cv::Point> polygon(corners.begin(), corners.end());
        cv::fillConvexPoly(image, polygon, level(), cv::LINE_AA);
        break;
      }
      case 1:
        cv::ellipse(image, p, {size(4, 100), size(4, 100)}, uniform(rng, 0, 180), 0, 360, level(), -1,
                    cv::LINE_AA);
        break;
      case 2: {
        const std::vector<cv::Point> triangle = {p, p + cv::Point(size(10, 150), size(5, 80)),
                                                 p + cv::Point(-size(5, 80), size(10, 150))};
        cv::fillConvexPoly(image, triangle, level(), cv::LINE_AA);
        break;
      }
      case 3:
        cv::line(image, p, point(), level(), whole(rng, 1, 6), cv::LINE_AA);
        break;
      default: {
        std::string text;
        for (int k = whole(rng, 3, 12); k > 0; --k) text += static_cast<char>(whole(rng, 'A', 'z'));
        cv::putText(image, text, p, cv::FONT_HERSHEY_SIMPLEX, scale * uniform(rng, 0.3, 1.5), level(),
                    whole(rng, 1, 3), cv::LINE_AA);
      }
    }
  }
  // A chessboard and fine grain: many small black squares, many tiny boundaries.
  const int square = size(10, 40);
  const cv::Point board = point();
  for (int row = 0; row < 8; ++row)
    for (int column = 0; column < 8; ++column)
      cv::rectangle(image, board + cv::Point(column * square, row * square),
                    board + cv::Point((column + 1) * square - 1, (row + 1) * square - 1),
                    cv::Scalar((row + column) % 2 == 0 ? 20 : 230), -1);
  const cv::Rect grain =
      cv::Rect(point(), cv::Size(size(150, 400), size(150, 400))) & cv::Rect({}, image.size());
  for (int y = grain.y; y < grain.y + grain.height; ++y)
    for (int x = grain.x; x < grain.x + grain.width; ++x)
      image.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(whole(rng, 40, 200));
  cv::GaussianBlur(image, image, {0, 0}, 0.7);
  return image;
}

}  // namespace limn::test
