#include "calib/observations.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calib/tie_points.h"
#include "core/file.h"
#include "core/frame.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/median.h"
#include "core/parallel.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr const char* k_ended = "captures: stopped before all images were decoded.";
// Cells along a side of a square; the held-out error averages over the same cells.
constexpr int k_cells = 2;
// Distance from a square's edge: pixels on the edge receive light of one side only.
constexpr double k_inset_px = 2;
constexpr double k_inset = 0.06;    // share of a square, the same
constexpr int k_least_pixels = 12;  // in a cell: more than three times the number of a plane's parameters
// Share of a cell's bright pixels with a label; fewer are a chance selection, and biased.
constexpr double k_least_of_cell = 0.5;
constexpr double k_outlier_px = 3;  // distance from the cell's plane
// Share of the cell's bright pixels' level; halfway between ink and paper is 0.5.
constexpr double k_bright = 0.75;
constexpr double k_least_stddev_px = 0.02;

// Pixel of every grid point (column, row of squares' corners, rim included) that can be computed from nearby
// corners.
class Grid {
 public:
  Grid(const Board& board, const std::vector<BoardCorner>& corners) : board_(board), corners_(corners) {
    for (int row = 0; row <= board.rows; ++row) {
      for (int column = 0; column <= board.columns; ++column) points_.push_back(place(column, row));
    }
  }
  const std::optional<Vector2d>& at(int column, int row) const {
    return points_[static_cast<size_t>(row * (board_.columns + 1) + column)];
  }

 private:
  std::pair<int, int> grid_of(const BoardCorner& corner) const {
    return {corner.id % (board_.columns - 1) + 1, corner.id / (board_.columns - 1) + 1};
  }

  std::optional<Vector2d> place(int column, int row) const {
    constexpr size_t k_nearest = 12;
    std::vector<std::pair<int, const BoardCorner*>> near;
    for (const BoardCorner& corner : corners_) {
      const auto [c, r] = grid_of(corner);
      if (c == column && r == row) return corner.px;
      const int distance = (c - column) * (c - column) + (r - row) * (r - row);
      if (distance <= 18) near.emplace_back(distance, &corner);
    }
    std::stable_sort(near.begin(), near.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    if (near.size() < 6 || near.front().first > 2) return std::nullopt;
    near.resize(std::min(near.size(), k_nearest));
    return extrapolated(near, column, row);
  }

  std::optional<Vector2d> extrapolated(const std::vector<std::pair<int, const BoardCorner*>>& near,
                                       int column,
                                       int row) const {
    std::vector<cv::Point2d> squares, px;
    for (const auto& [distance, corner] : near) {
      const auto [c, r] = grid_of(*corner);
      squares.emplace_back((board_.p_line(c) - board_.p_line(column)) / board_.square_m,
                           (board_.p_line(r) - board_.p_line(row)) / board_.square_m);
      px.emplace_back(corner->px.x(), corner->px.y());
    }
    const cv::Mat h = cv::findHomography(squares, px, 0);
    if (h.empty()) return std::nullopt;
    const Vector2d found(h.at<double>(0, 2) / h.at<double>(2, 2), h.at<double>(1, 2) / h.at<double>(2, 2));
    const Vector2d nearest = near.front().second->px;
    const double side = (near[0].second->px - near[1].second->px).norm();
    if (!found.allFinite() || (found - nearest).norm() > 4 * side)
      return std::nullopt;  // the corners lie on one line
    return found;
  }

  const Board& board_;
  const std::vector<BoardCorner>& corners_;
  std::vector<std::optional<Vector2d>> points_;
};

// The four points of a square, in order around it.
using Quad = std::array<Vector2d, 4>;

std::vector<Quad> squares_of(const Board& board, const std::vector<BoardCorner>& corners) {
  const Grid grid(board, corners);
  std::vector<Quad> squares;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const auto &a = grid.at(column, row), &b = grid.at(column + 1, row), &c = grid.at(column + 1, row + 1),
                 &d = grid.at(column, row + 1);
      if (a && b && c && d) squares.push_back({*a, *b, *c, *d});
    }
  }
  return squares;
}

// The squares between four circles of an asymmetric grid; they stand on their corners.
std::vector<Quad> diamonds_of(const Board& board, const std::vector<BoardCorner>& corners) {
  const int across = board.columns - 1, down = board.rows - 1;
  // By the place on the lattice: `x` in spacings.
  const auto at = [&](int x, int row) -> const BoardCorner* {
    const int column = (x - row % 2) / 2;
    if (x < row % 2 || column >= across || row >= down) return nullptr;
    const auto found = std::find_if(corners.begin(), corners.end(), [&](const BoardCorner& corner) {
      return corner.id == row * across + column;
    });
    return found == corners.end() ? nullptr : &*found;
  };
  std::vector<Quad> diamonds;
  for (int row = 0; row + 2 < down; ++row) {
    for (int column = 0; column < across; ++column) {
      const int x = 2 * column + row % 2;
      const BoardCorner *a = at(x, row), *b = at(x + 1, row + 1), *c = at(x, row + 2),
                        *d = at(x - 1, row + 1);
      if (a && b && c && d) diamonds.push_back({a->px, b->px, c->px, d->px});
    }
  }
  return diamonds;
}

struct Labelled {
  Vector2d px, label;
  double weight = 0;
};

// The labelled pixels of a cell that see paper, with nothing but paper around them.
struct Cell {
  std::vector<Labelled> pixels;
  std::vector<int> levels;        // white minus black of all its pixels
  std::vector<int> least_levels;  // minimum of the 3 x 3 around each pixel, of the same
  std::vector<int> labelled_at;   // index of each labelled pixel in the two arrays above

  // Removes ink in the cell (a marker's) with its fringe: a pixel on the edge of ink receives its light from
  // one side, and so its label is wrong. False when too few of the remaining pixels have labels.
  bool keep_bright() {
    if (pixels.empty()) return false;
    std::vector<int> ranked = levels;
    const double limit = k_bright * value_of_rank(&ranked, ranked.size() * 9 / 10);
    const auto all =
        std::count_if(least_levels.begin(), least_levels.end(), [&](int level) { return level >= limit; });
    size_t kept = 0;
    for (size_t i = 0; i < pixels.size(); ++i) {
      if (least_levels[static_cast<size_t>(labelled_at[i])] >= limit) pixels[kept++] = pixels[i];
    }
    pixels.resize(kept);
    return static_cast<double>(kept) >= k_least_of_cell * static_cast<double>(all);
  }
};

// A cell's match, and the covariance of its pixels' places, px^2.
struct CellMatch {
  Match match;
  Eigen::Matrix2d spread;
};

// Fits a robust plane to a cell's labels; returns the means of the inliers.
std::optional<CellMatch> fitted(std::vector<Labelled> pixels) {
  for (int pass = 0; pass < 3; ++pass) {
    if (static_cast<int>(pixels.size()) < k_least_pixels) return std::nullopt;
    double total = 0;
    Vector2d mean = Vector2d::Zero(), mean_label = Vector2d::Zero();
    for (const Labelled& p : pixels) total += p.weight;
    for (const Labelled& p : pixels) {
      mean += p.weight / total * p.px;
      mean_label += p.weight / total * p.label;
    }
    Eigen::Matrix2d normal = 1e-9 * Eigen::Matrix2d::Identity(), product = Eigen::Matrix2d::Zero();
    for (const Labelled& p : pixels) {
      normal += p.weight * (p.px - mean) * (p.px - mean).transpose();
      product += p.weight * (p.px - mean) * (p.label - mean_label).transpose();
    }
    const Eigen::Matrix2d slope = normal.ldlt().solve(product);
    auto residual = [&](const Labelled& p) -> Vector2d {
      return p.label - mean_label - slope.transpose() * (p.px - mean);
    };
    double squared = 0;
    for (const Labelled& p : pixels) squared += p.weight / total * residual(p).squaredNorm() / 2;
    const double limit = std::min(k_outlier_px, std::max(4 * std::sqrt(squared), 1.0));
    const size_t before = pixels.size();
    std::erase_if(pixels, [&](const Labelled& p) { return residual(p).cwiseAbs().maxCoeff() > limit; });
    if (pixels.size() < before && pass < 2) continue;
    Match match;
    match.px_camera = mean;
    match.px_projector = mean_label;
    match.pixels = static_cast<int>(before);
    match.stddev_px = std::hypot(std::sqrt(squared / static_cast<double>(before)), k_least_stddev_px);
    return CellMatch{match, normal / total};
  }
  return std::nullopt;
}

// A polynomial of degree 3: its terms at a place, and by how much the mean of each over places that scatter
// around it is larger.
constexpr int k_terms = 10;
using Terms = Eigen::Matrix<double, 1, k_terms>;
Terms terms_at(const Vector2d& p) {
  const double x = p.x(), y = p.y();
  return Terms{{1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y}};
}
Terms terms_of_spread(const Vector2d& p, const Eigen::Matrix2d& spread) {
  const double x = p.x(), y = p.y(), xx = spread(0, 0), xy = spread(0, 1), yy = spread(1, 1);
  return Terms{{0, 0, 0, xx, xy, yy, 3 * x * xx, y * xx + 2 * x * xy, x * yy + 2 * y * xy, 3 * y * yy}};
}

// The labels over the whole board as a polynomial of a cell's place, robustly.
using LabelPolynomial = Eigen::Matrix<double, k_terms, 2>;
LabelPolynomial label_polynomial(const std::vector<CellMatch>& cells, const std::vector<Vector2d>& places) {
  constexpr double k_far = 4;  // medians
  LabelPolynomial labels = LabelPolynomial::Zero();
  const auto distance = [&](size_t i) {
    return (terms_at(places[i]) * labels - cells[i].match.px_projector.transpose()).norm();
  };
  double limit = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < 3; ++pass) {
    Eigen::Matrix<double, k_terms, k_terms> normal = Eigen::Matrix<double, k_terms, k_terms>::Zero();
    LabelPolynomial product = LabelPolynomial::Zero();
    for (size_t i = 0; i < cells.size(); ++i) {
      if (distance(i) > limit) continue;
      const Terms terms = terms_at(places[i]);
      normal += terms.transpose() * terms;
      product += terms.transpose() * cells[i].match.px_projector.transpose();
    }
    labels = normal.ldlt().solve(product);
    std::vector<double> distances;
    for (size_t i = 0; i < cells.size(); ++i) distances.push_back(distance(i));
    limit = std::max(k_far * median(std::move(distances)), 1e-3);
  }
  return labels;
}

// Perspective and lenses bend the labels over a cell, so that their mean is not the label at its pixels'
// mean, by a hundredth of a pixel where the board is tilted, to one side on the whole board. The bend follows
// from a polynomial over all cells.
void remove_bend_of_labels(std::vector<CellMatch>* cells) {
  constexpr size_t k_least_cells = 3 * k_terms;
  if (cells->size() < k_least_cells) return;
  Vector2d middle = Vector2d::Zero();
  for (const CellMatch& cell : *cells) middle += cell.match.px_camera / static_cast<double>(cells->size());
  double size = 1;
  for (const CellMatch& cell : *cells)
    size = std::max(size, (cell.match.px_camera - middle).cwiseAbs().maxCoeff());
  std::vector<Vector2d> places;
  for (const CellMatch& cell : *cells) places.emplace_back((cell.match.px_camera - middle) / size);
  const LabelPolynomial labels = label_polynomial(*cells, places);
  if (!labels.allFinite()) return;
  for (size_t i = 0; i < cells->size(); ++i) {
    CellMatch& cell = (*cells)[i];
    const Terms bend = terms_of_spread(places[i], cell.spread / (size * size));
    cell.match.px_projector -= (bend * labels).transpose();
  }
}

// The pixels of one square, by cell. `least_contrast`: minimum contrast of the 3 x 3 around each pixel.
using Cells = std::array<Cell, k_cells * k_cells>;
void collect(const Quad& quad, const Decoded& decoded, const cv::Mat& least_contrast, Cells* cells) {
  std::array<cv::Point2f, 4> from, to = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  Vector2d low = quad[0], high = quad[0];
  double side = 1e9;
  for (size_t i = 0; i < 4; ++i) {
    from[i] = {static_cast<float>(quad[i].x()), static_cast<float>(quad[i].y())};
    low = low.cwiseMin(quad[i]);
    high = high.cwiseMax(quad[i]);
    side = std::min(side, (quad[i] - quad[(i + 1) % 4]).norm());
  }
  const cv::Mat cv_h = cv::getPerspectiveTransform(from.data(), to.data());
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> h(cv_h.ptr<double>());
  const double inset = std::max(k_inset, k_inset_px / side);
  const cv::Mat& labels = decoded.px_projector;
  for (int y = std::max(0, static_cast<int>(low.y()));
       y <= std::min(labels.rows - 1, static_cast<int>(high.y()) + 1); ++y) {
    for (int x = std::max(0, static_cast<int>(low.x()));
         x <= std::min(labels.cols - 1, static_cast<int>(high.x()) + 1); ++x) {
      const Vector2d s = (h * Eigen::Vector3d(x, y, 1)).hnormalized();
      if (!(s.minCoeff() > inset) || !(s.maxCoeff() < 1 - inset)) continue;
      Cell& cell = (*cells)[static_cast<size_t>(static_cast<int>(s.y() * k_cells) * k_cells +
                                                static_cast<int>(s.x() * k_cells))];
      cell.levels.push_back(decoded.contrast.at<uchar>(y, x));
      cell.least_levels.push_back(least_contrast.at<uchar>(y, x));
      const auto& label = labels.at<cv::Vec2f>(y, x);
      if (std::isnan(label[0])) continue;
      const auto& variance = decoded.variance.at<cv::Vec2f>(y, x);
      cell.labelled_at.push_back(static_cast<int>(cell.levels.size()) - 1);
      cell.pixels.push_back(
          {Vector2d(x, y), Vector2d(label[0], label[1]), 1.0 / (variance[0] + variance[1])});
    }
  }
}

// The mean of the projectors' white images: the board is visible where any of them illuminates it.
Result<cv::Mat> bright_image(const CaptureSet& captures, size_t pose, size_t camera) {
  const CapturedDevice& device = captures.cameras[camera];
  cv::Mat sum(device.height, device.width, CV_32F, cv::Scalar(0));
  for (size_t p = 0; p < captures.projectors.size(); ++p) {
    const auto& path =
        captures.poses[pose].images[p][camera][static_cast<size_t>(captures.patterns[p].white())];
    LIMN_TRY(const cv::Mat white, read_shot(path, device.width, device.height));
    cv::add(sum, white, sum, cv::noArray(), CV_32F);
  }
  cv::Mat mean;
  sum.convertTo(mean, CV_8U, 1.0 / static_cast<double>(captures.projectors.size()));
  return mean;
}

// Whether a pixel and its neighbours see one surface of one colour. A pixel on the edge of ink or of an
// object receives light from two sides, and so its label is wrong.
bool on_one_surface(const Decoded& decoded, int x, int y) {
  constexpr int k_near = 2;  // px: radius of a lens's blur
  if (x < k_near || y < k_near || x + k_near >= decoded.contrast.cols || y + k_near >= decoded.contrast.rows)
    return false;
  int least = 255, most = 0;
  for (int v = y - k_near; v <= y + k_near; ++v) {
    for (int u = x - k_near; u <= x + k_near; ++u) {
      if (std::isnan(decoded.px_projector.at<cv::Vec2f>(v, u)[0])) return false;
      const int contrast = decoded.contrast.at<uchar>(v, u);
      least = std::min(least, contrast);
      most = std::max(most, contrast);
    }
  }
  return least >= k_bright * most;
}

// Decoded pixels on a coarse grid over the whole image.
std::vector<DensePixel> thinned(const Decoded& decoded, const std::vector<BoardCorner>& corners) {
  std::vector<cv::Point2f> px_corners, hull;
  for (const BoardCorner& corner : corners)
    px_corners.emplace_back(static_cast<float>(corner.px.x()), static_cast<float>(corner.px.y()));
  cv::convexHull(px_corners, hull);
  std::vector<DensePixel> dense;
  constexpr double k_most = 5000;  // for each image: an RMS accurate to a percent, at about 10 us each
  const cv::Mat& labels = decoded.px_projector;
  const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(labels.cols * labels.rows / k_most))));
  for (int y = step / 2; y < labels.rows; y += step) {
    for (int x = step / 2; x < labels.cols; x += step) {
      if (!on_one_surface(decoded, x, y)) continue;
      const auto& label = labels.at<cv::Vec2f>(y, x);
      DensePixel pixel;
      pixel.px_camera = {static_cast<float>(x), static_cast<float>(y)};
      pixel.px_projector = {label[0], label[1]};
      pixel.on_board = cv::pointPolygonTest(hull, {pixel.px_camera.x(), pixel.px_camera.y()}, false) >= 0;
      dense.push_back(pixel);
    }
  }
  return dense;
}

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// About a hundred fields: the lenses' edges need a few points each, and each point costs time in the solve.
constexpr TiePointOptions k_room_points{.columns = 12, .rows = 9};

// What one camera observed in one pose.
Result<Observed> observe_pose(const CaptureSet& captures,
                              int pose,
                              int camera,
                              const DecodeOptions& options) {
  const auto at_pose = static_cast<size_t>(pose), at_camera = static_cast<size_t>(camera);
  Observed seen;
  const double started = now();
  LIMN_TRY(const cv::Mat lit, bright_image(captures, at_pose, at_camera));
  const std::vector<BoardCorner> corners = find_board(captures.board, lit);
  seen.seconds_board = now() - started;
  if (corners.empty()) return seen;
  const double decoding = now();
  std::vector<Decoded> by_projector;
  const bool sees_patterns = captures.cameras[at_camera].sees == Spectrum::visible;
  for (size_t p = 0; sees_patterns && p < captures.projectors.size(); ++p) {
    const CapturedDevice& device = captures.cameras[at_camera];
    LIMN_TRY(Decoded decoded, decode(captures.patterns[p], captures.poses[at_pose].images[p][at_camera],
                                     device.width, device.height, options));
    const int projector = static_cast<int>(p);
    seen.decoded.push_back(
        {camera, projector, pose, decoded.lit, decoded.decoded, decoded.outliers, decoded.contrasted});
    seen.quality.push_back(decoded.quality);
    seen.quality.back().camera = camera;
    seen.quality.back().projector = projector;
    seen.quality.back().pose = pose;
    for (DensePixel pixel : thinned(decoded, corners)) {
      pixel.camera = camera;
      pixel.projector = projector;
      pixel.pose = pose;
      seen.dense.push_back(pixel);
    }
    for (Match match : matches_on_board(captures.board, corners, decoded)) {
      match.camera = camera;
      match.projector = projector;
      match.pose = pose;
      seen.observations.matches.push_back(match);
    }
    by_projector.push_back(std::move(decoded));
  }
  // The corners are those of the white images, the matches those of the mean image.
  Vector2d white_shift_px = Vector2d::Zero();
  for (const Decoded& decoded : by_projector)
    white_shift_px += decoded.quality.shake.white_shift_px / static_cast<double>(by_projector.size());
  for (const BoardCorner& corner : corners)
    seen.observations.corners.push_back(
        {camera, pose, corner.id, corner.px - white_shift_px, corner.stddev_px});
  seen.observations.cameras = captures.cameras;
  if (sees_patterns) add_room_points(by_projector, corners, camera, pose, k_room_points, &seen.observations);
  seen.seconds_decode = now() - decoding;
  return seen;
}

void append(const Observed& seen, Observed* all) {
  const auto put = [](const auto& from, auto* to) { to->insert(to->end(), from.begin(), from.end()); };
  const int points = static_cast<int>(all->observations.points.size());
  put(seen.observations.points, &all->observations.points);
  for (TiePointObservation tie_observation : seen.observations.tie_observations) {
    tie_observation.point += points;
    all->observations.tie_observations.push_back(tie_observation);
  }
  put(seen.observations.corners, &all->observations.corners);
  put(seen.observations.matches, &all->observations.matches);
  put(seen.decoded, &all->decoded);
  put(seen.quality, &all->quality);
  put(seen.dense, &all->dense);
  all->seconds_board += seen.seconds_board;
  all->seconds_decode += seen.seconds_decode;
}

// What a camera decodes that sees no projected light.
Decoded nothing_decoded(const CapturedDevice& camera) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const cv::Size size(camera.width, camera.height);
  Decoded decoded;
  decoded.px_projector = cv::Mat(size, CV_32FC2, cv::Scalar::all(none));
  decoded.variance = cv::Mat(size, CV_32FC2, cv::Scalar::all(0));
  decoded.contrast = cv::Mat::zeros(size, CV_8U);
  return decoded;
}

// A pose in which no camera sees the board is a scene capture.
Status observe_scenes(const CaptureSet& captures,
                      const DecodeOptions& options,
                      const std::function<bool()>& should_continue,
                      Observed* observed) {
  for (size_t pose = 0; pose < captures.poses.size(); ++pose) {
    const bool has_board = std::any_of(
        observed->observations.corners.begin(), observed->observations.corners.end(),
        [&](const CornerObservation& corner) { return static_cast<size_t>(corner.pose) == pose; });
    if (has_board) continue;
    const double started = now();
    std::vector<std::vector<Decoded>> decoded(captures.cameras.size());
    for (size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      const CapturedDevice& device = captures.cameras[camera];
      for (size_t p = 0; p < captures.projectors.size(); ++p) {
        if (should_continue && !should_continue()) return error("{}", k_ended);
        if (device.sees != Spectrum::visible) {
          decoded[camera].push_back(nothing_decoded(device));
          continue;
        }
        LIMN_TRY(Decoded seen, decode(captures.patterns[p], captures.poses[pose].images[p][camera],
                                      device.width, device.height, options));
        decoded[camera].push_back(std::move(seen));
      }
    }
    add_tie_points(decoded, static_cast<int>(pose), {}, &observed->observations);
    observed->seconds_decode += now() - started;
  }
  return {};
}

// How many series of images may be decoded at the same time, so that they stay below 3 GB together.
int series_at_once(const CaptureSet& captures) {
  constexpr double k_bytes_per_pixel = 110;  // measured with images of 12 million pixels
  constexpr double k_most_bytes = 3e9;
  double pixels = 1;
  for (const CapturedDevice& camera : captures.cameras)
    pixels = std::max(pixels, static_cast<double>(camera.width) * camera.height);
  return static_cast<int>(std::clamp(k_most_bytes / (k_bytes_per_pixel * pixels), 1.0, 1e6));
}

}  // namespace

Result<Observed> observe(const CaptureSet& captures,
                         const DecodeOptions& options,
                         const std::function<bool()>& should_continue) {
  Observed observed;
  observed.observations.board = captures.board;
  observed.observations.cameras = captures.cameras;
  observed.observations.projectors = captures.projectors;
  for (const CapturedPose& pose : captures.poses) observed.observations.poses.push_back(pose.name);
  const int cameras = static_cast<int>(captures.cameras.size());
  const int count = static_cast<int>(captures.poses.size()) * cameras;
  // Cameras and poses are processed independently, as many at once as cores and memory allow, and joined in
  // order.
  std::vector<std::optional<Result<Observed>>> parts(static_cast<size_t>(count));
  Progress progress("decode", count);
  std::mutex progress_mutex;
  int done = 0;
  std::atomic<int> next = 0;
  parallel_for(std::min(count, series_at_once(captures)), [&](int) {
    for (int i = next++; i < count; i = next++) {
      if (should_continue && !should_continue()) {
        parts[static_cast<size_t>(i)] = error("{}", k_ended);
        continue;
      }
      parts[static_cast<size_t>(i)] = observe_pose(captures, i / cameras, i % cameras, options);
      const std::lock_guard lock(progress_mutex);
      progress.step(++done);
    }
  });
  for (const auto& part : parts) {
    LIMN_TRY_STATUS(part->ok() ? Status() : Status(part->error()));
    append(**part, &observed);
  }
  LIMN_TRY_STATUS(observe_scenes(captures, options, should_continue, &observed));
  return observed;
}

Observed joined(Observed first, Observed more) {
  const int poses = static_cast<int>(first.observations.poses.size());
  const auto shift = [poses](auto* of_poses) {
    for (auto& seen : *of_poses) seen.pose += poses;
  };
  shift(&more.observations.corners);
  shift(&more.observations.matches);
  shift(&more.observations.points);
  shift(&more.decoded);
  shift(&more.quality);
  shift(&more.dense);
  append(more, &first);
  auto& names = first.observations.poses;
  names.insert(names.end(), more.observations.poses.begin(), more.observations.poses.end());
  return first;
}

std::vector<Match> matches_on_board(const Board& board,
                                    const std::vector<BoardCorner>& corners,
                                    const Decoded& decoded) {
  cv::Mat least_contrast;
  cv::erode(decoded.contrast, least_contrast, cv::Mat());
  std::vector<CellMatch> fits;
  for (const Quad& quad : board.is_shifted() ? diamonds_of(board, corners) : squares_of(board, corners)) {
    Cells cells;
    collect(quad, decoded, least_contrast, &cells);
    for (Cell& cell : cells) {
      if (!cell.keep_bright()) continue;
      if (auto fit = fitted(std::move(cell.pixels))) fits.push_back(*fit);
    }
  }
  remove_bend_of_labels(&fits);
  std::vector<Match> matches;
  for (const CellMatch& fit : fits) matches.push_back(fit.match);
  return matches;
}

Status save_observations(const Observations& observations, const std::filesystem::path& path) {
  nlohmann::ordered_json json = {{"schema", "limn.observations/1"},
                                 {"board", observations.board.text()},
                                 {"poses", observations.poses},
                                 {"corner", {"camera", "pose", "corner", "x", "y", "stddev_px"}},
                                 {"match",
                                  {"camera", "projector", "pose", "camera_x", "camera_y", "projector_x",
                                   "projector_y", "stddev_px", "pixels"}},
                                 {"point", {"camera", "pose", "x", "y"}},
                                 {"sighting", {"point", "by_projector", "imager", "x", "y", "stddev_px"}}};
  for (const CornerObservation& c : observations.corners)
    json["corners"].push_back({c.camera, c.pose, c.corner, c.px.x(), c.px.y(), c.stddev_px});
  for (const Match& m : observations.matches)
    json["matches"].push_back({m.camera, m.projector, m.pose, m.px_camera.x(), m.px_camera.y(),
                               m.px_projector.x(), m.px_projector.y(), m.stddev_px, m.pixels});
  for (const TiePoint& p : observations.points)
    json["points"].push_back({p.camera, p.pose, p.px_camera.x(), p.px_camera.y()});
  for (const TiePointObservation& s : observations.tie_observations)
    json["sightings"].push_back({s.point, s.by_projector ? 1 : 0, s.imager, s.px.x(), s.px.y(), s.stddev_px});
  return write_file(path, json_text(json) + "\n");
}

Observations without_pose(const Observations& observations, int pose) {
  Observations left = observations;
  std::erase_if(left.corners, [&](const CornerObservation& corner) { return corner.pose == pose; });
  std::erase_if(left.matches, [&](const Match& match) { return match.pose == pose; });
  return left;
}

}  // namespace limn::calib
