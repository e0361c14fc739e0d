// How often the stated 95 % error holds. Rigs with known truth and noisy observations (no images, so that
// there can be many) are solved with selected lens models and assessed as limn solve does; then the share of
// unseen points within the stated error is counted, for each kind of prototype in place, moved and turned.
// Usage: calib_stated [CASES [FIRST [GROUP]]]
#include <fmt/core.h>

#include <array>

#include "calib/judge/assess.h"
#include "calib/model_selection.h"
#include "core/median.h"
#include "tests/calib/bad_print.h"
#include "tests/calib/true_rig.h"

namespace limn::test {
namespace {

// Rigs of a group are alike in what is named here; the rest is drawn.
struct Group {
  std::string name;
  int poses = 10;
  double tilt = 0.5;      // rad
  double spread = 1;      // spread of the boards over the space
  double bow_m = 0;       // the same in all poses
  double sag_mm = 0;      // standard deviation of a bend that each pose has by itself
  bool is_sharp = false;  // noise of good images instead of a drawn one
  double twist_m = 0;
  bool is_badly_printed = false;  // 0.15 % unequal, 0.1 mm smooth errors
  bool has_quarter_turns = false;
  double length_stddev_m = 0;  // above 0: the print was measured to this
  double shared_px = 0;        // errors that the matches of one placement share, as decoding leaves them
  double unstated_px = 0;      // noise of matches beyond what they state, as JPEG and shake leave it
};

const std::vector<Group> k_groups = {
    {.name = "12 poses", .poses = 12},
    {.name = "8 poses", .poses = 8},
    {.name = "5 poses", .poses = 5},
    {.name = "sharp images", .poses = 12, .is_sharp = true},
    {.name = "bowed", .bow_m = 0.4e-3},
    {.name = "sagging", .sag_mm = 0.2},
    {.name = "twisted", .bow_m = 0.4e-3, .twist_m = 0.4e-3},
    {.name = "badly printed, 5 poses", .poses = 5, .is_badly_printed = true},
    {.name = "badly printed, 5 poses, quarter turns",
     .poses = 5,
     .is_badly_printed = true,
     .has_quarter_turns = true},
    {.name = "badly printed, 8 poses", .poses = 8, .is_badly_printed = true},
    {.name = "badly printed", .poses = 12, .is_badly_printed = true},
    {.name = "badly printed, quarter turns",
     .poses = 12,
     .is_badly_printed = true,
     .has_quarter_turns = true},
    {.name = "badly printed, measured", .poses = 12, .is_badly_printed = true, .length_stddev_m = 0.03e-3},
    {.name = "shared decoding errors", .poses = 20, .is_sharp = true, .shared_px = 0.006},
    {.name = "all effects",
     .poses = 12,
     .bow_m = 0.4e-3,
     .is_sharp = true,
     .twist_m = 0.4e-3,
     .is_badly_printed = true,
     .has_quarter_turns = true,
     .length_stddev_m = 0.03e-3,
     .unstated_px = 0.08},
    {.name = "almost parallel", .tilt = 0.06},
    {.name = "almost parallel, in the middle", .tilt = 0.06, .spread = 0.15},
};

struct Drawn {
  RigOptions rig;
  double corner_px = 0, match_px = 0;
};

Drawn drawn(const Group& group, unsigned seed) {
  std::mt19937_64 rng(seed * 7919 + 17);
  std::uniform_real_distribution<double> even(0, 1);
  const auto pick = [&](std::initializer_list<double> of) {
    return of.begin()[static_cast<size_t>(even(rng) * static_cast<double>(of.size()))];
  };
  const auto between = [&](double low, double high) { return low * std::pow(high / low, even(rng)); };
  Drawn made;
  made.rig = {.k1 = pick({0, -0.05, -0.15}),
              .shift = pick({0, 0.5, 1.1}),
              .bow_m = group.bow_m,
              .poses = group.poses,
              .tilt = group.tilt * between(0.8, 1.2),
              .spread = group.spread,
              .asunder = between(0.3, 0.6),
              .square_pixels = group.is_badly_printed,
              .quarter_turns = group.has_quarter_turns,
              .seed = seed};
  made.corner_px = group.is_sharp ? 0.01 : between(0.015, 0.1);
  made.match_px = group.is_sharp ? 0.02 : between(0.03, 0.12);
  return made;
}

// Boards sag differently in each pose; the solver has no model for that.
calib::Observations sagging(const TrueRig& truth, double mm, std::mt19937_64* rng) {
  calib::Observations observations = observed_perfectly(truth, 4);
  if (mm == 0) return observations;
  observations.corners.clear();
  observations.matches.clear();
  std::normal_distribution<double> scatter(0, 1e-3 * mm);
  for (size_t pose = 0; pose < truth.world_from_board.size(); ++pose) {
    TrueRig bent = truth;
    bent.bow_m += Eigen::Vector2d(scatter(*rng), scatter(*rng));
    const calib::Observations all = observed_perfectly(bent, 4);
    const auto copy = [&](const auto& from, auto* to) {
      for (const auto& seen : from) {
        if (seen.pose == static_cast<int>(pose)) to->push_back(seen);
      }
    };
    copy(all.corners, &observations.corners);
    copy(all.matches, &observations.matches);
  }
  return observations;
}

// Sums over the rigs of a group: by prototype, then in place, moved, turned.
struct Tally {
  std::array<double, 9> shares{};
  std::vector<double> widths;  // the stated error divided by the true 95th percentile
  int rigs = 0, unsolved = 0;
};

void run(const Group& group, unsigned seed, Tally* tally) {
  const Drawn draw = drawn(group, seed);
  TrueRig truth = make_true_rig(draw.rig);
  truth.twist_m = group.twist_m;
  std::mt19937_64 rng(seed + 1000);
  calib::Observations observations = sagging(truth, group.sag_mm, &rng);
  calib::SolveOptions options{.camera_model = calib::k_auto_lens, .projector_model = calib::k_auto_lens};
  if (group.is_badly_printed) {
    const BadPrint print{.phase = 0.9 * seed};
    print_corners(truth, print, &observations);
    std::normal_distribution<double> error(0, group.length_stddev_m);
    const Eigen::Vector2d lengths = print.lengths(truth.board) + Eigen::Vector2d(error(rng), error(rng));
    if (group.length_stddev_m > 0) options.board_measured = {lengths.x(), lengths.y(), group.length_stddev_m};
    options.square_pixels = options.board_measured.has_value();
  }
  add_noise(draw.corner_px, draw.match_px, &rng, &observations);
  for (calib::Match& match : observations.matches) match.stddev_px = draw.match_px;
  std::mt19937_64 decoding(seed + 2000);
  add_shared_errors(group.shared_px, &decoding, &observations);
  add_noise(0, group.unstated_px, &decoding, &observations);
  auto choice = calib::solve_selecting_models(observations, options);
  if (choice) choice = calib::solve_uneven_print(observations, std::move(*choice));  // as limn solve does it
  if (!choice) {
    ++tally->unsolved;
    return;
  }
  const double stated =
      calib::assess({observations, {}, {}, 0, 0}, choice->solution, choice->held_out, choice->options)
          .predicted_error_mm[0];
  const double pnp_px = std::max(0.02, draw.corner_px);  // the prototype is measured as well as the board
  std::vector<double> all;
  for (const Prototype prototype : {Prototype::panel, Prototype::cluster, Prototype::concave}) {
    const Landed errors = landed(truth, choice->solution.rig, prototype_mesh(prototype), pnp_px, 240, &rng);
    const auto at = 3 * static_cast<size_t>(prototype);
    tally->shares[at] += share_within(errors.in_place_mm, stated);
    tally->shares[at + 1] += share_within(errors.moved_mm, stated);
    tally->shares[at + 2] += share_within(errors.turned_mm, stated);
    for (const double e : errors.pooled_mm()) all.push_back(e);
  }
  tally->widths.push_back(stated / p95(all));
  ++tally->rigs;
}

void print(const Group& group, const Tally& tally) {
  fmt::print("{:<38} {:3} rigs", group.name, tally.rigs);
  double sum = 0;
  for (size_t i = 0; i < tally.shares.size(); ++i) {
    fmt::print("{}{:.3f}", i % 3 == 0 ? " | " : " ", tally.shares[i] / tally.rigs);
    sum += tally.shares[i] / tally.rigs;
  }
  fmt::print(" | all {:.3f}, stated / true {:.2f}, unsolved {}\n",
             sum / static_cast<double>(tally.shares.size()), median(tally.widths), tally.unsolved);
  std::fflush(stdout);
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  using namespace limn::test;
  const int count = argc > 1 ? std::atoi(argv[1]) : 20, first = argc > 2 ? std::atoi(argv[2]) : 1;
  const std::string only = argc > 3 ? argv[3] : "";
  fmt::print(
      "share of points within the stated error: panel | cluster | concave, each in place, moved, turned\n");
  for (const Group& group : k_groups) {
    if (!only.empty() && group.name != only) continue;
    Tally tally;
    for (int i = 0; i < count; ++i) run(group, static_cast<unsigned>(first + i), &tally);
    if (tally.rigs > 0) print(group, tally);
  }
}
