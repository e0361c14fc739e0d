#include "scene/slot_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/utf8.h"
#include "scene/meshes/mesh_content.h"
#include "scene/meshes/mesh_formats.h"
#include "scene/volumes/volume_name.h"

namespace limn::scene {
namespace {

namespace fs = std::filesystem;

// Ends of names of files that belong to meshes or are not finished yet.
bool is_beside_a_mesh(const std::string& end) {
  static const std::set<std::string> k_ends = {
      ".png", ".jpg", ".jpeg", ".jpe",  ".jfif", ".bmp", ".tga", ".tif",  ".tiff", ".webp",      ".gif",
      ".dds", ".ktx", ".ktx2", ".hdr",  ".exr",  ".psd", ".svg", ".mtl",  ".bin",  ".basis",     ".ppm",
      ".pgm", ".tmp", ".temp", ".part", ".bak",  ".swp", ".ini", ".lock", ".db",   ".crdownload"};
  return k_ends.count(end) > 0;
}

// What a file is that is no mesh, and what to do.
std::string reason(const std::string& end) {
  static const std::map<std::string, std::string> k_reasons = [] {
    std::map<std::string, std::string> all;
    const std::string mesh = " Export it as a mesh, such as .glb, .3mf or .stl.";
    for (const char* e :
         {".x_t", ".x_b", ".sat", ".brep", ".jt", ".sldprt", ".sldasm", ".ipt", ".iam", ".catpart",
          ".catproduct", ".prt", ".asm", ".par", ".f3d", ".fcstd", ".3dm", ".dwg", ".scad"})
      all[e] = "it is a CAD file of a format that Limn does not read. Export it as STEP (.step).";
    for (const char* e : {".blend", ".max", ".ma", ".mb", ".c4d", ".skp", ".ztl", ".hip", ".lxo", ".spp"})
      all[e] = "it is a project of a modelling program." + mesh;
    for (const char* e : {".zip", ".rar", ".7z", ".gz", ".tgz", ".tar", ".xz", ".bz2", ".usdz", ".zae"})
      all[e] = "it is an archive. Unpack it, and put the mesh and its textures here.";
    for (const char* e :
         {".usd", ".usda", ".usdc", ".wrl", ".x3d", ".dxf", ".ifc",     ".abc",  ".vtk", ".pcd",  ".xyz",
          ".las", ".e57",  ".ase",  ".lws", ".b3d", ".md2", ".md5mesh", ".ms3d", ".wrz", ".vrml", ".gcode"})
      all[e] = "Limn does not read this format." + mesh;
    for (const char* e : {".dcm", ".ima"})
      all[e] = "it is a DICOM slice. Put the slices of a series into a folder of their own here.";
    return all;
  }();
  const auto known = k_reasons.find(end);
  return known != k_reasons.end()
             ? known->second
             : fmt::format("it is no mesh that Limn reads ({}). Export it as one of these, or take it away.",
                           mesh_formats());
}

bool holds_a_mesh(const fs::path& folder) {
  std::error_code none;
  fs::recursive_directory_iterator at(folder, none);
  for (int looked_at = 0; !none && at != fs::recursive_directory_iterator() && looked_at < 1000;
       ++looked_at) {
    if (is_mesh_name(at->path())) return true;
    at.increment(none);
  }
  return false;
}

}  // namespace

bool is_volume(const fs::path& path) { return is_volume_name(path) || is_dicom_folder(path); }

SlotFolder list_slot_folder(const fs::path& folder) {
  SlotFolder out;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    const fs::path& path = entry.path();
    const std::string name = path.filename().string(), end = lower_extension(path);
    if (name.starts_with('.') || name.starts_with('~') || name.ends_with('~') || name == "units.json")
      continue;
    std::error_code gone;
    if (entry.is_directory(gone)) {
      if (is_dicom_folder(path))
        out.meshes.push_back(path);
      else if (holds_a_mesh(path))
        out.others.push_back(
            {path, "it is a folder. Put the mesh and its textures into the slot's folder itself."});
    } else if (is_mesh_name(path) || is_volume_name(path)) {
      out.meshes.push_back(path);
    } else if (!is_beside_a_mesh(end)) {
      out.others.push_back({path, reason(end)});
    }
  }
  std::sort(out.meshes.begin(), out.meshes.end());
  std::sort(out.others.begin(), out.others.end(),
            [](const SlotFolder::Other& a, const SlotFolder::Other& b) { return a.path < b.path; });
  return out;
}

}  // namespace limn::scene
