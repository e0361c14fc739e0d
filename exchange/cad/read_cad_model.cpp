#include "exchange/cad/read_cad_model.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <opencascade/BRepBndLib.hxx>
#include <opencascade/BRepBuilderAPI_Sewing.hxx>
#include <opencascade/BRep_Builder.hxx>
#include <opencascade/Bnd_Box.hxx>
#include <opencascade/TopExp_Explorer.hxx>
#include <opencascade/TopTools_MapOfShape.hxx>
#include <opencascade/TopoDS.hxx>
#include <opencascade/TopoDS_Compound.hxx>
#include <opencascade/TopoDS_Iterator.hxx>
#include <opencascade/XCAFDoc_ShapeTool.hxx>
#include <opencascade/XCAFPrs.hxx>
#include <optional>

#include "core/file.h"
#include "core/utf8.h"
#include "exchange/cad/leaves.h"
#include "exchange/cad/occt_document.h"
#include "exchange/cad/triangles.h"
#include "scene/files/source_file.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;

constexpr double k_translated_percent = 60, k_cut_percent = 95;

Eigen::Matrix4d matrix_of(const gp_Trsf& placed) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) m(row, column) = placed.Value(row + 1, column + 1);
    m(row, 3) = 1e-3 * placed.Value(row + 1, 4);
  }
  return m;
}

using Styles = XCAFPrs_IndexedDataMapOfShapeStyle;

// The styles of the shapes inside a product.
Styles styles_inside(const Leaf& leaf) {
  Styles styles;
  XCAFPrs::CollectStyleSettings(leaf.product, TopLoc_Location(), styles);
  return styles;
}

// The colours of a product's faces.
class FaceColours {
 public:
  FaceColours(const Leaf& leaf, const Styles& styles) : leaf_(leaf) {
    if (leaf.whole) return;
    for (int type = TopAbs_FACE; type >= TopAbs_COMPOUND; --type)  // a face's own colour comes first
      for (Styles::Iterator at(styles); at.More(); at.Next())
        if (at.Key().ShapeType() == type && at.Value().IsSetColorSurf()) bind(at.Key(), at.Value());
  }

  Colour operator()(const TopoDS_Face& face) const {
    if (leaf_.whole) return *leaf_.whole;
    const XCAFPrs_Style* own = styles_.Seek(face);
    return colour_of(own ? *own : leaf_.style);
  }

 private:
  void bind(const TopoDS_Shape& shape, const XCAFPrs_Style& style) {
    for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next())
      if (!styles_.IsBound(at.Current())) styles_.Bind(at.Current(), style);
  }
  const Leaf& leaf_;
  NCollection_DataMap<TopoDS_Shape, XCAFPrs_Style, TopTools_ShapeMapHasher> styles_;
};

// A solid of a product, or its surfaces outside solids.
struct Body {
  TopoDS_Shape shape;
  std::string name;
};

// The shapes that the file hides.
TopTools_MapOfShape hidden_of(const Styles& styles) {
  TopTools_MapOfShape hidden;
  for (Styles::Iterator at(styles); at.More(); at.Next())
    if (!at.Value().IsVisible()) hidden.Add(at.Key());
  return hidden;
}

// The bodies of a product.
class Bodies {
 public:
  Bodies(const Leaf& leaf, const Styles& styles, const ShapeNames& names)
      : names_(names), hidden_(hidden_of(styles)) {
    const TopoDS_Shape product = XCAFDoc_ShapeTool::GetShape(leaf.product);
    if (product.IsNull()) return;
    BRep_Builder().MakeCompound(rest_);
    add(product);
    if (TopoDS_Iterator(rest_).More()) all_.push_back({rest_, ""});
    // The product's name is what people know; the names of its solids matter where there are several.
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (all_.size() == 1 && !leaf.name.empty())
        all_[i].name = leaf.name;
      else if (all_[i].name.empty())
        all_[i].name = leaf.name.empty() ? leaf.name : fmt::format("{} {}", leaf.name, i + 1);
    }
  }

  const std::vector<Body>& all() const { return all_; }
  int hidden() const { return left_out_; }  // the number of those that the file hides: not in all()

 private:
  // A hidden face of a body that is shown stays: the body would not close without it.
  void add(const TopoDS_Shape& shape) {
    if (hidden_.Contains(shape)) {
      ++left_out_;
      return;
    }
    const std::string* name = names_.Seek(shape.Located(TopLoc_Location()));
    const bool is_solid = shape.ShapeType() == TopAbs_SOLID;
    const bool is_surface = shape.ShapeType() < TopAbs_FACE && name &&
                            !TopExp_Explorer(shape, TopAbs_SOLID).More() &&
                            TopExp_Explorer(shape, TopAbs_FACE).More();
    if (is_solid || is_surface)
      all_.push_back({shape, name ? *name : ""});
    else if (shape.ShapeType() == TopAbs_FACE)
      BRep_Builder().Add(rest_, shape);  // belongs to no body
    else if (shape.ShapeType() < TopAbs_FACE)
      for (TopoDS_Iterator at(shape); at.More(); at.Next()) add(at.Value());
  }

  const ShapeNames& names_;
  TopTools_MapOfShape hidden_;
  TopoDS_Compound rest_;
  std::vector<Body> all_;
  int left_out_ = 0;
};

using ShapeColours = NCollection_DataMap<TopoDS_Shape, Colour, TopTools_ShapeMapHasher>;

// Faces that are joined along their edges, with their colours.
struct Joined {
  TopoDS_Shape shape;
  ShapeColours colours;
  Colour operator()(const TopoDS_Face& face) const {
    const Colour* own = colours.Seek(face);
    return own ? *own : colour_of(XCAFPrs_Style());
  }
};

Joined joined(const std::vector<std::pair<TopoDS_Shape, Colour>>& faces, double tolerance_mm) {
  BRepBuilderAPI_Sewing sewing(tolerance_mm);
  for (const auto& [face, colour] : faces) sewing.Add(face);
  sewing.Perform();
  Joined out{sewing.SewedShape(), {}};
  for (const auto& [face, colour] : faces) {
    const TopoDS_Shape now = sewing.IsModifiedSubShape(face) ? sewing.ModifiedSubShape(face) : face;
    if (!out.colours.IsBound(now)) out.colours.Bind(now, colour);
  }
  return out;
}

// The faces of a product at a place, with their colours.
void add_faces(const Leaf& leaf, const gp_Trsf& placed, std::vector<std::pair<TopoDS_Shape, Colour>>* faces) {
  const FaceColours colours(leaf, styles_inside(leaf));
  TopExp_Explorer at(XCAFDoc_ShapeTool::GetShape(leaf.product), TopAbs_FACE);
  for (; at.More(); at.Next())
    faces->emplace_back(at.Current().Moved(TopLoc_Location(placed)), colours(TopoDS::Face(at.Current())));
}

// Whether a shape of an IGES file is a thing by itself: it has solids, or is a named group of surfaces.
bool is_whole(const Leaf& leaf) {
  const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(leaf.product);
  if (TopExp_Explorer(shape, TopAbs_SOLID).More()) return true;
  TopExp_Explorer face(shape, TopAbs_FACE);
  if (leaf.name.empty() || !face.More()) return false;
  face.Next();
  return face.More();
}

// A chord error of one digit with which a model of so many triangles at `chord_mm` has few enough. Their
// number falls at least with the square root of the chord error.
double sufficient_chord_mm(const Tessellation& how, double triangles) {
  const double needed = how.chord_mm * std::pow(triangles / static_cast<double>(how.most_triangles), 2);
  const double decade = std::pow(10, std::floor(std::log10(needed)));
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * decade >= needed) return digit * decade;
  return 10 * decade;
}

// The diagonal of the box around all leaves, mm; an upper bound.
double diagonal_mm(const std::vector<Leaf>& leaves) {
  std::map<std::string, Bnd_Box> boxes;
  Bnd_Box whole;
  for (const Leaf& leaf : leaves) {
    const auto [known, is_new] = boxes.try_emplace(leaf.key);
    if (is_new) BRepBndLib::Add(XCAFDoc_ShapeTool::GetShape(leaf.product), known->second, false);
    if (!known->second.IsVoid()) whole.Add(known->second.Transformed(leaf.placed));
  }
  return whole.IsVoid() ? 0 : std::sqrt(whole.SquareExtent());
}

// Small models are cut more finely than asked for, so that their boxes hold, too. Not where a large chord
// error is asked for, to have fewer triangles.
Tessellation for_size(const std::vector<Leaf>& leaves, Tessellation how) {
  constexpr double k_share = 2e-4;  // share of the diagonal
  if (how.chord_mm > Tessellation().chord_mm) return how;
  if (const double diagonal = diagonal_mm(leaves); diagonal > 0)
    how.chord_mm = std::min(how.chord_mm, k_share * diagonal);
  return how;
}

// The first source that is no more as it was; empty: all are.
std::string changed_source(const fs::path& path, const std::vector<CadSource>& sources) {
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (scene::file_fingerprint(i == 0 ? path : path.parent_path() / sources[i].name) !=
        sources[i].fingerprint)
      return sources[i].name;
  return "";
}

// Builds the model leaf by leaf.
class Builder {
 public:
  // `asked` is how the user wants the model, `how` is how it is cut.
  Builder(const fs::path& path,
          const OcctDocument& document,
          const Tessellation& asked,
          const Tessellation& how)
      : path_(path), document_(document), asked_(asked), how_(how) {}

  Status add(const Leaf& leaf, double share_after) {
    const auto [known, is_new] = meshes_of_.try_emplace(leaf.key);
    if (is_new) known->second = cut(leaf);
    for (const auto& [name, mesh] : known->second) add_node(name, leaf.path, mesh, leaf.placed);
    return check_count(share_after);
  }

  // Error: there are too many triangles, when this share of the places is done.
  Status check_count(double share) const {
    if (triangles_ <= how_.most_triangles) return {};
    const double expected = static_cast<double>(triangles_) / std::max(share, 1e-3);
    return error(
        "{}: expected at most {:g} million triangles, found about {:.2g} million with a chord error of {} "
        "mm. "
        "Allow a larger one: limn import cad FILE --chord-mm {}",
        path_.string(), 1e-6 * static_cast<double>(how_.most_triangles), 1e-6 * expected, how_.chord_mm,
        sufficient_chord_mm(how_, expected));
  }

  // Surfaces of no solid and no named group, as IGES files have them: joined along their edges into one mesh.
  void add_loose(const std::vector<Leaf>& leaves) {
    if (leaves.empty()) return;
    std::vector<std::pair<TopoDS_Shape, Colour>> faces;
    for (const Leaf& leaf : leaves) add_faces(leaf, leaf.placed, &faces);
    const Joined whole = joined(faces, how_.chord_mm / 2);
    const std::string name = leaves.size() == 1 ? leaves.front().name : "";
    if (const auto mesh = cut_body({whole.shape, name}, whole)) add_node(name, {}, *mesh, gp_Trsf());
  }

  // The number of bodies inside the products that the file hides.
  int hidden() const { return hidden_; }

  // The model; the builder is empty then.
  CadModel take_model() {
    if (open_ > k_most_open)
      model_.warnings.push_back(fmt::format("{} more surfaces do not close", open_ - k_most_open));
    return std::move(model_);
  }

 private:
  static constexpr int k_most_open = 5;  // open surfaces that are named

  using Named = std::vector<std::pair<std::string, std::size_t>>;

  void add_node(const std::string& name,
                const std::vector<std::string>& path,
                std::size_t mesh,
                const gp_Trsf& placed) {
    model_.nodes.push_back({shown(name), path, mesh, matrix_of(placed)});
    triangles_ += model_.meshes[mesh].triangle_count();
  }

  std::string shown(const std::string& name) const {
    return name.empty() ? as_utf8(path_.stem().string()) : name;
  }

  Named cut(const Leaf& leaf) {
    Named named;
    const bool has_solid = TopExp_Explorer(XCAFDoc_ShapeTool::GetShape(leaf.product), TopAbs_SOLID).More();
    if (document_.format == "IGES" && !has_solid) return cut_group(leaf);
    const Styles styles = styles_inside(leaf);
    const FaceColours colours(leaf, styles);
    const Bodies bodies(leaf, styles, document_.shape_names);
    hidden_ += bodies.hidden();
    for (const Body& body : bodies.all())
      if (const auto mesh = cut_body(body, [&](const TopoDS_Face& face) { return colours(face); }))
        named.emplace_back(body.name, *mesh);
    return named;
  }

  // A named group of surfaces, joined along their edges.
  Named cut_group(const Leaf& leaf) {
    std::vector<std::pair<TopoDS_Shape, Colour>> faces;
    add_faces(leaf, gp_Trsf(), &faces);
    const Joined group = joined(faces, how_.chord_mm / 2);
    const auto mesh = cut_body({group.shape, leaf.name}, group);
    return mesh ? Named{{leaf.name, *mesh}} : Named{};
  }

  // The index of a body's mesh; nullopt when it has no surfaces.
  std::optional<std::size_t> cut_body(const Body& body,
                                      const std::function<Colour(const TopoDS_Face&)>& colours) {
    Triangulated cut = triangulated(body.shape, how_, asked_.chord_mm, colours);
    const std::string name = shown(body.name);
    if (cut.lost_faces > 0)
      model_.warnings.push_back(fmt::format("'{}': {} faces are damaged and left out", name, cut.lost_faces));
    if (cut.mesh.pieces.empty()) return std::nullopt;
    if (cut.open_edges > 0 && ++open_ <= k_most_open)
      model_.warnings.push_back(
          fmt::format("'{}': the surface does not close ({} open edges)", name, cut.open_edges));
    if (cut.mesh.chord_error_mm > asked_.chord_mm)
      model_.warnings.push_back(
          fmt::format("'{}': the chord error is {:.2g} mm (larger than {} mm in {} faces)", name,
                      cut.mesh.chord_error_mm, asked_.chord_mm, cut.coarse_faces));
    model_.meshes.push_back(std::move(cut.mesh));
    return model_.meshes.size() - 1;
  }

  const fs::path& path_;
  const OcctDocument& document_;
  const Tessellation& asked_;
  const Tessellation how_;
  std::map<std::string, Named> meshes_of_;
  std::size_t triangles_ = 0;
  int open_ = 0, hidden_ = 0;
  CadModel model_;
};

// Cuts all leaves; the first `loose` ones of an IGES file are surfaces of one mesh.
Result<CadModel> cut_all(Builder builder,
                         const Leaves& leaves,
                         std::ptrdiff_t loose,
                         ProgressLines* progress) {
  const std::size_t first = static_cast<std::size_t>(loose), count = leaves.all.size();
  builder.add_loose({leaves.all.begin(), leaves.all.begin() + loose});
  LIMN_TRY_STATUS(builder.check_count(1));
  for (std::size_t i = first; i < count; ++i) {
    const double share = static_cast<double>(i + 1 - first) / static_cast<double>(count - first);
    LIMN_TRY_STATUS(builder.add(leaves.all[i], share));
    progress->advance(share);
  }
  CadModel model = builder.take_model();
  if (const int hidden = leaves.hidden + builder.hidden(); hidden > 0)
    model.warnings.push_back(
        fmt::format("{} hidden {} left out", hidden, hidden == 1 ? "shape is" : "shapes are"));
  return model;
}

}  // namespace

Result<CadModel> read_cad_model(const fs::path& path, const Tessellation& how, ProgressLines* progress) {
  LIMN_TRY(const OcctDocument document, read_document(path, progress));
  progress->begin_stage("cutting into triangles", k_translated_percent, k_cut_percent);
  LIMN_TRY(Leaves leaves, leaves_of(document.document, path));
  std::ptrdiff_t loose = 0;
  if (document.format == "IGES")
    loose = std::stable_partition(leaves.all.begin(), leaves.all.end(), std::not_fn(is_whole)) -
            leaves.all.begin();
  const Tessellation fine = for_size(leaves.all, how);
  auto cut = cut_all(Builder(path, document, how, fine), leaves, loose, progress);
  if (!cut && fine.chord_mm < how.chord_mm)  // too many triangles
    cut = cut_all(Builder(path, document, how, how), leaves, loose, progress);
  LIMN_TRY(CadModel model, std::move(cut));
  model.warnings.insert(model.warnings.begin(), document.warnings.begin(), document.warnings.end());
  if (model.nodes.empty())
    return error(
        "{}: expected {} with surfaces, found only {}. Export solids or surfaces by their boundaries.",
        path.string(), a_file(document.format),
        document.unread.empty() ? "points, curves and hidden shapes" : document.unread);
  if (!document.unread.empty()) model.warnings.push_back(fmt::format("{} are left out", document.unread));
  model.format = document.format;
  model.schema = document.schema;
  model.unit = document.unit;
  model.metres_per_unit = document.metres_per_unit;
  model.sources = document.sources;
  model.changed_file = changed_source(path, model.sources);
  return model;
}

}  // namespace limn::cad
