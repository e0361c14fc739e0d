#include "exchange/mpcdi_reader.h"

#include <strings.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <pugixml.hpp>

#include "core/file.h"
#include "core/image_formats.h"
#include "exchange/pfm.h"
#include "exchange/zip.h"

namespace limn::exchange {
namespace {

namespace fs = std::filesystem;
using pugi::xml_node;

constexpr std::size_t k_most_file_bytes = std::size_t{2} << 30;
constexpr std::size_t k_most_xml_bytes = std::size_t{16} << 20;
constexpr std::size_t k_most_map_bytes = std::size_t{2} << 30;  // all maps together, unpacked
constexpr int k_most_side = 16384;
constexpr std::int64_t k_most_pixels = std::int64_t{1} << 26;  // one map; 8K has half as many

// The standard, its two versions and the programs that read it differ in upper and lower case.
bool is_same_name(const char* a, const char* b) { return ::strcasecmp(a, b) == 0; }

xml_node child_of(const xml_node& node, const char* name) {
  return node.find_child([&](const xml_node& child) { return is_same_name(child.name(), name); });
}

std::vector<xml_node> children_of(const xml_node& node, const char* name) {
  std::vector<xml_node> found;
  for (const xml_node& child : node.children())
    if (is_same_name(child.name(), name)) found.push_back(child);
  return found;
}

pugi::xml_attribute attribute_of(const xml_node& node, const char* name) {
  return node.find_attribute([&](const pugi::xml_attribute& a) { return is_same_name(a.name(), name); });
}

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

std::optional<double> number_of(const std::string& text) {
  const std::string digits = trimmed(text);
  const char* begin = digits.data() + (digits.starts_with('+') ? 1 : 0);
  double number = 0;
  const auto [end, code] = std::from_chars(begin, digits.data() + digits.size(), number);
  if (code != std::errc() || end != digits.data() + digits.size() || !std::isfinite(number))
    return std::nullopt;
  return number;
}

std::string shortened(const std::string& text) {
  return text.size() <= 40 ? text : fmt::format("{}…", text.substr(0, 40));
}

Result<double> read_number(const std::string& text, const std::string& where) {
  const auto number = number_of(text);
  if (!number) return error("{}: expected a number, found '{}'.", where, shortened(text));
  return *number;
}

Result<double> number_in(const xml_node& node, const char* name, const std::string& where) {
  const xml_node child = child_of(node, name);
  if (!child) return error("{}: expected the element {}, found none.", where, name);
  return read_number(child.text().get(), fmt::format("{}: {}", where, name));
}

Result<double> number_of_attribute(const xml_node& node, const char* name, const std::string& where) {
  const pugi::xml_attribute attribute = attribute_of(node, name);
  if (!attribute) return error("{}: expected the attribute {}, found none.", where, name);
  return read_number(attribute.value(), fmt::format("{}: {}", where, name));
}

Result<MpcdiFrustum> read_frustum(const xml_node& node, const std::string& where) {
  MpcdiFrustum frustum;
  const std::pair<const char*, double*> wanted[] = {
      {"yaw", &frustum.yaw},          {"pitch", &frustum.pitch},    {"roll", &frustum.roll},
      {"rightAngle", &frustum.right}, {"leftAngle", &frustum.left}, {"upAngle", &frustum.up},
      {"downAngle", &frustum.down}};
  for (const auto& [name, number] : wanted) {
    LIMN_TRY(*number, number_in(node, name, where));
  }
  return frustum;
}

// Checks a pinhole's angles. With a lens type of its own, Mystique writes angles that mean nothing.
Status check_angles(const MpcdiFrustum& frustum, const std::string& where) {
  const auto in_range = [](double low, double high) { return -90 < low && low < high && high < 90; };
  if (in_range(frustum.left, frustum.right) && in_range(frustum.down, frustum.up)) return {};
  return error(
      "{}: expected angles between -90 and 90 degrees, left below right and down below up, found left {}, "
      "right {}, "
      "down {}, up {}.",
      where, frustum.left, frustum.right, frustum.down, frustum.up);
}

Result<MpcdiFrame> read_frame(const xml_node& node, const std::string& where) {
  MpcdiFrame frame;
  const std::pair<const char*, Eigen::Vector3d*> wanted[] = {
      {"pos", &frame.p_eye}, {"pitch", &frame.d_right}, {"yaw", &frame.d_down}, {"roll", &frame.d_forward}};
  for (const auto& [name, vector] : wanted) {
    for (int i = 0; i < 3; ++i) {
      LIMN_TRY((*vector)[i], number_in(node, fmt::format("{}{}", name, "xyz"[i]).c_str(), where));
    }
  }
  constexpr double k_rounding = 1e-3;  // for files with few digits
  if ((frame.d_right.cross(frame.d_down) - frame.d_forward).norm() > k_rounding ||
      std::abs(frame.d_right.norm() - 1) > k_rounding || std::abs(frame.d_down.norm() - 1) > k_rounding) {
    return error(
        "{}: expected unit axes at right angles, pitch (right) x yaw (down) = roll (forward), found others. "
        "Export it "
        "again with a right-handed frame.",
        where);
  }
  return frame;
}

std::optional<double> metres_of(const std::string& unit) {
  static const std::map<std::string, double> units = {{"mm", 0.001},  {"cm", 0.01},   {"dm", 0.1},   {"m", 1},
                                                      {"in", 0.0254}, {"ft", 0.3048}, {"yd", 0.9144}};
  const auto found = units.find(unit);
  if (found == units.end()) return std::nullopt;
  return found->second;
}

bool leads_out(const std::string& path) {
  const fs::path parts(path);
  return parts.is_absolute() || path.find('\\') != std::string::npos || path.find(':') != std::string::npos ||
         std::any_of(parts.begin(), parts.end(), [](const fs::path& part) { return part == ".."; });
}

// Width and height from a PNG's header.
std::optional<cv::Size> png_size(const std::string& bytes) {
  if (!bytes.starts_with("\x89PNG\r\n\x1a\n") || bytes.size() < 33) return std::nullopt;
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return static_cast<int>(std::min<std::uint32_t>(value, 1u << 30));
  };
  return cv::Size(number(16), number(20));
}

Result<cv::Mat> read_png(const std::string& bytes, const cv::Size& wanted, const std::string& where) {
  const auto size = png_size(bytes);
  if (!size) return error("{}: expected a PNG image, found {} other bytes.", where, bytes.size());
  if (*size != wanted) {
    return error("{}: expected the region's size {}x{}, found {}x{}. Export it again.", where, wanted.width,
                 wanted.height, size->width, size->height);
  }
  const auto stored = image_formats::decode_png(bytes, false);
  if (!stored)
    return error("{}: expected a whole PNG image, found a truncated or damaged one. Export it again.", where);
  const cv::Mat image = stored->samples;
  if (image.channels() != 1 && image.channels() != 3)
    return error("{}: expected a grey or RGB image, found {} channels.", where, image.channels());
  return image;
}

// Reads the XML document and, in an archive, the files that it names.
class Reader {
 public:
  Reader(const fs::path& path, MpcdiParts parts) : where_(path.string()), parts_(parts) {}

  Result<Mpcdi> read();

 private:
  Result<std::string> find_xml(std::string bytes);
  Status read_head(const xml_node& root);
  Status read_region(const xml_node& node, const std::string& buffer);
  Status read_fileset(const xml_node& node);
  Status read_warp(const xml_node& node, const std::string& where, MpcdiRegion* region);
  Status read_extensions(const xml_node& set);
  Status read_lens(const xml_node& node);
  Status check_regions();
  MpcdiRegion* find_region(const std::string& id);
  bool has_path(const xml_node& map) const { return !trimmed(child_of(map, "path").text().get()).empty(); }
  Result<std::string> read_map(const xml_node& map, const std::string& where, std::size_t most_bytes);
  Result<cv::Mat> read_floats(const xml_node& map, const std::string& where, const MpcdiRegion& region);
  Result<MpcdiBlendMap> read_blend_map(const xml_node& map,
                                       const std::string& where,
                                       const MpcdiRegion& region);

  std::string where_;
  MpcdiParts parts_;
  std::optional<ZipArchive> archive_;
  std::size_t unpacked_ = 0;
  std::map<std::string, double> units_;  // unit of each region's lengths in metres, if its warp names one
  Mpcdi out_;
};

// In an archive: `mpcdi.xml`, or the only other XML file.
Result<std::string> Reader::find_xml(std::string bytes) {
  if (!bytes.starts_with("PK")) {
    const auto first = bytes.find_first_not_of(" \t\r\n\xef\xbb\xbf");
    if (first != std::string::npos && bytes[first] == '<' && bytes.size() <= k_most_xml_bytes) return bytes;
    return error("{}: expected an MPCDI archive (a zip with mpcdi.xml) or its XML, found {}.", where_,
                 bytes.empty() ? std::string("an empty file") : fmt::format("{} other bytes", bytes.size()));
  }
  LIMN_TRY(archive_, ZipArchive::open(std::move(bytes), where_));
  std::vector<std::string> documents;
  for (const std::string& name : archive_->names()) {
    if (name.size() >= 4 && is_same_name(name.c_str() + name.size() - 4, ".xml")) documents.push_back(name);
    if (!is_same_name(name.c_str(), "mpcdi.xml")) continue;
    documents = {name};
    break;
  }
  if (documents.size() != 1)
    return error("{}: expected mpcdi.xml inside, found {} files.", where_, archive_->names().size());
  auto content = archive_->read(documents[0], k_most_xml_bytes);
  if (!content) return error("{}: {}", where_, content.message());
  return content;
}

Result<Mpcdi> Reader::read() {
  std::error_code ignored;
  if (const auto bytes = fs::file_size(where_, ignored); !ignored && bytes > k_most_file_bytes)
    return error("{}: expected at most {} bytes, found {}.", where_, k_most_file_bytes, bytes);
  LIMN_TRY(std::string content, read_file(where_));
  LIMN_TRY(const std::string xml, find_xml(std::move(content)));
  if (archive_) where_ += ": mpcdi.xml";
  pugi::xml_document document;
  const auto parsed = document.load_buffer(xml.data(), xml.size());
  if (!parsed) {
    return error("{}: expected well-formed XML, found a mistake at byte {}: {}.", where_, parsed.offset,
                 parsed.description());
  }
  const xml_node root = document.document_element();
  LIMN_TRY_STATUS(read_head(root));
  for (const xml_node& buffer : children_of(child_of(root, "display"), "buffer")) {
    for (const xml_node& region : children_of(buffer, "region"))
      LIMN_TRY_STATUS(read_region(region, attribute_of(buffer, "id").value()));
  }
  if (out_.regions.empty())
    return error("{}: display: expected a buffer with at least one region, found none.", where_);
  LIMN_TRY_STATUS(read_extensions(child_of(root, "extensionSet")));
  // Mystique writes filesets beside an empty `files`.
  for (const xml_node& parent : {child_of(root, "files"), root}) {
    for (const xml_node& fileset : children_of(parent, "fileset")) LIMN_TRY_STATUS(read_fileset(fileset));
  }
  LIMN_TRY_STATUS(check_regions());
  return std::move(out_);
}

Status Reader::read_head(const xml_node& root) {
  if (!is_same_name(root.name(), "MPCDI"))
    return error("{}: expected the root element MPCDI, found '{}'.", where_, shortened(root.name()));
  std::string profile = attribute_of(root, "profile").value();
  std::transform(profile.begin(), profile.end(), profile.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  const auto known = k_mpcdi_profiles.find(profile);
  if (!known) return error("{}: profile: expected 2d, 3d, a3 or sl, found '{}'.", where_, shortened(profile));
  out_.profile = *known;
  out_.version = attribute_of(root, "version").value();
  if (!out_.version.starts_with("1.") && !out_.version.starts_with("2."))
    return error("{}: version: expected 1.0 or 2.0, found '{}'.", where_, shortened(out_.version));
  out_.date = attribute_of(root, "date").value();
  out_.colour_level = attribute_of(root, "color").as_int(1);
  return {};
}

Status Reader::read_region(const xml_node& node, const std::string& buffer) {
  MpcdiRegion region;
  region.id = attribute_of(node, "id").value();
  region.buffer = buffer;
  const std::string where = fmt::format("{}: region '{}'", where_, region.id);
  if (region.id.empty() || find_region(region.id))
    return error("{}: expected an id that no other region has, found this one again or an empty one.", where);
  double width = 0, height = 0;
  const std::pair<const char*, double*> wanted[] = {{"xResolution", &width},   {"yResolution", &height},
                                                    {"x", &region.x},          {"y", &region.y},
                                                    {"xSize", &region.x_size}, {"ySize", &region.y_size}};
  for (const auto& [name, number] : wanted) {
    LIMN_TRY(*number, number_of_attribute(node, name, where));
  }
  for (const double side : {width, height}) {
    if (!(side >= 1 && side <= k_most_side && side == std::floor(side)))
      return error("{}: expected a resolution of 1 … {} whole pixels, found {}x{}.", where, k_most_side,
                   width, height);
  }
  region.width = static_cast<int>(width);
  region.height = static_cast<int>(height);
  if (const xml_node frustum = child_of(node, "frustum")) {
    LIMN_TRY(region.frustum, read_frustum(frustum, where + ": frustum"));
  }
  if (const xml_node frame = child_of(node, "coordinateFrame")) {
    LIMN_TRY(region.frame, read_frame(frame, where + ": coordinateFrame"));
  }
  out_.regions.push_back(std::move(region));
  return {};
}

MpcdiRegion* Reader::find_region(const std::string& id) {
  const auto found = std::find_if(out_.regions.begin(), out_.regions.end(),
                                  [&](const MpcdiRegion& r) { return r.id == id; });
  return found == out_.regions.end() ? nullptr : &*found;
}

Result<std::string> Reader::read_map(const xml_node& map, const std::string& where, std::size_t most_bytes) {
  const std::string path = trimmed(child_of(map, "path").text().get());
  if (leads_out(path)) {
    return error("{}: expected the path of a file inside the archive, found '{}', which leads out of it.",
                 where, shortened(path));
  }
  if (!archive_)
    return error("{}: expected an archive with the file '{}', found its XML alone.", where, path);
  auto content = archive_->read(path, std::min(most_bytes, k_most_map_bytes - unpacked_));
  if (!content) return error("{}: {}", where, content.message());
  unpacked_ += content->size();
  return content;
}

Result<cv::Mat> Reader::read_floats(const xml_node& map,
                                    const std::string& where,
                                    const MpcdiRegion& region) {
  constexpr std::size_t k_header_bytes = 256;
  const std::int64_t pixels = std::int64_t{region.width} * region.height;
  LIMN_TRY(
      const std::string bytes,
      read_map(map, where, static_cast<std::size_t>(std::min(pixels, k_most_pixels)) * 12 + k_header_bytes));
  LIMN_TRY(cv::Mat floats, read_pfm(bytes, where, k_most_pixels));
  if (floats.cols > region.width || floats.rows > region.height || floats.cols < 2 || floats.rows < 2) {
    return error("{}: expected from 2x2 nodes to one for each pixel ({}x{}), found {}x{}. Export it again.",
                 where, region.width, region.height, floats.cols, floats.rows);
  }
  return floats;
}

Result<MpcdiBlendMap> Reader::read_blend_map(const xml_node& map,
                                             const std::string& where,
                                             const MpcdiRegion& region) {
  MpcdiBlendMap out;
  if (const xml_node gamma = child_of(map, "gammaEmbedded")) {
    LIMN_TRY(out.gamma_embedded, read_number(gamma.text().get(), where + ": gammaEmbedded"));
    if (!(out.gamma_embedded > 0))
      return error("{}: gammaEmbedded: expected > 0, found {}.", where, out.gamma_embedded);
  }
  LIMN_TRY(const std::string bytes, read_map(map, where, k_most_map_bytes));
  const std::size_t pixels = static_cast<std::size_t>(region.width) * static_cast<std::size_t>(region.height);
  if (pixels > static_cast<std::size_t>(k_most_pixels))
    return error("{}: expected at most {} pixels, found {}.", where, k_most_pixels, pixels);
  LIMN_TRY(out.image, read_png(bytes, cv::Size(region.width, region.height), where));
  unpacked_ += pixels * out.image.elemSize();
  if (unpacked_ > k_most_map_bytes)
    return error("{}: expected at most {} bytes of maps, found more.", where_, k_most_map_bytes);
  const int bits = child_of(map, "bitDepth").text().as_int(0);
  const int found = out.image.depth() == CV_16U ? 16 : 8;
  if (bits != 0 && bits != found)
    out_.remarks.push_back(fmt::format("{}: bitDepth says {}, the image has {}", where, bits, found));
  return out;
}

// Missing nodes become NaN; points become metres.
Status Reader::read_warp(const xml_node& node, const std::string& where, MpcdiRegion* region) {
  const std::string unit = trimmed(child_of(node, "geometricUnit").text().get());
  const bool has_points = holds_points(out_.profile);
  const auto metres = metres_of(unit);
  if (metres) units_[region->id] = *metres;
  if (has_points && !metres && !unit.empty() && unit != "unknown")
    return error("{}: geometricUnit: expected mm, cm, dm, m, in, ft or yd, found '{}'.", where,
                 shortened(unit));
  if (const std::string origin = trimmed(child_of(node, "originOf3DData").text().get()); !origin.empty())
    region->origin = origin;
  if (!has_path(node) || parts_ == MpcdiParts::poses) return {};
  if (has_points && !metres) out_.remarks.push_back(where + ": no unit; taken as metres");
  LIMN_TRY(region->warp, read_floats(node, where, *region));
  int known = 0;
  for (auto p = region->warp.begin<cv::Vec3f>(); p != region->warp.end<cv::Vec3f>(); ++p) {
    // The third number of a position is its error, or NaN.
    const bool is_known = std::isfinite((*p)[0]) && std::isfinite((*p)[1]) &&
                          (!has_points || std::isfinite((*p)[2])) &&
                          !((*p)[0] == 0 && (*p)[1] == 0 && (!has_points || (*p)[2] == 0));
    known += is_known;
    if (!is_known) *p = cv::Vec3f::all(std::numeric_limits<float>::quiet_NaN());
    if (is_known && has_points && metres) *p *= static_cast<float>(*metres);
  }
  if (known == 0)
    return error("{}: expected a warp with at least one point, found none in {} nodes.", where,
                 region->warp.total());
  return {};
}

Status Reader::read_fileset(const xml_node& node) {
  const std::string id = attribute_of(node, "region").value();
  MpcdiRegion* region = find_region(id);
  if (!region)
    return error("{}: fileset: expected a region of the display, found '{}'.", where_, shortened(id));
  const std::string where = fmt::format("{}: fileset of region '{}'", where_, id);
  if (const xml_node warp = child_of(node, "geometryWarpFile"))
    LIMN_TRY_STATUS(read_warp(warp, where + ": geometryWarpFile", region));
  if (parts_ == MpcdiParts::poses) {
    if (has_path(child_of(node, "distortionMap")) && !region->lens)
      out_.remarks.push_back(where + ": its distortionMap is ignored; the rig has the frustum's pinhole");
    return {};
  }
  if (const xml_node alpha = child_of(node, "alphaMap"); has_path(alpha)) {
    LIMN_TRY(region->alpha, read_blend_map(alpha, where + ": alphaMap", *region));
  }
  if (const xml_node beta = child_of(node, "betaMap"); has_path(beta)) {
    LIMN_TRY(region->beta, read_blend_map(beta, where + ": betaMap", *region));
  }
  if (const xml_node distortion = child_of(node, "distortionMap"); has_path(distortion)) {
    LIMN_TRY(region->distortion, read_floats(distortion, where + ": distortionMap", *region));
  }
  for (const char* table : {"decodeLUT", "correctLUT", "encodeLUT"})
    if (has_path(child_of(node, table)))
      out_.remarks.push_back(fmt::format("{}: {} is ignored", where, table));
  return {};
}

Status Reader::read_lens(const xml_node& node) {
  MpcdiRegion* region = find_region(attribute_of(node, "region").value());
  const std::string where =
      fmt::format("{}: lens of region '{}'", where_, attribute_of(node, "region").value());
  if (!region) return error("{}: expected a region of the display, found none of this id.", where);
  std::vector<double> values;
  std::string text = trimmed(node.text().get());
  while (!text.empty()) {
    const auto end = std::min(text.find_first_of(" \t\r\n"), text.size());
    LIMN_TRY(values.emplace_back(), read_number(text.substr(0, end), where));
    text = trimmed(text.substr(end));
  }
  auto lens = Lens::create(attribute_of(node, "model").value(), std::move(values));
  if (!lens) return error("{}: {}", where, lens.message());
  region->lens = std::move(lens).value();
  return {};
}

Status Reader::read_extensions(const xml_node& set) {
  for (const xml_node& extension : children_of(set, "extension")) {
    if (const xml_node maker = child_of(extension, "GeneratedBy")) out_.made_by = trimmed(maker.text().get());
    for (const xml_node& lens : children_of(extension, "lens")) LIMN_TRY_STATUS(read_lens(lens));
    for (const xml_node& buffer : children_of(extension, "buffer")) {
      for (const xml_node& node : children_of(buffer, "region")) {
        MpcdiRegion* region = find_region(attribute_of(node, "id").value());
        if (region && (child_of(node, "fisheye") || child_of(node, "anamorphic")))
          region->has_other_lens = true;
      }
    }
  }
  return {};
}

// Checks that are possible only after the whole file was read.
Status Reader::check_regions() {
  for (MpcdiRegion& region : out_.regions) {
    const std::string where = fmt::format("{}: region '{}'", where_, region.id);
    if (out_.profile == MpcdiProfile::shader_lamps && !(region.frustum && region.frame))
      return error("{}: expected a frustum and a coordinateFrame in profile sl, found at most one of them.",
                   where);
    const bool has_pose = region.frustum && region.frame;
    if (out_.profile != MpcdiProfile::shader_lamps && region.warp.empty() && parts_ == MpcdiParts::all) {
      if (!has_pose)
        return error("{}: expected a fileset with a geometryWarpFile in profile {}, found none.", where,
                     k_mpcdi_profiles.text(out_.profile));
      out_.remarks.push_back(where + ": no geometryWarpFile; it has a pose alone");
    }
    if (parts_ == MpcdiParts::poses && has_pose && !units_.contains(region.id))
      out_.remarks.push_back(where + ": no unit; its position is taken as metres");
    if (region.frustum && !region.has_other_lens)
      LIMN_TRY_STATUS(check_angles(*region.frustum, where + ": frustum"));
    if (const auto unit = units_.find(region.id); region.frame && unit != units_.end())
      region.frame->p_eye *= unit->second;
    if (region.has_other_lens)
      out_.remarks.push_back(where + ": a fisheye or anamorphic lens, which Limn does not support");
  }
  return {};
}

}  // namespace

Result<Mpcdi> read_mpcdi(const fs::path& path, MpcdiParts parts) { return Reader(path, parts).read(); }

}  // namespace limn::exchange
