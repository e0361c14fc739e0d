#include "projector/composite_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

PartCoverage covered(const std::string& slot, double share, int pixels = 1000) {
  return {slot, "a", pixels, share, 1 - share, {}};
}

Composite what_of(const std::vector<CompositePolicy>& policies, const std::string& slot) {
  for (const CompositePolicy& treatment : policies)
    if (treatment.slot == slot) return treatment.what;
  ADD_FAILURE() << slot << " has no policy";
  return Composite::rest;
}

TEST(CompositePolicy, GoesByTheMiddleFirstAndStaysBetweenTheLimits) {
  const CompositePolicyOptions options{0.3, 0.5, 0};
  for (const auto& [share, expected] : {std::pair(0.39, Composite::full), {0.41, Composite::rest}}) {
    const PartCoverage first = covered("mirror", share);
    auto policies = updated_policies({}, std::span(&first, 1), 0, options);
    EXPECT_EQ(what_of(policies, "mirror"), expected);
    for (const double later : {0.31, 0.49, 0.35}) {
      const PartCoverage part = covered("mirror", later);
      policies = updated_policies(policies, std::span(&part, 1), 1, options);
      EXPECT_EQ(what_of(policies, "mirror"), expected) << later;
    }
  }
}

TEST(CompositePolicy, EachPartGoesItsOwnWay) {
  std::vector<PartCoverage> parts = {covered("mirror", 0.8), covered("grille", 0.1)};
  auto policies = updated_policies({}, parts, 0);
  parts = {covered("mirror", 0.1), covered("grille", 0.9)};
  policies = updated_policies(policies, parts, 10);
  EXPECT_EQ(what_of(policies, "mirror"), Composite::full);
  EXPECT_EQ(what_of(policies, "grille"), Composite::rest);
}

TEST(CompositePolicy, APartLostFromSightStaysAsItIs) {
  const PartCoverage lit = covered("mirror", 0.9), unseen = covered("mirror", 0, 0);
  auto policies = updated_policies({}, std::span(&lit, 1), 0);
  policies = updated_policies(policies, {}, 10);
  policies = updated_policies(policies, std::span(&unseen, 1), 10);
  EXPECT_EQ(what_of(policies, "mirror"), Composite::rest);
}

// Random coverage, with frame times from 5 ms to 100 ms.
TEST(CompositePolicy, NeverChangesTwiceWithinTheHold) {
  auto rng = test::test_rng();
  std::uniform_real_distribution<double> share(0, 1), seconds(0.005, 0.1);
  const CompositePolicyOptions options;
  std::vector<CompositePolicy> policies;
  double now = 0, changed_at = -1e9, shortest = 1e9, fastest = 0;
  int changes = 0;
  for (int frame = 0; frame < 20000; ++frame) {
    const double step = seconds(rng);
    now += step;
    std::vector<PartCoverage> parts = {covered("mirror", share(rng), share(rng) < 0.1 ? 0 : 500)};
    if (share(rng) < 0.1) parts.clear();
    const auto after = updated_policies(policies, parts, step, options);
    if (!policies.empty() && after[0].what != policies[0].what) {
      shortest = std::min(shortest, now - changed_at);
      changed_at = now;
      ++changes;
    }
    if (!policies.empty())
      fastest = std::max(fastest, std::abs(after[0].full_weight() - policies[0].full_weight()) / step);
    policies = after;
  }
  EXPECT_GT(changes, 300);
  EXPECT_GE(shortest, options.hold_s - 1e-9);
  EXPECT_LE(fastest, 1 / options.fade_s + 1e-9);
  std::cout << changes << " changes in " << now << " s, at least " << shortest << " s apart\n";
}

TEST(CompositePolicy, OnePassesIntoTheOtherWithinTheFadeWhateverTheStepsOfTime) {
  for (const double step : {0.01, 0.037, 0.1}) {
    const CompositePolicyOptions options{0.3, 0.5, 0, 0.4};
    PartCoverage part = covered("mirror", 0.9);
    auto policies = updated_policies({}, std::span(&part, 1), 0, options);
    EXPECT_EQ(policies[0].full_weight(), 0) << "at first there is nothing to fade from";
    part = covered("mirror", 0.1);
    policies = updated_policies(policies, std::span(&part, 1), step, options);
    EXPECT_EQ(policies[0].what, Composite::full);
    EXPECT_EQ(policies[0].full_weight(), 0) << "a cross-fade starts from the previous state";
    for (double seconds = step; seconds < 0.2; seconds += step) {
      policies = updated_policies(policies, std::span(&part, 1), step, options);
      EXPECT_NEAR(policies[0].full_weight(), seconds / options.fade_s, 1e-9);
    }
    part = covered("mirror", 0.9);  // back again during the cross-fade
    const double before = policies[0].full_weight();
    policies = updated_policies(policies, std::span(&part, 1), step, options);
    EXPECT_EQ(policies[0].what, Composite::rest);
    EXPECT_NEAR(policies[0].full_weight(), before + step / options.fade_s, 1e-9);
    policies = updated_policies(policies, {}, 1, options);  // also while the part is not visible
    EXPECT_EQ(policies[0].full_weight(), 0);
  }
}

}  // namespace
}  // namespace limn::projector
