#include "scene/meshes/read_3mf.h"

#include <zip.h>

#include <algorithm>
#include <map>
#include <memory>
#include <pugixml.hpp>
#include <set>
#include <sstream>
#include <string_view>

namespace limn::scene {
namespace {

namespace fs = std::filesystem;
using pugi::xml_node;

constexpr int k_most_levels = 32;  // components inside components

// An open zip file.
class Package {
 public:
  static std::optional<Package> open(const fs::path& path) {
    Package out;
    int code = 0;
    out.zip_.reset(zip_open(path.c_str(), ZIP_RDONLY, &code));
    if (!out.zip_) return std::nullopt;
    return out;
  }

  // The content of a file; names may begin with a slash, and upper and lower case are the same.
  std::optional<std::string> content(const std::string& name) const {
    const std::string plain = name.starts_with('/') ? name.substr(1) : name;
    zip_stat_t stat;
    if (zip_stat(zip_.get(), plain.c_str(), ZIP_FL_NOCASE, &stat) != 0) return std::nullopt;
    const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file(zip_fopen_index(zip_.get(), stat.index, 0),
                                                                 zip_fclose);
    if (!file) return std::nullopt;
    std::string bytes;
    char part[1 << 16];
    for (;;) {
      const zip_int64_t count = zip_fread(file.get(), part, sizeof(part));
      if (count < 0) return std::nullopt;
      if (count == 0) return bytes;
      bytes.append(part, static_cast<std::size_t>(count));
    }
  }

 private:
  std::unique_ptr<zip_t, void (*)(zip_t*)> zip_{nullptr, zip_discard};
};

// Names in XML without their namespace's prefix.
std::string_view local(const char* name) {
  const std::string_view all(name);
  const auto colon = all.find(':');
  return colon == std::string_view::npos ? all : all.substr(colon + 1);
}

std::string attribute(const xml_node& node, std::string_view name) {
  for (const pugi::xml_attribute& a : node.attributes())
    if (local(a.name()) == name) return a.value();
  return {};
}

xml_node child(const xml_node& node, std::string_view name) {
  return node.find_child([&](const xml_node& c) { return local(c.name()) == name; });
}

// Twelve numbers, the columns of the matrix one after the other.
Eigen::Matrix4d transform_of(const xml_node& node) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  std::istringstream in(attribute(node, "transform"));
  for (Eigen::Index column = 0; column < 4; ++column)
    for (Eigen::Index row = 0; row < 3; ++row) {
      double value = 0;
      if (in >> value) m(row, column) = value;
    }
  return m;
}

// #RRGGBB or #RRGGBBAA, sRGB, as linear light.
Eigen::Vector3f colour_of(const std::string& text) {
  Eigen::Vector3f rgb = Eigen::Vector3f::Constant(k_no_colour);
  if (text.size() < 7 || text[0] != '#') return rgb;
  for (std::size_t i = 0; i < 3; ++i)
    rgb[static_cast<Eigen::Index>(i)] = linear_from_srgb(
        static_cast<float>(std::strtol(text.substr(1 + 2 * i, 2).c_str(), nullptr, 16)) / 255);
  return rgb;
}

// One model file of the package.
struct Model {
  pugi::xml_document document;
  std::map<std::string, xml_node> objects;
  std::map<std::string, std::vector<Eigen::Vector3f>> colours;  // base materials and colour groups, by id
};

class ThreeMfReader {
 public:
  ThreeMfReader(const fs::path& path, Package package) : path_(path), package_(std::move(package)) {}

  Result<MeshContent> read() {
    const std::string name = main_model();
    LIMN_TRY(const Model* model, model_at(name));
    const xml_node root = child(model->document, "model");
    content_.metres_per_unit = metres_of(attribute(root, "unit"));
    for (const xml_node& item : child(root, "build").children())
      if (local(item.name()) == "item")
        LIMN_TRY_STATUS(add_object(model_of(item, name), attribute(item, "objectid"), transform_of(item), 0));
    content_.materials.resize(2);
    content_.materials[1].base_colour.setConstant(k_no_colour);
    for (MeshPiece& piece : content_.pieces) piece.material = piece.colours.empty() ? 1 : 0;
    std::string names;
    for (const std::string& left_out : left_out_) names += (names.empty() ? "" : ", ") + left_out;
    if (!names.empty())
      content_.warnings.push_back(fmt::format("{}: its {} are not shown.", path_.string(), names));
    return std::move(content_);
  }

 private:
  // The model that the package names as its first one.
  std::string main_model() const {
    pugi::xml_document relations;
    const auto text = package_.content("_rels/.rels");
    if (text && relations.load_buffer(text->data(), text->size()))
      for (const xml_node& relation : relations.document_element().children())
        if (attribute(relation, "Type").ends_with("3dmodel")) return attribute(relation, "Target");
    return "3D/3dmodel.model";
  }

  static double metres_of(const std::string& unit) {
    static const std::map<std::string, double> k_units = {{"micron", 1e-6},     {"millimeter", 1e-3},
                                                          {"centimeter", 1e-2}, {"inch", 0.0254},
                                                          {"foot", 0.3048},     {"meter", 1}};
    const auto known = k_units.find(unit);
    return known == k_units.end() ? 1e-3 : known->second;
  }

  static std::string model_of(const xml_node& node, const std::string& same) {
    const std::string path = attribute(node, "path");  // production extension
    return path.empty() ? same : path;
  }

  Result<const Model*> model_at(const std::string& name) {
    std::unique_ptr<Model>& model = models_[name];
    if (model) return static_cast<const Model*>(model.get());
    const auto text = package_.content(name);
    auto read = std::make_unique<Model>();
    if (!text) return damaged_mesh(path_, "no model " + name + " in it");
    const pugi::xml_parse_result done = read->document.load_buffer(text->data(), text->size());
    if (!done) return damaged_mesh(path_, name + ": " + done.description());
    for (const xml_node& node : child(child(read->document, "model"), "resources").children())
      read_resource(node, read.get());
    model = std::move(read);
    return static_cast<const Model*>(model.get());
  }

  void read_resource(const xml_node& node, Model* model) {
    const std::string_view kind = local(node.name());
    const std::string id = attribute(node, "id");
    if (kind == "object") model->objects[id] = node;
    if (kind == "texture2dgroup") left_out_.insert("textures");
    if (kind == "compositematerials" || kind == "multiproperties") left_out_.insert("mixed materials");
    if (kind != "basematerials" && kind != "colorgroup") return;
    for (const xml_node& entry : node.children())
      model->colours[id].push_back(
          colour_of(attribute(entry, kind == "colorgroup" ? "color" : "displaycolor")));
  }

  Status add_object(const std::string& name,
                    const std::string& id,
                    const Eigen::Matrix4d& file_from_object,
                    int level) {
    LIMN_TRY(const Model* model, model_at(name));
    const auto object = model->objects.find(id);
    if (object == model->objects.end() || level > k_most_levels)
      return damaged_mesh(path_, "object " + id + " is absent or inside itself");
    if (const xml_node mesh = child(object->second, "mesh")) {
      LIMN_TRY(const MeshPiece piece, read_mesh(*model, object->second, mesh));
      content_.pieces.push_back(moved(piece, file_from_object));
    }
    for (const xml_node& component : child(object->second, "components").children())
      LIMN_TRY_STATUS(add_object(model_of(component, name), attribute(component, "objectid"),
                                 file_from_object * transform_of(component), level + 1));
    return {};
  }

  static std::optional<Eigen::Vector3f> colour_at(const Model& model,
                                                  const std::string& group,
                                                  const std::string& index) {
    const auto known = model.colours.find(group);
    const auto at = static_cast<std::size_t>(std::max(0, std::atoi(index.c_str())));
    if (known == model.colours.end() || at >= known->second.size()) return std::nullopt;
    return known->second[at];
  }

  Result<MeshPiece> read_mesh(const Model& model, const xml_node& object, const xml_node& mesh) {
    std::vector<Eigen::Vector3f> vertices;
    for (const xml_node& v : child(mesh, "vertices").children())
      vertices.emplace_back(v.attribute("x").as_float(), v.attribute("y").as_float(),
                            v.attribute("z").as_float());
    const std::string own_group = attribute(object, "pid"), own_index = attribute(object, "pindex");
    MeshPiece piece;
    bool has_colours = false;
    if (child(mesh, "beamlattice")) left_out_.insert("beams");
    for (const xml_node& t : child(mesh, "triangles").children()) {
      if (local(t.name()) != "triangle") continue;
      const auto first = static_cast<std::uint32_t>(piece.positions.size());
      const std::string group = t.attribute("pid").as_string(own_group.c_str());
      const std::string index = t.attribute("p1").as_string(own_index.c_str());
      for (const char* corner : {"1", "2", "3"}) {
        const auto at = t.attribute((std::string("v") + corner).c_str()).as_ullong(vertices.size());
        if (at >= vertices.size())
          return damaged_mesh(
              path_, fmt::format("a triangle of vertex {} where {} are stated", at, vertices.size()));
        piece.positions.push_back(vertices[at]);
        const auto colour = colour_at(
            model, group, t.attribute((std::string("p") + corner).c_str()).as_string(index.c_str()));
        has_colours |= colour.has_value();
        piece.colours.push_back(colour.value_or(Eigen::Vector3f::Constant(k_no_colour)));
      }
      piece.triangles.push_back({first, first + 1, first + 2});
    }
    if (!has_colours) piece.colours.clear();
    return piece;
  }

  const fs::path& path_;
  Package package_;
  std::map<std::string, std::unique_ptr<Model>> models_;
  std::set<std::string> left_out_;
  MeshContent content_;
};

}  // namespace

Result<MeshContent> read_3mf(const fs::path& path) {
  auto package = Package::open(path);
  if (!package) return damaged_mesh(path, "it is no zip file");
  return ThreeMfReader(path, std::move(*package)).read();
}

}  // namespace limn::scene
