#include "core/camera_files/camera_document.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>

#include "core/camera_files/camera_entries.h"

namespace limn {
namespace {

using Entry = CameraEntry;

struct NamedNode {
  std::string path;  // as messages name it
  const DataNode* node = nullptr;
};

// What is said about one camera, before it is understood.
struct CameraEntries {
  std::multimap<Entry, NamedNode> nodes;
  std::map<std::string, NamedNode> values;  // fx, k1 …

  const NamedNode* find(Entry entry) const {
    const auto found = nodes.find(entry);
    return found == nodes.end() ? nullptr : &found->second;
  }
  bool is_camera() const { return find(Entry::matrix) || (values.contains("fx") || values.contains("mu")); }
  // Entries of an outer level count where this one has none.
  void add_from(const CameraEntries& outer, std::initializer_list<Entry> entries) {
    for (const Entry entry : entries) {
      if (find(entry)) continue;
      const auto [first, last] = outer.nodes.equal_range(entry);
      nodes.insert(first, last);
    }
  }
};

using Cameras = std::map<std::string, CameraEntries>;  // by what the keys say: "", "1", "left" …

// These belong to all cameras that are nested below them.
constexpr auto k_inherited = {Entry::width, Entry::height, Entry::size,
                              Entry::shape, Entry::model,  Entry::is_fisheye};

Error entry_error(const NamedNode& entry, const std::string& text) {
  const std::string line = entry.node->line > 0 ? fmt::format(" (line {})", entry.node->line) : "";
  return error("{}: {}{}", entry.path, text, line);
}

// ---- numbers ----

Result<std::vector<double>> finite_numbers(const NamedNode& entry) {
  const auto numbers = numbers_in(*entry.node);
  if (!numbers) return entry_error(entry, "expected numbers, found something else.");
  if (!std::ranges::all_of(*numbers, [](double value) { return std::isfinite(value); }))
    return entry_error(entry, "expected finite numbers, found one that is not.");
  return *numbers;
}

struct Table {
  std::vector<double> numbers;
  std::size_t rows = 0, columns = 0;  // a list of numbers is a row
};

// The form of nested lists; of XML's lists of numbers too.
Result<Table> list_table(const NamedNode& entry) {
  LIMN_TRY(const auto numbers, finite_numbers(entry));
  Table table{numbers, 1, numbers.size()};
  const auto& items = entry.node->items;
  const bool has_rows = !items.empty() && items[0].is_list();
  if (!has_rows) return table;
  table.rows = items.size();
  table.columns = numbers.size() / table.rows;
  for (const DataNode& row : items)
    if (row.items.size() != table.columns && !(items.size() == 1))
      return entry_error(entry, "expected rows of the same length.");
  return table;
}

// A matrix as cv::FileStorage and ROS write it (rows, cols, data), or lists.
Result<Table> table_of(const NamedNode& entry) {
  const DataNode* data = entry.node->find("data");
  if (!data) return list_table(entry);
  LIMN_TRY(Table table, list_table({entry.path + ".data", data}));
  const auto side = [&](const char* key) -> std::optional<double> {
    const DataNode* node = entry.node->find(key);
    return node && node->is_text() ? number_in(node->text) : std::nullopt;
  };
  const auto rows = side("rows"), columns = side("cols");
  if (!rows && !columns) return table;
  const auto count = static_cast<double>(table.numbers.size());
  if (!rows || !columns || !(*rows >= 0) || !(*columns >= 0) || *rows * *columns != count)
    return entry_error(entry, fmt::format("expected rows x cols = {} x {} numbers, found {}.",
                                          rows.value_or(0), columns.value_or(0), count));
  table.rows = static_cast<std::size_t>(*rows);
  table.columns = static_cast<std::size_t>(*columns);
  return table;
}

Result<double> number_of(const NamedNode& entry) {
  LIMN_TRY(const auto numbers, finite_numbers(entry));
  if (numbers.size() != 1) return entry_error(entry, "expected a number, found several.");
  return numbers[0];
}

Result<int> side_in(const NamedNode& entry, double side) {
  if (side >= 1 && side <= k_max_side && side == std::floor(side)) return static_cast<int>(side);
  return entry_error(
      entry, fmt::format("expected a whole number of pixels from 1 to {}, found {:g}.", k_max_side, side));
}

// ---- gathering ----

bool is_lens_map(const DataNode& node) { return node.is_map() && !node.find("data"); }

Status gather(const DataNode& map, const std::string& path, Cameras* cameras);

// A map instead of a matrix or list: its entries belong to the camera themselves.
Status gather_inner(const NamedNode& entry, const std::string& camera, Cameras* cameras) {
  Cameras inner;
  LIMN_TRY_STATUS(gather(*entry.node, entry.path, &inner));
  for (auto& [name, entries] : inner) {
    CameraEntries& into = (*cameras)[name.empty() ? camera : name];
    into.nodes.merge(entries.nodes);
    into.values.merge(entries.values);
    if (!entries.values.empty())
      return entry_error(entries.values.begin()->second,
                         "expected this entry once, found another one beside it.");
  }
  return {};
}

// Sorts the entries of a map by what they mean and by the camera that they belong to.
Status gather(const DataNode& map, const std::string& path, Cameras* cameras) {
  for (std::size_t i = 0; i < map.items.size(); ++i) {
    const auto meaning = camera_entry(map.keys[i], map.items[i]);
    if (!meaning) continue;
    const NamedNode entry{path.empty() ? map.keys[i] : path + "." + map.keys[i], &map.items[i]};
    const bool is_inner =
        (meaning->entry == Entry::matrix || meaning->entry == Entry::distortion) && is_lens_map(*entry.node);
    if (is_inner) {
      LIMN_TRY_STATUS(gather_inner(entry, meaning->camera, cameras));
    } else if (meaning->entry == Entry::value) {
      if (!(*cameras)[meaning->camera].values.emplace(meaning->value, entry).second)
        return entry_error(entry, "expected this entry once, found another one with the same meaning.");
    } else {
      (*cameras)[meaning->camera].nodes.emplace(meaning->entry, entry);
    }
  }
  return {};
}

// ---- the parts of a camera ----

Result<double> value_in(const CameraEntries& entries, const std::string& name) {
  const auto found = entries.values.find(name);
  if (found == entries.values.end())
    return error("{}: expected it beside {}, found none.", name, entries.values.begin()->second.path);
  return number_of(found->second);
}

Result<double> value_or_zero(const CameraEntries& entries, const std::string& name) {
  return entries.values.contains(name) ? value_in(entries, name) : Result<double>(0.0);
}

Status read_matrix_values(const CameraEntries& entries, CameraDescription* camera) {
  // VINS names the values of a fisheye lens mu, mv, u0, v0.
  const bool is_vins = entries.values.contains("mu");
  const char* names[] = {is_vins ? "mu" : "fx", is_vins ? "mv" : "fy", "cx", "cy"};
  double* values[] = {&camera->matrix(0, 0), &camera->matrix(1, 1), &camera->matrix(0, 2),
                      &camera->matrix(1, 2)};
  for (std::size_t i = 0; i < 4; ++i) {
    LIMN_TRY(*values[i], value_in(entries, names[i]));
  }
  LIMN_TRY(camera->matrix(0, 1), value_or_zero(entries, "skew"));
  camera->matrix_entry = entries.values.at(names[0]).path;
  return {};
}

Status read_matrix(const CameraEntries& entries, CameraDescription* camera) {
  const NamedNode* entry = entries.find(Entry::matrix);
  if (!entry) return read_matrix_values(entries, camera);
  LIMN_TRY(const Table table, table_of(*entry));
  camera->matrix_entry = entry->path;
  const auto& n = table.numbers;
  const bool is_square = n.size() == 9 && (table.rows == table.columns || table.rows == 1);
  const bool is_list =
      n.size() == 4 && table.rows == 1 && plain_name(entry->path).find("matrix") == std::string::npos;
  if (is_square) {
    camera->matrix = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(n.data());
  } else if (is_list) {
    camera->matrix << n[0], 0, n[2], 0, n[1], n[3], 0, 0, 1;
  } else {
    return entry_error(*entry,
                       fmt::format("expected a camera matrix of 3 x 3 numbers (or the list fx, fy, cx, cy), "
                                   "found {} x {}.",
                                   table.rows, table.columns));
  }
  // Another entry with this meaning must say the same.
  const auto [first, last] = entries.nodes.equal_range(Entry::matrix);
  for (auto other = std::next(first); other != last; ++other) {
    LIMN_TRY(const Table same, table_of(other->second));
    if (same.numbers != n)
      return entry_error(other->second,
                         fmt::format("expected one camera matrix, found another one as {}.", entry->path));
  }
  if (entries.values.contains("fx"))
    return entry_error(entries.values.at("fx"),
                       fmt::format("expected one camera matrix, found another one as {}.", entry->path));
  return {};
}

// What the entries say about the lens model.
struct NamedModel {
  LensWord word = LensWord::neutral;
  std::string path;
};

Result<NamedModel> model_in(const CameraEntries& entries) {
  NamedModel model;
  const auto add = [&](LensWord word, const NamedNode& entry) -> Status {
    if (word == LensWord::neutral) return {};
    if (model.word != LensWord::neutral && model.word != word)
      return entry_error(entry,
                         fmt::format("expected the same lens model as {}, found another.", model.path));
    model = {word, entry.path};
    return {};
  };
  const auto [first, last] = entries.nodes.equal_range(Entry::model);
  for (auto entry = first; entry != last; ++entry) {
    const DataNode& node = *entry->second.node;
    auto word = lens_word(node.text);
    // MC-Calib's and DepthAI's numbers.
    if (node.text == "0") word = LensWord::neutral;
    if (node.text == "1") word = LensWord::fisheye;
    if (!word || node.is_list() || node.is_map())
      return entry_error(
          entry->second,
          fmt::format("expected the lens model plumb_bob, radtan, rational_polynomial (OpenCV's), "
                      "equidistant (fisheye) or none, found '{}'. Calibrate the camera with one of "
                      "these, or with limn calibrate.",
                      node.text.substr(0, 60)));
    LIMN_TRY_STATUS(add(*word, entry->second));
  }
  if (const NamedNode* flag = entries.find(Entry::is_fisheye)) {
    const std::string text = plain_name(flag->node->text);
    if (text == "1" || text == "true" || text == "yes") LIMN_TRY_STATUS(add(LensWord::fisheye, *flag));
  }
  return model;
}

constexpr const char* k_opencv_order[] = {"k1", "k2", "p1", "p2", "k3", "k4",    "k5",
                                          "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"};

// Cuts or adds zeros at the end, so that there are as many coefficients as OpenCV's formulas have.
void fit_count(std::vector<double>* coefficients) {
  while (coefficients->size() > 4 && coefficients->back() == 0) coefficients->pop_back();
  for (const std::size_t count : {4, 5, 8, 12, 14})
    if (coefficients->size() <= count) return coefficients->resize(count);
}

bool has_coefficient_values(const CameraEntries& entries) {
  return std::ranges::any_of(k_opencv_order, [&](const char* name) { return entries.values.contains(name); });
}

// Coefficients that are entries of their own.
Status read_coefficient_values(const CameraEntries& entries,
                               const NamedModel& model,
                               CameraDescription* camera) {
  const auto has = [&](const char* name) { return entries.values.contains(name); };
  const bool is_vins = has("mu");
  camera->distortion_entry = is_vins ? entries.values.at("mu").path : "k1";
  for (const char* name : k_opencv_order)
    if (has(name)) camera->distortion_entry = entries.values.at(name).path;
  if (model.word == LensWord::fisheye) {
    for (const char* name : {"p1", "p2", "k6"})
      if (has(name))
        return entry_error(entries.values.at(name), "expected k1 to k4 of a fisheye lens alone.");
    const auto names = is_vins ? std::array{"k2", "k3", "k4", "k5"} : std::array{"k1", "k2", "k3", "k4"};
    for (const char* name : names) {
      LIMN_TRY(const double value, value_in(entries, name));
      camera->coefficients.push_back(value);
    }
    return {};
  }
  if (model.word == LensWord::neutral && has("k4") && !has("p1"))
    return entry_error(
        entries.values.at("k4"),
        "found k1 to k4 without p1 and p2, which fisheye lenses have. Add distortion_model: equidistant "
        "if it is one, else p1: 0 and p2: 0.");
  for (const char* name : k_opencv_order) {
    LIMN_TRY(const double value, value_or_zero(entries, name));
    camera->coefficients.push_back(value);
  }
  fit_count(&camera->coefficients);
  return {};
}

Status read_coefficient_list(const NamedNode& entry, CameraDescription* camera) {
  camera->distortion_entry = entry.path;
  if (entry.node->kind == DataNode::Kind::null)
    return entry_error(
        entry, "expected numbers, found nothing. Write [0, 0, 0, 0, 0] if the lens has no distortion.");
  if (entry.node->is_text() && lens_word(entry.node->text) == LensWord::none) return {};
  LIMN_TRY(const Table table, table_of(entry));
  if (table.rows > 1 && table.columns > 1)
    return entry_error(entry,
                       fmt::format("expected a row or a column of coefficients, found a matrix of {} x {}.",
                                   table.rows, table.columns));
  camera->coefficients = table.numbers;
  return {};
}

Status read_distortion(const CameraEntries& entries, CameraDescription* camera) {
  const NamedNode* entry = entries.find(Entry::distortion);
  const NamedNode* unknown = entries.find(Entry::unknown_distortion);
  LIMN_TRY(const NamedModel model, model_in(entries));
  if (unknown)
    return entry_error(*unknown,
                       "this entry looks like distortion, but its name is not known. Call the coefficients "
                       "distortion_coefficients, or remove the entry if it is something else.");
  if (const auto xi = entries.values.find("xi"); xi != entries.values.end())
    return entry_error(xi->second,
                       "expected OpenCV's lens or its fisheye lens, found the mirror parameter of an "
                       "omnidirectional one. Calibrate the camera with one of these.");
  if (entry && has_coefficient_values(entries))
    return entry_error(*entry, "expected one list of coefficients, found k1 or others beside it.");
  if (entry) {
    LIMN_TRY_STATUS(read_coefficient_list(*entry, camera));
    const auto [first, last] = entries.nodes.equal_range(Entry::distortion);
    for (auto other = std::next(first); other != last; ++other) {
      CameraDescription same;
      LIMN_TRY_STATUS(read_coefficient_list(other->second, &same));
      if (same.coefficients != camera->coefficients)
        return entry_error(
            other->second,
            fmt::format("expected one list of coefficients, found another one as {}.", entry->path));
    }
  } else if (has_coefficient_values(entries)) {
    LIMN_TRY_STATUS(read_coefficient_values(entries, model, camera));
  } else if (model.word != LensWord::none) {
    return error(
        "{}: expected distortion coefficients beside it (distortion_coefficients), found none. Write zeros "
        "if "
        "the lens has none.",
        camera->matrix_entry);
  }
  const bool is_zero = std::ranges::all_of(camera->coefficients, [](double value) { return value == 0; });
  if ((model.word == LensWord::none || model.word == LensWord::inverse) && !is_zero)
    return error(
        "{}: expected no coefficients but zeros for this lens model, found others. Calibrate the camera with "
        "OpenCV's lens model (plumb_bob).",
        model.path);
  if (is_zero && model.word != LensWord::fisheye) camera->coefficients.clear();
  camera->kind = model.word == LensWord::fisheye ? DistortionKind::fisheye : DistortionKind::opencv;
  if (model.word == LensWord::neutral && entry && camera->coefficients.size() == 4)
    camera->remarks.push_back(
        fmt::format("{}: the four coefficients are taken as k1, k2, p1, p2 of OpenCV; if the lens "
                    "is a fisheye, add fisheye_model: 1",
                    camera->distortion_entry));
  return {};
}

Status read_size(const CameraEntries& entries, CameraDescription* camera) {
  for (const auto& [entry, side] :
       {std::pair{Entry::width, &camera->width}, std::pair{Entry::height, &camera->height}}) {
    const NamedNode* node = entries.find(entry);
    if (!node) continue;
    LIMN_TRY(const double number, number_of(*node));
    LIMN_TRY(*side, side_in(*node, number));
  }
  if (camera->width > 0 && camera->height > 0) return {};
  const bool is_shape = !entries.find(Entry::size);
  const NamedNode* size = entries.find(is_shape ? Entry::shape : Entry::size);
  if (!size && camera->width != camera->height) {
    const NamedNode* side = entries.find(camera->width > 0 ? Entry::width : Entry::height);
    return entry_error(*side, "expected both width and height of the image, found one of them.");
  }
  if (!size) return {};
  std::vector<double> numbers;
  if (size->node->is_map() && !size->node->find("data")) {
    Cameras inner;
    LIMN_TRY_STATUS(gather(*size->node, size->path, &inner));
    CameraDescription sides;
    inner[""].nodes.erase(Entry::size);
    LIMN_TRY_STATUS(read_size(inner[""], &sides));
    numbers = {double(sides.width), double(sides.height)};
  } else {
    LIMN_TRY(const Table table, table_of(*size));
    numbers = table.numbers;
  }
  if (numbers.size() != 2 && !(is_shape && numbers.size() == 3))
    return entry_error(*size,
                       fmt::format("expected width and height in pixels, found {} numbers.", numbers.size()));
  LIMN_TRY(camera->width, side_in(*size, numbers[is_shape ? 1 : 0]));
  LIMN_TRY(camera->height, side_in(*size, numbers[is_shape ? 0 : 1]));
  return {};
}

// ROS: an image that was binned or cut has another camera matrix than the one in the file.
Status check_region(const CameraEntries& entries, const CameraDescription& camera) {
  const auto [first, last] = entries.nodes.equal_range(Entry::binning);
  for (auto entry = first; entry != last; ++entry) {
    LIMN_TRY(const double binning, number_of(entry->second));
    if (binning != 0 && binning != 1)
      return entry_error(entry->second,
                         fmt::format("expected images without binning (0 or 1), found {:g}.", binning));
  }
  const NamedNode* region = entries.find(Entry::region);
  if (!region) return {};
  for (const auto& [key, whole] : {std::pair{"x_offset", 0}, std::pair{"y_offset", 0},
                                   std::pair{"width", camera.width}, std::pair{"height", camera.height}}) {
    const DataNode* node = region->node->find(key);
    if (!node) continue;
    const NamedNode entry{region->path + "." + key, node};
    LIMN_TRY(const double side, number_of(entry));
    if (side != 0 && side != whole)
      return entry_error(entry, fmt::format("expected the whole image (0), found {:g}.", side));
  }
  return {};
}

Status read_pose(const CameraEntries& entries, CameraDescription* camera) {
  const NamedNode* entry = entries.find(Entry::from_previous);
  if (!entry) return {};
  LIMN_TRY(const Table table, table_of(*entry));
  if (table.numbers.size() != 16) return entry_error(*entry, "expected a matrix of 4 x 4 numbers.");
  const Eigen::Matrix4d m =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(table.numbers.data());
  const Eigen::Matrix3d rotation = m.topLeftCorner<3, 3>();
  constexpr double k_rounded = 1e-3;
  if (!((rotation * rotation.transpose()).isIdentity(k_rounded) && rotation.determinant() > 0))
    return entry_error(*entry, "expected a rotation and a translation, found something else.");
  camera->imager_from_world = Pose(rotation, m.topRightCorner<3, 1>());
  return {};
}

Result<CameraDescription> camera_of(const CameraEntries& entries, const std::string& name) {
  CameraDescription camera;
  camera.name = name;
  // The model comes first: another model's values have another form.
  LIMN_TRY([[maybe_unused]] const NamedModel model, model_in(entries));
  LIMN_TRY_STATUS(read_matrix(entries, &camera));
  LIMN_TRY_STATUS(read_size(entries, &camera));
  LIMN_TRY_STATUS(read_distortion(entries, &camera));
  LIMN_TRY_STATUS(check_region(entries, camera));
  LIMN_TRY_STATUS(read_pose(entries, &camera));
  return camera;
}

// ---- the tree ----

// ORB-SLAM's keys "Camera.fx" as a map "Camera" with the key "fx". Where "Camera" has no lens, because the
// lenses are in "Camera1" and "Camera2", its entries belong to both and stay on the outer level.
DataNode without_dots(const DataNode& map) {
  DataNode nested;
  nested.kind = DataNode::Kind::map;
  nested.line = map.line;
  const auto inner = [&](const std::string& key) -> DataNode& {
    const auto found = std::ranges::find(nested.keys, key);
    if (found != nested.keys.end())
      return nested.items[static_cast<std::size_t>(found - nested.keys.begin())];
    nested.keys.push_back(key);
    nested.items.emplace_back().kind = DataNode::Kind::map;
    return nested.items.back();
  };
  for (std::size_t i = 0; i < map.items.size(); ++i) {
    const auto dot = map.keys[i].find('.');
    // ROS's nested parameters have some dots; a damaged file may have thousands.
    const bool is_dotted = dot != std::string::npos && dot > 0 && std::ranges::count(map.keys[i], '.') <= 4;
    std::string prefix = is_dotted ? map.keys[i].substr(0, dot) : "";
    std::string key = is_dotted ? map.keys[i].substr(dot + 1) : map.keys[i];
    if (is_dotted && (key == "type" || key == "model")) key = "camera_model";
    const bool is_shared = prefix == "Camera" && std::ranges::find(map.keys, "Camera.fx") == map.keys.end();
    DataNode& target = prefix.empty() || is_shared ? nested : inner(prefix);
    if (!target.is_map()) continue;
    target.keys.push_back(key);
    target.items.push_back(map.items[i]);
  }
  return nested;
}

bool has_dots(const DataNode& map) {
  return std::ranges::any_of(map.keys,
                             [](const std::string& key) { return key.find('.') != std::string::npos; });
}

std::string joined_path(const std::string& path, const std::string& key) {
  return path.empty() ? key : path + "." + key;
}

class DocumentReader {
 public:
  std::vector<CameraDescription> cameras;

  Status read(const DataNode& node, const std::string& path, const CameraEntries& outer) {
    if (node.is_list()) return read_items(node, path, outer);
    if (!node.is_map()) return {};
    const DataNode nested = has_dots(node) ? without_dots(node) : DataNode();
    const DataNode& map = has_dots(node) ? nested : node;
    // What is not in a camera's map is not understood and does no harm: another file's part.
    if (!holds_camera(map)) return read_items(map, path, inherited_by(map, path, outer));
    Cameras found;
    LIMN_TRY_STATUS(gather(map, path, &found));
    found[""].add_from(outer, k_inherited);
    for (auto& [camera, entries] : found) {
      if (!camera.empty()) entries.add_from(found[""], k_inherited);
      LIMN_TRY_STATUS(add(camera, entries, path, found));
    }
    return {};
  }

 private:
  // Whether the map's own entries hold a camera matrix or a focal length.
  static bool holds_camera(const DataNode& map) {
    for (std::size_t i = 0; i < map.items.size(); ++i) {
      const auto meaning = camera_entry(map.keys[i], map.items[i]);
      if (!meaning) continue;
      if (meaning->entry == Entry::value && (meaning->value == "fx" || meaning->value == "mu")) return true;
      if (meaning->entry != Entry::matrix) continue;
      if (!is_lens_map(map.items[i]) || holds_camera(map.items[i])) return true;
    }
    return false;
  }

  static CameraEntries inherited_by(const DataNode& map,
                                    const std::string& path,
                                    const CameraEntries& outer) {
    CameraEntries entries;
    for (std::size_t i = 0; i < map.items.size(); ++i) {
      const auto meaning = camera_entry(map.keys[i], map.items[i]);
      if (!meaning || !meaning->camera.empty() || map.items[i].kind == DataNode::Kind::null) continue;
      const bool is_model_text = meaning->entry != Entry::model || map.items[i].is_text();
      if (std::ranges::find(k_inherited, meaning->entry) != k_inherited.end() && is_model_text)
        entries.nodes.emplace(meaning->entry, NamedNode{joined_path(path, map.keys[i]), &map.items[i]});
    }
    entries.add_from(outer, k_inherited);
    return entries;
  }

  Status read_items(const DataNode& node, const std::string& path, const CameraEntries& outer) {
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      const std::string key = node.is_map() ? node.keys[i] : std::to_string(i);
      LIMN_TRY_STATUS(read(node.items[i], joined_path(path, key), outer));
    }
    return {};
  }

  Status add(const std::string& camera,
             const CameraEntries& entries,
             const std::string& path,
             const Cameras& all) {
    const NamedNode* matrix = entries.find(Entry::matrix);
    if (!entries.is_camera()) {
      const NamedNode* distortion = entries.find(Entry::distortion);
      if (!distortion) distortion = entries.find(Entry::unknown_distortion);
      return distortion ? Status(entry_error(*distortion,
                                             "expected a camera matrix with a name like this, found none."))
                        : Status();
    }
    const std::string key = matrix ? matrix->path.substr(path.empty() ? 0 : path.size() + 1) : camera;
    LIMN_TRY(CameraDescription described, camera_of(entries, camera.empty() ? path : joined_path(path, key)));
    if (!camera.empty()) described.also_named = {camera, key};
    if (const NamedNode* distortion = entries.find(Entry::distortion))
      described.also_named.push_back(distortion->path.substr(distortion->path.rfind('.') + 1));
    // The first of a numbered pair is the left one.
    const bool from_one = all.contains("1") && all.contains("2"),
               from_zero = all.contains("0") && all.contains("1");
    if (camera == (from_one ? "1" : from_zero ? "0" : "l")) described.also_named.push_back("left");
    if (camera == (from_one ? "2" : from_zero ? "1" : "r")) described.also_named.push_back("right");
    if (!path.empty()) described.also_named.push_back(path.substr(path.rfind('.') + 1));
    if (described.width > 0)
      described.also_named.push_back(fmt::format("{}x{}", described.width, described.height));
    cameras.push_back(std::move(described));
    return {};
  }
};

}  // namespace

Result<std::vector<CameraDescription>> cameras_in(const DataNode& root) {
  DocumentReader reader;
  LIMN_TRY_STATUS(reader.read(root, "", {}));
  // Kalibr's poses are relative to the camera before.
  for (std::size_t i = 1; i < reader.cameras.size(); ++i) {
    Pose& pose = reader.cameras[i].imager_from_world;
    pose = pose * reader.cameras[i - 1].imager_from_world;
    if (!pose.is_finite()) return error("{}: expected a pose of finite numbers.", reader.cameras[i].name);
  }
  return std::move(reader.cameras);
}

}  // namespace limn
