#include "projector/shadow_detector.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/median.h"
#include "projector/light_levels.h"

namespace limn::projector {
namespace {

// The prior of a patch's model, for light that is 1 at full scale and irradiance that is 1 at a typical
// patch. Room light and albedo are unknown; the projectors are assumed to be alike.
constexpr float k_offset = 0.03F, k_offset_stddev = 0.15F;
constexpr float k_gain = 0.5F, k_albedo_stddev = 0.5F, k_projector_stddev = 0.04F;
// Standard deviation of a patch's light: shot noise of 64 pixels, and rounding.
constexpr float k_noise = 0.0012F;
constexpr float k_drift = 0.002F;  // process noise: relative change of a patch's model from frame to frame
// Standard deviation of the room light, relative: people walk through it.
constexpr float k_offset_unmodelled = 0.01F;
constexpr std::uint8_t k_too_bright = 250;  // grey level that counts as overexposed
constexpr float k_least_weight = 0.02F;     // weight of a patch without light among illuminated ones
// Limit for each patch, so that none decides alone: five standard deviations.
constexpr float k_most_cost = 25;
constexpr float k_unexplained_cost = 9;  // a patch with a higher cost fits no explanation
constexpr float k_unchanged_cost = 4;    // a patch with a lower cost has not changed
constexpr float k_change_cost = 3;       // cost of a change of one projector's state
constexpr float k_least_vote = 1;        // least difference of a cell's votes that changes its state
constexpr float k_most_vote = 10;
// Limits for the blocked cells among the eight neighbours.
constexpr float k_most_others = 5, k_few_others = 2;
constexpr float k_stale_votes = 0.5F;  // factor for old votes when the next frame arrives
// After this many frames without an explanation, the patch is learned afresh.
constexpr std::uint8_t k_patience = 60;
// Labels that are not sets of projectors.
constexpr std::uint8_t k_no_label = 255, k_unexplained = 254, k_dark = 253;
constexpr float k_infinity = 1e30F;
constexpr std::size_t k_all_sets = 4;  // with more projectors, no three are assumed blocked at one point
constexpr std::size_t k_most_projectors = 7;  // so that all sets of projectors fit into the labels

// Median distance between horizontal neighbours that both have a value.
double typical_distance(const cv::Mat& places, int dimensions) {
  std::vector<double> distances;
  for (int row = 0; row < places.rows; ++row)
    for (int column = 1; column < places.cols; ++column) {
      const auto& a = places.at<cv::Vec4f>(row, column - 1);
      const auto& b = places.at<cv::Vec4f>(row, column);
      // Channel that says whether there is a value: the irradiance, or w of a point.
      const int value_channel = dimensions == 3 ? 3 : 2;
      if (!(a[value_channel] > 0 && b[value_channel] > 0)) continue;
      double sum = 0;
      for (int k = 0; k < dimensions; ++k) sum += std::pow(static_cast<double>(a[k] - b[k]), 2);
      distances.push_back(std::sqrt(sum));
    }
  return median(std::move(distances), 1.0);
}

// Mean light of each patch.
cv::Mat in_patches(const cv::Mat& levels, const cv::Mat& light_of_level, const cv::Size& patches) {
  cv::Mat light, out;
  cv::LUT(levels, light_of_level, light);
  cv::resize(light, out, patches, 0, 0, cv::INTER_AREA);
  return out;
}

cv::Mat too_bright(const cv::Mat& levels, const cv::Size& patches) {
  cv::Mat bright = levels >= k_too_bright, channels[3];
  cv::resize(bright, bright, patches, 0, 0, cv::INTER_AREA);
  if (bright.channels() == 1) return bright;
  cv::split(bright, channels);
  return channels[0] | channels[1] | channels[2];
}

// Blocked cells and the cells around them become 0; two cells further all is 1.
cv::Mat softened(const cv::Mat& blocked) {
  cv::Mat grown, soft;
  cv::dilate(blocked, grown, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  cv::Mat(1 - grown).convertTo(soft, CV_32F);
  cv::blur(soft, soft, {3, 3}, {-1, -1}, cv::BORDER_REPLICATE);
  return soft;
}

int cells(int pixels, int cell_px) { return (pixels + cell_px - 1) / cell_px; }

float square(float value) { return value * value; }

// The light that a model predicts for the arriving light `x` (1 for the offset, then one value for each
// projector).
struct Prediction {
  float mean = 0, variance = 0;
};

Prediction predicted(const float* model, const float* x, std::size_t d) {
  Prediction out;
  const float* covariance = model + d;
  for (std::size_t i = 0; i < d; ++i) {
    if (x[i] == 0) continue;
    out.mean += model[i] * x[i];
    for (std::size_t j = 0; j < d; ++j) out.variance += x[i] * covariance[i * d + j] * x[j];
  }
  return out;
}

// Updates the model with the measured light and its variance (Kalman filter).
void update_model(float light, const float* x, float variance, std::size_t d, float* model) {
  float* covariance = model + d;
  const Prediction f = predicted(model, x, d);
  float gain[k_most_projectors + 1], length_2 = 0;
  for (std::size_t i = 0; i < d; ++i) {
    gain[i] = 0;
    for (std::size_t j = 0; j < d; ++j) gain[i] += covariance[i * d + j] * x[j];
    length_2 += x[i] * x[i];
  }
  const float whole = f.variance + variance;
  const float drift = square(k_drift * light / length_2);
  for (std::size_t i = 0; i < d; ++i) {
    model[i] += gain[i] / whole * (light - f.mean);
    for (std::size_t j = 0; j < d; ++j)
      covariance[i * d + j] += drift * x[i] * x[j] - gain[i] * gain[j] / whole;
  }
}

// One projector with the cells of its image.
struct Source {
  int width = 0, height = 0;
  cv::Mat light;    // CV_32FC3, 1 x 256: light of each display value (BGR), including the black level
  cv::Mat blocked;  // CV_8U, one pixel for each cell: 1 where no light arrives
  cv::Mat map;
};

struct CameraState {
  Imager imager;
  cv::Mat light;  // CV_32F, 1 x 256: light of each grey level
  IlluminatedPatches patches;
  double spacing_m = 0;  // typical distance of neighbouring patches on the prototype
  double typical_irradiance = 1;
  std::vector<int> footprints;  // side of a patch in each projector's image, in projector pixels
  int channels = 0;
  // For each patch and channel: mean (offset, then gains), covariance, and the projectors' light at the last
  // update.
  std::vector<float> models;
  // For each patch: number of consecutive frames without an explanation.
  std::vector<std::uint8_t> unexplained;
  // For each projector CV_32FC2, one pixel for each cell: votes for free and for blocked.
  std::vector<cv::Mat> votes;
};

// The evaluation of one frame, patch by patch.
struct Evaluation {
  cv::Mat light;                   // CV_32F, with the camera's number of channels: measured light
  std::vector<cv::Mat> unblocked;  // same type: irradiance x light from each projector if all of it arrives
  cv::Mat usable;                  // CV_8U: illuminated by a projector and not overexposed
  std::vector<cv::Mat> costs;      // CV_32F for each explanation: its cost around each patch
  std::vector<cv::Mat> misfits;    // the same without the logarithm of the variance
  cv::Mat labels;  // CV_8U: the set of blocked projectors, or k_unexplained, k_dark or k_no_label
  // CV_32F for each projector: by how much the label's cost is lower than that of the alternative.
  std::vector<cv::Mat> gaps;
};

// The index of the patch that a point of the prototype had before the prototype moved.
std::optional<std::size_t> patch_of(const CameraState& camera, const cv::Vec4f& point) {
  if (!(point[3] > 0)) return std::nullopt;
  const IlluminatedPatches& patches = camera.patches;
  const Eigen::Vector3d p = Eigen::Vector3f(point[0], point[1], point[2]).cast<double>();
  const auto px = camera.imager.project(patches.prototype_from_world.inverse() * p);
  if (!px || !camera.imager.contains(*px)) return std::nullopt;
  const int column = static_cast<int>((px->x() + 0.5) / patches.side_px);
  const int row = static_cast<int>((px->y() + 0.5) / patches.side_px);
  if (column >= patches.points.cols || row >= patches.points.rows) return std::nullopt;
  const auto& q = patches.points.at<cv::Vec4f>(row, column);
  const bool is_same =
      q[3] > 0 && (Eigen::Vector3f(q[0], q[1], q[2]).cast<double>() - p).norm() < camera.spacing_m;
  if (!is_same) return std::nullopt;  // the point was hidden by another side of the prototype
  return static_cast<std::size_t>(row * patches.points.cols + column);
}

}  // namespace

struct ShadowDetector::Impl {
  ShadowDetectorOptions options;
  std::vector<Source> sources;
  std::vector<CameraState> cameras;
  std::vector<unsigned> explanations;  // the sets of blocked projectors that are tried, as bits

  Impl(const Rig& rig, const ShadowDetectorOptions& options_in) : options(options_in) {
    LIMN_CHECK(options.cell_px > 0 && rig.projectors.size() <= k_most_projectors);
    for (const Imager& imager : rig.projectors) {
      const cv::Size size(cells(imager.width, options.cell_px), cells(imager.height, options.cell_px));
      sources.push_back({imager.width, imager.height, light_of_display(rig, imager.name),
                         cv::Mat(size, CV_8U, cv::Scalar(0)), cv::Mat(size, CV_32F, cv::Scalar(1))});
    }
    for (const Imager& imager : rig.cameras) {
      CameraState camera;
      camera.imager = imager;
      camera.light = light_of_levels(rig, imager.name);
      for (const Source& source : sources)
        camera.votes.emplace_back(source.blocked.size(), CV_32FC2, cv::Scalar::all(0));
      cameras.push_back(std::move(camera));
    }
    for (unsigned set = 0; set < 1U << sources.size(); ++set)
      if (sources.size() <= k_all_sets || std::popcount(set) <= 2) explanations.push_back(set);
  }

  std::size_t dimensions() const { return sources.size() + 1; }
  std::size_t model_size() const { return dimensions() * (dimensions() + 1) + sources.size(); }
  cv::Point cell_of(const cv::Vec4f& patch_light) const {
    return {static_cast<int>((patch_light[0] + 0.5F) / static_cast<float>(options.cell_px)),
            static_cast<int>((patch_light[1] + 0.5F) / static_cast<float>(options.cell_px))};
  }

  void reset_model(CameraState* camera, std::size_t patch) const;
  void reset_models(CameraState* camera) const;
  Evaluation evaluation_of(const CameraState& camera,
                           const cv::Mat& frame,
                           std::span<const cv::Mat> shown) const;
  float variance_of(const float* model, const float* x) const;
  void compute_costs(const CameraState& camera, Evaluation* evaluation) const;
  std::pair<unsigned, unsigned> reached_and_blocked(const CameraState& camera, int row, int column) const;
  void choose_explanations(const CameraState& camera, Evaluation* evaluation) const;
  void collect_votes(const Evaluation& evaluation, CameraState* camera) const;
  bool count_votes();
  void update_models(const Evaluation& evaluation, CameraState* camera) const;
};

void ShadowDetector::Impl::reset_model(CameraState* camera, std::size_t patch) const {
  const std::size_t d = dimensions();
  const auto channels = static_cast<std::size_t>(camera->channels);
  for (std::size_t c = 0; c < channels; ++c) {
    float* mean = &camera->models[(patch * channels + c) * model_size()];
    float* covariance = mean + d;
    for (std::size_t i = 0; i < d; ++i) {
      mean[i] = i == 0 ? k_offset : k_gain;
      for (std::size_t j = 0; j < d; ++j) {
        float value = i == 0 || j == 0 ? 0 : square(k_albedo_stddev);
        if (i == j) value += square(i == 0 ? k_offset_stddev : k_projector_stddev);
        covariance[i * d + j] = value;
      }
    }
    std::fill_n(covariance + d * d, sources.size(), 0.0F);
  }
  camera->unexplained[patch] = 0;
}

void ShadowDetector::Impl::reset_models(CameraState* camera) const {
  const std::size_t patches = camera->patches.points.total();
  camera->models.resize(patches * static_cast<std::size_t>(camera->channels) * model_size());
  camera->unexplained.assign(patches, 0);
  for (std::size_t patch = 0; patch < patches; ++patch) reset_model(camera, patch);
}

Evaluation ShadowDetector::Impl::evaluation_of(const CameraState& camera,
                                               const cv::Mat& frame,
                                               std::span<const cv::Mat> shown) const {
  Evaluation evaluation;
  const IlluminatedPatches& patches = camera.patches;
  const cv::Size size = patches.points.size();
  const cv::Rect covered(0, 0, size.width * patches.side_px, size.height * patches.side_px);
  evaluation.light = in_patches(frame(covered), camera.light, size);
  evaluation.usable = cv::Mat(size, CV_8U, cv::Scalar(0));
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const Source& source = sources[i];
    cv::Mat image = shown[i], light, place[4], irradiance;
    if (image.empty()) image = cv::Mat(source.height, source.width, CV_8UC3, cv::Scalar::all(0));
    LIMN_CHECK(image.type() == CV_8UC3 && image.cols == source.width && image.rows == source.height);
    cv::LUT(image, source.light, light);
    if (camera.channels == 1) light = luminance(light);
    const int side = camera.footprints[i];
    cv::blur(light, light, {side, side}, {-1, -1}, cv::BORDER_REPLICATE);
    cv::split(patches.by_projector[i], place);
    cv::remap(light, light, place[0], place[1], cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    evaluation.usable |= place[2] > 0;
    irradiance = place[2] / camera.typical_irradiance;
    cv::merge(std::vector<cv::Mat>(static_cast<std::size_t>(camera.channels), irradiance), irradiance);
    evaluation.unblocked.push_back(light.mul(irradiance));
  }
  evaluation.usable.setTo(0, too_bright(frame(covered), size));
  return evaluation;
}

// The variance of a patch's light in addition to the model's own variance.
float ShadowDetector::Impl::variance_of(const float* model, const float* x) const {
  const std::size_t d = dimensions();
  const float* last = model + d + d * d;
  float change = 0;
  for (std::size_t i = 0; i < sources.size(); ++i) change += model[i + 1] * (x[i + 1] - last[i]);
  return square(k_noise) + square(k_offset_unmodelled * model[0]) +
         square(static_cast<float>(options.unmodelled) * change);
}

// Computes the cost of each explanation: minus twice its log-likelihood, averaged over the channels and the
// neighbouring patches. Brightly illuminated patches have the highest weight.
void ShadowDetector::Impl::compute_costs(const CameraState& camera, Evaluation* evaluation) const {
  const std::size_t n = sources.size(), d = dimensions();
  const auto channels = static_cast<std::size_t>(camera.channels);
  const cv::Size size = evaluation->light.size();
  for (std::size_t k = 0; k < explanations.size(); ++k) {
    evaluation->costs.emplace_back(size, CV_32F, cv::Scalar(0));
    evaluation->misfits.emplace_back(size, CV_32F, cv::Scalar(0));
  }
  cv::Mat weight(size, CV_32F, cv::Scalar(0));
  cv::parallel_for_({0, size.height}, [&](const cv::Range& rows) {
    float x[k_most_projectors + 1] = {1};
    for (int row = rows.start; row < rows.end; ++row)
      for (int column = 0; column < size.width; ++column) {
        if (!evaluation->usable.at<std::uint8_t>(row, column)) continue;
        const auto patch = static_cast<std::size_t>(row * size.width + column);
        for (std::size_t c = 0; c < channels; ++c) {
          const float* model = &camera.models[(patch * channels + c) * model_size()];
          const auto value = [&](const cv::Mat& m) {
            return m.ptr<float>(row)[static_cast<std::size_t>(column) * channels + c];
          };
          const float light = value(evaluation->light);
          float brightest = 0;
          for (std::size_t i = 0; i < n; ++i)
            brightest = std::max(brightest, model[i + 1] * value(evaluation->unblocked[i]));
          const float patch_weight = std::max(k_least_weight, brightest / (brightest + 2 * k_noise));
          weight.at<float>(row, column) += patch_weight;
          for (std::size_t k = 0; k < explanations.size(); ++k) {
            for (std::size_t i = 0; i < n; ++i)
              x[i + 1] = (explanations[k] >> i & 1U) != 0 ? 0 : value(evaluation->unblocked[i]);
            const Prediction f = predicted(model, x, d);
            const float variance = f.variance + variance_of(model, x);
            const float misfit = std::min(k_most_cost, square(f.mean - light) / variance);
            evaluation->misfits[k].at<float>(row, column) += patch_weight * misfit;
            evaluation->costs[k].at<float>(row, column) +=
                patch_weight * (misfit + std::log(variance / square(k_noise)));
          }
        }
      }
  });
  const auto around = [](cv::Mat& m) {
    cv::boxFilter(m, m, CV_32F, {3, 3}, {-1, -1}, false, cv::BORDER_CONSTANT);
  };
  around(weight);
  weight = cv::max(weight, k_least_weight);
  for (std::vector<cv::Mat>* sums : {&evaluation->costs, &evaluation->misfits})
    for (cv::Mat& sum : *sums) {
      around(sum);
      sum /= weight;
    }
}

// The set of projectors that reach a patch, and the subset whose light was blocked at the last frame.
std::pair<unsigned, unsigned> ShadowDetector::Impl::reached_and_blocked(const CameraState& camera,
                                                                        int row,
                                                                        int column) const {
  unsigned reached = 0, blocked = 0;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const auto& patch_light = camera.patches.by_projector[i].at<cv::Vec4f>(row, column);
    if (!(patch_light[2] > 0)) continue;
    reached |= 1U << i;
    if (sources[i].blocked.at<std::uint8_t>(cell_of(patch_light)) != 0) blocked |= 1U << i;
  }
  return {reached, blocked};
}

// Chooses the explanation with the least cost around each patch; each change of a projector's state adds to
// the cost. Where no light arrives at all (k_dark), the state stays: no projector can fill the shadow, and it
// may be a dark thing before the camera.
void ShadowDetector::Impl::choose_explanations(const CameraState& camera, Evaluation* evaluation) const {
  const cv::Size size = evaluation->light.size();
  evaluation->labels = cv::Mat(size, CV_8U, cv::Scalar(k_no_label));
  for (std::size_t i = 0; i < sources.size(); ++i) evaluation->gaps.emplace_back(size, CV_32F, cv::Scalar(0));
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      if (!evaluation->usable.at<std::uint8_t>(row, column)) continue;
      const auto [reached, before] = reached_and_blocked(camera, row, column);
      const auto cost = [&](std::size_t k) { return evaluation->costs[k].at<float>(row, column); };
      std::size_t best = 0, unchanged = 0;
      float least = k_infinity;
      for (std::size_t k = 0; k < explanations.size(); ++k) {
        if ((explanations[k] & ~reached) != 0) continue;
        const auto changes = static_cast<float>(std::popcount(explanations[k] ^ before));
        if (changes == 0) unchanged = k;
        if (cost(k) + k_change_cost * changes >= least) continue;
        least = cost(k) + k_change_cost * changes;
        best = k;
      }
      const auto misfit = [&](std::size_t k) { return evaluation->misfits[k].at<float>(row, column); };
      if (misfit(unchanged) < k_unchanged_cost) best = unchanged;
      if (explanations[best] == reached) {
        evaluation->labels.at<std::uint8_t>(row, column) = k_dark;
        continue;
      }
      if (misfit(best) > k_unexplained_cost) {
        evaluation->labels.at<std::uint8_t>(row, column) = k_unexplained;
        continue;
      }
      evaluation->labels.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(explanations[best]);
      for (std::size_t i = 0; i < sources.size(); ++i) {
        const unsigned bit = 1U << i;
        if ((reached & bit) == 0) continue;
        float otherwise = cost(unchanged);
        if (((explanations[best] ^ before) & bit) == 0) {
          otherwise = k_infinity;
          for (std::size_t k = 0; k < explanations.size(); ++k)
            if ((explanations[k] & ~reached) == 0 && ((explanations[k] ^ explanations[best]) & bit) != 0)
              otherwise = std::min(otherwise, cost(k));
        }
        evaluation->gaps[i].at<float>(row, column) = std::clamp(otherwise - cost(best), 0.0F, k_most_vote);
      }
    }
}

void ShadowDetector::Impl::collect_votes(const Evaluation& evaluation, CameraState* camera) const {
  for (std::size_t i = 0; i < sources.size(); ++i) {
    camera->votes[i].setTo(0);
    for (int row = 0; row < evaluation.labels.rows; ++row)
      for (int column = 0; column < evaluation.labels.cols; ++column) {
        const std::uint8_t label = evaluation.labels.at<std::uint8_t>(row, column);
        const auto& patch_light = camera->patches.by_projector[i].at<cv::Vec4f>(row, column);
        if (label >= k_dark || !(patch_light[2] > 0)) continue;
        camera->votes[i].at<cv::Vec2f>(cell_of(patch_light))[label >> i & 1] +=
            evaluation.gaps[i].at<float>(row, column);
      }
  }
}

bool ShadowDetector::Impl::count_votes() {
  bool changed = false;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    Source& source = sources[i];
    cv::Mat votes = cameras.front().votes[i].clone(), counted = source.blocked.clone();
    for (std::size_t k = 1; k < cameras.size(); ++k) votes += cameras[k].votes[i];
    for (int row = 0; row < votes.rows; ++row)
      for (int column = 0; column < votes.cols; ++column) {
        const cv::Vec2f& vote = votes.at<cv::Vec2f>(row, column);
        std::uint8_t& blocked = counted.at<std::uint8_t>(row, column);
        if (vote[1 - blocked] > vote[blocked] + k_least_vote) blocked = 1 - blocked;
      }
    // A cell that no camera sees follows the majority of its neighbours. A single blocked cell is no shadow.
    cv::Mat neighbours;
    counted.convertTo(neighbours, CV_32F);
    cv::boxFilter(neighbours, neighbours, CV_32F, {3, 3}, {-1, -1}, false, cv::BORDER_REPLICATE);
    for (int row = 0; row < votes.rows; ++row)
      for (int column = 0; column < votes.cols; ++column) {
        const cv::Vec2f& vote = votes.at<cv::Vec2f>(row, column);
        std::uint8_t& blocked = counted.at<std::uint8_t>(row, column);
        const float others = neighbours.at<float>(row, column) - static_cast<float>(blocked);
        if (vote[0] + vote[1] == 0 && others >= k_most_others) blocked = 1;
        if (others < (vote[0] + vote[1] == 0 ? k_most_others - 1 : k_few_others)) blocked = 0;
      }
    if (cv::norm(counted, source.blocked, cv::NORM_INF) == 0) continue;
    changed = true;
    source.blocked = counted;
    source.map = softened(counted);
  }
  return changed;
}

// Updates the models of patches that have the same explanation as all patches around them.
void ShadowDetector::Impl::update_models(const Evaluation& evaluation, CameraState* camera) const {
  const std::size_t n = sources.size(), d = dimensions();
  const auto channels = static_cast<std::size_t>(camera->channels);
  const cv::Size size = evaluation.labels.size();
  cv::Mat lowest, highest = evaluation.labels.clone();
  const cv::Mat around = cv::getStructuringElement(cv::MORPH_RECT, {5, 5});
  cv::erode(evaluation.labels, lowest, around);
  highest.setTo(0, evaluation.labels == k_no_label);
  cv::dilate(highest, highest, around);
  float x[k_most_projectors + 1] = {1};
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      const std::uint8_t label = evaluation.labels.at<std::uint8_t>(row, column);
      const auto patch = static_cast<std::size_t>(row * size.width + column);
      if (label == k_no_label) continue;
      if (label == k_unexplained) {
        if (++camera->unexplained[patch] >= k_patience) reset_model(camera, patch);
        continue;
      }
      camera->unexplained[patch] = 0;
      if (label == k_dark) continue;
      if (lowest.at<std::uint8_t>(row, column) != label || highest.at<std::uint8_t>(row, column) != label)
        continue;
      for (std::size_t c = 0; c < channels; ++c) {
        float* model = &camera->models[(patch * channels + c) * model_size()];
        const auto value = [&](const cv::Mat& m) {
          return m.ptr<float>(row)[static_cast<std::size_t>(column) * channels + c];
        };
        for (std::size_t i = 0; i < n; ++i)
          x[i + 1] = (label >> i & 1) != 0 ? 0 : value(evaluation.unblocked[i]);
        update_model(value(evaluation.light), x, variance_of(model, x), d, model);
        std::copy_n(x + 1, n, model + d + d * d);
      }
    }
}

ShadowDetector::ShadowDetector(const Rig& rig, const ShadowDetectorOptions& options)
    : impl_(std::make_unique<Impl>(rig, options)) {}
ShadowDetector::ShadowDetector(ShadowDetector&&) noexcept = default;
ShadowDetector& ShadowDetector::operator=(ShadowDetector&&) noexcept = default;
ShadowDetector::~ShadowDetector() = default;

void ShadowDetector::place(std::size_t index, IlluminatedPatches patches) {
  CameraState& camera = impl_->cameras.at(index);
  LIMN_CHECK(patches.side_px > 0 && patches.by_projector.size() == impl_->sources.size());
  const CameraState before = camera;
  const bool is_first = before.patches.points.empty();
  camera.patches = std::move(patches);
  const cv::Mat& points = camera.patches.points;
  camera.spacing_m = typical_distance(points, 3);
  camera.footprints.clear();
  std::vector<double> irradiances;
  for (const cv::Mat& patch_light : camera.patches.by_projector) {
    camera.footprints.push_back(std::max(1, cvRound(typical_distance(patch_light, 2))));
    for (const auto& pixel : cv::Mat_<cv::Vec4f>(patch_light))
      if (pixel[2] > 0) irradiances.push_back(static_cast<double>(pixel[2]));
  }
  if (is_first) camera.typical_irradiance = median(std::move(irradiances), 1.0);
  impl_->reset_models(&camera);
  if (is_first || camera.channels == 0) return;
  const std::size_t size = static_cast<std::size_t>(camera.channels) * impl_->model_size();
  for (int row = 0; row < points.rows; ++row)
    for (int column = 0; column < points.cols; ++column)
      if (const auto from = patch_of(before, points.at<cv::Vec4f>(row, column))) {
        const auto to = static_cast<std::size_t>(row * points.cols + column);
        std::copy_n(&before.models[*from * size], size, &camera.models[to * size]);
      }
}

bool ShadowDetector::update_maps(std::size_t index, const cv::Mat& frame, std::span<const cv::Mat> shown) {
  CameraState& camera = impl_->cameras.at(index);
  LIMN_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3);
  LIMN_CHECK(frame.cols == camera.imager.width && frame.rows == camera.imager.height);
  LIMN_CHECK(shown.size() == impl_->sources.size());
  if (camera.patches.points.empty()) return false;
  if (camera.channels != frame.channels()) {
    camera.channels = frame.channels();
    impl_->reset_models(&camera);
  }
  Evaluation evaluation = impl_->evaluation_of(camera, frame, shown);
  impl_->compute_costs(camera, &evaluation);
  impl_->choose_explanations(camera, &evaluation);
  for (CameraState& other : impl_->cameras)
    for (cv::Mat& votes : other.votes) votes *= k_stale_votes;
  impl_->collect_votes(evaluation, &camera);
  impl_->update_models(evaluation, &camera);
  return impl_->count_votes();
}

const cv::Mat& ShadowDetector::map(std::size_t projector) const { return impl_->sources.at(projector).map; }

}  // namespace limn::projector
