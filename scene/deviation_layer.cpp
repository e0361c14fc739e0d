#include "scene/deviation_layer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace limn::scene {
namespace {

static_assert(std::endian::native == std::endian::little);  // numbers are written as copies of memory

constexpr std::string_view k_magic = "limn.deviation-layer/1\n";
constexpr std::size_t k_most_triangles = 50'000'000, k_most_values = 100'000'000, k_most_marks = 100,
                      k_most_texts = 12, k_most_text = 200;

template <typename T>
void put(std::string* bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

template <typename T>
void put_all(std::string* bytes, const std::vector<T>& values) {
  put(bytes, static_cast<std::uint64_t>(values.size()));
  bytes->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

// Reads numbers in their order; false from the first one on that is missing.
class Reading {
 public:
  explicit Reading(std::string_view bytes) : rest_(bytes) {}

  template <typename T>
  T number() {
    T value{};
    read_bytes(&value, sizeof(T));
    return value;
  }
  template <typename T>
  std::vector<T> list(std::size_t most) {
    const std::size_t count = size(most, sizeof(T));
    std::vector<T> values(count);
    read_bytes(values.data(), count * sizeof(T));
    return values;
  }
  std::string text() {
    const std::size_t count = size(k_most_text, 1);
    std::string text(count, ' ');
    read_bytes(text.data(), count);
    return text;
  }
  // A count of things that have at least `bytes` each.
  std::size_t size(std::size_t most, std::size_t bytes) {
    const auto count = number<std::uint64_t>();
    if (count > most || count * bytes > rest_.size()) is_good_ = false;
    return is_good_ ? static_cast<std::size_t>(count) : 0;
  }
  Eigen::Vector3d vector() {
    const auto x = number<double>(), y = number<double>(), z = number<double>();
    return {x, y, z};
  }
  bool is_good() const { return is_good_; }
  bool is_at_end() const { return rest_.empty(); }

 private:
  void read_bytes(void* to, std::size_t count) {
    if (count > rest_.size()) is_good_ = false;
    if (!is_good_ || count == 0) return;
    std::memcpy(to, rest_.data(), count);
    rest_.remove_prefix(count);
  }
  std::string_view rest_;
  bool is_good_ = true;
};

bool is_consistent(const DeviationLayer& layer) {
  constexpr std::uint32_t k_most_divisions = 1 << 14;
  const auto fits = [&](const DeviationLayer::Triangle& triangle) {
    return triangle.divisions >= 1 && triangle.divisions <= k_most_divisions &&
           triangle.first + points_of_divisions(triangle.divisions) <= layer.values.size();
  };
  const auto is_finite = [](const DeviationLayer::Mark& mark) {
    return mark.p_prototype.allFinite() && mark.d_normal.allFinite() && std::isfinite(mark.distance_m);
  };
  return std::ranges::all_of(layer.triangles, fits) && std::ranges::all_of(layer.marks, is_finite) &&
         std::ranges::all_of(layer.band_colours, [](const auto& colour) { return colour.allFinite(); });
}

}  // namespace

std::uint32_t deviation_value(double distance_m, double stddev_m) {
  if (!std::isfinite(distance_m) || !std::isfinite(stddev_m)) return k_no_deviation;
  constexpr double k_most = 32'767, k_most_stddev = 65'534;  // the largest number says that there is none
  const auto distance = static_cast<std::int16_t>(std::lround(std::clamp(1e6 * distance_m, -k_most, k_most)));
  const auto stddev = static_cast<std::uint32_t>(std::lround(std::clamp(1e6 * stddev_m, 0.0, k_most_stddev)));
  return static_cast<std::uint16_t>(distance) | stddev << 16;
}

std::string bytes_of(const DeviationLayer& layer) {
  std::string bytes(k_magic);
  put(&bytes, static_cast<std::int32_t>(layer.number));
  put_all(&bytes, layer.triangles);
  put_all(&bytes, layer.values);
  for (const Eigen::Vector3f& colour : layer.band_colours)
    for (int i = 0; i < 3; ++i) put(&bytes, colour[i]);
  put(&bytes, static_cast<std::uint64_t>(layer.marks.size()));
  for (const DeviationLayer::Mark& mark : layer.marks) {
    for (const Eigen::Vector3d& vector : {mark.p_prototype, mark.d_normal})
      for (int i = 0; i < 3; ++i) put(&bytes, vector[i]);
    put(&bytes, mark.distance_m);
  }
  put(&bytes, static_cast<std::uint64_t>(layer.unsure.size()));
  for (const std::string& text : layer.unsure) {
    put(&bytes, static_cast<std::uint64_t>(std::min(text.size(), k_most_text)));
    bytes += text.substr(0, k_most_text);
  }
  return bytes;
}

Result<DeviationLayer> deviation_layer_of(std::string_view bytes) {
  DeviationLayer layer;
  const bool has_magic = bytes.starts_with(k_magic);
  Reading reading(has_magic ? bytes.substr(k_magic.size()) : std::string_view());
  layer.number = reading.number<std::int32_t>();
  layer.triangles = reading.list<DeviationLayer::Triangle>(k_most_triangles);
  layer.values = reading.list<std::uint32_t>(k_most_values);
  for (Eigen::Vector3f& colour : layer.band_colours)
    for (int i = 0; i < 3; ++i) colour[i] = reading.number<float>();
  constexpr std::size_t k_mark_bytes = 7 * sizeof(double);
  layer.marks.resize(reading.size(k_most_marks, k_mark_bytes));
  for (DeviationLayer::Mark& mark : layer.marks) {
    mark.p_prototype = reading.vector();
    mark.d_normal = reading.vector();
    mark.distance_m = reading.number<double>();
  }
  layer.unsure.resize(reading.size(k_most_texts, sizeof(std::uint64_t)));
  for (std::string& text : layer.unsure) text = reading.text();
  if (reading.is_good() && reading.is_at_end() && layer.number > 0 && is_consistent(layer)) return layer;
  return error("expected a whole deviation layer ({}), found {}.", k_magic.substr(0, k_magic.size() - 1),
               has_magic ? "a damaged one" : "something else");
}

}  // namespace limn::scene
