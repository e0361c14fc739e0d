#include "wizard/capture/rig_recheck.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "calib/board_print.h"
#include "calib/observations.h"
#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Minimum of the rig's own error, px: a smaller held-out error holds only near the calibration's poses.
constexpr double k_least_rig_px = 0.05;
constexpr double k_guard_s = 0.001;  // added to a measured latency
constexpr auto k_code_in_place = calib::PatternCode::gray;
const calib::CodeOptions k_sparse{.inverses = false};
constexpr const char* k_any_board = "charuco:11x8:25mm";  // for a rig whose provenance names no board

double rounded(double v) { return std::round(v * 1e4) / 1e4; }

Json provenance_of(const Rig& rig) {
  const Json provenance = Json::parse(rig.provenance_json, nullptr, false);
  return provenance.is_object() ? provenance : Json::object();
}

// Adds the bend, the twist and the print of the board as its solve stored them.
void add_board(const Json& provenance, calib::RigCheckOptions* options) {
  const auto numbers_in_mm = [&](const char* key, std::size_t count) {
    std::vector<double> metres;
    const auto list = provenance.find(key);
    if (list == provenance.end() || !list->is_array() || list->size() != count) return metres;
    for (const Json& number : *list)
      if (number.is_number()) metres.push_back(1e-3 * number.get<double>());
    if (metres.size() != count) metres.clear();
    return metres;
  };
  if (const auto bend = numbers_in_mm("board_bend_mm", 2); !bend.empty())
    options->bend_m = {bend[0], bend[1]};
  const auto print = numbers_in_mm("board_print_mm", calib::k_print_modes);
  options->print = Eigen::Map<const Eigen::VectorXd>(print.data(), static_cast<Eigen::Index>(print.size()));
  if (const auto twist = provenance.find("board_twist_mm"); twist != provenance.end() && twist->is_number())
    options->twist_m = 1e-3 * twist->get<double>();
}

// The rig's own error and the shape of its board, as its solve stored them.
calib::RigCheckOptions options_for(const Rig& rig, const calib::Board& board) {
  calib::RigCheckOptions options;
  const Json provenance = provenance_of(rig);
  if (const auto held_out = provenance.find("held_out_px");
      held_out != provenance.end() && held_out->is_number())
    options.rig_px = std::max(k_least_rig_px, held_out->get<double>() / std::sqrt(2.0));
  if (provenance.value("board", Json()) == board.text()) add_board(provenance, &options);
  return options;
}

Result<std::vector<std::optional<Pose>>> still_boards(const fs::path& path,
                                                      const std::vector<std::string>& poses) {
  std::vector<std::optional<Pose>> boards(poses.size());
  LIMN_TRY(const Config config, Config::load(path, "limn.recheck/1"));
  const ConfigNode places = config.root().at("boards");
  bool any = false;
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto place = places.find(poses[i]);
    if (!place) continue;
    boards[i] = place->at("world_from_board").pose();
    any = true;
  }
  LIMN_TRY_STATUS(config.status());
  if (!any)
    return error("{}: boards: expected one of the captures' poses ({}), found none.", path.string(),
                 fmt::join(poses, ", "));
  return boards;
}

Json json_of(const calib::Move& move) {
  return {{"device", move.device},
          {"degrees", rounded(move.degrees)},
          {"degrees_stddev", rounded(move.degrees_stddev)},
          {"mm", rounded(move.mm)},
          {"mm_stddev", rounded(move.mm_stddev)},
          {"px", rounded(move.px)},
          {"mm_on_board", rounded(move.mm_on_board)},
          {"imager_from_world", to_json(move.imager_from_world)}};
}

Json json_of(const Rechecked& checked, const std::vector<std::string>& poses) {
  const calib::RigCheck& result = checked.result;
  Json devices = Json::array(), candidates = Json::array(), boards = Json::object();
  for (const calib::CheckedDevice& device : result.devices)
    devices.push_back({{"name", device.name},
                       {"observations", device.observations},
                       {"before_px", rounded(device.before_px)},
                       {"after_px", rounded(device.after_px)}});
  for (const calib::Move& move : result.candidates) candidates.push_back(json_of(move));
  for (size_t i = 0; i < poses.size(); ++i) {
    if (const auto& pose = result.world_from_board[i])
      boards[poses[i]] = {{"world_from_board", to_json(*pose)}};
  }
  return {{"schema", "limn.recheck/1"},        {"verdict", calib::to_text(result.verdict)},
          {"candidates", candidates},          {"devices", devices},
          {"board_moved", result.board_moved}, {"boards", boards},
          {"pictures", checked.images}};
}

// The checked rig, whose first candidate has a re-solved pose, with a note of it in its provenance. Its
// stored covariance is removed, because it is no longer right.
Rig repaired(const calib::RigCheck& result) {
  Rig rig = result.rig;
  if (result.candidates.empty()) return rig;
  Json provenance = provenance_of(rig);
  const calib::Move& move = result.candidates.front();
  provenance["re_solved"] = {{"made_by", "limn recheck"},
                             {"device", move.device},
                             {"degrees", rounded(move.degrees)},
                             {"mm", rounded(move.mm)}};
  rig.provenance_json = json_text(provenance);
  rig.covariance_json.clear();
  return rig;
}

int shown_images(const calib::CaptureSet& captures) {
  int images = 0;
  for (const calib::Patterns& patterns : captures.patterns) images += patterns.count();
  return images * static_cast<int>(captures.poses.size());
}

}  // namespace

Result<calib::Board> calibration_board(const Rig& rig) {
  const Json provenance = provenance_of(rig);
  const auto text = provenance.find("board");
  const bool is_stated = text != provenance.end() && text->is_string();
  return calib::Board::parse(is_stated ? text->get<std::string>() : k_any_board);
}

std::string recheck_sentence(const calib::RigCheck& result) {
  using calib::RigVerdict;
  if (result.verdict == RigVerdict::sound) return "sound: nothing has moved";
  if (result.verdict == RigVerdict::unexplained)
    return "no move of one device explains the observations: several devices have moved, or a lens was "
           "turned";
  std::string names;
  for (const calib::Move& move : result.candidates) names += (names.empty() ? "" : " or ") + move.device;
  if (result.verdict == RigVerdict::moved) return names + " has moved";
  return names + " has moved relative to the other; a board that stands still (--still) shows which one";
}

Status check_explained(const calib::RigCheck& result) {
  if (result.verdict != calib::RigVerdict::unexplained) return {};
  return error("{}. Calibrate again (limn solve).", recheck_sentence(result));
}

Result<CheckedRig> recheck_rig(const Rig& rig,
                               const fs::path& folder,
                               const fs::path& still,
                               const fs::path& out,
                               const std::function<bool()>& should_continue) {
  LIMN_TRY(const calib::CaptureSet captures, calib::load_captures(folder));
  LIMN_TRY(const calib::Observed observed, calib::observe(captures, {}, should_continue));
  const std::vector<std::string>& poses = observed.observations.poses;
  calib::RigCheckOptions options = options_for(rig, captures.board);
  options.should_continue = should_continue;
  if (!still.empty()) {
    LIMN_TRY(options.still_boards, still_boards(still, poses));
  }
  CheckedRig checked;
  LIMN_TRY(checked.rechecked.result, calib::check_rig(rig, observed.observations, options));
  checked.rechecked.images = shown_images(captures);
  checked.json = json_text(json_of(checked.rechecked, poses), 2) + "\n";
  checked.rechecked.result.rig = repaired(checked.rechecked.result);
  LIMN_TRY_STATUS(make_folder(out));
  LIMN_TRY_STATUS(write_file(out / "recheck.json", checked.json));
  return checked;
}

Status capture_once(const calib::CaptureSet& captures, const Rig& rig, const WizardBackend& backend) {
  LIMN_TRY_STATUS(calib::begin_captures(captures));
  const Json latencies_ms = provenance_of(rig).value("display_latency_ms", Json::object());
  for (std::size_t i = 0; i < captures.projectors.size(); ++i)
    if (const auto ms = latencies_ms.find(captures.projectors[i].name);
        ms != latencies_ms.end() && ms->is_number())
      backend.use_latency(static_cast<int>(i), 1e-3 * ms->get<double>() + k_guard_s);
  const Status taken = calib::capture_pose(captures, 0, backend.capture);
  const Status written = backend.wait_for_files();
  return taken ? written : taken;
}

int recheck_images(const Rig& rig) {
  int images = 0;
  for (const Imager& projector : rig.projectors)
    if (const auto patterns =
            calib::Patterns::create(k_code_in_place, projector.width, projector.height, k_sparse))
      images += patterns->count();
  return images;
}

Result<Rechecked> recheck_in_place(const Rig& rig,
                                   const WizardBackend& backend,
                                   const fs::path& folder,
                                   const std::function<bool()>& should_continue) {
  LIMN_TRY(const calib::Board board, calibration_board(rig));
  const auto devices = [](const std::vector<Imager>& imagers) {
    std::vector<calib::CapturedDevice> list;
    for (const Imager& imager : imagers)
      list.push_back({imager.name, imager.width, imager.height, imager.sees});
    return list;
  };
  const fs::path captures = folder / "captures";
  LIMN_TRY_STATUS(capture_once(calib::plan_captures(captures, devices(rig.cameras), devices(rig.projectors),
                                                    board, k_code_in_place, k_sparse),
                               rig, backend));
  LIMN_TRY(CheckedRig checked, recheck_rig(rig, captures, {}, folder, should_continue));
  LIMN_TRY_STATUS(check_explained(checked.rechecked.result));
  LIMN_TRY_STATUS(save_rig(checked.rechecked.result.rig, folder));
  if (!rig.responses.empty() || !rig.camera_responses.empty())
    LIMN_TRY_STATUS(save_responses({rig.responses, rig.camera_responses}, {}, folder));
  return std::move(checked.rechecked);
}

}  // namespace limn::wizard
