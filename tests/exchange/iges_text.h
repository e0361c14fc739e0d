#pragma once

#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace limn::test {

/// Writes IGES files as text, without the library that reads them: boxes, cylinders and spheres of ruled
/// surfaces and surfaces of revolution, colours, names, subfigures at several places.
class IgesText {
 public:
  /// The number and name of the file's length unit: 1, "INCH"; 2, "MM"; 6, "M".
  explicit IgesText(int unit = 2, std::string unit_name = "MM")
      : unit_(unit), unit_name_(std::move(unit_name)) {}

  using Point = std::array<double, 3>;

  /// An entity's pointer. `colour` is the pointer of a colour, or a number of IGES (2: red, 3: green, 4:
  /// blue).
  int add(
      int type, int form, const std::string& parameters, int colour = 0, bool is_part_of_another = false) {
    entities_.push_back({type, form, fmt::format("{},{};", type, parameters), colour, is_part_of_another});
    return 2 * static_cast<int>(entities_.size()) - 1;
  }

  /// A colour in percent.
  int colour(const Point& rgb_percent) {
    return -add(314, 0, fmt::format("{:.4f},{:.4f},{:.4f}", rgb_percent[0], rgb_percent[1], rgb_percent[2]),
                0, true);
  }

  int line(const Point& a, const Point& b) {
    return add(110, 0, fmt::format("{},{}", list(a), list(b)), 0, true);
  }

  /// A surface of straight lines between two lines.
  int ruled(int first, int second, int colour) {
    return add(118, 1, fmt::format("{},{},0,0", first, second), colour, is_part_);
  }

  /// The surface that a curve leaves when it turns once around a line.
  int turned(int axis, int curve, int colour) {
    return add(120, 0, fmt::format("{},{},0.,{:.12f}", axis, curve, 2 * 3.14159265358979324), colour,
               is_part_);
  }

  /// The six faces of a box from `low` to `high`.
  std::vector<int> box(const Point& low, const Point& high, int colour = 0) {
    const auto at = [&](int x, int y, int z) {
      return Point{x != 0 ? high[0] : low[0], y != 0 ? high[1] : low[1], z != 0 ? high[2] : low[2]};
    };
    const auto face = [&](const Point& a, const Point& b, const Point& c, const Point& d) {
      const int first = line(a, b), second = line(c, d);
      return ruled(first, second, colour);
    };
    return {face(at(0, 0, 0), at(1, 0, 0), at(0, 1, 0), at(1, 1, 0)),
            face(at(0, 0, 1), at(1, 0, 1), at(0, 1, 1), at(1, 1, 1)),
            face(at(0, 0, 0), at(1, 0, 0), at(0, 0, 1), at(1, 0, 1)),
            face(at(0, 1, 0), at(1, 1, 0), at(0, 1, 1), at(1, 1, 1)),
            face(at(0, 0, 0), at(0, 1, 0), at(0, 0, 1), at(0, 1, 1)),
            face(at(1, 0, 0), at(1, 1, 0), at(1, 0, 1), at(1, 1, 1))};
  }

  /// A cylinder around z from z = 0, with its two ends.
  std::vector<int> cylinder(double radius, double height, int colour = 0) {
    const int axis = line({0, 0, 0}, {0, 0, 1});
    const auto around = [&](const Point& a, const Point& b) { return turned(axis, line(a, b), colour); };
    return {around({radius, 0, 0}, {radius, 0, height}), around({0, 0, 0}, {radius, 0, 0}),
            around({0, 0, height}, {radius, 0, height})};
  }

  /// A sphere around the origin: half a circle in the plane z = 0 that turns around y.
  int sphere(double radius, int colour = 0) {
    const int axis = line({0, -1, 0}, {0, 1, 0});
    const int half = add(100, 0, fmt::format("0.,0.,0.,0.,{0:.9f},0.,{1:.9f}", -radius, radius), 0, true);
    return turned(axis, half, colour);
  }

  /// Until the next call of place(), surfaces belong to a subfigure of this name.
  void begin_subfigure() { is_part_ = true; }
  int end_subfigure(const std::string& name, const std::vector<int>& inside) {
    is_part_ = false;
    std::string pointers;
    for (const int pointer : inside) pointers += fmt::format(",{}", pointer);
    return add(308, 0, fmt::format("0,{}H{},{}{}", name.size(), name, inside.size(), pointers), 0, true);
  }
  int place(int subfigure, const Point& shift, double scale = 1) {
    return add(408, 0, fmt::format("{},{},{:.9f}", subfigure, list(shift), scale));
  }

  std::string file() const {
    const std::string name = fmt::format("{}H{}", unit_name_.size(), unit_name_);
    std::string text, directory, parameters;
    int lines = 0;
    add_line(&text, "written by a test", 'S', 1);
    const std::string global = fmt::format(
        "1H,,1H;,4Htest,8Htest.igs,4Htest,4Htest,32,38,6,308,15,4Htest,1.,{},{},1,1.,15H20260101.000000,1.E-"
        "6,1000.,"
        "4Htest,4Htest,11,0,15H20260101.000000;",
        unit_, name);
    const int globals = add_lines(&text, global, 72, 'G', 0, "");
    for (std::size_t i = 0; i < entities_.size(); ++i) {
      const Entity& e = entities_[i];
      const int pointer = 2 * static_cast<int>(i) + 1, first = lines + 1;
      lines += add_lines(&parameters, e.parameters, 64, 'P', lines, fmt::format(" {:>7}", pointer));
      const std::string status = e.is_part_of_another ? "00010000" : "00000000";
      add_line(
          &directory,
          fmt::format("{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{}", e.type, first, 0, 0, 0, 0, 0, 0, status),
          'D', pointer);
      add_line(&directory,
               fmt::format("{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}", e.type, 0, e.colour,
                           lines - first + 1, e.form, "", "", "", 0),
               'D', pointer + 1);
    }
    text += directory + parameters;
    add_line(&text, fmt::format("S{:>7}G{:>7}D{:>7}P{:>7}", 1, globals, 2 * entities_.size(), lines), 'T', 1);
    return text;
  }

 private:
  struct Entity {
    int type, form;
    std::string parameters;
    int colour;
    bool is_part_of_another;
  };

  static std::string list(const Point& p) { return fmt::format("{:.9f},{:.9f},{:.9f}", p[0], p[1], p[2]); }

  static void add_line(std::string* text, const std::string& content, char section, int number) {
    *text += fmt::format("{:<72}{}{:>7}\n", content, section, number);
  }

  // Cuts the parameters behind commas into lines; `end` stands behind each. How many lines.
  static int add_lines(std::string* text,
                       const std::string& content,
                       std::size_t width,
                       char section,
                       int lines_before,
                       const std::string& end) {
    int count = 0;
    for (std::size_t begin = 0; begin < content.size();) {
      std::size_t size = content.size() - begin;
      if (size > width) size = content.rfind(',', begin + width - 1) - begin + 1;
      add_line(text, fmt::format("{:<{}}{}", content.substr(begin, size), width, end), section,
               lines_before + ++count);
      begin += size;
    }
    return count;
  }

  int unit_;
  std::string unit_name_;
  bool is_part_ = false;
  std::vector<Entity> entities_;
};

}  // namespace limn::test
