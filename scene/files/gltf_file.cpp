#include "scene/files/gltf_file.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/json_text.h"
#include "scene/files/named_file.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t k_most_values = std::size_t{1} << 31;

enum ComponentType { k_i8 = 5120, k_u8 = 5121, k_i16 = 5122, k_u16 = 5123, k_u32 = 5125, k_f32 = 5126 };

std::size_t size_of(std::size_t component_type) {
  switch (component_type) {
    case k_i8:
    case k_u8:
      return 1;
    case k_i16:
    case k_u16:
      return 2;
    case k_u32:
    case k_f32:
      return 4;
    default:
      return 0;
  }
}

std::size_t components_of(const std::string& type) {
  static const std::map<std::string, std::size_t> k_types = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  const auto known = k_types.find(type);
  return known == k_types.end() ? 0 : known->second;
}

template <class T>
double bytes_as(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return static_cast<double>(value);
}

double component_at(const char* at, std::size_t component_type) {
  switch (component_type) {
    case k_i8:
      return bytes_as<std::int8_t>(at);
    case k_u8:
      return bytes_as<std::uint8_t>(at);
    case k_i16:
      return bytes_as<std::int16_t>(at);
    case k_u16:
      return bytes_as<std::uint16_t>(at);
    case k_u32:
      return bytes_as<std::uint32_t>(at);
    default:
      return bytes_as<float>(at);
  }
}

// The stored number that stands for 1.
double full_scale(std::size_t component_type) {
  switch (component_type) {
    case k_i8:
      return 127;
    case k_u8:
      return 255;
    case k_i16:
      return 32767;
    case k_u16:
      return 65535;
    case k_u32:
      return 4294967295.0;
    default:
      return 1;
  }
}

std::uint32_t u32_at(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  if (at + 4 <= bytes.size()) std::memcpy(&value, bytes.data() + at, 4);
  return value;
}

}  // namespace

std::size_t whole_number(const json& number) {
  const auto value = number.get<double>();
  if (!(value >= 0 && value < 9e15 && value == std::floor(value)))
    throw json::other_error::create(501, fmt::format("{} is not a whole number from 0", value), &number);
  return static_cast<std::size_t>(value);
}

std::size_t whole_number(const json& object, const char* key, std::size_t otherwise) {
  const auto found = object.find(key);
  return found == object.end() || found->is_null() ? otherwise : whole_number(*found);
}

// The values of an accessor as they are stored.
struct GltfFile::Accessor {
  std::size_t count = 0, components = 0, type = 0;
  bool is_normalised = false;
  std::vector<double> values = {};
};

Error GltfFile::problem(const std::string& what) const {
  return error("{}: {}. Export it again.", path_.string(), what);
}

Result<GltfFile> GltfFile::open(const fs::path& path) {
  GltfFile file;
  file.path_ = path;
  LIMN_TRY(std::string bytes, read_file(path));
  const Error cut =
      error("{}: expected a complete glTF file, found one that ends too early ({} bytes). Export it again.",
            path.string(), bytes.size());
  std::string text = std::move(bytes);
  if (text.starts_with("glTF")) {
    const std::string whole = std::move(text);
    const std::size_t length = u32_at(whole, 8), json_length = u32_at(whole, 12);
    if (whole.size() < 20 || length > whole.size() || json_length > whole.size() - 20) return cut;
    if (u32_at(whole, 4) == 1) {  // glTF 1.0 has another layout; the version is all that is needed
      file.root_ = std::make_shared<json>(json{{"asset", {{"version", "1.0"}}}});
      return file;
    }
    text = whole.substr(20, json_length);
    std::size_t next = 20 + json_length;  // some programs forget to fill up to four bytes
    if (whole.compare(std::min(next + 4, whole.size()), 3, "BIN") != 0) next = 20 + (json_length + 3) / 4 * 4;
    if (next + 8 <= whole.size()) {
      if (u32_at(whole, next) > whole.size() - next - 8) return cut;
      file.bin_ = whole.substr(next + 8, u32_at(whole, next));
      file.has_bin_ = whole.compare(next + 4, 3, "BIN") == 0;
    }
  }
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
  try {
    file.root_ = std::make_shared<json>(json::parse(text));
    if (!file.root_->is_object()) return error("{}: expected a glTF file, found other JSON.", path.string());
  } catch (const json::exception& problem) {
    return error("{}: expected a complete glTF file, found JSON that cannot be read ({}). Export it again.",
                 path.string(), problem.what());
  }
  return file;
}

int GltfFile::version() const {
  // In glTF 1.0 meshes have names instead of numbers.
  if (const auto meshes = root_->find("meshes"); meshes != root_->end() && meshes->is_object()) return 1;
  const json asset = root_->value("asset", json::object());
  const json version = asset.value("version", json("2.0"));
  return version.is_string() && version.get<std::string>().starts_with("1") ? 1 : 2;
}

Result<std::string_view> GltfFile::part_of(std::string_view bytes,
                                           std::size_t offset,
                                           std::size_t length) const {
  if (offset > bytes.size() || length > bytes.size() - offset)
    return problem(
        fmt::format("expected a buffer of {} bytes or more, found {} bytes", offset + length, bytes.size()));
  return bytes.substr(offset, length);
}

Result<std::string_view> GltfFile::buffer(std::size_t index) {
  if (const auto known = buffers_.find(index); known != buffers_.end())
    return std::string_view(known->second);
  const json& buffer = root_->at("buffers").at(index);
  if (!buffer.contains("uri")) {
    if (index != 0 || !has_bin_)
      return problem(fmt::format("expected buffer {} to have a file, found none", index));
    return std::string_view(bin_);
  }
  const auto uri = buffer.at("uri").get<std::string>();
  std::string bytes;
  if (uri.starts_with("data:")) {
    auto decoded = data_uri_bytes(uri);
    if (!decoded) return problem(fmt::format("expected buffer {} in base64, found other characters", index));
    bytes = std::move(*decoded);
  } else {
    const auto file = find_named_file(path_.parent_path(), uri);
    if (!file)
      return error(
          "{}: expected its buffer file {} beside it, found none. Copy it there, or export one .glb file.",
          path_.string(), percent_decoded(uri));
    LIMN_TRY(bytes, read_file(file->path));
  }
  return std::string_view(buffers_[index] = std::move(bytes));
}

Result<std::string> GltfFile::meshopt_view(const json& compressed) {
  LIMN_TRY(const std::string_view all, buffer(whole_number(compressed, "buffer", 0)));
  LIMN_TRY(const std::string_view packed, part_of(all, whole_number(compressed, "byteOffset", 0),
                                                  whole_number(compressed, "byteLength", 0)));
  const std::size_t stride = whole_number(compressed, "byteStride", 0),
                    count = whole_number(compressed, "count", 0);
  const auto mode = compressed.at("mode").get<std::string>();
  const auto filter = compressed.value("filter", std::string("NONE"));
  const bool is_vertices = mode == "ATTRIBUTES";
  const bool is_valid =
      count < k_most_values &&
      (is_vertices ? stride > 0 && stride <= 256 && stride % 4 == 0 : stride == 2 || stride == 4) &&
      (mode != "TRIANGLES" || count % 3 == 0) && (filter != "OCTAHEDRAL" || stride == 4 || stride == 8) &&
      (filter != "QUATERNION" || stride == 8) && (filter == "NONE" || is_vertices);
  if (!is_valid) return problem("expected buffers compressed as EXT_meshopt_compression says, found others");
  std::string out(count * stride, '\0');
  const auto* const in = reinterpret_cast<const unsigned char*>(packed.data());
  const int failed = is_vertices ? meshopt_decodeVertexBuffer(out.data(), count, stride, in, packed.size())
                     : mode == "TRIANGLES"
                         ? meshopt_decodeIndexBuffer(out.data(), count, stride, in, packed.size())
                         : meshopt_decodeIndexSequence(out.data(), count, stride, in, packed.size());
  if (failed != 0) return problem("expected whole buffers of EXT_meshopt_compression, found damaged ones");
  if (filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), count, stride);
  if (filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), count, stride);
  if (filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), count, stride);
  return out;
}

Result<std::string_view> GltfFile::view(std::size_t index) {
  if (const auto known = decoded_views_.find(index); known != decoded_views_.end())
    return std::string_view(known->second);
  const json& view = root_->at("bufferViews").at(index);
  const json extensions = view.value("extensions", json::object());
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
    if (extensions.contains(name)) {
      LIMN_TRY(std::string bytes, meshopt_view(extensions.at(name)));
      return std::string_view(decoded_views_[index] = std::move(bytes));
    }
  LIMN_TRY(const std::string_view all, buffer(whole_number(view, "buffer", 0)));
  return part_of(all, whole_number(view, "byteOffset", 0), whole_number(view, "byteLength", 0));
}

Status GltfFile::fill(std::size_t index, std::size_t offset, std::size_t count, Accessor* to) {
  if (count == 0) return {};
  LIMN_TRY(const std::string_view bytes, view(index));
  const std::size_t component = size_of(to->type), item = component * to->components;
  const std::size_t stride = whole_number(root_->at("bufferViews").at(index), "byteStride", item);
  if (stride < component)
    return problem(fmt::format("buffer view {}: expected a byteStride of {} or more, found {}", index,
                               component, stride));
  LIMN_TRY(const std::string_view part, part_of(bytes, offset, stride * (count - 1) + item));
  to->values.resize(count * to->components);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < to->components; ++k)
      to->values[i * to->components + k] = component_at(part.data() + i * stride + k * component, to->type);
  return {};
}

template <class Use>
Status GltfFile::each_sparse(const json& sparse, const Accessor& like, const Use& use) {
  const std::size_t count = whole_number(sparse, "count", 0);
  const json &at = sparse.at("indices"), &with = sparse.at("values");
  Accessor places{count, 1, whole_number(at, "componentType", 0)}, values{count, like.components, like.type};
  if (count > like.count || size_of(places.type) == 0 || places.type == k_f32)
    return problem("expected a sparse accessor with whole numbers as indices, found another");
  LIMN_TRY_STATUS(fill(whole_number(at, "bufferView", 0), whole_number(at, "byteOffset", 0), count, &places));
  LIMN_TRY_STATUS(
      fill(whole_number(with, "bufferView", 0), whole_number(with, "byteOffset", 0), count, &values));
  for (std::size_t i = 0; i < count; ++i) {
    if (!(places.values[i] >= 0 && places.values[i] < static_cast<double>(like.count)))
      return problem(
          "expected a sparse accessor with indices of its own entries, found indices beyond their number");
    use(static_cast<std::size_t>(places.values[i]), &values.values[i * like.components]);
  }
  return {};
}

Result<GltfFile::Accessor> GltfFile::accessor_at(std::size_t index) {
  const json& accessor = root_->at("accessors").at(index);
  Accessor out{whole_number(accessor, "count", 0), components_of(accessor.at("type").get<std::string>()),
               whole_number(accessor, "componentType", 0), accessor.value("normalized", false)};
  if (out.components == 0 || size_of(out.type) == 0 || out.count > k_most_values / 16)
    return problem(
        fmt::format("accessor {}: expected a type and a number of values of glTF, found others", index));
  if (accessor.contains("bufferView"))
    LIMN_TRY_STATUS(fill(whole_number(accessor, "bufferView", 0), whole_number(accessor, "byteOffset", 0),
                         out.count, &out));
  out.values.resize(out.count * out.components, 0);
  if (accessor.contains("sparse"))
    LIMN_TRY_STATUS(each_sparse(accessor.at("sparse"), out, [&](std::size_t i, const double* value) {
      std::copy_n(value, out.components, &out.values[i * out.components]);
    }));
  return out;
}

Result<std::vector<float>> GltfFile::numbers(std::size_t index, std::size_t components, bool may_be_more) {
  LIMN_TRY(const Accessor all, accessor_at(index));
  if (all.components < components || (all.components > components && !may_be_more))
    return problem(fmt::format("accessor {}: expected {} numbers for each entry, found {}", index, components,
                               all.components));
  const double full = all.is_normalised ? full_scale(all.type) : 1;
  std::vector<float> out;
  out.reserve(all.count * components);
  for (std::size_t i = 0; i < all.count; ++i)
    for (std::size_t k = 0; k < components; ++k) {
      const double value = all.values[i * all.components + k] / full;
      out.push_back(static_cast<float>(all.is_normalised ? std::max(value, -1.0) : value));
    }
  return out;
}

Result<std::vector<std::uint32_t>> GltfFile::indices(std::size_t index) {
  LIMN_TRY(const Accessor all, accessor_at(index));
  if (all.components != 1 || all.type == k_f32)
    return problem(fmt::format("accessor {}: expected whole numbers as indices, found others", index));
  std::vector<std::uint32_t> out;
  out.reserve(all.count);
  for (const double value : all.values) out.push_back(static_cast<std::uint32_t>(std::max(value, 0.0)));
  return out;
}

std::string short_text(const nlohmann::json& json) {
  std::string text = json_text(json);
  std::size_t end = 100;
  if (text.size() <= end) return text;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U)
    --end;  // a character stays whole
  return text.substr(0, end) + "...";
}

}  // namespace limn::scene
