#include "calib/code/patterns.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/names.h"

namespace limn::calib {
namespace {

constexpr int k_max_side = 16384;  // 14 bits; no projector is larger
constexpr int k_min_period_px = 4, k_max_period_px = 256;
constexpr int k_min_steps = 3, k_max_steps = 32;
constexpr int k_max_step_px = 16;  // wider stripes measure no direct light
constexpr double k_min_gamma = 0.2, k_max_gamma = 5;

int gray_bit(int i, int bit) { return ((i ^ (i >> 1)) >> bit) & 1; }

// Light of each position along an axis: that bit of its label's Gray code, combined with bit `base` if above
// it. `block`: pixels with one label.
std::vector<uchar> stripe(int size, int block, int bit, int base, bool inverse) {
  std::vector<uchar> line(static_cast<size_t>(size));
  for (int i = 0; i < size; ++i) {
    const int label = i / block;
    const bool lit = (gray_bit(label, bit) ^ (bit > base ? gray_bit(label, base) : 0)) != 0;
    line[static_cast<size_t>(i)] = lit != inverse ? 255 : 0;
  }
  return line;
}

// Light of each position in one step of the sinusoid, 0 … 1.
std::vector<double> wave(int size, int step, const CodeOptions& options) {
  std::vector<double> line(static_cast<size_t>(size));
  for (int i = 0; i < size; ++i) {
    const double turns = static_cast<double>(i % options.period_px) / options.period_px -
                         static_cast<double>(step) / options.steps;
    line[static_cast<size_t>(i)] = std::max(0.0, 0.5 + 0.5 * std::cos(2 * std::numbers::pi * turns));
  }
  return line;
}

// Display values for light between black's and white's; one channel, or BGR.
std::vector<uchar> displayed(const std::vector<double>& light, const CodeOptions& options) {
  std::vector<uchar> values;
  const auto give = [&](double value) { values.push_back(static_cast<uchar>(std::lround(255 * value))); };
  for (const double l : light) {
    if (!options.response) {
      give(std::pow(l, 1 / options.gamma));
      continue;
    }
    for (const auto* curve : {&options.response->blue, &options.response->green, &options.response->red})
      give(inverse_lookup(*curve, curve->front() + l * (curve->back() - curve->front())));
  }
  return values;
}

// Repeats a line (one value for each position, or three for BGR) side by side over the whole image.
cv::Mat across(std::vector<uchar> line, int width, int height) {
  const int channels = static_cast<int>(line.size()) / width;
  return cv::repeat(cv::Mat(1, width, CV_8UC(channels), line.data()), height, 1);
}

// Repeats it from top to bottom.
cv::Mat down(std::vector<uchar> line, int width, int height) {
  const int channels = static_cast<int>(line.size()) / height;
  return cv::repeat(cv::Mat(height, 1, CV_8UC(channels), line.data()), 1, width);
}

bool rises(const std::vector<double>& curve) {
  return curve.size() >= 2 && std::is_sorted(curve.begin(), curve.end()) && curve.back() > curve.front();
}

Status check(PatternCode code, const CodeOptions& options) {
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  if (code == PatternCode::phase && !within(options.period_px, k_min_period_px, k_max_period_px))
    return error("expected waves of {} to {} whole pixels, found {}.", k_min_period_px, k_max_period_px,
                 options.period_px);
  if (code == PatternCode::phase && !within(options.steps, k_min_steps, k_max_steps))
    return error("expected {} to {} steps of a wave, found {}.", k_min_steps, k_max_steps, options.steps);
  if (code == PatternCode::phase && !within(options.gamma, k_min_gamma, k_max_gamma))
    return error("expected a gamma of {} to {}, found {}.", k_min_gamma, k_max_gamma, options.gamma);
  if (code == PatternCode::phase && options.response &&
      !(rises(options.response->red) && rises(options.response->green) && rises(options.response->blue)))
    return error(
        "response: expected curves of at least 2 numbers that never fall and end above their start.");
  if (code == PatternCode::gray && !within(options.step_px, 1, k_max_step_px))
    return error("expected narrowest stripes of 1 to {} pixels, found {}.", k_max_step_px, options.step_px);
  if (code == PatternCode::exclusive_or && options.base_stripe_px != 2 && options.base_stripe_px != 4 &&
      options.base_stripe_px != 8)
    return error("expected stripes of 2, 4 or 8 pixels, found {}.", options.base_stripe_px);
  return {};
}

// Options that a code does not use keep their defaults, so that equal images mean equal structs.
CodeOptions used(PatternCode code, const CodeOptions& options) {
  CodeOptions kept;
  if (code == PatternCode::phase) {
    kept.period_px = options.period_px;
    kept.steps = options.steps;
    if (options.response)
      kept.response = options.response;
    else
      kept.gamma = options.gamma;
  }
  if (code == PatternCode::exclusive_or) kept.base_stripe_px = options.base_stripe_px;
  if (code != PatternCode::phase) kept.inverses = options.inverses;
  if (code == PatternCode::gray) {
    kept.step_px = options.step_px;
    kept.axes = options.axes;
  }
  return kept;
}

}  // namespace

Result<Patterns> Patterns::create(PatternCode code, int width, int height, const CodeOptions& options) {
  if (width < 2 || height < 2 || width > k_max_side || height > k_max_side)
    return error("expected a projector of 2 to {} pixels a side, found {}x{}.", k_max_side, width, height);
  LIMN_TRY_STATUS(check(code, options));
  return Patterns{code, width, height, used(code, options)};
}

int Patterns::block_px() const {
  if (code != PatternCode::phase) return options.step_px;
  // Labels of at most half a wave: their centres identify the wave with a margin of a quarter.
  const int half = std::bit_width(static_cast<unsigned>(options.period_px / 2)) - 1;
  return 1 << std::min(half, bits_for(std::min(width, height)) - 1);
}

int Patterns::lowest_bit() const { return std::bit_width(static_cast<unsigned>(block_px())) - 1; }
int Patterns::column_bits() const { return bits_for(labels_on(width, block_px())); }
int Patterns::row_bits() const {
  return options.axes == CodeAxes::columns ? 0 : bits_for(labels_on(height, block_px()));
}

int Patterns::base_bit() const {
  if (code != PatternCode::exclusive_or) return 32;
  return std::bit_width(static_cast<unsigned>(options.base_stripe_px)) - 2;
}

int Patterns::widest_stripe_px() const {
  return code == PatternCode::exclusive_or ? options.base_stripe_px
                                           : block_px() << (std::max(column_bits(), row_bits()) - 1);
}

std::vector<PatternGroup> Patterns::groups() const {
  std::vector<PatternGroup> groups;
  for (int first = 0; options.inverses && first < first_step(); first += 2) groups.push_back({first, 2});
  if (steps() > 0) {
    groups.push_back({first_step(), steps()});
    groups.push_back({first_step() + steps(), steps()});
  }
  groups.push_back({white(), 2});
  return groups;
}

cv::Mat Patterns::image(int index) const {
  LIMN_CHECK(index >= 0 && index < count());
  if (index >= white()) return cv::Mat(height, width, CV_8U, cv::Scalar(index == white() ? 255 : 0));
  if (index >= first_step() + steps())
    return down(displayed(wave(height, index - first_step() - steps(), options), options), width, height);
  if (index >= first_step())
    return across(displayed(wave(width, index - first_step(), options), options), width, height);
  const bool inverse = index % images_of_bit() == 1;
  const int bit = index / images_of_bit();
  if (bit < column_bits())
    return across(stripe(width, block_px(), column_bits() - 1 - bit, base_bit(), inverse), width, height);
  const int row_bit = bit - column_bits();
  return down(stripe(height, block_px(), row_bits() - 1 - row_bit, base_bit(), inverse), width, height);
}

Result<Patterns> linearised(const Patterns& patterns,
                            const std::vector<ProjectorResponse>& responses,
                            const std::string& projector) {
  if (patterns.code != PatternCode::phase) return patterns;
  std::vector<std::string> names;
  for (const ProjectorResponse& response : responses) {
    names.push_back(response.projector);
    if (response.projector != projector) continue;
    CodeOptions options = patterns.options;
    options.response = DisplayCurves{response.red, response.green, response.blue};
    return Patterns::create(patterns.code, patterns.width, patterns.height, options);
  }
  return error("response: expected curves of {}, found those of {}. Measure its response, too.", projector,
               joined_names(names, "no projector"));
}

int bits_for(int labels) { return static_cast<int>(std::bit_width(static_cast<unsigned>(labels - 1))); }

int labels_on(int size, int block) { return (size + block - 1) / block; }

std::string image_name(int index) { return fmt::format("{:03d}.png", index); }

Status save_patterns(const Patterns& patterns, const std::filesystem::path& path) {
  nlohmann::ordered_json json = {{"schema", "limn.patterns/1"},
                                 {"code", to_text(patterns.code)},
                                 {"size", {patterns.width, patterns.height}},
                                 {"pictures", patterns.count()}};
  if (patterns.code == PatternCode::phase) {
    json["period_px"] = patterns.options.period_px;
    json["steps"] = patterns.options.steps;
    if (const auto& curves = patterns.options.response)
      json["response"] = {{"red", curves->red}, {"green", curves->green}, {"blue", curves->blue}};
    else
      json["gamma"] = patterns.options.gamma;
  }
  if (patterns.code == PatternCode::exclusive_or) json["base_stripe_px"] = patterns.options.base_stripe_px;
  if (!patterns.options.inverses) json["inverses"] = false;
  if (patterns.options.step_px != 1) json["step_px"] = patterns.options.step_px;
  if (patterns.options.axes != CodeAxes::both) json["axes"] = k_code_axes.text(patterns.options.axes);
  return write_file(path, json_text(json, 2) + "\n");
}

CodeOptions read_code_options(const ConfigNode& node) {
  CodeOptions options;
  if (const auto period = node.find("period_px")) options.period_px = period->integer();
  if (const auto steps = node.find("steps")) options.steps = steps->integer();
  if (const auto gamma = node.find("gamma")) options.gamma = gamma->positive();
  if (const auto stripe = node.find("base_stripe_px")) options.base_stripe_px = stripe->integer();
  if (const auto inverses = node.find("inverses")) options.inverses = inverses->boolean();
  if (const auto step = node.find("step_px")) options.step_px = step->integer();
  if (const auto axes = node.find("axes")) options.axes = k_code_axes.read(*axes);
  return options;
}

std::set<std::string> code_option_keys(PatternCode code) {
  if (code == PatternCode::phase) return {"period_px", "steps", "gamma", "response"};
  if (code == PatternCode::exclusive_or) return {"base_stripe_px", "inverses"};
  return {"inverses", "step_px", "axes"};
}

Result<Patterns> load_patterns(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.patterns/1"));
  const ConfigNode root = config.root();
  const PatternCode code = k_pattern_codes.read(root.at("code"));
  std::set<std::string> keys = code_option_keys(code);
  keys.merge(std::set<std::string>{"schema", "code", "size", "pictures"});
  root.only(keys);
  const auto [width, height] = root.at("size").image_size();
  const int images = root.at("pictures").integer();
  CodeOptions options = read_code_options(root);
  if (const auto response = root.find("response")) {
    response->only({"red", "green", "blue"});
    options.response = DisplayCurves{response->at("red").numbers(-1), response->at("green").numbers(-1),
                                     response->at("blue").numbers(-1)};
  }
  LIMN_TRY_STATUS(config.status());
  const auto patterns = Patterns::create(code, width, height, options);
  if (!patterns) return error("{}: {}", path.string(), patterns.message());
  if (images != patterns->count())
    return error("{}: pictures: expected {} for {}x{} {} code, found {}.", path.string(), patterns->count(),
                 patterns->width, patterns->height, to_text(code), images);
  return patterns;
}

}  // namespace limn::calib
