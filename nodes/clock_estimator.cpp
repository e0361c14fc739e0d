#include "nodes/clock_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace limn::nodes {
namespace {

// How fast a rate changes, 1/s: 1.2 ppm in a minute. A laptop's quartz that warms up changes by 0.1 to 1 ppm.
constexpr double k_wander = 2e-8;
constexpr double k_shortest_window_s = 5;
constexpr double k_rate_change = 10e-6;  // of a quartz while its machine was suspended, standard deviation
// The smallest delays of each direction that the rate depends on, and those that the offset's uncertainty
// depends on: few, because the density changes with the distance from the line (Weibull, lognormal).
constexpr std::size_t k_least_smallest = 10, k_window_per_smallest = 16, k_nearest = 5;
constexpr int k_rates = 33, k_enough_rates = 12;  // at which the likelihood is computed; that matter
constexpr double k_negligible = 9;                // a likelihood e^-9 times the largest
constexpr double k_resolution_s = 50e-9;          // of stamps
// What no delay is below the line by unless a clock has stepped.
constexpr double k_margin_s = 100e-6, k_margin_scales = 16, k_margin_stddevs = 6;
constexpr std::size_t k_few = 8;  // exchanges, among which a much smaller delay is no surprise
// Questions: how often, while there are fewer exchanges than that or while the offset is uncertain.
constexpr double k_interval_s = 0.2, k_first_interval_s = 0.025, k_uncertain_interval_s = 0.05;
constexpr double k_uncertain_s = 300e-6;
constexpr std::size_t k_first = 16, k_most_uncertain = 200;

double seconds(std::chrono::nanoseconds time) { return std::chrono::duration<double>(time).count(); }
std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::nanoseconds(std::llround(1e9 * seconds));
}
double square(double x) { return x * x; }

std::chrono::nanoseconds offset_of(const ClockExchange& exchange) {
  return ((exchange.received_at - exchange.asked_at) + (exchange.answered_at - exchange.arrived_at)) / 2;
}

// A delay of one direction. Its value at the newest moment is delay_s + rate * age_s; delays back have
// negative ages, because the offset counts negatively in them.
struct Delay {
  double age_s, delay_s;
};

// The lower edge of the delays of one direction.
struct Edge {
  double smallest = 0;
  double span = 0;       // from the smallest to the K-th
  double near_span = 0;  // from the smallest to the k_nearest-th
};

Edge edge_of(const std::vector<Delay>& delays, double rate, std::size_t count, std::vector<double>* values) {
  values->clear();
  for (const Delay& each : delays) values->push_back(each.delay_s + rate * each.age_s);
  const auto first = values->begin(), last = first + static_cast<std::ptrdiff_t>(count - 1);
  std::nth_element(first, last, values->end());
  const auto near = first + static_cast<std::ptrdiff_t>(std::min(count, k_nearest) - 1);
  std::nth_element(first, near, last);
  const double smallest = *std::min_element(first, near + 1);
  return {smallest, *last - smallest + k_resolution_s, *near - smallest + k_resolution_s};
}

// How far the smallest of many delays is above the line, if its density there is even but unknown: of k
// values that span s, the distance has the density (s + x)^-k (a Lomax distribution).
double mean_distance(double span, std::size_t k) { return k > 2 ? span / static_cast<double>(k - 2) : span; }
double distance_variance(double span, std::size_t count) {
  const auto k = static_cast<double>(count);
  return square(span) * (count > 3 ? (k - 1) / (square(k - 2) * (k - 3)) : 1.0);
}

// What is known if the rate has a certain value.
struct AtRate {
  double rate = 0, log_likelihood = 0, weight = 0;
  Edge there, back;
  double offset_s = 0;
};

class Likelihood {
 public:
  Likelihood(std::vector<Delay> there, std::vector<Delay> back, double rate_mean, double rate_stddev)
      : there_(std::move(there)),
        back_(std::move(back)),
        mean_(rate_mean),
        stddev_(rate_stddev),
        count_(std::min(there_.size(), std::max(k_least_smallest, there_.size() / k_window_per_smallest))) {}

  std::size_t count() const { return count_; }

  // The rates that matter, with weights that add up to 1.
  std::vector<AtRate> rates() {
    constexpr double k_widest = 4;
    constexpr int k_most_rounds = 10;
    double low = mean_ - k_widest * stddev_, high = mean_ + k_widest * stddev_;
    std::vector<AtRate> all;
    for (int round = 0; round < k_most_rounds; ++round) {
      all = computed(low, high);
      const auto matters = [](const AtRate& each) { return each.weight > std::exp(-k_negligible); };
      if (std::count_if(all.begin(), all.end(), matters) >= k_enough_rates) break;
      const double step = (high - low) / (k_rates - 1);
      low = std::find_if(all.begin(), all.end(), matters)->rate - step;
      high = std::find_if(all.rbegin(), all.rend(), matters)->rate + step;
    }
    double sum = 0;
    for (const AtRate& each : all) sum += each.weight;
    for (AtRate& each : all) each.weight /= sum;
    return all;
  }

 private:
  std::vector<AtRate> computed(double low, double high) {
    std::vector<AtRate> out;
    double best = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < k_rates; ++i) {
      out.push_back(at_rate(low + (high - low) * i / (k_rates - 1)));
      best = std::max(best, out.back().log_likelihood);
    }
    for (AtRate& each : out) each.weight = std::exp(each.log_likelihood - best);
    return out;
  }

  AtRate at_rate(double rate) {
    AtRate out{rate, 0, 0, edge_of(there_, rate, count_, &values_), edge_of(back_, rate, count_, &values_)};
    out.log_likelihood = -0.5 * square((rate - mean_) / stddev_) -
                         static_cast<double>(count_ - 1) * std::log(out.there.span * out.back.span);
    out.offset_s = (out.there.smallest - mean_distance(out.there.span, count_) - out.back.smallest +
                    mean_distance(out.back.span, count_)) /
                   2;
    return out;
  }

  std::vector<Delay> there_, back_;
  double mean_, stddev_;
  std::size_t count_;
  std::vector<double> values_;
};

}  // namespace

Stamp ClockEstimate::to_other(Stamp local) const {
  return local + offset + nanoseconds(rate * seconds(local - at));
}

Stamp ClockEstimate::to_local(Stamp other) const {
  return at + nanoseconds(seconds(other - (at + offset)) / (1 + rate));
}

void ClockEstimator::restart(const ClockExchange& exchange) {
  begin_ = exchange.arrived_at;
  base_ = offset_of(exchange);
  samples_.clear();
  newest_s_ = 0;
}

ClockEstimator::Sample ClockEstimator::sample_of(const ClockExchange& exchange) const {
  return {seconds(exchange.asked_at - begin_), seconds(exchange.arrived_at - begin_),
          seconds(exchange.received_at - exchange.asked_at - base_),
          seconds(exchange.arrived_at - exchange.answered_at + base_)};
}

// Whether one of the two delays is below its line. If both are, the path has become shorter.
bool ClockEstimator::contradicts(const Sample& sample) const {
  const double ahead_s = std::max(0.0, sample.arrived_s - newest_s_);
  double margin_s = k_margin_s + k_margin_scales * fit_.scale_s + k_wander * square(ahead_s) +
                    k_margin_stddevs * std::sqrt(fit_.variance + fit_.rate_variance * square(ahead_s));
  if (samples_.size() < k_few) margin_s += fit_.round_trip_s();
  const double there_s = sample.there_s - fit_.there_s - fit_.rate * (sample.asked_s - newest_s_);
  const double back_s = sample.back_s - fit_.back_s + fit_.rate * (sample.arrived_s - newest_s_);
  return (there_s < -margin_s) != (back_s < -margin_s);
}

void ClockEstimator::add(const ClockExchange& exchange) {
  if (samples_.empty()) restart(exchange);
  const Sample sample = sample_of(exchange);
  if (exchange.arrived_at < exchange.asked_at || sample.there_s + sample.back_s < 0 ||
      sample.arrived_s < newest_s_ - k_window_s)
    return;
  if (samples_.empty() || !contradicts(sample)) {
    odd_.reset();
    samples_.push_back(sample);
  } else if (!odd_) {
    odd_ = exchange;
    return;
  } else {
    const ClockEstimate before = *estimate(exchange.arrived_at);
    const double moved_s = std::abs(seconds(offset_of(exchange) - before.offset));
    if (moved_s > before.round_trip_s) ++steps_;
    prior_ = {fit_.rate, std::min(prior_.stddev, std::hypot(std::sqrt(fit_.rate_variance), k_rate_change))};
    restart(exchange);
    samples_ = {sample_of(*odd_), sample_of(exchange)};
    odd_.reset();
  }
  drop_old();
  fit_ = fitted();
}

void ClockEstimator::drop_old() {
  newest_s_ = std::max(newest_s_, samples_.back().arrived_s);
  while (samples_.size() > k_most || samples_.front().arrived_s < newest_s_ - k_window_s)
    samples_.pop_front();
}

ClockEstimator::Fit ClockEstimator::fitted() const {
  std::vector<Delay> there, back;
  double length_s = 0;
  for (const Sample& sample : samples_) {
    const double age_s = newest_s_ - sample.arrived_s;
    if (age_s > fit_.window_s) continue;
    there.push_back({newest_s_ - sample.asked_s, sample.there_s});
    back.push_back({-age_s, sample.back_s});
    length_s = std::max(length_s, age_s);
  }
  const auto exchanges = static_cast<double>(there.size());
  Likelihood likelihood(std::move(there), std::move(back), prior_.mean, prior_.stddev);
  const std::vector<AtRate> rates = likelihood.rates();
  Fit out;
  double noise_variance = 0;
  const std::size_t count = likelihood.count(), nearest = std::min(count, k_nearest);
  for (const AtRate& each : rates) {
    out.rate += each.weight * each.rate;
    out.offset_s += each.weight * each.offset_s;
    out.there_s += each.weight * each.there.smallest;
    out.back_s += each.weight * each.back.smallest;
    out.scale_s += each.weight * mean_distance((each.there.span + each.back.span) / 2, count);
    noise_variance +=
        each.weight *
        (distance_variance(each.there.near_span, nearest) + distance_variance(each.back.near_span, nearest)) /
        4;
  }
  for (const AtRate& each : rates) {
    out.variance += each.weight * square(each.offset_s - out.offset_s);
    out.covariance += each.weight * (each.offset_s - out.offset_s) * (each.rate - out.rate);
    out.rate_variance += each.weight * square(each.rate - out.rate);
  }
  // A line through a parabola with the curvature k_wander is wrong by a twelfth at its end. The first
  // exchanges say nothing about queues: their offset may be wrong by half the round trip.
  out.variance += noise_variance + square(k_wander * square(length_s) / 12) +
                  square(out.round_trip_s() / 2 / (exchanges * exchanges * exchanges));
  // The noise is inversely proportional to the length: here both errors are equally large.
  out.window_s =
      std::clamp(std::cbrt(12 / k_wander * length_s * out.scale_s), k_shortest_window_s, k_window_s);
  return out;
}

std::optional<ClockEstimate> ClockEstimator::estimate(Stamp local) const {
  if (samples_.empty()) return std::nullopt;
  const double ahead_s = seconds(local - begin_) - newest_s_;
  const double variance = fit_.variance + 2 * fit_.covariance * ahead_s +
                          fit_.rate_variance * square(ahead_s) + square(k_wander * square(ahead_s) / 2);
  return ClockEstimate{.at = local,
                       .offset = base_ + nanoseconds(fit_.offset_s + fit_.rate * ahead_s),
                       .rate = fit_.rate,
                       .stddev_s = std::sqrt(variance),
                       .rate_stddev = std::sqrt(fit_.rate_variance),
                       .round_trip_s = fit_.round_trip_s(),
                       .steps = steps_};
}

double ClockEstimator::wanted_interval_s() const {
  if (samples_.size() < k_first || odd_) return k_first_interval_s;
  const bool is_uncertain = std::sqrt(fit_.variance) > k_uncertain_s && samples_.size() < k_most_uncertain;
  return is_uncertain ? k_uncertain_interval_s : k_interval_s;
}

}  // namespace limn::nodes
