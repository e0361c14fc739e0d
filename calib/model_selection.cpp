#include "calib/model_selection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

namespace limn::calib {

const char* const k_auto_lens = "auto";

namespace {

constexpr auto k_pinhole = "LENSMODEL_PINHOLE", k_plain = "LENSMODEL_OPENCV4";
constexpr const char* k_richer[] = {"LENSMODEL_OPENCV5", "LENSMODEL_OPENCV8"};

// Share of the error; by chance, lenses that need no more values gain 1 or 2 %.
constexpr double k_least_gain = 0.03;

// A print's errors are believed where they gain so much, even if chance could do it: few poses leave much to
// chance, and a bad print that passes for an exact one costs more than the opposite. Bad prints gain 0.2 to
// 2, sheets that lie differently in each of four or five poses -0.5 to 0.3.
constexpr double k_enough_gain = 0.2;

// Chi-square of four values, 95 %: distortion beyond it is no chance.
constexpr double k_distorted = 9.49;

// Whether a projector's distortion differs from 0 by more than its covariance explains.
bool is_distorted(const Solution& solution, size_t projector) {
  const std::vector<double>& values = solution.rig.projectors[projector].lens.values;
  const auto count = static_cast<Eigen::Index>(values.size()) - 4;
  const Eigen::Index at = solution.projector_at(projector) + 4;
  const Eigen::VectorXd distortion = Eigen::Map<const Eigen::VectorXd>(values.data() + 4, count);
  return distortion.dot(solution.covariance.block(at, at, count, count).ldlt().solve(distortion)) >
         k_distorted;
}

struct Candidate {
  std::vector<std::string> models;
  Solution solution;
  CrossValidation held_out;
};

struct Gain {
  double share = 0, uncertainty = 0;
  bool is_certain() const { return share > uncertainty; }
};

// Student's t, 95 % one-sided, for degrees of freedom from 1; large for few poses.
double student_95(size_t freedom) {
  constexpr double k_t[] = {6.31, 2.92, 2.35, 2.13, 2.02, 1.94, 1.89, 1.86, 1.83, 1.81, 1.80, 1.78};
  return k_t[std::min(freedom, std::size(k_t)) - 1];
}

// Statistics over poses, because poses scatter independently. Ratios are used, because a steep or distant
// pose has more of every error: by what share the richer model's error is lower in the (geometric) mean, and
// what chance could make of that.
Gain gain_of(const CrossValidation& simple, const CrossValidation& rich) {
  std::vector<double> ratios;
  double sum = 0;
  for (const HeldOutPose& a : simple.poses) {
    for (const HeldOutPose& b : rich.poses) {
      if (a.pose != b.pose || !(a.rms_px > 0) || !(b.rms_px > 0)) continue;
      ratios.push_back(std::log(a.rms_px / b.rms_px));
      sum += ratios.back();
    }
  }
  const auto n = static_cast<double>(ratios.size());
  if (n < 2) return {0, std::numeric_limits<double>::infinity()};
  double squared = 0;
  for (const double ratio : ratios) squared += (ratio - sum / n) * (ratio - sum / n);
  const double chance = student_95(ratios.size() - 1) * std::sqrt(squared / (n - 1) / n);
  return {sum / n, std::max(chance, k_least_gain)};
}

class ModelSelector {
 public:
  ModelSelector(const Observations& observations, const SolveOptions& options, Candidate first)
      : observations_(observations), options_(options), first_(first.solution), best_(std::move(first)) {}

  void choose(size_t device) {
    const bool is_projector = device >= observations_.cameras.size();
    const size_t first = trials_.size();
    note(device, best_.models[device], best_.held_out.rms_px, {});
    if (is_projector && try_simpler(device)) return mark_chosen(device, first);
    for (const char* model : k_richer) try_richer(device, model);
    mark_chosen(device, first);
  }
  const Candidate& best() const { return best_; }
  std::vector<ModelTrial> trials() { return std::move(trials_); }

 private:
  std::optional<Candidate> candidate(size_t device, const std::string& model) {
    Candidate tried;
    tried.models = best_.models;
    tried.models[device] = model;
    SolveOptions options = options_;
    options.lens_models = tried.models;
    auto solution = solve_again(observations_, options, best_.solution);
    if (!solution) return std::nullopt;
    auto score = cross_validate(observations_, options, *solution, false);
    if (!score) return std::nullopt;
    tried.solution = *std::move(solution);
    tried.held_out = *std::move(score);
    return tried;
  }

  bool try_simpler(size_t device) {
    auto tried = candidate(device, k_pinhole);
    const Gain gain = tried ? gain_of(tried->held_out, best_.held_out) : Gain();
    note(device, k_pinhole, tried ? tried->held_out.rms_px : std::nan(""), gain);
    const size_t projector = device - observations_.cameras.size();
    if (!tried || gain.is_certain() || is_distorted(first_, projector)) return false;
    best_ = *std::move(tried);
    return true;
  }

  void try_richer(size_t device, const std::string& model) {
    auto tried = candidate(device, model);
    const Gain gain = tried ? gain_of(best_.held_out, tried->held_out) : Gain();
    note(device, model, tried ? tried->held_out.rms_px : std::nan(""), gain);
    if (tried && gain.is_certain()) best_ = *std::move(tried);
  }

  void note(size_t device, const std::string& model, double px, const Gain& gain) {
    const size_t cameras = observations_.cameras.size();
    const std::string& name = device < cameras ? observations_.cameras[device].name
                                               : observations_.projectors[device - cameras].name;
    trials_.push_back({name, model, px, gain.share, gain.uncertainty, false});
  }
  void mark_chosen(size_t device, size_t first) {
    for (size_t i = first; i < trials_.size(); ++i)
      trials_[i].chosen = trials_[i].model == best_.models[device];
  }

  const Observations& observations_;
  const SolveOptions& options_;
  Solution first_;  // with plain distortion for every device, and with covariance
  Candidate best_;
  std::vector<ModelTrial> trials_;
};

}  // namespace

Result<ModelSelection> solve_selecting_models(const Observations& observations, const SolveOptions& options) {
  ModelSelection choice;
  choice.options = options;
  const std::vector<std::string> asked = lens_models(observations, options);
  choice.options.lens_models = asked;
  for (std::string& name : choice.options.lens_models) {
    if (name == k_auto_lens) name = k_plain;
  }
  LIMN_TRY(choice.solution, solve(observations, choice.options));
  LIMN_TRY(choice.held_out, cross_validate(observations, choice.options, choice.solution));
  if (choice.options.lens_models == asked) return choice;

  // Projectors first: nearly all of the remaining error is theirs.
  ModelSelector choosing(observations, choice.options,
                         {choice.options.lens_models, choice.solution, choice.held_out});
  const size_t cameras = observations.cameras.size();
  for (size_t i = 0; i < asked.size(); ++i) {
    const size_t device = (i + cameras) % asked.size();
    if (asked[device] == k_auto_lens) choosing.choose(device);
  }
  choice.trials = choosing.trials();
  if (choosing.best().models == choice.options.lens_models) return choice;
  choice.options.lens_models = choosing.best().models;
  LIMN_TRY(choice.solution, solve_from(observations, choice.options, choosing.best().solution));
  LIMN_TRY(choice.held_out, cross_validate(observations, choice.options, choice.solution));
  return choice;
}

Result<ModelSelection> solve_uneven_print(const Observations& observations, ModelSelection plain) {
  const UnevenPrint print = uneven_print(observations, plain.options, plain.solution);
  if (print.size == 0) return plain;
  SolveOptions options = plain.options;
  options.print_size = print.size;
  options.square_pixels = print.are_pixels_square;
  options.lens_models.clear();  // other lenses may be chosen, now that they need not imitate the print
  LIMN_TRY(ModelSelection freed, solve_selecting_models(observations, options));
  const Gain gain = gain_of(plain.held_out, freed.held_out);
  const bool predicts_better = gain.share > std::min(gain.uncertainty, k_enough_gain);
  return print.is_shown_by_pixels || predicts_better ? std::move(freed) : std::move(plain);
}

}  // namespace limn::calib
