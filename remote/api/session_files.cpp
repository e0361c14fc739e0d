#include "remote/api/session_files.h"

#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "core/json_text.h"
#include "core/names.h"
#include "device/jpeg.h"
#include "remote/api/painted_mesh.h"
#include "remote/api/responses.h"
#include "remote/glasses/part_cut.h"
#include "scene/kept_files.h"
#include "scene/lines/line_file.h"
#include "scene/meshes/glb.h"

namespace limn::remote {
namespace {

constexpr int k_projector_jpeg_quality = 85;

// The decoded name between the two ends of a path; nullopt: the path has other ends, or the name is
// malformed.
std::optional<std::string> name_in(const std::string& path, std::string_view begin, std::string_view end) {
  if (path.size() <= begin.size() + end.size() || !path.starts_with(begin) || !path.ends_with(end))
    return std::nullopt;
  return decoded(std::string_view(path).substr(begin.size(), path.size() - begin.size() - end.size()));
}

// A look's parts on the prototype, in its finish, as a glTF file; what the look's plane cuts has `cut` in its
// node's extras. Empty: the look has no parts and there is no prototype.
std::string look_assembly(const scene::Scene& scene, const scene::Look& look) {
  std::vector<scene::GlbNode> nodes;
  const scene::Finish* finish = find_named(scene.finishes, look.finish);
  const scene::Mesh painted =
      scene.prototype && finish ? painted_mesh(scene.prototype->mesh, *finish) : scene::Mesh{};
  const auto cut_of = [&](bool is_cut, const Pose& part_from_prototype, int owner) {
    if (!is_cut || !look.cut || !scene.section) return std::string();
    const scene::CutPlane plane = scene::transformed(part_from_prototype, *look.cut);
    return json_text(nlohmann::ordered_json{{"cut", part_cut_json(*scene.section, plane, owner)}});
  };
  if (scene.prototype)
    nodes.push_back({"prototype", finish ? &painted : &scene.prototype->mesh, Pose(),
                     cut_of(scene.section && scene.section->cuts_prototype, Pose(), 0)});
  for (const scene::Look::Part& part : look.parts) {
    const scene::Slot* slot = scene.find_slot(part.slot);
    if (!slot) continue;
    for (const scene::Variant& variant : slot->variants)
      if (variant.name == part.variant)
        nodes.push_back(
            {part.slot + " " + part.variant, &variant.mesh, part.prototype_from_part,
             cut_of(scene.section && scene.section->cuts(part.slot), part.prototype_from_part.inverse(),
                    1 + static_cast<int>(slot - scene.slots.data()))});
  }
  return nodes.empty() ? "" : scene::encode_glb(nodes);
}

HttpResponse step_response(const std::vector<exchange::NamedCurve>& curves) {
  constexpr scene::CadLimits k_limits{.seconds = 20, .silent_seconds = 20, .memory_mb = 1024};
  namespace fs = std::filesystem;
  std::error_code none;
  std::string name = (fs::temp_directory_path(none) / "limn-lines-XXXXXX").string();
  if (!mkdtemp(name.data()))
    return error_response(k_http_unavailable, "expected room for a file, found the disk full or read-only.");
  const fs::path folder = name, file = folder / "lines.step";
  const Status written = scene::write_line_file(curves, file, exchange::CurveForm::polyline, k_limits);
  auto text = written ? read_file(file) : Result<std::string>(written.error());
  fs::remove_all(folder, none);
  return text ? uncached_response("model/step", std::move(*text))
              : error_response(k_http_unavailable, text.message());
}

}  // namespace

SessionFiles::SessionFiles(WorkerThread* worker)
    : worker_(worker),
      encoded_projectors_(std::make_shared<std::map<std::string, EncodedImage>>()),
      thumbnails_(std::make_shared<Thumbnails>()) {}

void SessionFiles::respond_from_worker(std::function<HttpResponse()> job, ResponseCallback respond) {
  if (!worker_->add_job([job = std::move(job), respond] { respond(job()); }))
    respond(error_response(k_http_unavailable, "too many pictures are asked for at once."));
}

void SessionFiles::send_projector_image(const std::string& path,
                                        const SessionUpdate* update,
                                        ResponseCallback respond) {
  const auto name = name_in(path, "/picture/projector/", ".jpg");
  std::size_t index = 0;
  const std::size_t count =
      update ? std::min(update->state.projectors.size(), update->projector_images.size()) : 0;
  while (name && index < count && update->state.projectors[index] != *name) ++index;
  if (!name || index >= count || update->projector_images[index].empty())
    return respond(
        error_response(k_http_not_found, "expected a projector of the state, found another name."));
  respond_from_worker(
      [cache = encoded_projectors_, name = *name, image = update->projector_images[index]] {
        EncodedImage& encoded = (*cache)[name];
        if (!encoded.jpeg || encoded.image.data != image.data) {
          const auto jpeg = device::encode_jpeg(image, k_projector_jpeg_quality);
          encoded = {image, std::make_shared<const std::string>(jpeg.begin(), jpeg.end())};
        }
        return uncached_response("image/jpeg", *encoded.jpeg);
      },
      std::move(respond));
}

void SessionFiles::send_step_curves(std::vector<exchange::NamedCurve> curves, ResponseCallback respond) {
  respond_from_worker([curves = std::move(curves)] { return step_response(curves); }, std::move(respond));
}

void SessionFiles::send_look_image(const std::string& path,
                                   const SessionUpdate* update,
                                   ResponseCallback respond) {
  const auto name = name_in(path, "/picture/look/", ".png");
  const auto is_look = [&] {
    const std::vector<std::string>& looks = update->state.looks;
    return std::find(looks.begin(), looks.end(), *name) != looks.end();
  };
  if (!name || !update || !is_look())
    return respond(error_response(k_http_not_found, "expected a look of the state, found another name."));
  respond_from_worker(
      [file = scene::kept_file(update->scene->folder, std::filesystem::path("looks") / (*name + ".png"))] {
        auto png = read_file(file);
        return png ? uncached_response("image/png", std::move(*png))
                   : error_response(k_http_not_found, "this look has no picture.");
      },
      std::move(respond));
}

void SessionFiles::send_look_assembly(const std::string& path,
                                      const SessionUpdate* update,
                                      ResponseCallback respond) {
  const auto name = name_in(path, "/look/", ".glb");
  const scene::Look* look = nullptr;
  if (name && update)
    for (const scene::Look& each : update->looks)
      if (each.name == *name) look = &each;
  if (!look)
    return respond(error_response(k_http_not_found, "expected a look of the state, found another name."));
  respond_from_worker(
      [scene = update->scene, look = *look] {
        const std::string bytes = look_assembly(*scene, look);
        return bytes.empty() ? error_response(k_http_not_found, "this look has no parts.")
                             : uncached_response("model/gltf-binary", bytes);
      },
      std::move(respond));
}

void SessionFiles::send_mesh(const std::string& path, const SessionUpdate* update, ResponseCallback respond) {
  constexpr std::string_view k_begin = "/glasses/part/";
  const bool is_prototype = path == "/glasses/prototype.glb";
  const auto slash = path.find('/', k_begin.size());
  const auto slot_name = is_prototype || slash == std::string::npos || !path.starts_with(k_begin)
                             ? std::nullopt
                             : decoded(std::string_view(path).substr(k_begin.size(), slash - k_begin.size()));
  const auto variant_name = slot_name ? name_in(path, path.substr(0, slash) + "/", ".glb") : std::nullopt;
  const scene::Mesh* mesh = nullptr;
  if (update && is_prototype && update->scene->prototype) mesh = &update->scene->prototype->mesh;
  if (const scene::Slot* slot = update && variant_name ? update->scene->find_slot(*slot_name) : nullptr)
    for (const scene::Variant& variant : slot->variants)
      if (variant.name == *variant_name) mesh = &variant.mesh;
  if (!mesh)
    return respond(error_response(
        k_http_not_found, "expected the prototype, or a slot and a variant of the state, found others."));
  respond_from_worker(
      [scene = update->scene, mesh] {
        const scene::GlbNode node{"mesh", mesh, Pose()};
        return uncached_response("model/gltf-binary", scene::encode_glb(std::span(&node, 1)));
      },
      std::move(respond));
}

void SessionFiles::send_variant_image(const std::string& path,
                                      const SessionUpdate* update,
                                      ResponseCallback respond) {
  constexpr std::string_view k_begin = "/picture/variant/";
  const auto slash = path.find('/', k_begin.size());
  const auto slot = slash == std::string::npos
                        ? std::nullopt
                        : decoded(std::string_view(path).substr(k_begin.size(), slash - k_begin.size()));
  const auto variant = name_in(path, path.substr(0, slash) + "/", ".png");
  if (!slot || !variant || !update)
    return respond(
        error_response(k_http_not_found, "expected a slot and a variant of the state, found others."));
  respond_from_worker(
      [thumbnails = thumbnails_, scene = update->scene, slot = *slot, variant = *variant] {
        const auto png = thumbnails->png(scene, slot, variant);
        return png ? uncached_response("image/png", **png) : error_response(k_http_not_found, png.message());
      },
      std::move(respond));
}

}  // namespace limn::remote
