#include "calib/response/vignetting.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "calib/code/decode.h"
#include "calib/response/camera_response.h"
#include "core/median.h"

namespace limn::calib {
namespace {

constexpr size_t k_least_places = 50;
constexpr double k_prior = 0.5;               // standard deviation of each coefficient
constexpr double k_outlier = 4.7;             // Tukey's, in standard deviations of the logarithms
constexpr int k_camera = 2, k_projector = 4;  // coefficients: r2, r4; tilt too

// Position of a pixel relative to the centre, in half diagonals, as in Vignetting.
Eigen::Vector2d place(const Eigen::Vector2d& px, const CapturedDevice& device) {
  const Eigen::Vector2d half(device.width / 2.0, device.height / 2.0);
  return (px - half + Eigen::Vector2d::Constant(0.5)) / half.norm();
}

// The parameters: a logarithm for each camera and projector pair, then the cameras', then the projectors'.
class Problem {
 public:
  Problem(std::span<const PaperLight> light,
          const std::vector<CapturedDevice>& cameras,
          const std::vector<CapturedDevice>& projectors)
      : light_(light), cameras_(cameras), projectors_(projectors) {
    for (const PaperLight& l : light) pairs_.try_emplace({l.camera, l.projector}, 0);
    for (auto& [pair, index] : pairs_) index = unknowns_++;
    camera_at_ = unknowns_;
    projector_at_ = camera_at_ + k_camera * static_cast<int>(cameras.size());
    unknowns_ = projector_at_ + k_projector * static_cast<int>(projectors.size());
    x_ = Eigen::VectorXd::Zero(unknowns_);
    for (const PaperLight& l : light) start(l);
  }

  void solve() {
    for (int iteration = 0; iteration < 25; ++iteration) {
      std::vector<double> residuals;
      for (const PaperLight& l : light_) residuals.push_back(residual(l, nullptr));
      const double scale = 1.4826 * median_size(residuals) + 1e-6;
      Eigen::MatrixXd normal = prior();
      Eigen::VectorXd product = -normal * x_;
      Eigen::VectorXd row(unknowns_);
      for (size_t i = 0; i < light_.size(); ++i) {
        const double off = residual(light_[i], &row) / scale;
        if (std::abs(off) >= k_outlier) continue;
        const double weight = std::pow(1 - off * off / (k_outlier * k_outlier), 2) / (scale * scale);
        normal += weight * row * row.transpose();
        product -= weight * off * scale * row;
      }
      covariance_ = normal.inverse();
      const Eigen::VectorXd step = covariance_ * product;
      x_ += step;
      if (step.norm() < 1e-9) break;
    }
  }

  Vignetting camera(int index) const { return vignetting(camera_at_ + k_camera * index, false); }
  Vignetting projector(int index) const { return vignetting(projector_at_ + k_projector * index, true); }
  bool sees(int camera, int projector) const {
    return std::any_of(pairs_.begin(), pairs_.end(), [&](const auto& pair) {
      return (camera < 0 || pair.first.first == camera) && (projector < 0 || pair.first.second == projector);
    });
  }

 private:
  void start(const PaperLight& l) {
    double& x = x_[pairs_.at({l.camera, l.projector})];
    x = std::max(x == 0 ? -1e9 : x, std::log(l.light));
  }

  static double median_size(std::vector<double> values) {
    for (double& value : values) value = std::abs(value);
    return median(std::move(values));
  }

  Eigen::MatrixXd prior() const {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns_, unknowns_);
    normal.diagonal().tail(unknowns_ - camera_at_).setConstant(1 / (k_prior * k_prior));
    return normal;
  }

  // Computes log(model) - log(measured), and its derivatives by the parameters.
  double residual(const PaperLight& l, Eigen::VectorXd* row) const {
    const int pair = pairs_.at({l.camera, l.projector}), at_camera = camera_at_ + k_camera * l.camera,
              at_projector = projector_at_ + k_projector * l.projector;
    const Eigen::Vector2d c = place(l.px_camera, cameras_[static_cast<size_t>(l.camera)]),
                          p = place(l.px_projector, projectors_[static_cast<size_t>(l.projector)]);
    const Eigen::Vector2d by_camera(c.squaredNorm(), c.squaredNorm() * c.squaredNorm());
    const Eigen::Vector4d by_projector(p.squaredNorm(), p.squaredNorm() * p.squaredNorm(), p.x(), p.y());
    constexpr double k_least_gain = 0.05;
    const double camera = std::max(k_least_gain, 1 + by_camera.dot(x_.segment<k_camera>(at_camera)));
    const double projector =
        std::max(k_least_gain, 1 + by_projector.dot(x_.segment<k_projector>(at_projector)));
    if (row) {
      row->setZero();
      (*row)[pair] = 1;
      row->segment<k_camera>(at_camera) = by_camera / camera;
      row->segment<k_projector>(at_projector) = by_projector / projector;
    }
    return x_[pair] + std::log(camera) + std::log(projector) - std::log(l.light);
  }

  Vignetting vignetting(int at, bool tilted) const {
    Vignetting found;
    found.r2 = x_[at];
    found.r4 = x_[at + 1];
    if (tilted) found.tilt = {x_[at + 2], x_[at + 3]};
    const Eigen::Vector2d corner(1, 1);
    found.corner_stddev = std::sqrt(corner.dot(covariance_.block<2, 2>(at, at) * corner));
    return found;
  }

  std::span<const PaperLight> light_;
  const std::vector<CapturedDevice>&cameras_, &projectors_;
  std::map<std::pair<int, int>, int> pairs_;
  int unknowns_ = 0, camera_at_ = 0, projector_at_ = 0;
  Eigen::VectorXd x_;
  Eigen::MatrixXd covariance_;
};

struct ShotPair {
  cv::Mat white, black;
};

Result<ShotPair> shots_of(const CaptureSet& captures, const Match& match) {
  const auto projector = static_cast<size_t>(match.projector), camera = static_cast<size_t>(match.camera);
  const auto& files = captures.poses[static_cast<size_t>(match.pose)].images[projector][camera];
  const Patterns& patterns = captures.patterns[projector];
  const CapturedDevice& device = captures.cameras[camera];
  const auto& white_file = files[static_cast<size_t>(patterns.white())];
  const auto& black_file = files[static_cast<size_t>(patterns.black())];
  LIMN_TRY(const int used_bits, find_used_bits(white_file));
  LIMN_TRY(cv::Mat white, read_shot(white_file, device.width, device.height, used_bits));
  LIMN_TRY(cv::Mat black, read_shot(black_file, device.width, device.height, used_bits));
  return ShotPair{white, black};
}

// Share of a square, to each side of a match: holds paper even where a marker is.
constexpr double k_reach = 0.2;
constexpr double k_as_bright = 0.88;  // share of the brightest tenth: paper, no edge of ink
constexpr size_t k_least_pixels = 6;

// Light of the paper around a match, white minus black, and its position; nothing where it is clipped.
std::optional<PaperLight> paper_around(const ShotPair& shots,
                                       const Decoding& decoding,
                                       const Match& match,
                                       double reach_px) {
  struct Bright {
    double light;
    Eigen::Vector2d px;
  };
  const auto low = [&](double at) { return std::max(0, static_cast<int>(std::lround(at - reach_px))); };
  const auto high = [&](double at, int side) {
    return std::min(side - 1, static_cast<int>(std::lround(at + reach_px)));
  };
  std::vector<Bright> pixels;
  for (int y = low(match.px_camera.y()); y <= high(match.px_camera.y(), shots.white.rows); ++y)
    for (int x = low(match.px_camera.x()); x <= high(match.px_camera.x(), shots.white.cols); ++x) {
      const uchar white = shots.white.at<uchar>(y, x);
      if (white >= k_clipped) return std::nullopt;
      pixels.push_back({decoding.light[white] - decoding.light[shots.black.at<uchar>(y, x)], {x, y}});
    }
  if (pixels.size() < k_least_pixels) return std::nullopt;
  const auto tenth = pixels.begin() + static_cast<std::ptrdiff_t>(pixels.size() * 9 / 10);
  std::nth_element(pixels.begin(), tenth, pixels.end(),
                   [](const Bright& a, const Bright& b) { return a.light < b.light; });
  const double least = k_as_bright * tenth->light;
  PaperLight mean{match.camera, match.projector, Eigen::Vector2d::Zero(), match.px_projector, 0};
  size_t count = 0;
  for (const Bright& pixel : pixels) {
    if (pixel.light < least) continue;
    mean.light += pixel.light;
    mean.px_camera += pixel.px;
    ++count;
  }
  if (count < k_least_pixels || !(mean.light > 0)) return std::nullopt;
  mean.light /= static_cast<double>(count);
  mean.px_camera /= static_cast<double>(count);
  return mean;
}

// Size of a square of the board in a camera's image, pixels.
double square_px(const Imager& camera,
                 const Pose& world_from_board,
                 const Eigen::Vector3d& p,
                 double square_m) {
  const auto here = camera.project(p),
             beside = camera.project(p + world_from_board.rotation * Eigen::Vector3d(square_m, 0, 0)),
             below = camera.project(p + world_from_board.rotation * Eigen::Vector3d(0, square_m, 0));
  if (!here || !beside || !below) return 0;
  return std::min((*beside - *here).norm(), (*below - *here).norm());
}

// Ink is far darker than paper; light between the two comes from an edge.
void keep_paper(std::vector<PaperLight>* light) {
  std::map<std::pair<int, int>, std::vector<double>> values;
  for (const PaperLight& l : *light) values[{l.camera, l.projector}].push_back(l.light);
  for (auto& [pair, sorted] : values) std::sort(sorted.begin(), sorted.end());
  std::erase_if(*light, [&](const PaperLight& l) {
    const auto& sorted = values.at({l.camera, l.projector});
    constexpr double k_paper = 0.4;  // share of bright paper; ink is 0.05 to 0.15
    return l.light < k_paper * sorted[sorted.size() * 9 / 10];
  });
}

}  // namespace

Result<std::vector<PaperLight>> paper_light(const CaptureSet& captures,
                                            const Observations& observations,
                                            const Solution& solution,
                                            const std::vector<CameraResponse>& cameras) {
  std::vector<PaperLight> light;
  std::map<std::array<int, 3>, ShotPair> shots;
  for (const Match& match : observations.matches) {
    const std::string& name = captures.cameras[static_cast<size_t>(match.camera)].name;
    const auto response = std::find_if(cameras.begin(), cameras.end(),
                                       [&](const CameraResponse& c) { return c.camera == name; });
    const auto& pose = solution.world_from_board[static_cast<size_t>(match.pose)];
    if (response == cameras.end() || !pose) continue;
    const auto p = surface_point(observations, solution, *pose, match);
    if (!p) continue;
    const std::array<int, 3> series = {match.pose, match.projector, match.camera};
    if (!shots.contains(series)) {
      LIMN_TRY(ShotPair read, shots_of(captures, match));
      shots.clear();  // matches are sorted by series
      shots.emplace(series, std::move(read));
    }
    const Decoding decode = decoding(*response);
    const double reach = k_reach * square_px(solution.rig.cameras[static_cast<size_t>(match.camera)], *pose,
                                             *p, observations.board.square_m);
    auto seen = paper_around(shots.at(series), decode, match, reach);
    const Imager& projector = solution.rig.projectors[static_cast<size_t>(match.projector)];
    const Eigen::Vector3d d = projector.imager_from_world.inverse().translation - *p;
    const double cosine = std::abs((pose->rotation * Eigen::Vector3d::UnitZ()).dot(d.normalized()));
    constexpr double k_least_cosine = 0.1;
    if (!seen || cosine < k_least_cosine) continue;
    seen->light *= d.squaredNorm() / cosine;
    light.push_back(*seen);
  }
  keep_paper(&light);
  return light;
}

void add_vignetting(std::span<const PaperLight> light,
                    const std::vector<CapturedDevice>& cameras,
                    const std::vector<CapturedDevice>& projectors,
                    RigResponses* responses) {
  if (light.size() < k_least_places) return;
  Problem problem(light, cameras, projectors);
  problem.solve();
  for (CameraResponse& response : responses->cameras)
    for (int i = 0; i < static_cast<int>(cameras.size()); ++i)
      if (cameras[static_cast<size_t>(i)].name == response.camera && problem.sees(i, -1))
        response.vignetting = problem.camera(i);
  for (ProjectorResponse& response : responses->projectors)
    for (int i = 0; i < static_cast<int>(projectors.size()); ++i)
      if (projectors[static_cast<size_t>(i)].name == response.projector && problem.sees(-1, i))
        response.vignetting = problem.projector(i);
}

}  // namespace limn::calib
