#pragma once

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace limn::test {

/// Writes STEP files as text, without the library that reads them: boxes, spheres, tori, cones, colours,
/// assemblies.
class StepText {
 public:
  /// `unit` is "mm", "m", "inch" or "none".
  explicit StepText(const std::string& unit = "mm", std::string schema = "AUTOMOTIVE_DESIGN")
      : schema_(std::move(schema)) {
    const int metre = add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({},.METRE.))", unit == "m" ? "$" : ".MILLI.");
    length_ = metre;
    if (unit == "inch") {
      const int measure = add("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{})", metre);
      const int exponents = add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)");
      length_ = add("(CONVERSION_BASED_UNIT('INCH',#{})LENGTH_UNIT()NAMED_UNIT(#{}))", measure, exponents);
    }
    const int angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
    const int solid_angle = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
    context_ = unit == "none"
                   ? add("(GEOMETRIC_REPRESENTATION_CONTEXT(3)REPRESENTATION_CONTEXT('',''))")
                   : add("(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{},#{},#{}))"
                         "REPRESENTATION_CONTEXT('',''))",
                         length_, angle, solid_angle);
    application_ = add("APPLICATION_CONTEXT('design')");
  }

  template <class... Values>
  int add(fmt::format_string<Values...> entity, Values&&... values) {
    lines_.push_back(fmt::format(entity, std::forward<Values>(values)...));
    return static_cast<int>(lines_.size());
  }

  using Point = std::array<double, 3>;
  int point(const Point& p) { return add("CARTESIAN_POINT('',({:.9E},{:.9E},{:.9E}))", p[0], p[1], p[2]); }
  int direction(const Point& d) { return add("DIRECTION('',({:.9E},{:.9E},{:.9E}))", d[0], d[1], d[2]); }
  int frame(const Point& origin, const Point& z = {0, 0, 1}, const Point& x = {1, 0, 0}) {
    const int at = point(origin), up = direction(z), along = direction(x);
    return add("AXIS2_PLACEMENT_3D('',#{},#{},#{})", at, up, along);
  }

  /// A box from the origin; `faces` gets the numbers of its faces. With `open` one face is absent.
  int box(const Point& size,
          std::vector<int>* faces = nullptr,
          const std::string& name = "",
          bool open = false);
  int sphere(double radius) {
    return round_solid(add("SPHERICAL_SURFACE('',#{},{:.9E})", frame({0, 0, 0}), radius), {radius, 0, 0});
  }
  int torus(double major, double minor) {
    return round_solid(add("TOROIDAL_SURFACE('',#{},{:.9E},{:.9E})", frame({0, 0, 0}), major, minor),
                       {major + minor, 0, 0});
  }

  /// A solid cone: its base around the origin, its tip below it.
  int cone(double radius, double height) {
    const int rim = add("VERTEX_POINT('',#{})", point({radius, 0, 0}));
    const int tip = add("VERTEX_POINT('',#{})", point({0, 0, -height}));
    const int circle = add("CIRCLE('',#{},{:.9E})", frame({0, 0, 0}), radius);
    const int around = add("EDGE_CURVE('',#{0},#{0},#{1},.T.)", rim, circle);
    const int down = add("VECTOR('',#{},1.)", direction({-radius, 0, -height}));
    const int line = add("LINE('',#{},#{})", point({radius, 0, 0}), down);
    const int seam = add("EDGE_CURVE('',#{},#{},#{},.T.)", rim, tip, line);
    const auto along = [&](int edge, const char* sense) {
      return add("ORIENTED_EDGE('',*,*,#{},{})", edge, sense);
    };
    const auto face = [&](int loop, int surface) {
      return add("ADVANCED_FACE('',(#{}),#{},.T.)", add("FACE_OUTER_BOUND('',#{},.T.)", loop), surface);
    };
    const int base_loop = add("EDGE_LOOP('',(#{}))", along(around, ".T."));
    const int base = face(base_loop, add("PLANE('',#{})", frame({0, 0, 0})));
    const int side_loop =
        add("EDGE_LOOP('',(#{},#{},#{}))", along(around, ".F."), along(seam, ".T."), along(seam, ".F."));
    const int side = face(side_loop, add("CONICAL_SURFACE('',#{},{:.9E},{:.9E})", frame({0, 0, 0}), radius,
                                         std::atan2(radius, height)));
    return add("MANIFOLD_SOLID_BREP('',#{})", add("CLOSED_SHELL('',(#{},#{}))", base, side));
  }

  struct Product {
    int definition = 0, representation = 0;
  };
  Product product(const std::string& name, const std::vector<int>& items, const char* kind) {
    const int origin = frame({0, 0, 0});
    std::string list = fmt::format("#{}", origin);
    for (const int item : items) list += fmt::format(",#{}", item);
    const int context = add("PRODUCT_CONTEXT('',#{},'mechanical')", application_);
    const int product = add("PRODUCT('{0}','{0}','',(#{1}))", name, context);
    const int formation = add("PRODUCT_DEFINITION_FORMATION('','',#{})", product);
    const int view = add("PRODUCT_DEFINITION_CONTEXT('part definition',#{},'design')", application_);
    Product made;
    made.definition = add("PRODUCT_DEFINITION('design','',#{},#{})", formation, view);
    const int shape = add("PRODUCT_DEFINITION_SHAPE('','',#{})", made.definition);
    made.representation = add("{}('',({}),#{})", kind, list, context_);
    add("SHAPE_DEFINITION_REPRESENTATION(#{},#{})", shape, made.representation);
    return made;
  }
  Product part(const std::string& name, const std::vector<int>& solids) {
    return product(name, solids, "ADVANCED_BREP_SHAPE_REPRESENTATION");
  }
  Product assembly(const std::string& name) { return product(name, {}, "SHAPE_REPRESENTATION"); }

  /// Puts a product into an assembly, moved by `shift`.
  void place(const Product& in, const Product& what, const Point& shift, const std::string& name) {
    const int use = add("NEXT_ASSEMBLY_USAGE_OCCURRENCE('{0}','{0}','',#{1},#{2},$)", name, in.definition,
                        what.definition);
    const int shape = add("PRODUCT_DEFINITION_SHAPE('','',#{})", use);
    const int from = frame({0, 0, 0}), to = frame(shift);
    const int move = add("ITEM_DEFINED_TRANSFORMATION('','',#{},#{})", from, to);
    const int relation =
        add("(REPRESENTATION_RELATIONSHIP('','',#{},#{})REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{})"
            "SHAPE_REPRESENTATION_RELATIONSHIP())",
            what.representation, in.representation, move);
    add("CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{},#{})", relation, shape);
  }

  /// Says that a product's shape is in another file.
  void refer(const Product& what, const std::string& name) {
    const int type = add("DOCUMENT_TYPE('geometry')");
    const int document = add("DOCUMENT_FILE('{}','','',#{},'',$)", name, type);
    add("APPLIED_DOCUMENT_REFERENCE(#{},'',(#{}))", document, what.definition);
    const int role = add("IDENTIFICATION_ROLE('external document id and location','')");
    const int source = add("EXTERNAL_SOURCE(IDENTIFIER(''))");
    add("APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('{}',#{},#{},(#{}))", name, role, source, document);
    add("DOCUMENT_REPRESENTATION_TYPE('digital',#{})", document);
  }

  /// Gives a solid or a face a colour, in sRGB; returns the number of the styled item.
  int paint(int item, const Point& srgb) {
    const int colour = add("COLOUR_RGB('',{:.6f},{:.6f},{:.6f})", srgb[0], srgb[1], srgb[2]);
    const int fill = add("FILL_AREA_STYLE_COLOUR('',#{})", colour);
    const int area = add("FILL_AREA_STYLE('',(#{}))", fill);
    const int surface = add("SURFACE_STYLE_FILL_AREA(#{})", area);
    const int side = add("SURFACE_SIDE_STYLE('',(#{}))", surface);
    const int use = add("SURFACE_STYLE_USAGE(.BOTH.,#{})", side);
    const int style = add("PRESENTATION_STYLE_ASSIGNMENT((#{}))", use);
    const int styled = add("STYLED_ITEM('',(#{}),#{})", style, item);
    styles_ += fmt::format("{}#{}", styles_.empty() ? "" : ",", styled);
    return styled;
  }
  void hide(int item) { add("INVISIBILITY((#{}))", paint(item, {1, 1, 1})); }

  std::string file() {
    if (!styles_.empty())
      add("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({}),#{})", styles_, context_);
    std::string text = fmt::format(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
        "FILE_SCHEMA(('{}'));\nENDSEC;\nDATA;\n",
        schema_);
    for (std::size_t i = 0; i < lines_.size(); ++i) text += fmt::format("#{}={};\n", i + 1, lines_[i]);
    return text + "ENDSEC;\nEND-ISO-10303-21;\n";
  }

 private:
  // A closed surface without edges; `at` is a point on it.
  int round_solid(int surface, const Point& at) {
    const int vertex = add("VERTEX_POINT('',#{})", point(at));
    const int loop = add("VERTEX_LOOP('',#{})", vertex);
    const int bound = add("FACE_BOUND('',#{},.T.)", loop);
    const int face = add("ADVANCED_FACE('',(#{}),#{},.T.)", bound, surface);
    return add("MANIFOLD_SOLID_BREP('',#{})", add("CLOSED_SHELL('',(#{}))", face));
  }

  std::string schema_, styles_;
  std::vector<std::string> lines_;
  int length_ = 0, context_ = 0, application_ = 0;
};

inline int StepText::box(const Point& size, std::vector<int>* faces, const std::string& name, bool open) {
  std::array<Point, 8> corners{};
  std::array<int, 8> vertices{};
  for (std::size_t i = 0; i < 8; ++i) {
    corners[i] = {(i & 1U) != 0 ? size[0] : 0, (i & 2U) != 0 ? size[1] : 0, (i & 4U) != 0 ? size[2] : 0};
    vertices[i] = add("VERTEX_POINT('',#{})", point(corners[i]));
  }
  std::map<std::pair<std::size_t, std::size_t>, int> edges;
  const auto edge = [&](std::size_t a, std::size_t b) {
    const auto key = std::minmax(a, b);
    if (!edges.contains(key)) {
      const Point &p = corners[key.first], &q = corners[key.second];
      const int start = point(p), along = direction({q[0] - p[0], q[1] - p[1], q[2] - p[2]});
      const int vector = add("VECTOR('',#{},1.)", along);
      const int line = add("LINE('',#{},#{})", start, vector);
      edges[key] = add("EDGE_CURVE('',#{},#{},#{},.T.)", vertices[key.first], vertices[key.second], line);
    }
    return add("ORIENTED_EDGE('',*,*,#{},{})", edges[key], a < b ? ".T." : ".F.");
  };
  // The corners of each face, counter-clockwise as seen from outside, its normal and an axis in it.
  struct Face {
    std::array<std::size_t, 4> corners;
    Point normal, x;
  };
  const std::array<Face, 6> all = {{{{0, 2, 3, 1}, {0, 0, -1}, {1, 0, 0}},
                                    {{4, 5, 7, 6}, {0, 0, 1}, {1, 0, 0}},
                                    {{0, 1, 5, 4}, {0, -1, 0}, {1, 0, 0}},
                                    {{2, 6, 7, 3}, {0, 1, 0}, {1, 0, 0}},
                                    {{0, 4, 6, 2}, {-1, 0, 0}, {0, 1, 0}},
                                    {{1, 3, 7, 5}, {1, 0, 0}, {0, 1, 0}}}};
  std::string list;
  for (const Face& face : all) {
    if (open && &face == &all.back()) continue;
    std::string sides;
    for (std::size_t k = 0; k < 4; ++k)
      sides += fmt::format("{}#{}", k == 0 ? "" : ",", edge(face.corners[k], face.corners[(k + 1) % 4]));
    const int loop = add("EDGE_LOOP('',({}))", sides);
    const int bound = add("FACE_OUTER_BOUND('',#{},.T.)", loop);
    const int plane = add("PLANE('',#{})", frame(corners[face.corners[0]], face.normal, face.x));
    const int number = add("ADVANCED_FACE('',(#{}),#{},.T.)", bound, plane);
    if (faces) faces->push_back(number);
    list += fmt::format("{}#{}", list.empty() ? "" : ",", number);
  }
  return add("MANIFOLD_SOLID_BREP('{}',#{})", name, add("CLOSED_SHELL('',({}))", list));
}

}  // namespace limn::test
