#include "nodes/timing/clock_estimator.h"

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
// How a rate changes, standard deviations: that of a quartz while its machine was suspended; that of a clock
// when NTP begins to slew it, which moves the offset by less than k_slewed_s until it is noticed.
constexpr double k_rate_change = 10e-6, k_rate_slewed = 250e-6, k_slewed_s = 0.05;
// The smallest delays of each direction that the rate depends on, and those that the offset's uncertainty
// depends on: few, because the density changes with the distance from the line (Weibull, lognormal).
constexpr std::size_t k_least_smallest = 10, k_window_per_smallest = 16, k_nearest = 5;
constexpr double k_widening =
    1.35;  // because the density often rises at the line, when several queues add up
constexpr int k_rates = 33, k_enough_rates = 12;  // at which the likelihood is computed; that matter
constexpr double k_search_stddevs = 6;            // about the last rate
constexpr double k_negligible = 9;                // a likelihood e^-9 times the largest
constexpr double k_resolution_s = 50e-9;          // stamps' own
// What no delay is below the line by unless a clock has stepped.
constexpr double k_margin_s = 100e-6, k_margin_scales = 16, k_margin_stddevs = 6;
constexpr std::size_t k_few = 12;  // exchanges, among which a much smaller delay is no surprise
// Exchanges are clearly below a line by so many scales; so many in a row are no chance. A smaller movement is
// not called a step.
constexpr double k_clear_scales = 2, k_least_step_s = 1e-3;
constexpr int k_lower_in_a_row = 3;
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

// How far the smallest of many delays is above the line, if their density there is even but unknown: of k
// values that span s, the distance has the density (s + x)^-k (a Lomax distribution).
double mean_distance(double span, std::size_t k) {
  return span / static_cast<double>(std::max<std::size_t>(k, 3) - 2);
}
double distance_variance(double span, std::size_t count) {
  const auto k = static_cast<double>(count);
  return square(span) * (count > 3 ? (k - 1) / (square(k - 2) * (k - 3)) : 1.0);
}

// How many of the smallest delays the rate depends on.
std::size_t smallest_of(std::size_t exchanges) {
  return std::max({std::min<std::size_t>(exchanges, 2), std::min(exchanges / 2, k_least_smallest),
                   exchanges / k_window_per_smallest});
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
        count_(smallest_of(there_.size())) {}

  std::size_t count() const { return count_; }

  // The rates that matter, with weights that add up to 1. The search begins with `within` about `near`.
  std::vector<AtRate> rates(double near, double within) {
    constexpr double k_widest = 4;  // standard deviations
    constexpr int k_most_rounds = 12;
    const double lowest = mean_ - k_widest * stddev_, highest = mean_ + k_widest * stddev_;
    double low = std::max(lowest, near - within), high = std::min(highest, near + within);
    std::vector<AtRate> all;
    for (int round = 0; round < k_most_rounds; ++round) {
      all = computed(low, high);
      const auto matters = [](const AtRate& each) { return each.weight > std::exp(-k_negligible); };
      const bool is_cut_low = matters(all.front()) && low > lowest;
      const bool is_cut_high = matters(all.back()) && high < highest;
      if (!is_cut_low && !is_cut_high && std::count_if(all.begin(), all.end(), matters) >= k_enough_rates)
        break;
      const double width = high - low, step = width / (k_rates - 1);
      low = std::find_if(all.begin(), all.end(), matters)->rate - (is_cut_low ? width : step);
      high = std::find_if(all.rbegin(), all.rend(), matters)->rate + (is_cut_high ? width : step);
      low = std::max(low, lowest);
      high = std::min(high, highest);
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

ClockEstimator::Sample ClockEstimator::sample_of(const ClockExchange& exchange) const {
  return {seconds(exchange.asked_at - begin_), seconds(exchange.arrived_at - begin_),
          seconds(exchange.received_at - exchange.asked_at - base_),
          seconds(exchange.arrived_at - exchange.answered_at + base_)};
}

ClockEstimator::Depth ClockEstimator::depth_of(const Sample& sample) const {
  const double there_s = fit_.there_s + fit_.rate * (sample.asked_s - newest_s_) - sample.there_s;
  const double back_s = fit_.back_s - fit_.rate * (sample.arrived_s - newest_s_) - sample.back_s;
  if (there_s > 0 && back_s > 0) return {};
  return {std::max(0.0, there_s), std::max(0.0, back_s)};
}

// The depth that queues and an uncertain rate explain.
double ClockEstimator::largest_depth_s(const Sample& sample) const {
  const double ahead_s = std::max(0.0, sample.arrived_s - newest_s_);
  return k_margin_s + k_margin_scales * fit_.scale_s + k_wander * square(ahead_s) +
         k_margin_stddevs * std::sqrt(fit_.variance + fit_.rate_variance * square(ahead_s)) +
         (samples_.size() < k_few ? fit_.round_trip_s() : 0);
}

void ClockEstimator::add(const ClockExchange& exchange) {
  if (samples_.empty()) {
    begin_ = exchange.arrived_at;
    base_ = offset_of(exchange);
  }
  const Sample sample = sample_of(exchange);
  if (exchange.arrived_at < exchange.asked_at || sample.there_s + sample.back_s < 0 ||
      sample.arrived_s < newest_s_ - k_window_s)
    return;
  const Depth depth = samples_.empty() ? Depth{} : depth_of(sample);
  const bool is_odd = !samples_.empty() && depth.most_s() > largest_depth_s(sample);
  if (is_odd && !odd_) {
    odd_ = sample;
    return;
  }
  const double clearly_s = k_resolution_s + k_clear_scales * fit_.scale_s;
  lower_there_ = depth.there_s > clearly_s ? lower_there_ + 1 : 0;
  lower_back_ = depth.back_s > clearly_s ? lower_back_ + 1 : 0;
  if (is_odd) samples_.push_back(*odd_);
  samples_.push_back(sample);
  odd_.reset();
  const double offset_s = (sample.there_s - sample.back_s) / 2;
  if (is_odd)
    begin_again(2, offset_s);
  else if (samples_.size() > k_few && std::max(lower_there_, lower_back_) >= k_lower_in_a_row)
    begin_again(k_lower_in_a_row, offset_s);
  drop_old();
  fit_ = fitted();
}

// Keeps only the newest exchanges, after which the offset is about `offset_s`.
void ClockEstimator::begin_again(std::size_t exchanges, double offset_s) {
  const double expected_s = fit_.offset_s + fit_.rate * (samples_.back().arrived_s - newest_s_);
  const double moved_s = std::abs(offset_s - expected_s);
  if (moved_s > std::max(fit_.round_trip_s(), k_least_step_s)) ++steps_;
  prior_ = {fit_.rate,
            moved_s > k_slewed_s ? std::hypot(std::sqrt(fit_.rate_variance), k_rate_change) : k_rate_slewed};
  samples_.erase(samples_.begin(), samples_.end() - static_cast<std::ptrdiff_t>(exchanges));
  lower_there_ = lower_back_ = 0;
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
  const std::vector<AtRate> rates = likelihood.rates(
      fit_.rate, k_search_stddevs * (fit_.rate_variance > 0 ? std::sqrt(fit_.rate_variance) : prior_.stddev));
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
  out.variance += k_widening * noise_variance + square(k_wander * square(length_s) / 12) +
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
