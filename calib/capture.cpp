#include "calib/capture.h"

#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"

namespace limn::calib {
namespace {

nlohmann::ordered_json devices_json(const std::vector<CapturedDevice>& devices) {
  auto list = nlohmann::ordered_json::array();
  for (const CapturedDevice& device : devices) {
    list.push_back({{"name", device.name}, {"size", {device.width, device.height}}});
    if (device.sees != Spectrum::visible) list.back()["sees"] = k_spectra.text(device.sees);
  }
  return list;
}

// patterns.json for the first projector's size, patterns-NAME.json for projectors of other sizes.
std::string patterns_file(const CaptureSet& plan, size_t projector) {
  if (plan.patterns[projector] == plan.patterns[0]) return "patterns.json";
  return "patterns-" + plan.projectors[projector].name + ".json";
}

Status capture_image(
    const CaptureSet& plan, int pose, int projector, int pattern, const CaptureBackend& backend) {
  for (int camera = 0; camera < static_cast<int>(plan.cameras.size()); ++camera) {
    const CapturedDevice& device = plan.cameras[static_cast<size_t>(camera)];
    LIMN_TRY(const cv::Mat image, backend.grab(camera));
    if (image.cols != device.width || image.rows != device.height)
      return error("{}: expected images of {}x{}, the camera gave {}x{}. Has its mode changed?", device.name,
                   device.width, device.height, image.cols, image.rows);
    LIMN_TRY_STATUS(backend.store(image_path(plan, pose, projector, camera, pattern), image));
  }
  return {};
}

void add_board_measured(const BoardMeasured& measured, nlohmann::ordered_json* json) {
  (*json)["board_measured_mm"] = {1e3 * measured.width_m, 1e3 * measured.height_m};
  (*json)["board_measured_stddev_mm"] = 1e3 * measured.stddev_m;
}

}  // namespace

Status store_image_now(const std::filesystem::path& path, const cv::Mat& image) {
  return write_png(path, image, {.compression = 1});
}

Result<std::optional<BoardMeasured>> stored_board_measured(const std::filesystem::path& captures) {
  const auto path = captures / "capture.json";
  if (!std::filesystem::exists(path)) return std::optional<BoardMeasured>();
  LIMN_TRY(const Config config, Config::load(path, "limn.capture/1"));
  const auto measured = read_board_measured(config.root());
  LIMN_TRY_STATUS(config.status());
  return measured;
}

Status store_board_measured(const std::filesystem::path& captures, const BoardMeasured& measured) {
  const auto path = captures / "capture.json";
  LIMN_TRY(const std::string text, read_file(path));
  auto json = nlohmann::ordered_json::parse(text, nullptr, false, true);
  if (!json.is_object())
    return error("{}: expected a capture file (limn.capture/1), found other text.", path.string());
  add_board_measured(measured, &json);
  return write_file(path, json_text(json, 2) + "\n");
}

Status begin_captures(const CaptureSet& plan) {
  const auto path = plan.folder / "capture.json";
  if (std::filesystem::exists(path))
    return error("{}: this folder already holds captures. Choose another folder, or remove this one.",
                 path.string());
  LIMN_TRY_STATUS(make_folder(plan.folder));
  nlohmann::ordered_json projectors = devices_json(plan.projectors);
  for (size_t i = 0; i < plan.projectors.size(); ++i) {
    const std::string file = patterns_file(plan, i);
    LIMN_TRY_STATUS(save_patterns(plan.patterns[i], plan.folder / file));
    if (file != "patterns.json") projectors[i]["patterns"] = file;
  }
  nlohmann::ordered_json json = {{"schema", "limn.capture/1"},
                                 {"cameras", devices_json(plan.cameras)},
                                 {"projectors", projectors},
                                 {"board", plan.board.text()},
                                 {"patterns", "patterns.json"}};
  if (plan.board_measured) add_board_measured(*plan.board_measured, &json);
  return write_file(path, json_text(json, 2) + "\n");
}

Status capture_pose(const CaptureSet& plan, int pose, const CaptureBackend& backend) {
  const int projectors = static_cast<int>(plan.projectors.size()),
            cameras = static_cast<int>(plan.cameras.size());
  int done = 0, total = 0;
  for (const Patterns& patterns : plan.patterns) total += patterns.count() * cameras;
  for (int projector = 0; projector < projectors; ++projector) {
    const Patterns& patterns = plan.patterns[static_cast<size_t>(projector)];
    for (int camera = 0; camera < cameras; ++camera)
      LIMN_TRY_STATUS(make_folder(image_path(plan, pose, projector, camera, 0).parent_path()));
    for (int pattern = 0; pattern < patterns.count(); ++pattern) {
      LIMN_TRY_STATUS(backend.show(projector, patterns.image(pattern)));
      LIMN_TRY_STATUS(capture_image(plan, pose, projector, pattern, backend));
      done += cameras;
      if (backend.report_progress) backend.report_progress(done, total);
    }
  }
  return {};
}

}  // namespace limn::calib
