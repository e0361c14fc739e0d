#include "scene/meshes/read_ply.h"

#include <algorithm>
#include <cmath>

#include "core/file.h"
#include "scene/files/named_file.h"
#include "scene/files/ply_file.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using Index = std::uint32_t;

// The values of one element: a number for each property, or a list.
struct Row {
  std::vector<double> numbers;
  std::vector<std::vector<double>> lists;
};

void read_row(const PlyElement& element, PlyValues* values, Row* row) {
  row->numbers.resize(element.properties.size());
  row->lists.resize(element.properties.size());
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    row->numbers[i] = values->next(property.count_type.size > 0 ? property.count_type : property.type);
    row->lists[i].clear();
    if (property.count_type.size == 0) continue;
    for (double n = row->numbers[i]; n > 0 && !values->failed(); --n)
      row->lists[i].push_back(values->next(property.type));
  }
}

// The number of the property with one of these names; -1: none.
int place_of(const PlyElement& element, std::initializer_list<const char*> names) {
  for (const char* name : names)
    for (std::size_t i = 0; i < element.properties.size(); ++i)
      if (element.properties[i].name == name) return static_cast<int>(i);
  return -1;
}

template <std::size_t N>
bool is_whole(const std::array<int, N>& places) {
  return std::all_of(places.begin(), places.end(), [](int place) { return place >= 0; });
}

std::array<int, 3> colour_places(const PlyElement& element) {
  return {place_of(element, {"red", "diffuse_red", "r"}), place_of(element, {"green", "diffuse_green", "g"}),
          place_of(element, {"blue", "diffuse_blue", "b"})};
}

// The largest value that stands for full light; 0: numbers, see below.
double full_light(const PlyElement& element, const std::array<int, 3>& places) {
  const PlyType& type = element.properties[static_cast<std::size_t>(places[0])].type;
  return type.real ? 0 : type.size == 1 ? 255 : 65535;
}

// Colours as stored to linear light. Some programs write numbers from 0 to 1, others from 0 to 255.
void make_linear(double full, std::vector<Eigen::Vector3f>* colours) {
  if (full == 0) {
    float most = 0;
    for (const Eigen::Vector3f& c : *colours) most = std::max(most, c.maxCoeff());
    full = most > 1 ? 255 : 1;
  }
  for (Eigen::Vector3f& c : *colours)
    for (float& v : c) v = linear_from_srgb(v / static_cast<float>(full));
}

template <std::size_t N>
Eigen::Matrix<float, static_cast<int>(N), 1> vector_at(const Row& row, const std::array<int, N>& places) {
  Eigen::Matrix<float, static_cast<int>(N), 1> out;
  for (std::size_t i = 0; i < N; ++i)
    out[static_cast<Eigen::Index>(i)] = static_cast<float>(row.numbers[static_cast<std::size_t>(places[i])]);
  return out;
}

// Reads a PLY file; see the header.
class PlyReader {
 public:
  PlyReader(const fs::path& path, const std::string& bytes, PlyHeader header)
      : path_(path), header_(std::move(header)), values_(bytes, header_) {
    for (const PlyElement& element : header_.elements)
      if (element.name == "vertex") vertex_count_ = element.count;
  }

  Result<MeshContent> read() {
    for (const PlyElement& element : header_.elements) {
      Status done;
      if (element.name == "vertex")
        done = read_vertices(element);
      else if (element.name == "face")
        done = read_faces(element);
      else if (element.name == "tristrips")
        done = read_strips(element);
      else
        skip(element);
      if (!done) return done.error();
      if (values_.failed())
        return error(
            "{}: expected a complete {} list, found the end of a truncated file. Copy or export it again.",
            path_.string(), element.name);
    }
    return finished();
  }

 private:
  // What a face states beside its corners, in the order of faces_.
  struct Face {
    std::vector<Index> corners;
    std::vector<Eigen::Vector2f> uvs;
    std::size_t texture = 0;
  };

  void skip(const PlyElement& element) {
    Row row;
    for (std::size_t i = 0; i < element.count && !values_.failed() && !element.properties.empty(); ++i)
      read_row(element, &values_, &row);
  }

  Status read_vertices(const PlyElement& element) {
    const std::array<int, 3> p{place_of(element, {"x"}), place_of(element, {"y"}), place_of(element, {"z"})};
    const std::array<int, 3> n{place_of(element, {"nx"}), place_of(element, {"ny"}),
                               place_of(element, {"nz"})};
    const std::array<int, 2> uv{place_of(element, {"s", "u", "texture_u", "texcoord_x"}),
                                place_of(element, {"t", "v", "texture_v", "texcoord_y"})};
    const std::array<int, 3> rgb = colour_places(element);
    if (!is_whole(p))
      return error("{}: expected vertices with x, y and z, found some missing. Export it again.",
                   path_.string());
    Row row;
    for (std::size_t i = 0; i < element.count && !values_.failed(); ++i) {
      read_row(element, &values_, &row);
      vertices_.positions.push_back(vector_at(row, p));
      if (is_whole(n)) vertices_.normals.push_back(vector_at(row, n));
      if (is_whole(uv)) vertices_.uvs.push_back(vector_at(row, uv));
      if (is_whole(rgb)) vertices_.colours.push_back(vector_at(row, rgb));
    }
    if (is_whole(rgb)) make_linear(full_light(element, rgb), &vertices_.colours);
    return {};
  }

  Status read_corners(const std::vector<double>& list, std::vector<Index>* corners) const {
    corners->clear();
    for (const double index : list) {
      if (!(index >= 0 && index < static_cast<double>(vertex_count_)))
        return error(
            "{}: expected faces with indices of its {} vertices, found an index beyond them. Export it "
            "again.",
            path_.string(), vertex_count_);
      corners->push_back(static_cast<Index>(index));
    }
    return {};
  }

  Status read_faces(const PlyElement& element) {
    const int indices = place_of(element, {"vertex_indices", "vertex_index"});
    const int uvs = place_of(element, {"texcoord"}), texture = place_of(element, {"texnumber"});
    const std::array<int, 3> rgb = colour_places(element);
    if (indices < 0 && element.count > 0)
      return error("{}: expected faces with a list vertex_indices, found none. Export it again.",
                   path_.string());
    Row row;
    std::size_t empty = 0;
    for (std::size_t i = 0; i < element.count && !values_.failed(); ++i) {
      read_row(element, &values_, &row);
      Face face;
      if (values_.failed()) return {};
      LIMN_TRY_STATUS(read_corners(row.lists[static_cast<std::size_t>(indices)], &face.corners));
      if (face.corners.size() < 3) {
        ++empty;
        continue;
      }
      if (uvs >= 0) {
        const std::vector<double>& list = row.lists[static_cast<std::size_t>(uvs)];
        for (std::size_t k = 0; k + 1 < list.size(); k += 2)
          face.uvs.emplace_back(static_cast<float>(list[k]), static_cast<float>(list[k + 1]));
        face.uvs.resize(face.corners.size(), Eigen::Vector2f::Zero());
      }
      if (texture >= 0)
        face.texture =
            static_cast<std::size_t>(std::max(0.0, row.numbers[static_cast<std::size_t>(texture)]));
      if (is_whole(rgb)) face_colours_.push_back(vector_at(row, rgb));
      has_corner_uvs_ |= uvs >= 0;
      faces_.push_back(std::move(face));
    }
    if (is_whole(rgb)) make_linear(full_light(element, rgb), &face_colours_);
    if (empty > 0)
      content_.warnings.push_back(
          fmt::format("{}: {} of {} faces have fewer than three corners and are not shown.", path_.string(),
                      empty, element.count));
    return {};
  }

  // Strips of triangles; -1 begins a new strip, and every second triangle is turned.
  Status read_strips(const PlyElement& element) {
    const int indices = place_of(element, {"vertex_indices", "vertex_index"});
    Row row;
    for (std::size_t i = 0; i < element.count && !values_.failed(); ++i) {
      read_row(element, &values_, &row);
      if (indices < 0 || values_.failed()) continue;
      std::vector<double> strip;
      std::vector<double> list = row.lists[static_cast<std::size_t>(indices)];
      list.push_back(-1);
      for (const double index : list) {
        if (index >= 0) {
          strip.push_back(index);
          continue;
        }
        std::vector<Index> c;
        LIMN_TRY_STATUS(read_corners(strip, &c));
        for (std::size_t k = 2; k < c.size(); ++k)
          faces_.push_back({k % 2 == 0 ? std::vector<Index>{c[k - 2], c[k - 1], c[k]}
                                       : std::vector<Index>{c[k - 1], c[k - 2], c[k]},
                            {}});
        strip.clear();
      }
    }
    return {};
  }

  std::vector<std::array<Index, 3>> triangles_of(const Face& face) const {
    std::vector<Eigen::Vector3f> corners;
    for (const Index i : face.corners) corners.push_back(vertices_.positions[i]);
    return polygon_triangles(corners);
  }

  // Faces with colours, textures or uvs of their own do not share vertices.
  void add_apart(std::size_t i) {
    const Face& face = faces_[i];
    MeshPiece& piece = content_.pieces[std::min(face.texture, content_.pieces.size() - 1)];
    const auto first = static_cast<Index>(piece.positions.size());
    for (std::size_t k = 0; k < face.corners.size(); ++k) {
      const Index v = face.corners[k];
      piece.positions.emplace_back(vertices_.positions[v]);
      if (!vertices_.normals.empty()) piece.normals.emplace_back(vertices_.normals[v]);
      if (has_corner_uvs_)
        piece.uvs.push_back(face.uvs.empty() ? Eigen::Vector2f::Zero() : face.uvs[k]);
      else if (!vertices_.uvs.empty())
        piece.uvs.emplace_back(vertices_.uvs[v]);
      if (!vertices_.colours.empty())
        piece.colours.emplace_back(vertices_.colours[v]);
      else if (!face_colours_.empty())
        piece.colours.push_back(i < face_colours_.size() ? face_colours_[i] : Eigen::Vector3f::Ones());
    }
    for (const auto& t : triangles_of(face))
      piece.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }

  void add_materials() {
    const std::string k_word = "TextureFile";
    for (const std::string& comment : header_.comments) {
      if (!comment.starts_with(k_word)) continue;
      MaterialSource material;
      material.base.name = trimmed(comment.substr(k_word.size()));
      content_.materials.push_back(material);
    }
    if (!content_.materials.empty()) return;
    content_.materials.emplace_back();
    if (vertices_.colours.empty() && face_colours_.empty())
      content_.materials[0].base_colour.setConstant(k_no_colour);
  }

  Result<MeshContent> finished() {
    add_materials();
    const bool is_apart = has_corner_uvs_ || (!face_colours_.empty() && vertices_.colours.empty()) ||
                          content_.materials.size() > 1;
    content_.pieces.resize(is_apart ? content_.materials.size() : 1);
    for (std::size_t i = 0; i < content_.pieces.size(); ++i) content_.pieces[i].material = i;
    if (!is_apart) content_.pieces[0] = std::move(vertices_);
    if (!is_apart) vertices_.positions = content_.pieces[0].positions;
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (is_apart) {
        add_apart(i);
        continue;
      }
      const std::vector<Index>& c = faces_[i].corners;
      for (const auto& t : triangles_of(faces_[i]))
        content_.pieces[0].triangles.push_back({c[t[0]], c[t[1]], c[t[2]]});
    }
    return std::move(content_);
  }

  const fs::path& path_;
  PlyHeader header_;
  PlyValues values_;
  std::size_t vertex_count_ = 0;
  MeshPiece vertices_;
  std::vector<Face> faces_;
  std::vector<Eigen::Vector3f> face_colours_;  // as many as faces_, or none
  bool has_corner_uvs_ = false;
  MeshContent content_;
};

}  // namespace

Result<MeshContent> read_ply(const fs::path& path) {
  LIMN_TRY(const std::string bytes, read_file(path));
  LIMN_TRY(PlyHeader header, read_ply_header(bytes, path.string()));
  return PlyReader(path, bytes, std::move(header)).read();
}

}  // namespace limn::scene
