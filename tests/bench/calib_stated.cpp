// How often the stated 95 % error holds. Rigs with known truth and noisy observations (no images, so that
// there can be many) are solved and assessed; then the share of unseen points within the stated error is
// counted. Usage: calib_stated [CASES [FIRST]]
#include <fmt/core.h>

#include "calib/judge/assess.h"
#include "calib/judge/uncertainty.h"
#include "calib/solve.h"
#include "tests/calib/true_rig.h"

namespace limn::test {
namespace {

constexpr int k_shares = 3;  // by the scatter's covariance, by the jackknife's, as stated

struct Drawn {
  RigOptions rig;
  double corner_px = 0, match_px = 0, pose_mm = 0;
};

// Cases vary in everything in which real rigs may differ.
Drawn drawn(unsigned seed) {
  std::mt19937_64 rng(seed);
  std::uniform_real_distribution<double> even(0, 1);
  const auto pick = [&](std::initializer_list<double> of) {
    return of.begin()[static_cast<size_t>(even(rng) * static_cast<double>(of.size()))];
  };
  Drawn drawn;
  drawn.rig.k1 = pick({0, -0.05, -0.15});
  drawn.rig.shift = pick({0, 0.5, 1.1});
  drawn.rig.bow_m = pick({0, 0.4e-3});
  drawn.rig.poses = static_cast<int>(pick({6, 9, 12}));
  drawn.rig.tilt = pick({0.4, 0.6});
  drawn.rig.asunder = pick({0.3, 0.6});
  drawn.rig.seed = seed;
  drawn.corner_px = pick({0.015, 0.05, 0.1});
  drawn.match_px = pick({0.03, 0.06, 0.12});
  drawn.pose_mm = pick({0, 0.1, 0.3});
  return drawn;
}

// Boards sag differently in each pose; the solver has no model for that.
void sag(const TrueRig& truth, double mm, std::mt19937_64* rng, calib::Observations* observations) {
  std::normal_distribution<double> scatter(0, 1e-3 * mm);
  for (size_t pose = 0; pose < truth.world_from_board.size(); ++pose) {
    TrueRig sagging = truth;
    sagging.bow_m += Eigen::Vector2d(scatter(*rng), scatter(*rng));
    const calib::Observations all = observed_perfectly(sagging, 4);
    const auto take = [&](const auto& from, auto* to) {
      for (const auto& seen : from) {
        if (seen.pose == static_cast<int>(pose)) to->push_back(seen);
      }
    };
    take(all.corners, &observations->corners);
    take(all.matches, &observations->matches);
  }
}

Status run(unsigned seed, double* share_sum) {
  const Drawn draw = drawn(seed);
  const TrueRig truth = make_true_rig(draw.rig);
  std::mt19937_64 rng(seed + 1000);
  calib::Observations observations = observed_perfectly(truth, 4);
  if (draw.pose_mm > 0) {
    observations.corners.clear();
    observations.matches.clear();
    sag(truth, draw.pose_mm, &rng, &observations);
  }
  add_noise(draw.corner_px, draw.match_px, &rng, &observations);
  for (calib::Match& match : observations.matches) match.stddev_px = draw.match_px;
  LIMN_TRY(const calib::Solution solution, calib::solve(observations));
  LIMN_TRY(const calib::Assessment assessment, calib::assess({observations, {}, {}, 0, 0}, {}, solution));
  const double pnp_px = std::max(0.03, draw.corner_px);  // the prototype is measured as well as the board
  std::vector<double> errors, clean;
  for (const Prototype prototype : {Prototype::panel, Prototype::cluster, Prototype::concave}) {
    const scene::Mesh mesh = prototype_mesh(prototype);
    for (const double e : landed(truth, solution.rig, mesh, pnp_px, 400, &rng).pooled_mm())
      errors.push_back(e);
    for (const double e : landed(truth, solution.rig, mesh, 1e-6, 400, &rng).pooled_mm()) clean.push_back(e);
  }
  const Eigen::MatrixXd jackknife = calib::jackknife_covariance(solution, assessment.held_out.rigs);
  const auto p = [&](const Eigen::MatrixXd& covariance, double px) {
    return calib::propagated_error_mm(observations, solution, {covariance, px})[0];
  };
  const double stated = assessment.predicted_error_mm[0];
  const double shares[k_shares] = {share_within(errors, p(solution.covariance, pnp_px)),
                                   share_within(errors, p(jackknife, pnp_px)), share_within(errors, stated)};
  for (int i = 0; i < k_shares; ++i) share_sum[i] += shares[i];
  fmt::print(
      "{:4} k1 {:5.2f} shift {:3.1f} bow {:.1f} poses {:2} tilt {:.1f} corner {:.3f} match {:.3f} px sag "
      "{:.1f} mm"
      " | noise {:.3f} jackknife {:.3f} held-out {:.3f} stated {:.3f} true p95 {:.3f} mm, rig alone {:.3f} | "
      "shares {:.3f} {:.3f} {:.3f}\n",
      seed, draw.rig.k1, draw.rig.shift, 1e3 * draw.rig.bow_m, draw.rig.poses, draw.rig.tilt, draw.corner_px,
      draw.match_px, draw.pose_mm, p(solution.covariance, 0), p(jackknife, 0),
      assessment.held_out_error_mm[0], stated, p95(errors), p95(clean), shares[0], shares[1], shares[2]);
  std::fflush(stdout);
  return {};
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 20, first = argc > 2 ? std::atoi(argv[2]) : 1;
  double shares[limn::test::k_shares] = {};
  for (int i = 0; i < count; ++i) {
    const limn::Status status = limn::test::run(static_cast<unsigned>(first + i), shares);
    if (status.ok()) continue;
    fmt::print(stderr, "case {}: {}\n", first + i, status.message());
    return 1;
  }
  fmt::print("mean share: by the scatter {:.3f}, by the jackknife {:.3f}, as stated {:.3f}\n",
             shares[0] / count, shares[1] / count, shares[2] / count);
}
