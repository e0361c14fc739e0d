#include "exchange/mpcdi_writer.h"

#include <pugixml.hpp>
#include <sstream>

#include "core/file.h"
#include "core/image_encoder.h"
#include "exchange/pfm.h"
#include "exchange/zip.h"

namespace limn::exchange {
namespace {

void add(pugi::xml_node parent, const char* name, const std::string& text) {
  parent.append_child(name).text().set(text.c_str());
}

// Writes no exponent, because not every reader accepts one.
void add_decimals(pugi::xml_node parent, const char* name, double number) {
  add(parent, name, fmt::format("{:.15f}", number + 0.0));  // + 0.0 turns -0 into 0
}

void add(pugi::xml_node parent, const char* axis, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) add_decimals(parent, fmt::format("{}{}", axis, "xyz"[i]).c_str(), v[i]);
}

void add_region(pugi::xml_node buffer, const MpcdiRegion& region) {
  pugi::xml_node node = buffer.append_child("region");
  node.append_attribute("id") = region.id.c_str();
  // The standard's two versions and the programs that read it spell these names in three ways, and each looks
  // only for its own.
  for (const char* name : {"xResolution", "Xresolution"}) node.append_attribute(name) = region.width;
  for (const char* name : {"yResolution", "Yresolution"}) node.append_attribute(name) = region.height;
  node.append_attribute("x") = region.x;
  node.append_attribute("y") = region.y;
  for (const char* name : {"xSize", "xsize"}) node.append_attribute(name) = region.x_size;
  for (const char* name : {"ySize", "ysize"}) node.append_attribute(name) = region.y_size;
  if (region.frustum) {
    pugi::xml_node frustum = node.append_child("frustum");
    add_decimals(frustum, "yaw", region.frustum->yaw);
    add_decimals(frustum, "pitch", region.frustum->pitch);
    add_decimals(frustum, "roll", region.frustum->roll);
    add_decimals(frustum, "rightAngle", region.frustum->right);
    add_decimals(frustum, "leftAngle", region.frustum->left);
    add_decimals(frustum, "upAngle", region.frustum->up);
    add_decimals(frustum, "downAngle", region.frustum->down);
  }
  if (region.frame) {
    pugi::xml_node frame = node.append_child("coordinateFrame");
    add(frame, "pos", region.frame->p_eye);
    add(frame, "yaw", region.frame->d_down);
    add(frame, "pitch", region.frame->d_right);
    add(frame, "roll", region.frame->d_forward);
  }
}

ZipFile png_file(const std::string& name, const cv::Mat& image) { return {name, encode_png(image), true}; }

void add_blend_map(pugi::xml_node fileset,
                   const char* name,
                   const std::string& path,
                   const MpcdiBlendMap& map) {
  pugi::xml_node node = fileset.append_child(name);
  add(node, "path", path);
  add(node, "componentDepth", fmt::format("{}", map.image.channels()));
  add(node, "bitDepth", map.image.depth() == CV_16U ? "16" : "8");
  if (name == std::string("alphaMap")) add(node, "gammaEmbedded", fmt::format("{}", map.gamma_embedded));
}

// Adds the region's entry, and its maps as files.
void add_fileset(pugi::xml_node parent,
                 const MpcdiRegion& region,
                 bool has_points,
                 std::size_t index,
                 std::vector<ZipFile>* files) {
  pugi::xml_node node = parent.append_child("fileset");
  node.append_attribute("region") = region.id.c_str();
  const std::string warp = fmt::format("warp{}.pfm", index), alpha = fmt::format("alpha{}.png", index),
                    beta = fmt::format("beta{}.png", index),
                    distortion = fmt::format("distortion{}.pfm", index);
  if (!region.warp.empty()) {
    pugi::xml_node geometry = node.append_child("geometryWarpFile");
    add(geometry, "path", warp);
    add(geometry, "interpolation", "linear");
    if (has_points) add(geometry, "geometricUnit", "m");
    if (has_points) add(geometry, "originOf3DData", region.origin);
    files->push_back({warp, pfm_bytes(region.warp)});
  }
  if (region.alpha) {
    add_blend_map(node, "alphaMap", alpha, *region.alpha);
    files->push_back(png_file(alpha, region.alpha->image));
  }
  if (region.beta) {
    add_blend_map(node, "betaMap", beta, *region.beta);
    files->push_back(png_file(beta, region.beta->image));
  }
  if (!region.distortion.empty()) {
    add(node.append_child("distortionMap"), "path", distortion);
    files->push_back({distortion, pfm_bytes(region.distortion)});
  }
}

void add_extension(pugi::xml_node root, const Mpcdi& mpcdi) {
  pugi::xml_node extension = root.append_child("extensionSet").append_child("extension");
  extension.append_attribute("name") = "LimnExtension";
  extension.append_attribute("hasExternalFiles") = "false";
  add(extension, "GeneratedBy", mpcdi.made_by);
  for (const MpcdiRegion& region : mpcdi.regions) {
    if (!region.lens) continue;
    pugi::xml_node lens = extension.append_child("lens");
    lens.append_attribute("region") = region.id.c_str();
    lens.append_attribute("model") = region.lens->model.name().c_str();
    lens.text().set(fmt::format("{}", fmt::join(region.lens->values, " ")).c_str());
  }
}

}  // namespace

Status write_mpcdi(const std::filesystem::path& path, const Mpcdi& mpcdi) {
  pugi::xml_document document;
  pugi::xml_node root = document.append_child("MPCDI");
  root.append_attribute("profile") = k_mpcdi_profiles.text(mpcdi.profile).c_str();
  root.append_attribute("geometry") = 2;  // warps with one node for each pixel
  root.append_attribute("color") = mpcdi.colour_level;
  root.append_attribute("date") = mpcdi.date.c_str();
  root.append_attribute("version") = mpcdi.version.c_str();
  pugi::xml_node buffer = root.append_child("display").append_child("buffer");
  buffer.append_attribute("id") = mpcdi.regions.empty() ? "" : mpcdi.regions[0].buffer.c_str();
  pugi::xml_node list = root.append_child("files");
  std::vector<ZipFile> files(1);
  for (std::size_t i = 0; i < mpcdi.regions.size(); ++i) {
    add_region(buffer, mpcdi.regions[i]);
    add_fileset(list, mpcdi.regions[i], holds_points(mpcdi.profile), i, &files);
  }
  add_extension(root, mpcdi);
  std::ostringstream xml;
  document.save(xml, "  ", pugi::format_default, pugi::encoding_utf8);
  files[0] = {"mpcdi.xml", xml.str()};
  LIMN_TRY(const std::string bytes, zipped(files));
  return write_file(path, bytes);
}

}  // namespace limn::exchange
