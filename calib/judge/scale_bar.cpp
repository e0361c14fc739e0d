#include "calib/judge/scale_bar.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <regex>
#include <sstream>

#include "calib/code/decode.h"
#include "calib/surface/triangulate.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_around = 1.35;      // share of the mark's size: includes the white margin of every marker
constexpr double k_paper = 0.6;        // share of the bright pixels' contrast; ink and its edges are darker
constexpr size_t k_most_pixels = 400;  // for each mark; more only cost time
constexpr size_t k_least_pixels = 30;  // ten times the number of a plane's parameters
constexpr double k_far_sigmas = 3;

// A decoded pixel on a mark's paper.
struct Spot {
  Vector2d px_camera, px_projector;
};

Vector2d crossing_of_diagonals(const std::array<Vector2d, 4>& q) {
  Eigen::Matrix2d m;
  m << q[2] - q[0], q[1] - q[3];
  const Vector2d shares = m.inverse() * (q[1] - q[0]);  // q0 + s (q2 - q0) = q1 - t (q1 - q3)
  return q[0] + shares.x() * (q[2] - q[0]);
}

std::vector<Spot> paper_spots(const Decoded& decoded, const std::array<Vector2d, 4>& corners) {
  const Vector2d centre = crossing_of_diagonals(corners);
  std::vector<cv::Point2f> hull;
  Vector2d low = centre, high = centre;
  for (const Vector2d& corner : corners) {
    const Vector2d p = centre + k_around * (corner - centre);
    hull.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  struct Candidate {
    Spot spot;
    int contrast = 0;
  };
  std::vector<Candidate> all;
  std::vector<int> contrasts;
  const cv::Mat& labels = decoded.px_projector;
  for (int y = std::max(0, static_cast<int>(low.y()));
       y <= std::min(labels.rows - 1, static_cast<int>(high.y())); ++y) {
    for (int x = std::max(0, static_cast<int>(low.x()));
         x <= std::min(labels.cols - 1, static_cast<int>(high.x())); ++x) {
      const auto& label = labels.at<cv::Vec2f>(y, x);
      const cv::Point2f at(static_cast<float>(x), static_cast<float>(y));
      if (std::isnan(label[0]) || cv::pointPolygonTest(hull, at, false) < 0) continue;
      all.push_back({{Vector2d(x, y), Vector2d(label[0], label[1])}, decoded.contrast.at<uchar>(y, x)});
      contrasts.push_back(all.back().contrast);
    }
  }
  if (all.size() < k_least_pixels) return {};
  const double least = k_paper * value_of_rank(&contrasts, contrasts.size() * 9 / 10);
  std::erase_if(all, [&](const Candidate& c) { return c.contrast < least; });
  std::vector<Spot> spots;
  const size_t step = all.size() / k_most_pixels + 1;
  for (size_t i = 0; i < all.size(); i += step) spots.push_back(all[i].spot);
  return spots;
}

// The mark's centre in the world and its standard deviations along and across the camera's ray.
struct Centre {
  Vector3d p_world;
  double along_m = 0, across_m = 0;
  Vector3d d_ray;
  double side_m = 0;  // mean of the four sides of the mark, in the paper's plane
};

// Number of independent labels: neighbours within one projector pixel share their error.
double independent(const std::vector<Spot>& spots, double pixels) {
  Eigen::Matrix2d normal = 1e-9 * Eigen::Matrix2d::Identity(), product = Eigen::Matrix2d::Zero();
  Vector2d mean = Vector2d::Zero(), mean_label = Vector2d::Zero();
  for (const Spot& s : spots) {
    mean += s.px_camera / static_cast<double>(spots.size());
    mean_label += s.px_projector / static_cast<double>(spots.size());
  }
  for (const Spot& s : spots) {
    normal += (s.px_camera - mean) * (s.px_camera - mean).transpose();
    product += (s.px_camera - mean) * (s.px_projector - mean_label).transpose();
  }
  // Area of one camera pixel in projector pixels.
  const double area = std::abs((normal.inverse() * product).determinant());
  return std::clamp(area * pixels, 4.0, pixels);
}

// Mean length of the mark's sides, which lie in a plane: its inverse depth is plane . (1, x - m_x, y - m_y).
double side_in_plane(const Imager& camera,
                     const DetectedMark& mark,
                     const Vector3d& plane,
                     const Vector2d& m) {
  std::array<Vector3d, 4> corners;
  for (size_t i = 0; i < 4; ++i) {
    const auto d = camera.lens.unproject(mark.corners_px[i]);
    if (!d) return 0;
    const Vector2d at = d->head<2>() / d->z();
    const double depth = 1 / plane.dot(Vector3d(1, at.x() - m.x(), at.y() - m.y()));
    corners[i] = depth * Vector3d(at.x(), at.y(), 1);
  }
  double sum = 0;
  for (size_t i = 0; i < 4; ++i) sum += (corners[(i + 1) % 4] - corners[i]).norm() / 4;
  return sum;
}

// On a plane, the inverse depth along the camera's axis is an affine function of direction.
std::optional<Centre> centre_of(const Imager& camera,
                                const Imager& projector,
                                const DetectedMark& mark,
                                const std::vector<Spot>& spots) {
  const auto middle = camera.lens.unproject(crossing_of_diagonals(mark.corners_px));
  if (!middle) return std::nullopt;
  const Vector2d m = middle->head<2>() / middle->z();
  std::vector<Vector3d> rows;
  std::vector<double> inverse_depths;
  for (const Spot& spot : spots) {
    const auto eye = camera.ray(spot.px_camera), light = projector.ray(spot.px_projector);
    const auto p = eye && light ? midpoint(*eye, *light) : std::nullopt;
    if (!p) continue;
    const Vector3d p_camera = camera.imager_from_world * *p;
    if (!(p_camera.z() > 0)) continue;
    rows.emplace_back(1, p_camera.x() / p_camera.z() - m.x(), p_camera.y() / p_camera.z() - m.y());
    inverse_depths.push_back(1 / p_camera.z());
  }
  for (int pass = 0;; ++pass) {
    if (rows.size() < k_least_pixels) return std::nullopt;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Vector3d product = Vector3d::Zero();
    for (size_t i = 0; i < rows.size(); ++i) {
      normal += rows[i] * rows[i].transpose();
      product += rows[i] * inverse_depths[i];
    }
    const Vector3d plane = normal.ldlt().solve(product);
    double squared = 0;
    for (size_t i = 0; i < rows.size(); ++i) squared += std::pow(rows[i].dot(plane) - inverse_depths[i], 2);
    const double sigma = std::sqrt(squared / static_cast<double>(rows.size() - 3));
    if (pass < 2) {  // pixels far from the plane are no paper
      std::vector<Vector3d> kept_rows;
      std::vector<double> kept;
      for (size_t i = 0; i < rows.size(); ++i) {
        if (std::abs(rows[i].dot(plane) - inverse_depths[i]) > k_far_sigmas * sigma) continue;
        kept_rows.push_back(rows[i]);
        kept.push_back(inverse_depths[i]);
      }
      rows = std::move(kept_rows);
      inverse_depths = std::move(kept);
      continue;
    }
    if (!(plane[0] > 0)) return std::nullopt;
    Centre centre;
    const double depth = 1 / plane[0];
    centre.p_world = camera.imager_from_world.inverse() * Vector3d(depth * m.x(), depth * m.y(), depth);
    centre.d_ray = camera.imager_from_world.rotation.conjugate() * *middle;
    const auto count = static_cast<double>(rows.size());
    const double leverage = normal.inverse()(0, 0) * count / independent(spots, count);
    centre.along_m = sigma * std::sqrt(leverage) * depth * depth / middle->z();
    centre.across_m = mark.stddev_px / 2 * depth / camera.lens.fx();  // mean of four corners
    centre.side_m = side_in_plane(camera, mark, plane, m);
    return centre;
  }
}

struct Pair {
  const DetectedMark *a = nullptr, *b = nullptr;
  std::vector<Spot> spots_a, spots_b;
};

double length_between(const Centre& a, const Centre& b, bool is_side) {
  return is_side ? a.side_m : (a.p_world - b.p_world).norm();
}

std::optional<double> length_of(const Imager& camera, const Imager& projector, const Pair& pair) {
  const auto a = centre_of(camera, projector, *pair.a, pair.spots_a),
             b = centre_of(camera, projector, *pair.b, pair.spots_b);
  if (!a || !b) return std::nullopt;
  return length_between(*a, *b, pair.a == pair.b);
}

// The noise of a side: it is as much too long as the paper is too far away; and the noise of its ends.
double side_noise_of(const Centre& centre, const Imager& camera) {
  const double depth = (camera.imager_from_world * centre.p_world).z();
  return std::hypot(centre.side_m * centre.along_m / depth, centre.across_m);
}

double noise_of(const Centre& a, const Centre& b) {
  const Vector3d along = (b.p_world - a.p_world).normalized();
  double variance = 0;
  for (const Centre* c : {&a, &b}) {
    const double share = std::pow(along.dot(c->d_ray), 2);
    variance += share * c->along_m * c->along_m + (1 - share) * c->across_m * c->across_m;
  }
  return std::sqrt(variance);
}

// Standard deviation of the length by the devices' covariance: central differences with steps of one standard
// deviation.
double calibration_of(const Solution& solution, int camera, int projector, const Pair& pair) {
  if (solution.covariance.size() == 0) return 0;
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(solution.covariance.cols());
  const auto vary = [&](int at, bool is_camera) {
    const Imager& original = is_camera ? solution.rig.cameras[static_cast<size_t>(camera)]
                                       : solution.rig.projectors[static_cast<size_t>(projector)];
    const int values = original.lens.model.value_count();
    for (int i = 0; i < values + 6; ++i) {
      const double step = std::sqrt(std::max(0.0, solution.covariance(at + i, at + i)));
      if (!(step > 0)) continue;
      double difference = 0;
      for (const double sign : {1.0, -1.0}) {
        Imager moved = original;
        if (i < values) {
          moved.lens.values[static_cast<size_t>(i)] += sign * step;
        } else {
          moved.imager_from_world =
              boxplus(moved.imager_from_world, sign * step * Vector6d::Unit(i - values));
        }
        const Imager& eye = is_camera ? moved : solution.rig.cameras[static_cast<size_t>(camera)];
        const Imager& light = is_camera ? solution.rig.projectors[static_cast<size_t>(projector)] : moved;
        difference += sign * length_of(eye, light, pair).value_or(0);
      }
      gradient[at + i] = difference / (2 * step);
    }
  };
  vary(solution.camera_at(static_cast<size_t>(camera)), true);
  vary(solution.projector_at(static_cast<size_t>(projector)), false);
  return std::sqrt(std::max(0.0, gradient.dot(solution.covariance * gradient)));
}

const DetectedMark* find(const std::vector<DetectedMark>& marks,
                         int camera,
                         int pose,
                         const std::string& name) {
  const auto found = std::find_if(marks.begin(), marks.end(), [&](const DetectedMark& mark) {
    return mark.camera == camera && mark.pose == pose && mark.name == name;
  });
  return found == marks.end() ? nullptr : &*found;
}

void measure_view(const Solution& solution,
                  const Decoded& decoded,
                  const DetectedMark& a,
                  const DetectedMark& b,
                  int projector,
                  ScaleBarCheck* check) {
  const Imager& eye = solution.rig.cameras[static_cast<size_t>(a.camera)];
  const Imager& light = solution.rig.projectors[static_cast<size_t>(projector)];
  const Pair pair{&a, &b, paper_spots(decoded, a.corners_px), paper_spots(decoded, b.corners_px)};
  const auto from = centre_of(eye, light, a, pair.spots_a), to = centre_of(eye, light, b, pair.spots_b);
  if (!from || !to) return;
  const bool is_side = &a == &b;
  check->views.push_back({a.camera, projector, a.pose, length_between(*from, *to, is_side),
                          is_side ? side_noise_of(*from, eye) : noise_of(*from, *to),
                          calibration_of(solution, a.camera, projector, pair)});
}

void conclude(double widened, ScaleBarCheck* check) {
  double weights = 0, sum = 0, calibration = 0, squared = 0;
  for (const ScaleBarView& view : check->views) {
    const double weight = 1 / std::pow(std::max(view.noise_m, 1e-9), 2);
    weights += weight;
    sum += weight * view.measured_m;
    calibration += weight * view.calibration_m;
  }
  if (weights == 0) return;
  check->measured_m = sum / weights;
  for (const ScaleBarView& view : check->views)
    squared += std::pow((view.measured_m - check->measured_m) / std::max(view.noise_m, 1e-9), 2);
  const double freedom = static_cast<double>(check->views.size()) - 1;
  const double scatter = freedom > 0 ? std::max(1.0, std::sqrt(squared / freedom)) : 1;
  check->calibration_m = widened * calibration / weights;
  check->stddev_m = std::hypot(scatter / std::sqrt(weights), check->calibration_m);
}

// Reads "250mm" or "250mm:0.05".
bool parse_length(const std::string& text, ScaleBar* known) {
  static const std::regex k_form(
      R"(((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(mm|cm|m)(?::(\d+\.?\d*|\.\d+)(?:mm)?)?)");
  std::smatch parts;
  if (text.size() > 40 || !std::regex_match(text, parts, k_form)) return false;
  const auto number = [&](size_t i) { return std::strtod(parts[i].str().c_str(), nullptr); };
  known->length_m = number(1) * (parts[2] == "mm" ? 1e-3 : parts[2] == "cm" ? 1e-2 : 1);
  if (parts[3].matched) known->stddev_m = 1e-3 * number(3);
  return known->length_m > 0 && known->stddev_m > 0 && known->stddev_m < known->length_m;
}

bool is_board(const std::string& word) {
  return std::ranges::any_of(std::array{"charuco:", "chessboard:", "aprilgrid:", "circles:", "acircles:"},
                             [&](const char* kind) { return word.starts_with(kind); });
}

// A second board, and its measured size if there is one.
Result<ScaleBar> parse_board_bar(const std::vector<std::string>& words) {
  LIMN_TRY(const Board board, Board::parse(words[0]));
  if (board.is_shifted())
    return error(
        "known length '{}': expected a board of rows and columns at right angles, found an asymmetric grid. "
        "Use a ChArUco board or a chessboard.",
        words[0]);
  std::optional<BoardMeasured> measured;
  if (words.size() > 1) {
    LIMN_TRY(measured, parse_board_measured(words[1]));
    LIMN_TRY_STATUS(check_measured(board, *measured));
  }
  if (words.size() > 2)
    return error("known length '{}': expected no more words, found '{}'.", words[0], words[2]);
  const PrintGrowth growth = expected_growth(board, measured);
  const double nominal_m = nominal_lengths(board).mean();
  const std::string name = board.text();
  return ScaleBar{name, name, nominal_m * (1 + growth.mean), nominal_m * growth.stddev, board};
}

std::string what_is_believed(const Board& board, const std::optional<BoardMeasured>& measured, bool is_used) {
  if (is_used) return "The rig's size is the mean that board and lengths give, each by its deviation.";
  if (board.is_exact) return "The rig keeps the board's size, because its text says that it is exact.";
  if (measured) return "The rig keeps the board's size, because it was measured, too.";
  return "The rig keeps the board's size: prints are wrong by some thousandths at most, so one of both "
         "numbers is a mistake, and images do not show which.";
}

}  // namespace

std::string ScaleBar::text() const {
  if (board) return "the board " + from;
  return is_side() ? "the side of " + from : fmt::format("{} to {}", from, to);
}

Result<ScaleBar> parse_scale_bar(const std::string& text) {
  std::istringstream stream(text);
  const std::vector<std::string> words{std::istream_iterator<std::string>(stream), {}};
  if (!words.empty() && is_board(words[0])) return parse_board_bar(words);
  ScaleBar known;
  if (words.size() == 2 || words.size() == 3) {
    known.from = words[0];
    known.to = words[words.size() - 2];
    if (parse_length(words.back(), &known) && (words.size() == 2 || known.from != known.to)) return known;
  }
  return error(
      "known length '{}': expected two markers and their distance, such as 'apriltag_36h11:3 "
      "apriltag_36h11:7 250mm', a marker and its side, such as 'apriltag_36h11:3 40mm', or a second board, "
      "such as 'charuco:6x5:30mm:aruco_5x5_50'; behind a length its standard deviation in mm, if it is not "
      "0.1, such as 250mm:0.05.",
      text);
}

Result<std::vector<ScaleBarCheck>> measure_scale_bars(const CaptureSet& captures,
                                                      const Solution& solution,
                                                      const std::vector<DetectedMark>& marks,
                                                      const std::vector<ScaleBar>& lengths,
                                                      double widened) {
  std::vector<ScaleBarCheck> checks;
  for (const ScaleBar& known : lengths) checks.push_back({known, {}, 0, 0});
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      const auto mark = [&](const std::string& name) {
        return find(marks, static_cast<int>(camera), static_cast<int>(pose), name);
      };
      const bool needed = std::any_of(lengths.begin(), lengths.end(), [&](const ScaleBar& known) {
        return mark(known.from) && mark(known.to);
      });
      for (size_t projector = 0; needed && projector < captures.projectors.size(); ++projector) {
        const CapturedDevice& device = captures.cameras[camera];
        LIMN_TRY(const Decoded decoded,
                 decode(captures.patterns[projector], captures.poses[pose].images[projector][camera],
                        device.width, device.height));
        for (ScaleBarCheck& check : checks) {
          const DetectedMark *a = mark(check.known.from), *b = mark(check.known.to);
          if (a && b) measure_view(solution, decoded, *a, *b, static_cast<int>(projector), &check);
        }
      }
    }
  }
  for (ScaleBarCheck& check : checks) conclude(widened, &check);
  return checks;
}

std::optional<PrintGrowth> growth_by_lengths(const std::vector<ScaleBarCheck>& checks, double assumed) {
  double weights = 0, sum = 0, calibration = 0, squared = 0;
  std::vector<PrintGrowth> each;  // with each length's own error alone
  for (const ScaleBarCheck& check : checks) {
    if (check.views.empty()) continue;
    const double share = check.known.length_m / check.measured_m;
    const double own_m =
        std::sqrt(std::max(0.0, check.stddev_m * check.stddev_m - check.calibration_m * check.calibration_m));
    each.push_back(
        {(1 + assumed) * share - 1,
         share * std::hypot(own_m / check.measured_m, check.known.stddev_m / check.known.length_m)});
    const double weight = 1 / std::pow(std::max(each.back().stddev, 1e-9), 2);
    weights += weight;
    sum += weight * each.back().mean;
    calibration += weight * check.calibration_m / check.measured_m;
  }
  if (each.empty()) return std::nullopt;
  const double mean = sum / weights;
  for (const PrintGrowth& one : each) squared += std::pow((one.mean - mean) / std::max(one.stddev, 1e-9), 2);
  const double freedom = static_cast<double>(each.size()) - 1;
  const double scatter = freedom > 0 ? std::max(1.0, std::sqrt(squared / freedom)) : 1;
  return PrintGrowth{mean, std::hypot(scatter / std::sqrt(weights), calibration / weights)};
}

bool may_be_growth(const PrintGrowth& expected, const PrintGrowth& found) {
  constexpr double k_largest = 0.01;  // prints differ by so much at most, if nobody scaled them
  const double difference = std::abs(found.mean - expected.mean);
  const bool is_unmeasured = expected.stddev > k_print_size / 2;
  return difference <= (is_unmeasured
                            ? k_largest
                            : std::max(k_scale_tolerance, 3 * std::hypot(expected.stddev, found.stddev)));
}

std::optional<Fault> scale_fault(const ScaleBarCheck& check,
                                 const Board& board,
                                 const std::optional<BoardMeasured>& measured,
                                 bool is_used) {
  const ScaleBar& known = check.known;
  const std::string name = known.text();
  if (check.views.empty())
    return Fault{FaultName::scale_bar_not_seen,
                 fmt::format("in no pose is {} seen whole by a camera and lit by a projector", name),
                 "place it where a camera sees it and a projector lights it", Severity::note};
  const double difference = check.measured_m - known.length_m, share = difference / known.length_m;
  const double stddev_m = std::hypot(check.stddev_m, known.stddev_m);
  if (std::abs(difference) <= 3 * stddev_m || std::abs(share) <= k_scale_tolerance) return std::nullopt;
  return Fault{
      FaultName::wrong_scale,
      fmt::format("{} is {:.2f} mm long, but {:.2f} mm (standard deviation {:.2f} mm) were measured in {} "
                  "views ({:+.2f} %). {}",
                  name, 1e3 * known.length_m, 1e3 * check.measured_m, 1e3 * stddev_m, check.views.size(),
                  100 * share, what_is_believed(board, measured, is_used)),
      fmt::format(
          "measure the board: its squares seem to be {:.3f} mm instead of {:g} mm; or measure {} again",
          1e3 * board.square_m / (1 + share), 1e3 * board.square_m, name)};
}

std::optional<Fault> growth_note(const PrintGrowth& found, const Board& board) {
  if (std::abs(found.mean) <= std::max(k_scale_tolerance, 3 * found.stddev)) return std::nullopt;
  return Fault{
      FaultName::wrong_scale,
      fmt::format("the known lengths show the board's size to differ from its text by {:+.2f} % (standard "
                  "deviation {:.2f} %). They are believed and part of the solve, because prints are "
                  "often wrong by so much, measured lengths are not",
                  100 * found.mean, 100 * found.stddev),
      fmt::format("describe the board with squares of {:.3f} mm instead of {:g} mm, or print it again "
                  "without scaling",
                  1e3 * board.square_m * (1 + found.mean), 1e3 * board.square_m),
      Severity::note};
}

}  // namespace limn::calib
