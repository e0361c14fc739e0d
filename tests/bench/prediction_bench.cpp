// Compares ways to predict where a hand-held body is when the light reaches it: what `limn live --prediction`
// offers (hold, linear, filtered) and two published methods, on generated motions of a hand and on recordings
// of limn live. Prints the error (root mean square) against the delay from image to light, and writes the
// same as prediction.json and prediction.html. Usage: limn bench prediction [--out DIR] [RECORDING ...]
#include <fmt/core.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/html.h"
#include "core/json_text.h"
#include "session/perception.h"
#include "session/recording.h"
#include "tests/bench/hand_motions.h"
#include "tests/bench/prediction_peers.h"
#include "tests/tracker/seen_body.h"
#include "tracker/predict.h"

namespace limn::test {
namespace {

namespace fs = std::filesystem;
using tracker::BodyFilter;

constexpr std::array k_delays_ms = {10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120};
constexpr double k_settled_s = 0.5;     // not judged: filters have just begun
constexpr std::size_t k_chosen_at = 5;  // index of the delay for which a peer's parameter is chosen

// What the tracker knew of one body after each image, and the truth.
struct Sequence {
  std::string name;
  std::vector<double> at_s = {};
  std::vector<BodyFilter> known = {};
  std::function<Pose(double)> truth = {};
  double begins_s = 0, ends_s = 0;  // predictions for moments in between are judged
};

struct Errors {
  std::array<double, k_delays_ms.size()> mm{}, deg{};
};

// Predicts from the images up to `index` to a moment.
using Method = std::function<Pose(std::size_t index, double at_s)>;

Errors errors_of(const Sequence& sequence,
                 const std::function<void(std::size_t)>& add,
                 const Method& method) {
  std::array<double, k_delays_ms.size()> shift{}, turn{}, count{};
  for (std::size_t i = 0; i < sequence.at_s.size(); ++i) {
    add(i);
    for (std::size_t k = 0; k < k_delays_ms.size(); ++k) {
      const double at_s = sequence.at_s[i] + 1e-3 * k_delays_ms[k];
      if (sequence.at_s[i] < sequence.begins_s || at_s > sequence.ends_s) continue;
      const Pose truth = sequence.truth(at_s), found = method(i, at_s);
      shift[k] += (found.translation - truth.translation).squaredNorm();
      turn[k] += std::pow(angle_between(found.rotation, truth.rotation), 2);
      ++count[k];
    }
  }
  Errors errors;
  for (std::size_t k = 0; k < k_delays_ms.size(); ++k) {
    errors.mm[k] = 1e3 * std::sqrt(shift[k] / count[k]);
    errors.deg[k] = 180 / std::numbers::pi * std::sqrt(turn[k] / count[k]);
  }
  return errors;
}

Errors errors_of(const Sequence& sequence, tracker::Prediction how) {
  return errors_of(
      sequence, [](std::size_t) {},
      [&](std::size_t i, double at_s) {
        return tracker::predicted({&sequence.known[i], 1}, shifted(Stamp{}, at_s), how)[0].world_from_body;
      });
}

Errors errors_of(const Sequence& sequence, PosePredictor* peer) {
  return errors_of(
      sequence,
      [&](std::size_t i) {
        const tracker::Fix& fix = sequence.known[i].fixes.back();
        peer->add(sequence.at_s[i], fix.world_from_body, fix.covariance);
      },
      [&](std::size_t, double at_s) { return peer->at(at_s); });
}

// A published method with one parameter, and the parameter's values to choose from.
struct Peer {
  std::string name;
  std::function<std::unique_ptr<PosePredictor>(double)> make;
  std::vector<double> values;
};

const std::vector<Peer>& peers() {
  static const std::vector<Peer> k_peers = {
      {"double exponential", double_exponential, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}},
      {"constant velocity", constant_velocity, {1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1, 3}}};
  return k_peers;
}

// The value with the smallest error on a motion of the same kind that is not judged.
double chosen_value(const Peer& peer, const Sequence& training) {
  double best = 0, least = std::numeric_limits<double>::infinity();
  for (const double value : peer.values) {
    const double error = errors_of(training, peer.make(value).get()).mm[k_chosen_at];
    if (error < least) least = error, best = value;
  }
  return best;
}

struct Compared {
  std::string motion;
  std::vector<std::pair<std::string, Errors>> methods;
};

Compared compared(const Sequence& sequence, const Sequence& training) {
  Compared result{sequence.name, {}};
  for (const tracker::Prediction how :
       {tracker::Prediction::hold, tracker::Prediction::linear, tracker::Prediction::filtered})
    result.methods.emplace_back(tracker::k_predictions.text(how), errors_of(sequence, how));
  for (const Peer& peer : peers()) {
    const double value = chosen_value(peer, training);
    result.methods.emplace_back(fmt::format("{} ({:g})", peer.name, value),
                                errors_of(sequence, peer.make(value).get()));
  }
  return result;
}

// ---- generated motions ----

using MotionMaker = std::function<std::function<Pose(double)>(std::mt19937_64& rng)>;

constexpr double k_seconds = 20, k_image_s = 1 / 60.0, k_noise_px = 0.1;

// A marker of 40 mm, 64 px wide, seen by one camera.
Sequence generated(const std::string& name, const MotionMaker& make, unsigned seed) {
  std::mt19937_64 rng(seed);
  const Imager camera = camera_1080p();
  const Body body = body_of(1);
  Sequence sequence{.name = name, .truth = make(rng), .begins_s = k_settled_s, .ends_s = k_seconds};
  std::vector<BodyFilter> known;
  for (int i = 0; i * k_image_s < k_seconds; ++i) {
    const double at_s = i * k_image_s;
    const auto found = detections_of(body, camera, sequence.truth(at_s), k_noise_px, rng);
    const tracker::View view{&camera, found};
    known = tracker::observed(known, {&body, 1}, {&view, 1}, shifted(Stamp{}, at_s));
    if (known.empty()) continue;
    sequence.at_s.push_back(at_s);
    sequence.known.push_back(known[0]);
  }
  return sequence;
}

std::vector<Compared> compare_generated() {
  const Pose about(exp_rotation({0.5, 0.3, 0}), {0, 0, 1});
  const auto reaches = [&](double largest_m, double tremor_m) -> MotionMaker {
    return [=](std::mt19937_64& rng) {
      return [reaches = Reaches(about, largest_m, tremor_m, k_seconds + 1, rng)](double s) {
        return reaches.at(s);
      };
    };
  };
  const std::vector<std::pair<std::string, MotionMaker>> motions = {
      {"sweeping, 0.25 m/s",
       [&](std::mt19937_64& rng) {
         return [hand = HandMotion(about, rng)](double s) { return hand.at(s); };
       }},
      {"reaches of up to 0.4 m, with rests", reaches(0.4, 0)},
      {"corrections of up to 30 mm, with tremor", reaches(0.03, 0.2e-3)}};
  std::vector<Compared> all;
  for (const auto& [name, make] : motions)
    all.push_back(compared(generated(name, make, 1), generated(name, make, 2)));
  return all;
}

// ---- recordings ----

// The tracker's knowledge of every body of a recording, after each moment's images.
Result<std::map<std::string, Sequence>> perceived(const fs::path& folder) {
  LIMN_TRY(const session::SessionSetup setup, session::load_setup(folder));
  LIMN_TRY(session::Perception perception, session::Perception::create(setup.scene, setup.rig, setup.watch));
  std::ifstream events(folder / "events.jsonl");
  if (!events) return error("{}: expected events.jsonl, found none.", folder.string());
  std::map<std::string, Sequence> bodies;
  for (std::string line; std::getline(events, line);) {
    const auto event = nlohmann::json::parse(line, nullptr, false);
    if (!event.is_object() || !event.contains("watch")) continue;
    std::vector<Frame> frames;
    for (const auto& item : event["watch"]) {
      LIMN_TRY(Frame frame, session::load_frame(folder / item.at("file").get<std::string>()));
      frame.camera = item.at("camera").get<std::string>();
      frame.captured_at = Stamp{} + std::chrono::nanoseconds(item.at("captured_at_ns").get<std::int64_t>());
      frames.push_back(std::move(frame));
    }
    const session::Percepts& percepts = perception.watch(frames);
    for (const BodyFilter& known : percepts.motions) {
      if (known.measured_at != percepts.captured_at) continue;
      Sequence& sequence = bodies[known.body];
      sequence.at_s.push_back(seconds_between(Stamp{}, known.measured_at));
      sequence.known.push_back(known);
    }
  }
  return bodies;
}

// The truth is what later images show: the poses from single images, and straight motion between them.
Pose measured_at(const Sequence& sequence, double at_s) {
  const auto next = std::ranges::lower_bound(sequence.at_s, at_s);
  const auto i = static_cast<std::size_t>(next - sequence.at_s.begin());
  if (i == 0) return sequence.known.front().fixes.back().world_from_body;
  if (i == sequence.at_s.size()) return sequence.known.back().fixes.back().world_from_body;
  const double share = (at_s - sequence.at_s[i - 1]) / (sequence.at_s[i] - sequence.at_s[i - 1]);
  return interpolated(sequence.known[i - 1].fixes.back().world_from_body,
                      sequence.known[i].fixes.back().world_from_body, share);
}

double way_m(const Sequence& sequence) {
  double way = 0;
  for (std::size_t i = 15; i < sequence.known.size();
       i += 15)  // in steps of half a second: noise is no motion
    way += (sequence.known[i].fixes.back().world_from_body.translation -
            sequence.known[i - 15].fixes.back().world_from_body.translation)
               .norm();
  return way;
}

// A third of a recording chooses the peers' parameters, the rest is judged.
Result<std::vector<Compared>> compare_recorded(const fs::path& folder) {
  constexpr double k_least_way_m = 0.1, k_least_s = 3;
  LIMN_TRY(auto bodies, perceived(folder));
  std::vector<Compared> all;
  for (auto& [body, sequence] : bodies) {
    const double seconds = sequence.at_s.back() - sequence.at_s.front();
    if (way_m(sequence) < k_least_way_m || seconds < k_least_s) continue;
    sequence.name = fmt::format("{} of {}", body, folder.filename().string());
    sequence.truth = [&sequence](double at_s) { return measured_at(sequence, at_s); };
    Sequence training = sequence;
    const double divided_s = sequence.at_s.front() + seconds / 3;
    training.begins_s = sequence.at_s.front() + k_settled_s;
    training.ends_s = sequence.begins_s = divided_s;
    sequence.ends_s = sequence.at_s.back();
    all.push_back(compared(sequence, training));
  }
  if (all.empty())
    return error("{}: expected a body that moves by {} m or more in {} s or more, found none.",
                 folder.string(), k_least_way_m, k_least_s);
  return all;
}

// ---- results ----

void print(const Compared& result) {
  for (const bool is_turn : {false, true}) {
    fmt::print("{}: {} by the delay in ms\n  {:<28}", result.motion,
               is_turn ? "rotation, degrees RMS" : "position, mm RMS", "");
    for (const int delay : k_delays_ms) fmt::print("{:>8}", delay);
    fmt::print("\n");
    for (const auto& [name, errors] : result.methods) {
      fmt::print("  {:<28}", name);
      for (const double value : is_turn ? errors.deg : errors.mm) fmt::print("{:>8.2f}", value);
      fmt::print("\n");
    }
  }
  std::fflush(stdout);
}

// Lines of the position's error by the delay.
std::string plot(const Compared& result) {
  constexpr std::array k_colours = {"#888888", "#d08000", "#0060c0", "#30a030", "#b030a0"};
  constexpr double k_width = 560, k_height = 300, k_left = 50, k_bottom = 30, k_right = 200, k_top = 14;
  double most = 0;
  for (const auto& [name, errors] : result.methods) most = std::max(most, errors.mm.back());
  const auto x = [&](double ms) { return k_left + (k_width - k_left - k_right) * ms / k_delays_ms.back(); };
  const auto y = [&](double mm) { return k_height - k_bottom - (k_height - k_bottom - k_top) * mm / most; };
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"sans-serif\" font-size=\"11\">",
      k_width, k_height);
  for (int i = 0; i <= 4; ++i) {
    const double mm = most * i / 4;
    svg += fmt::format(
        "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\" stroke=\"#ddd\"/>"
        "<text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:.1f}</text>",
        k_left, k_width - k_right, y(mm), k_left - 6, y(mm) + 4, mm);
  }
  for (int ms = 0; ms <= k_delays_ms.back(); ms += 20)
    svg +=
        fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>", x(ms), k_height - 12, ms);
  std::vector<std::pair<double, std::size_t>> ends;  // of the lines, to set their names apart
  for (std::size_t i = 0; i < result.methods.size(); ++i) {
    std::string points;
    const Errors& errors = result.methods[i].second;
    for (std::size_t k = 0; k < k_delays_ms.size(); ++k)
      points += fmt::format("{:.1f},{:.1f} ", x(k_delays_ms[k]), y(errors.mm[k]));
    svg += fmt::format("<polyline fill=\"none\" stroke-width=\"2\" stroke=\"{}\" points=\"{}\"/>",
                       k_colours[i], points);
    ends.emplace_back(y(errors.mm.back()), i);
  }
  std::ranges::sort(ends);
  double below = k_top - 14;
  for (const auto& [at, i] : ends) {
    below = std::max(at, below + 14);
    svg += fmt::format("<text x=\"{}\" y=\"{:.1f}\" fill=\"{}\">{}</text>", k_width - k_right + 8, below + 4,
                       k_colours[i], escaped(result.methods[i].first));
  }
  return svg + "</svg>";
}

Status write(const std::vector<Compared>& all, const fs::path& out) {
  nlohmann::ordered_json json = {{"schema", "limn.prediction_bench/1"}, {"delays_ms", k_delays_ms}};
  std::string body;
  for (const Compared& result : all) {
    nlohmann::ordered_json methods = nlohmann::ordered_json::array();
    for (const auto& [name, errors] : result.methods)
      methods.push_back({{"method", name}, {"position_mm", errors.mm}, {"rotation_deg", errors.deg}});
    json["motions"].push_back({{"motion", result.motion}, {"methods", methods}});
    body += html_figure(plot(result), result.motion,
                        "Error of the predicted position in mm (root mean square) by the delay from image to "
                        "light in ms.");
  }
  LIMN_TRY_STATUS(make_folder(out));
  LIMN_TRY_STATUS(write_file(out / "prediction.json", json_text(json, 2) + "\n"));
  return write_file(out / "prediction.html",
                    html_page("Prediction of a hand's motion", HtmlColours::light, "", body));
}

Status run(const fs::path& out, const std::vector<fs::path>& recordings) {
  std::vector<Compared> all = compare_generated();
  for (const Compared& result : all) print(result);
  for (const fs::path& folder : recordings) {
    LIMN_TRY(const auto more, compare_recorded(folder));
    for (const Compared& result : more) print(result);
    all.insert(all.end(), more.begin(), more.end());
  }
  LIMN_TRY_STATUS(write(all, out));
  fmt::print("page and numbers in {}\n", out.string());
  return {};
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  std::filesystem::path out = "out/bench-prediction";
  std::vector<std::filesystem::path> recordings;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--out") == 0 && i + 1 < argc)
      out = argv[++i];
    else
      recordings.emplace_back(argv[i]);
  }
  const limn::Status done = limn::test::run(out, recordings);
  if (done.ok()) return 0;
  fmt::print(stderr, "bench prediction: {}\n", done.message());
  return 1;
}
