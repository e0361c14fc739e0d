#include "tests/bench/tracker_frames.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace limn::test {
namespace {

constexpr int k_width = 1280;
constexpr int k_height = 960;
constexpr int k_columns = 4;
constexpr int k_rows = 3;
constexpr double k_black_of_dark_card = 35;

using Rng = std::mt19937_64;

double uniform(Rng& rng, const Range& range) {
  return std::uniform_real_distribution<double>(range.low, range.high)(rng);
}
double any_angle(Rng& rng) { return uniform(rng, {0, 2 * std::numbers::pi}); }

Lens frame_lens(const Condition& condition) {
  const double cx = (k_width - 1) / 2.0;
  const double cy = (k_height - 1) / 2.0;
  if (!condition.bent_lens) return Lens::pinhole(k_width, k_width, cx, cy);
  return Lens::create("LENSMODEL_OPENCV8", {900, 900, cx, cy, -0.28, 0.09, 1e-3, -1e-3, 0, 0, 0, 0}).value();
}

Eigen::Vector2d along(double angle) { return {std::cos(angle), std::sin(angle)}; }

PlacedMarker drawn_marker(const Condition& condition,
                          const Lens& lens,
                          const MarkerName& name,
                          const Eigen::Vector2d& middle,
                          Rng& rng) {
  const double degree = std::numbers::pi / 180;
  const Eigen::Vector2d px = middle + Eigen::Vector2d(uniform(rng, {-30, 30}), uniform(rng, {-30, 30}));
  const double side = uniform(rng, condition.side_px);
  const double spin = any_angle(rng);
  const double tilt = uniform(rng, condition.tilt_deg) * degree;
  PlacedMarker marker = placed(lens, name, px, side, spin, tilt, any_angle(rng));
  Pose& pose = marker.camera_from_marker;  // tilted relative to the ray, not to the camera's axis
  const auto ray = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), lens.unproject(px).value());
  pose = Pose(ray.toRotationMatrix() * pose.rotation_matrix(), pose.translation);
  marker.margin = condition.margin;
  marker.bow = condition.bow;
  marker.cylinder_radius = condition.cylinder_radius;
  marker.row_motion = condition.row_motion_px / 1000 * along(any_angle(rng));
  return marker;
}

// The name of the i-th marker of a frame.
using NameOf = std::function<MarkerName(int i, Rng& rng)>;

MarkerName benchmark_name(int i, Rng& rng) {
  const std::vector<std::string> families = tracker_frame_families();
  const std::string& family = families[static_cast<std::size_t>(i) % families.size()];
  const int ids = family == "apriltag_36h11" ? 587 : 35;
  return {family, std::to_string(std::uniform_int_distribution<int>(0, ids - 1)(rng))};
}

std::vector<PlacedMarker> drawn_markers(const Condition& condition,
                                        const Lens& lens,
                                        const NameOf& name_of,
                                        Rng& rng) {
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < k_columns * k_rows; ++i) {
    const MarkerName name = name_of(i, rng);
    const Eigen::Vector2d middle((i % k_columns + 0.5) * k_width / k_columns,
                                 (i / k_columns + 0.5) * k_height / k_rows);
    markers.push_back(drawn_marker(condition, lens, name, middle, rng));
  }
  return markers;
}

// ---- background, paper and things that cover it ----

std::array<Eigen::Vector2d, 4> outline(const Lens& lens, PlacedMarker marker, double around) {
  marker.size_m *= 1 + 2 * around;
  return true_corners(lens, marker);
}

cv::Point fixed(const Eigen::Vector2d& px) {  // 4 fractional bits
  return {static_cast<int>(std::lround(16 * px.x())), static_cast<int>(std::lround(16 * px.y()))};
}

void fill(cv::Mat& image, std::span<const Eigen::Vector2d> polygon, double level) {
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& px : polygon) points.push_back(fixed(px));
  cv::fillConvexPoly(image, points, cv::Scalar(level), cv::LINE_AA, 4);
}

cv::Mat background(const Condition& condition,
                   const Lens& lens,
                   std::span<const PlacedMarker> markers,
                   bool cluttered,
                   Rng& rng) {
  double level = condition.black + uniform(rng, {0.1, 0.7}) * (condition.white - condition.black);
  if (condition.background >= 0) level = condition.background, cluttered = false;
  cv::Mat image =
      cluttered ? clutter(k_width, k_height, rng) : plain(k_width, k_height, static_cast<int>(level));
  if (cluttered) {  // in the levels of the condition
    const double gain = (condition.white - condition.black) / 235;
    image.convertTo(image, CV_8U, gain, condition.black - 10 * gain);
  }
  if (condition.dark_card)
    for (const PlacedMarker& marker : markers)
      fill(image, outline(lens, marker, condition.margin + 0.12), k_black_of_dark_card);
  return image;
}

// Draws something of a medium grey over a marker's corner or edge, paper that covers a part of the border, or
// a round spot over an edge.
void cover(const Condition& condition,
           const Lens& lens,
           const PlacedMarker& marker,
           cv::Mat& light,
           TrueMarker* truth,
           Rng& rng) {
  const auto corners = true_corners(lens, marker);
  const Eigen::Vector2d centre = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
  const std::size_t i = std::uniform_int_distribution<std::size_t>(0, 3)(rng);
  const Eigen::Vector2d next = corners[(i + 1) % 4];
  const double side = (next - corners[i]).norm();
  const double width = condition.cover_share * side;
  if (condition.cover == Cover::bite) {
    const double at = uniform(rng, {0.25, 0.75});
    const Eigen::Vector2d middle = corners[i] + at * (next - corners[i]);
    cv::circle(light, fixed(middle), static_cast<int>(std::lround(8 * width)), cv::Scalar(condition.white),
               -1, cv::LINE_AA, 4);
    return;
  }
  if (condition.cover == Cover::bright_spot || condition.cover == Cover::dark_spot) {
    const bool bright = condition.cover == Cover::bright_spot;
    const Eigen::Vector2d outward =
        Eigen::Vector2d(next.y() - corners[i].y(), corners[i].x() - next.x()) / side;
    const Eigen::Vector2d edge = corners[i] + uniform(rng, {0.3, 0.7}) * (next - corners[i]);
    const Eigen::Vector2d middle = edge + (bright ? 0.02 : 0.07) * side * outward;
    const double level = bright ? 255 : condition.black + 0.06 * (condition.white - condition.black);
    cv::circle(light, fixed(middle), static_cast<int>(std::lround(8 * width)), cv::Scalar(level), -1,
               cv::LINE_AA, 4);
    return;
  }
  const bool on_corner = condition.cover == Cover::corner;
  const Eigen::Vector2d tip_of = on_corner ? corners[i] : Eigen::Vector2d(0.5 * (corners[i] + next));
  const Eigen::Vector2d outward = (tip_of - centre).normalized();
  const double inside = (on_corner ? 0.5 : 0.1) * width;
  const Eigen::Vector2d tip = tip_of - inside * outward;
  const double level = condition.black + uniform(rng, {0.35, 0.8}) * (condition.white - condition.black);
  const double half = 0.5 * width;
  const Eigen::Vector2d base = tip + 0.75 * side * (outward + 0.4 * along(any_angle(rng))).normalized();
  cv::line(light, fixed(tip), fixed(base), cv::Scalar(level), static_cast<int>(std::lround(2 * half)),
           cv::LINE_AA, 4);
  if (on_corner) truth->corner_covered[i] = true;
}

// Factor on the light at every pixel.
cv::Mat shade(const Condition& condition, Rng& rng) {
  cv::Mat factor(k_height, k_width, CV_32F, cv::Scalar(1));
  const double angle = any_angle(rng);
  const double phase = any_angle(rng);
  const Eigen::Vector2d d = along(angle);
  const double slat_px = uniform(rng, {22, 44});
  const double span_px = condition.light == Light::gradient ? std::hypot(k_width, k_height) : 320;
  for (int y = 0; y < k_height; ++y)
    for (int x = 0; x < k_width; ++x) {
      const double s = d.dot(Eigen::Vector2d(x - k_width / 2.0, y - k_height / 2.0));
      double f = 1;
      if (condition.light == Light::slats) {
        // The penumbra is two pixels wide.
        const double wave =
            std::sin(2 * std::numbers::pi * s / slat_px + phase) * slat_px / (2 * std::numbers::pi);
        f = 0.25 + 0.75 * std::clamp(0.5 + wave / 2, 0.0, 1.0);
      } else {  // 10:1 over the span, rising and falling in turn
        const double t = std::abs(std::remainder(s / span_px + phase, 2.0));
        f = std::pow(10.0, -std::clamp(t, 0.0, 1.0));
      }
      factor.at<float>(y, x) = static_cast<float>(f);
    }
  return factor;
}

// A projector's image over everything: its light adds to the room's and is reflected by paper and ink.
cv::Mat with_projected_content(const cv::Mat& light, Rng& rng) {
  cv::Mat content;
  clutter(k_width, k_height, rng).convertTo(content, CV_32F, 1.0 / 255);
  cv::GaussianBlur(content, content, {0, 0}, 1.2);
  cv::Mat seen;
  cv::multiply(light, 0.45 + 0.55 * content, seen);
  return seen;
}

cv::Mat lit(const Condition& condition, const cv::Mat& light, Rng& rng) {
  if (condition.light == Light::even) return light;
  if (condition.light == Light::projected) return with_projected_content(light, rng);
  cv::Mat seen;
  cv::multiply(light, shade(condition, rng), seen);
  return seen;
}

// ---- the camera ----

// Uniform motion over `length` pixels: each kernel pixel's share of the line, from many points.
cv::Mat motion_kernel(double length, double angle) {
  const int half = static_cast<int>(std::ceil(0.5 * length)) + 1;
  cv::Mat kernel(2 * half + 1, 2 * half + 1, CV_32F, cv::Scalar(0));
  constexpr int k_points = 2001;
  for (int i = 0; i < k_points; ++i) {
    const Eigen::Vector2d p = (static_cast<double>(i) / (k_points - 1) - 0.5) * length * along(angle);
    const int x = static_cast<int>(std::floor(p.x()));
    const int y = static_cast<int>(std::floor(p.y()));
    const double fx = p.x() - x;
    const double fy = p.y() - y;
    for (const auto& [dx, dy, share] :
         {std::tuple{0, 0, (1 - fx) * (1 - fy)}, std::tuple{1, 0, fx * (1 - fy)},
          std::tuple{0, 1, (1 - fx) * fy}, std::tuple{1, 1, fx * fy}})
      if (share > 0) kernel.at<float>(half + y + dy, half + x + dx) += static_cast<float>(share / k_points);
  }
  return kernel;
}

cv::Mat photographed(const Condition& condition, cv::Mat light, Rng& rng) {
  const double blur = uniform(rng, condition.blur_px);
  if (blur > 0) cv::GaussianBlur(light, light, {0, 0}, blur);
  if (condition.motion_px > 0)
    cv::filter2D(light, light, -1, motion_kernel(condition.motion_px, any_angle(rng)), {-1, -1}, 0,
                 cv::BORDER_REPLICATE);
  cv::Mat grey = noisy_grey(light, condition.noise_levels, rng);
  if (condition.jpeg_quality == 0) return grey;
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, condition.jpeg_quality});
  return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
}

TrackerFrame frame_of(const Condition& condition, std::uint64_t seed, int number, const NameOf& name_of) {
  std::seed_seq words{seed, static_cast<std::uint64_t>(number),
                      static_cast<std::uint64_t>(std::hash<std::string>()(condition.name))};
  Rng rng(words);
  TrackerFrame frame;
  frame.lens = frame_lens(condition);
  const std::vector<PlacedMarker> markers = drawn_markers(condition, frame.lens, name_of, rng);
  ImageOptions options;
  options.black = condition.black;
  options.white = condition.white;
  cv::Mat light = light_of(frame.lens, background(condition, frame.lens, markers, number % 2 == 1, rng),
                           markers, options, rng);
  for (const PlacedMarker& marker : markers) {
    TrueMarker truth{marker.marker, true_corners(frame.lens, marker), {}, marker.camera_from_marker};
    if (condition.cover != Cover::none) cover(condition, frame.lens, marker, light, &truth, rng);
    frame.markers.push_back(truth);
    frame.marker_size_m = marker.size_m;
  }
  frame.grey = photographed(condition, lit(condition, light, rng), rng);
  return frame;
}

}  // namespace

std::vector<std::string> tracker_frame_families() { return {"apriltag_36h11", "apriltag_25h9"}; }

TrackerFrame tracker_frame(const Condition& condition, std::uint64_t seed, int number) {
  if (condition.family.empty()) return frame_of(condition, seed, number, benchmark_name);
  return frame_of(condition, seed, number, [&](int, Rng& rng) {
    return MarkerName{condition.family, std::to_string(std::uniform_int_distribution<int>(0, 49)(rng))};
  });
}

TrackerFrame tracker_frame(const Condition& condition,
                           std::uint64_t seed,
                           int number,
                           std::span<const MarkerName> names) {
  return frame_of(condition, seed, number, [&](int, Rng& rng) {
    return names[std::uniform_int_distribution<std::size_t>(0, names.size() - 1)(rng)];
  });
}

TrackerFrame cluttered_frame(int width, int height, std::uint64_t seed) {
  Rng rng(seed);
  TrackerFrame frame;
  frame.lens = Lens::pinhole(width, width, (width - 1) / 2.0, (height - 1) / 2.0);
  Condition ordinary;
  ordinary.side_px = {32, 120};
  ordinary.tilt_deg = {0, 69};
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < k_columns * k_rows; ++i) {
    const int id = std::uniform_int_distribution<int>(0, 586)(rng);
    const Eigen::Vector2d middle((i % k_columns + 0.5) * width / k_columns,
                                 (i / k_columns + 0.5) * height / k_rows);
    markers.push_back(
        drawn_marker(ordinary, frame.lens, {"apriltag_36h11", std::to_string(id)}, middle, rng));
    frame.markers.push_back({markers.back().marker,
                             true_corners(frame.lens, markers.back()),
                             {},
                             markers.back().camera_from_marker});
    frame.marker_size_m = markers.back().size_m;
  }
  ImageOptions options;
  options.blur_px = 0.5;
  options.noise_levels = ordinary.noise_levels;
  frame.grey = image_of(frame.lens, clutter(width, height, rng), markers, options, rng);
  return frame;
}

std::vector<Condition> tracker_conditions() {
  return {
      {.group = "sharp", .name = "48-64 px", .side_px = {48, 64}, .tilt_deg = {0, 30}},
      {.group = "sharp", .name = "64-140 px", .side_px = {64, 140}, .tilt_deg = {0, 30}},
      {.group = "sharp", .name = "tilt 30-60", .side_px = {60, 120}, .tilt_deg = {30, 60}},
      {.group = "sharp", .name = "tilt 60-70", .side_px = {80, 120}, .tilt_deg = {60, 70}},
      {.group = "sharp",
       .name = "no blur at all",
       .side_px = {48, 120},
       .tilt_deg = {0, 60},
       .blur_px = {0, 0}},
      {.group = "sharp 80 px, tilt 0-45", .name = "80 px", .side_px = {80, 80}, .tilt_deg = {0, 45}},
      {.group = "small 16-32 px", .name = "16-20 px", .side_px = {16, 20}, .tilt_deg = {0, 40}},
      {.group = "small 16-32 px", .name = "20-24 px", .side_px = {20, 24}, .tilt_deg = {0, 40}},
      {.group = "small 16-32 px", .name = "24-32 px", .side_px = {24, 32}, .tilt_deg = {0, 40}},
      {.group = "small 12 px", .name = "12 px", .side_px = {12, 12}, .tilt_deg = {0, 30}},
      {.group = "steep", .name = "75 deg", .side_px = {120, 120}, .tilt_deg = {75, 75}},
      {.group = "steep", .name = "80 deg", .side_px = {120, 120}, .tilt_deg = {80, 80}},
      {.group = "steep", .name = "84 deg", .side_px = {120, 120}, .tilt_deg = {84, 84}},
      {.group = "blur, motion", .name = "sigma 1.5", .blur_px = {1.5, 1.5}},
      {.group = "blur, motion", .name = "sigma 2.5", .blur_px = {2.5, 2.5}},
      {.group = "blur, motion", .name = "sigma 3.5", .blur_px = {3.5, 3.5}},
      {.group = "blur, motion", .name = "motion 4 px", .motion_px = 4},
      {.group = "blur, motion", .name = "motion 8 px", .motion_px = 8},
      {.group = "blur, motion", .name = "motion 12 px", .motion_px = 12},
      {.group = "blur, motion", .name = "motion 16 px", .motion_px = 16},
      {.group = "motion of 24 px", .name = "motion 24 px", .motion_px = 24},
      {.group = "poor light", .name = "contrast 30 levels", .black = 100, .white = 130},
      {.group = "poor light", .name = "dark, 8 to 40", .black = 8, .white = 40},
      {.group = "dark room", .name = "dark, 8 to 40, noise of 3", .black = 8, .white = 40, .noise_levels = 3},
      {.group = "poor light", .name = "10:1 over the picture", .light = Light::gradient},
      {.group = "poor light", .name = "10:1 over 320 px", .light = Light::steep_gradient},
      {.group = "poor light", .name = "slatted shadow 4:1", .light = Light::slats},
      {.group = "projected content", .name = "clutter as bright as the room", .light = Light::projected},
      {.group = "white margin", .name = "6 %", .margin = 0.06},
      {.group = "white margin", .name = "3 %", .margin = 0.03},
      {.group = "white margin", .name = "1.5 %", .margin = 0.015},
      {.group = "nested, white on dark", .name = "margin 12 %", .dark_card = true},
      {.group = "nested, white on dark", .name = "margin 4 %", .margin = 0.04, .dark_card = true},
      {.group = "finger", .name = "over a corner, 20 %", .cover = Cover::corner, .cover_share = 0.2},
      {.group = "finger", .name = "over an edge, 15 %", .cover = Cover::edge, .cover_share = 0.15},
      {.group = "finger", .name = "over an edge, 25 %", .cover = Cover::edge, .cover_share = 0.25},
      {.group = "finger", .name = "edge bitten by 8 %", .cover = Cover::bite, .cover_share = 0.08},
      {.group = "finger", .name = "edge bitten by 16 %", .cover = Cover::bite, .cover_share = 0.16},
      {.group = "spot on an edge, 4x4",
       .name = "bright, 25 %",
       .cover = Cover::bright_spot,
       .cover_share = 0.25,
       .family = "aruco_4x4_50"},
      {.group = "spot on an edge, 4x4",
       .name = "dark, 25 %",
       .cover = Cover::dark_spot,
       .cover_share = 0.25,
       .family = "aruco_4x4_50"},
      {.group = "lens", .name = "barrel", .bent_lens = true},
      {.group = "lens",
       .name = "barrel, 120-180 px, sigma 2.5",
       .side_px = {120, 180},
       .blur_px = {2.5, 2.5},
       .bent_lens = true},
      {.group = "lens", .name = "rolling shutter, 60 px a picture", .row_motion_px = 60},
      {.group = "bent paper", .name = "bow 0.6 %", .bow = 0.006},
      {.group = "cylinder", .name = "radius of 4 sides", .cylinder_radius = 4},
      {.group = "cylinder", .name = "radius of 2 sides", .cylinder_radius = 2},
      {.group = "cylinder", .name = "radius of 1 side", .cylinder_radius = 1},
      {.group = "cylinder, 4x4 100-160 px",
       .name = "radius of 1 side, 4x4",
       .side_px = {100, 160},
       .cylinder_radius = 1,
       .family = "aruco_4x4_50"},
      {.group = "JPEG", .name = "quality 75", .jpeg_quality = 75},
      {.group = "JPEG", .name = "quality 35", .jpeg_quality = 35},
  };
}

}  // namespace limn::test
