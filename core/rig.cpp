#include "core/rig.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

Imager read_imager(const ConfigNode& node, bool is_projector) {
  if (is_projector)
    node.only({"name", "size", "lens", "imager_from_world", "focus"});
  else
    node.only({"name", "size", "lens", "imager_from_world", "sees"});
  Imager imager;
  imager.name = node.at("name").text();
  const auto [width, height] = node.at("size").image_size();
  imager.width = width;
  imager.height = height;
  const ConfigNode lens = node.at("lens");
  lens.only({"model", "values"});
  auto made = Lens::create(lens.at("model").text(), lens.at("values").numbers(-1));
  if (made) imager.lens = *made;
  if (!made) lens.problem(made.message() + " Run limn calibrate again.");
  imager.imager_from_world = node.at("imager_from_world").pose();
  if (const auto sees = node.find("sees")) imager.sees = k_spectra.read(*sees);
  return imager;
}

std::vector<Imager> read_imagers(const ConfigNode& root,
                                 const std::string& key,
                                 std::set<std::string>* names) {
  std::vector<Imager> imagers;
  for (const ConfigNode& node : root.at(key).items()) {
    imagers.push_back(read_imager(node, key == "projectors"));
    const std::string& name = imagers.back().name;
    if (name.empty() || name.find('/') != std::string::npos) {
      node.problem(fmt::format("name: expected a name without '/', found \"{}\".", name));
    }
    if (!names->insert(name).second)
      node.problem(fmt::format("name: \"{}\" is used twice in this rig.", name));
  }
  return imagers;
}

std::vector<Focus> read_focuses(const ConfigNode& root) {
  std::vector<Focus> focuses;
  for (const ConfigNode& node : root.at("projectors").items()) {
    const auto focus = node.find("focus");
    if (!focus) continue;
    focus->only({"distance_m", "aperture_m"});
    focuses.push_back(
        {node.at("name").text(), focus->at("distance_m").positive(), focus->at("aperture_m").positive()});
  }
  return focuses;
}

// Reads the measured responses beside the rig, if there are any.
Status add_responses(const fs::path& folder, Rig* rig) {
  if (std::error_code ignored; !fs::exists(folder / "response.json", ignored)) return {};
  LIMN_TRY(RigResponses responses, load_responses(folder / "response.json"));
  rig->responses = std::move(responses.projectors);
  rig->camera_responses = std::move(responses.cameras);
  return {};
}

Result<Rig> load_rig_json(const fs::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.rig/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "cameras", "projectors", "covariance", "provenance"});
  Rig rig;
  std::set<std::string> names;
  rig.cameras = read_imagers(root, "cameras", &names);
  rig.projectors = read_imagers(root, "projectors", &names);
  rig.focuses = read_focuses(root);
  if (const auto node = root.find("covariance")) rig.covariance_json = json_text(node->json());
  if (const auto node = root.find("provenance")) rig.provenance_json = json_text(node->json());
  LIMN_TRY_STATUS(config.status());
  LIMN_TRY_STATUS(add_responses(config.folder(), &rig));
  return rig;
}

Result<Rig> load_cameramodels(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".cameramodel") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  if (paths.empty()) {
    return error(
        "{}: expected a rig folder with rig.json or .cameramodel files, found neither. Run limn calibrate.",
        folder.string());
  }
  Rig rig;
  for (const fs::path& path : paths) {
    LIMN_TRY(const Imager imager, load_cameramodel(path));
    (imager.name.starts_with("projector") ? rig.projectors : rig.cameras).push_back(imager);
  }
  LIMN_TRY_STATUS(add_responses(folder, &rig));
  return rig;
}

OrderedJson json_of(const Imager& imager) {
  OrderedJson json = {{"name", imager.name},
                      {"size", {imager.width, imager.height}},
                      {"lens", {{"model", imager.lens.model.name()}, {"values", imager.lens.values}}},
                      {"imager_from_world", to_json(imager.imager_from_world)}};
  if (imager.sees != Spectrum::visible) json["sees"] = k_spectra.text(imager.sees);
  return json;
}

}  // namespace

const Imager* Rig::find(const std::string& name) const {
  for (const auto* imagers : {&cameras, &projectors}) {
    for (const Imager& imager : *imagers) {
      if (imager.name == name) return &imager;
    }
  }
  return nullptr;
}

std::size_t Rig::first_visible_camera() const {
  const auto found = std::ranges::find(cameras, Spectrum::visible, &Imager::sees);
  return found == cameras.end() ? 0 : static_cast<std::size_t>(found - cameras.begin());
}

Result<Rig> load_rig(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_regular_file(path, ignored)) return load_rig_json(path);
  if (!fs::is_directory(path, ignored)) {
    return error("{}: expected a rig folder or its rig.json, found nothing. Check the name.", path.string());
  }
  if (fs::exists(path / "rig.json", ignored)) return load_rig_json(path / "rig.json");
  return load_cameramodels(path);
}

Status save_rig(const Rig& rig, const fs::path& folder) {
  OrderedJson json = {
      {"schema", "limn.rig/1"}, {"cameras", OrderedJson::array()}, {"projectors", OrderedJson::array()}};
  for (const Imager& camera : rig.cameras) json["cameras"].push_back(json_of(camera));
  for (const Imager& projector : rig.projectors) {
    json["projectors"].push_back(json_of(projector));
    for (const Focus& focus : rig.focuses)
      if (focus.projector == projector.name && focus.aperture_m > 0)
        json["projectors"].back()["focus"] = {{"distance_m", focus.distance_m},
                                              {"aperture_m", focus.aperture_m}};
  }
  if (!rig.covariance_json.empty()) json["covariance"] = OrderedJson::parse(rig.covariance_json);
  if (!rig.provenance_json.empty()) json["provenance"] = OrderedJson::parse(rig.provenance_json);
  return write_together(folder, [&](const fs::path& into) -> Status {
    for (const auto* imagers : {&rig.cameras, &rig.projectors}) {
      for (const Imager& imager : *imagers) {
        LIMN_TRY_STATUS(save_cameramodel(imager, into / (imager.name + ".cameramodel")));
      }
    }
    return write_file(into / "rig.json", json_text(json, 2) + "\n");
  });
}

}  // namespace limn
