#include "calib/patterns.h"

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/config.h"
#include "core/file.h"

namespace limn::calib {
namespace {

constexpr int k_max_side = 16384;  // 14 bits; no projector is larger

int bits_for(int size) { return static_cast<int>(std::bit_width(static_cast<unsigned>(size - 1))); }

// Gray code of each position along an axis, that bit of it, as light.
std::vector<uchar> stripe(int size, int bit, bool inverse) {
  std::vector<uchar> line(static_cast<size_t>(size));
  for (int i = 0; i < size; ++i) {
    const bool lit = (((i ^ (i >> 1)) >> bit) & 1) != 0;
    line[static_cast<size_t>(i)] = lit != inverse ? 255 : 0;
  }
  return line;
}

}  // namespace

std::vector<std::string> pattern_codes() { return {"gray"}; }

Result<Patterns> Patterns::create(const std::string& code, int width, int height) {
  const auto codes = pattern_codes();
  if (std::find(codes.begin(), codes.end(), code) == codes.end())
    return error("pattern code '{}' is unknown. The codes are: {}.", code, fmt::join(codes, ", "));
  if (width < 2 || height < 2 || width > k_max_side || height > k_max_side)
    return error("expected a projector of 2 to {} pixels a side, found {}x{}.", k_max_side, width, height);
  return Patterns{code, width, height};
}

int Patterns::column_bits() const { return bits_for(width); }
int Patterns::row_bits() const { return bits_for(height); }

std::vector<PatternGroup> Patterns::groups() const {
  std::vector<PatternGroup> groups;
  for (int first = 0; first < count(); first += 2) groups.push_back({first, 2});
  return groups;
}

cv::Mat Patterns::picture(int index) const {
  LIMN_CHECK(index >= 0 && index < count());
  if (index >= white()) return cv::Mat(height, width, CV_8U, cv::Scalar(index == white() ? 255 : 0));
  const bool inverse = index % 2 == 1;
  const int pair = index / 2;
  if (pair < column_bits()) {
    std::vector<uchar> line = stripe(width, column_bits() - 1 - pair, inverse);
    return cv::repeat(cv::Mat(1, width, CV_8U, line.data()), height, 1);
  }
  std::vector<uchar> line = stripe(height, row_bits() - 1 - (pair - column_bits()), inverse);
  return cv::repeat(cv::Mat(height, 1, CV_8U, line.data()), 1, width);
}

std::string picture_name(int index) { return fmt::format("{:03d}.png", index); }

Status save_patterns(const Patterns& patterns, const std::filesystem::path& path) {
  const nlohmann::ordered_json json = {{"schema", "limn.patterns/1"},
                                       {"code", patterns.code},
                                       {"size", {patterns.width, patterns.height}},
                                       {"pictures", patterns.count()}};
  return write_file(path, json.dump(2) + "\n");
}

Result<Patterns> load_patterns(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.patterns/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "code", "size", "pictures"});
  const std::string code = root.at("code").choice(pattern_codes());
  const std::vector<double> size = root.at("size").numbers(2);
  const int pictures = root.at("pictures").integer();
  LIMN_TRY_STATUS(config.status());
  const auto patterns = Patterns::create(code, static_cast<int>(size[0]), static_cast<int>(size[1]));
  if (!patterns) return error("{}: size: {}", path.string(), patterns.message());
  if (pictures != patterns->count())
    return error("{}: pictures: expected {} for {}x{} {} code, found {}.", path.string(), patterns->count(),
                 patterns->width, patterns->height, code, pictures);
  return patterns;
}

}  // namespace limn::calib
