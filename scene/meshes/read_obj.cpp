#include "scene/meshes/read_obj.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <utility>

#include "core/file.h"
#include "scene/files/named_file.h"
#include "scene/meshes/read_mtl.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// A corner of a face: indices from 0; -1: absent.
struct ObjCorner {
  long position = -1, uv = -1, normal = -1;
};

// Reads an OBJ file; see the header.
class ObjReader {
 public:
  explicit ObjReader(const fs::path& path) : path_(path) {
    content_.materials.push_back({.base_colour = Eigen::Vector3f::Constant(k_no_colour)});
  }

  Result<MeshContent> read(const std::string& text) {
    for (const ObjLine& line : obj_lines(text)) {
      LIMN_TRY_STATUS(read_line(line));
    }
    LIMN_TRY_STATUS(check_indices());
    add_faces();
    return std::move(content_);
  }

 private:
  struct Face {
    std::vector<ObjCorner> corners;
    std::size_t material = 0, line = 0;
  };

  Error unreadable(const ObjLine& line, const std::string& expected) const {
    return error("{}: line {}: expected {}, found '{} {}'. Export it again.", path_.string(), line.number,
                 expected, line.word, line.rest.substr(0, 60));
  }

  Status read_line(const ObjLine& line) {
    if (line.word == "v") return read_position(line);
    if (line.word == "vt") return read_numbers(line, 1, &uvs_);
    if (line.word == "vn") return read_numbers(line, 3, &normals_);
    if (line.word == "f" || line.word == "fo") return read_face(line);
    if (line.word == "mtllib") return read_materials(line.rest);
    if (line.word == "usemtl") use_material(line.rest);
    if (line.word == "surf" && std::exchange(has_free_forms_, true) == false)
      content_.warnings.push_back(
          fmt::format("{}: line {}: free-form surfaces are not shown. Export it as polygons.", path_.string(),
                      line.number));
    return {};
  }

  Result<std::vector<float>> numbers_of(const ObjLine& line, std::size_t least) const {
    std::vector<float> values;
    for (const std::string& word : words_of(line.rest)) {
      const auto value = number_of_word(word);
      if (!value) return unreadable(line, "numbers");
      values.push_back(static_cast<float>(*value));
    }
    if (values.size() < least) return unreadable(line, fmt::format("{} numbers or more", least));
    return values;
  }

  Status read_position(const ObjLine& line) {
    LIMN_TRY(const std::vector<float> v, numbers_of(line, 3));
    Eigen::Vector3f p(v[0], v[1], v[2]);
    if (v.size() == 4 && v[3] != 0) p /= v[3];
    positions_.push_back(p);
    colours_.emplace_back(v.size() >= 6 ? Eigen::Vector3f(v[3], v[4], v[5]) : Eigen::Vector3f::Ones().eval());
    has_colours_ |= v.size() >= 6;
    return {};
  }

  Status read_numbers(const ObjLine& line, std::size_t least, std::vector<Eigen::Vector3f>* to) const {
    LIMN_TRY(std::vector<float> v, numbers_of(line, least));
    v.resize(3, 0);
    to->emplace_back(v[0], v[1], v[2]);
    return {};
  }

  // An index counts from 1, or backwards from the last entry above it if it is negative; -1: none. Whether
  // there is such an entry is only known at the end of the file.
  Result<long> index_of(const ObjLine& line, const std::string& text, std::size_t above) const {
    if (text.empty()) return -1L;
    const auto value = number_of_word(text);
    const double at = !value ? -1 : *value < 0 ? static_cast<double>(above) + *value : *value - 1;
    if (!(at >= 0 && at < 4e9))
      return unreadable(line, fmt::format("indices from 1, or back into the {} entries above it", above));
    return static_cast<long>(at);
  }

  Status read_face(const ObjLine& line) {
    Face face{{}, material_, line.number};
    for (const std::string& word : words_of(line.rest)) {
      const auto first = std::min(word.find('/'), word.size());
      const auto second = first == word.size() ? first : std::min(word.find('/', first + 1), word.size());
      const auto part = [&](std::size_t from, std::size_t to) {
        return from < to ? word.substr(from + 1, to - from - 1) : std::string();
      };
      ObjCorner corner;
      LIMN_TRY(corner.position, index_of(line, word.substr(0, first), positions_.size()));
      LIMN_TRY(corner.uv, index_of(line, part(first, second), uvs_.size()));
      LIMN_TRY(corner.normal, index_of(line, part(second, word.size()), normals_.size()));
      if (corner.position < 0) return unreadable(line, "a vertex for each corner");
      face.corners.push_back(corner);
    }
    if (face.corners.size() >= 3) faces_.push_back(std::move(face));
    return {};
  }

  // Texture coordinates and normals that the file does not hold count as absent; vertices may not be absent.
  Status check_indices() {
    bool is_missing = false;
    const auto check = [&](std::size_t count, long* index) {
      if (*index < static_cast<long>(count)) return;
      *index = -1;
      is_missing = true;
    };
    for (Face& face : faces_)
      for (ObjCorner& corner : face.corners) {
        if (corner.position >= static_cast<long>(positions_.size()))
          return error("{}: line {}: expected indices of the file's {} vertices, found {}. Export it again.",
                       path_.string(), face.line, positions_.size(), corner.position + 1);
        check(uvs_.size(), &corner.uv);
        check(normals_.size(), &corner.normal);
      }
    if (is_missing)
      content_.warnings.push_back(
          fmt::format("{}: its faces name texture coordinates or normals that it does not hold; it is shown "
                      "without them.",
                      path_.string()));
    return {};
  }

  // The names behind mtllib: one name, which may have blanks, or several. A backslash may stand before a
  // blank.
  std::vector<std::string> library_names(const std::string& text) const {
    std::string whole, name;
    std::vector<std::string> each;
    for (std::size_t i = 0; i <= text.size(); ++i) {
      const bool is_escaped = text.compare(i, 2, "\\ ") == 0;
      if (is_escaped) ++i;
      if (i < text.size()) whole += text[i];
      if (i < text.size() && (is_escaped || !std::isspace(static_cast<unsigned char>(text[i])))) {
        name += text[i];
      } else if (!name.empty()) {
        each.push_back(std::exchange(name, {}));
      }
    }
    return find_named_file(path_.parent_path(), whole) ? std::vector{whole} : each;
  }

  Status read_materials(const std::string& text) {
    const fs::path folder = path_.parent_path();
    const std::vector<std::string> names = library_names(text);
    bool is_any_found = false;
    std::string missing;
    for (const std::string& name : names) {
      const auto file = find_named_file(folder, name);
      if (!file) missing += (missing.empty() ? "" : ", ") + name;
      if (!file) continue;
      is_any_found = true;
      if (file->is_other_case) note_library(name, file->path);
      LIMN_TRY_STATUS(read_library(file->path));
    }
    if (is_any_found && !missing.empty())
      content_.warnings.push_back(fmt::format(
          "{}: expected the material files {}, found none of these names.", path_.string(), missing));
    if (is_any_found) return {};
    // The mesh may have been renamed together with its materials.
    const auto own = find_named_file(folder, path_.stem().string() + ".mtl");
    if (own) {
      note_library(text, own->path);
      return read_library(own->path);
    }
    is_library_missing_ = true;
    content_.warnings.push_back(
        fmt::format("{}: expected the material file {}, found none. Its surfaces are shown grey. Copy it "
                    "beside the mesh.",
                    path_.string(), text));
    return {};
  }

  void note_library(const std::string& name, const fs::path& used) {
    content_.warnings.push_back(
        fmt::format("{}: names the material file {}; {} is used.", path_.string(), name, used.string()));
  }

  Status read_library(const fs::path& file) {
    LIMN_TRY(const std::vector<MaterialSource> read, read_mtl(file, &content_.warnings));
    for (const MaterialSource& material : read) add_material(material);
    return {};
  }

  void add_material(const MaterialSource& material) {
    const auto [known, is_new] = materials_.try_emplace(material.name, content_.materials.size());
    if (is_new) content_.materials.emplace_back();
    content_.materials[known->second] = material;
    unknown_.erase(known->second);
  }

  // Materials may be named before their library; what is unknown then stays grey.
  void use_material(const std::string& name) {
    const auto [known, is_new] = materials_.try_emplace(name, content_.materials.size());
    if (is_new) {
      content_.materials.push_back({.name = name, .base_colour = Eigen::Vector3f::Constant(k_no_colour)});
      unknown_.insert(known->second);
    }
    material_ = known->second;
  }

  void add_faces() {
    make_linear();
    content_.pieces.resize(content_.materials.size());
    for (std::size_t i = 0; i < content_.pieces.size(); ++i) content_.pieces[i].material = i;
    for (const Face& face : faces_) add_face(face, &content_.pieces[face.material]);
    for (MeshPiece& piece : content_.pieces)
      if (!has_uv_[piece.material]) piece.uvs.clear();
    note_unknown_materials();
    if (!has_colours_) return;
    // Colours of vertices replace the grey of surfaces without a material.
    content_.materials[0].base_colour.setOnes();
    for (const std::size_t i : unknown_) content_.materials[i].base_colour.setOnes();
  }

  // Colours from 0 to 1, or from 0 to 255.
  void make_linear() {
    float most = 0;
    for (const Eigen::Vector3f& c : colours_) most = std::max(most, c.maxCoeff());
    for (Eigen::Vector3f& c : colours_)
      for (float& v : c) v = linear_from_srgb(v / (most > 1 ? 255.F : 1.F));
  }

  void add_face(const Face& face, MeshPiece* piece) {
    const auto first = static_cast<std::uint32_t>(piece->positions.size());
    std::vector<Eigen::Vector3f> places;
    for (const ObjCorner& corner : face.corners) {
      const auto at = [](long i) { return static_cast<std::size_t>(i); };
      places.emplace_back(positions_[at(corner.position)]);
      piece->normals.emplace_back(corner.normal < 0 ? Eigen::Vector3f::Zero().eval()
                                                    : normals_[at(corner.normal)]);
      piece->uvs.emplace_back(corner.uv < 0 ? Eigen::Vector2f::Zero().eval()
                                            : Eigen::Vector2f(uvs_[at(corner.uv)].head<2>()));
      if (has_colours_) piece->colours.emplace_back(colours_[at(corner.position)]);
      has_uv_[piece->material] |= corner.uv >= 0;
    }
    piece->positions.insert(piece->positions.end(), places.begin(), places.end());
    for (const auto& t : polygon_triangles(places))
      piece->triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }

  void note_unknown_materials() {
    std::string names;
    for (const Face& face : faces_)
      if (unknown_.count(face.material) > 0 && !is_library_missing_) {
        const std::string& name = content_.materials[face.material].name;
        if (names.find("'" + name + "'") == std::string::npos)
          names += (names.empty() ? "'" : ", '") + name + "'";
      }
    if (!names.empty())
      content_.warnings.push_back(
          fmt::format("{}: expected the materials {} in its material files, found none of these names. They "
                      "are shown grey.",
                      path_.string(), names));
  }

  const fs::path& path_;
  MeshContent content_;
  std::vector<Eigen::Vector3f> positions_, colours_, uvs_, normals_;
  std::vector<Face> faces_;
  std::map<std::string, std::size_t> materials_;
  std::set<std::size_t> unknown_;
  std::map<std::size_t, bool> has_uv_;
  std::size_t material_ = 0;
  bool has_colours_ = false, has_free_forms_ = false, is_library_missing_ = false;
};

}  // namespace

Result<MeshContent> read_obj(const fs::path& path) {
  LIMN_TRY(const std::string text, read_file(path));
  return ObjReader(path).read(text);
}

}  // namespace limn::scene
