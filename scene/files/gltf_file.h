#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// A glTF 2.0 file: its JSON, and its buffers, which are read when they are needed. Functions throw
/// nlohmann::json::exception where the JSON has not the form of glTF; read_gltf() catches it.
class GltfFile {
 public:
  /// Reads a .gltf or .glb, whatever its name says. Errors: unreadable, cut, no JSON.
  static Result<GltfFile> open(const std::filesystem::path& path);

  const nlohmann::json& root() const { return *root_; }
  const std::filesystem::path& path() const { return path_; }
  /// The number before the point of the version that the file states.
  int version() const;

  /// The bytes of a buffer view, decompressed where EXT_meshopt_compression applies. They live as long as
  /// this file.
  Result<std::string_view> view(std::size_t index);

  /// All values of an accessor with this number of components, integers as numbers from 0 (or -1) to 1 where
  /// the accessor is normalised. `may_be_more`: more components are allowed and left out.
  Result<std::vector<float>> numbers(std::size_t accessor, std::size_t components, bool may_be_more = false);
  /// All values of an accessor of whole numbers with one component, not normalised.
  Result<std::vector<std::uint32_t>> indices(std::size_t accessor);

  /// "PATH: WHAT. Export it again."
  Error problem(const std::string& what) const;

 private:
  struct Accessor;
  Result<std::string_view> buffer(std::size_t index);
  Result<std::string> meshopt_view(const nlohmann::json& compressed);
  Result<std::string_view> part_of(std::string_view bytes, std::size_t offset, std::size_t length) const;
  Result<Accessor> accessor_at(std::size_t index);
  Status fill(std::size_t view, std::size_t offset, std::size_t count, Accessor* to);
  template <class Use>
  Status each_sparse(const nlohmann::json& sparse, const Accessor& like, const Use& use);

  std::filesystem::path path_;
  std::shared_ptr<const nlohmann::json> root_;
  std::string bin_;  // the binary chunk of a .glb
  bool has_bin_ = false;
  std::map<std::size_t, std::string> buffers_, decoded_views_;
};

/// JSON as text for a message. What is longer than about 100 characters is cut.
std::string short_text(const nlohmann::json& json);

/// A JSON number as a whole number from 0. Throws nlohmann::json::exception for anything else: a negative
/// number, one with decimals, one beyond 9e15.
std::size_t whole_number(const nlohmann::json& number);
/// The whole number at a key of a JSON object, or `otherwise` when it has none. Throws as above.
std::size_t whole_number(const nlohmann::json& object, const char* key, std::size_t otherwise);

}  // namespace limn::scene
