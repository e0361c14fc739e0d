#include "apps/recheck.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/capture.h"
#include "apps/devices.h"
#include "apps/picture_writer.h"
#include "apps/plan.h"
#include "apps/wizard/device_stage.h"
#include "apps/world_markers.h"
#include "calib/captures.h"
#include "calib/observations.h"
#include "core/config.h"
#include "core/file.h"
#include "core/rig.h"
#include "device/desktop.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// A rig that foretells pixels better than this has not been asked outside its poses.
constexpr double k_least_rig_px = 0.05;
constexpr double k_pictures_a_second = 10;  // shown, settled, photographed by an ordinary camera
constexpr double k_most_seconds = 15;
constexpr double k_guard_s = 0.001;                       // beyond a measured latency
constexpr const char* k_code_in_place = "gray";
const calib::CodeOptions k_sparse{.inverses = false};
constexpr const char* k_any_board = "charuco:11x8:25mm";  // of a rig that does not tell its own

double rounded(double v) { return std::round(v * 1e4) / 1e4; }

// As many as fit into the time that a recheck may take, at least one.
size_t affordable_poses(const Plan& plan, const Rig& rig) {
  int pictures = 0;
  for (const Imager& projector : rig.projectors) {
    if (const auto patterns =
            calib::Patterns::create(plan.code, projector.width, projector.height, plan.code_options))
      pictures += patterns->count();
  }
  return static_cast<size_t>(std::max(1.0, k_most_seconds * k_pictures_a_second / std::max(1, pictures)));
}

Json provenance_of(const Rig& rig) {
  const Json provenance = Json::parse(rig.provenance_json, nullptr, false);
  return provenance.is_object() ? provenance : Json::object();
}

// The board that it was calibrated with, should that be in view.
Result<calib::Board> board_of(const Rig& rig) {
  const Json provenance = provenance_of(rig);
  const auto text = provenance.find("board");
  const bool is_told = text != provenance.end() && text->is_string();
  return calib::Board::parse(is_told ? text->get<std::string>() : k_any_board);
}

Status captured_virtually(const RecheckCommand& command, const fs::path& folder) {
  LIMN_TRY(Plan plan, load_plan(command.plan));
  plan.code_options.inverses = false;  // the rig is all but known: sparse pictures, more devices in the time
  LIMN_TRY(sim::World world, sim::load_world(plan.world, marker_picture));
  if (command.prototype && !world.scene)
    return error("{}: scene: expected a prototype for --prototype, found none.", plan.world.string());
  plan.world_from_board.resize(std::min(plan.world_from_board.size(), affordable_poses(plan, world.rig)));
  sim::VirtualRig rig(std::move(world));
  if (!command.prototype) return capture_virtually(plan, &rig, folder);
  return capture_prototype(plan, {rig.world().world_from_prototype}, &rig, folder);
}

Status captured_by_devices(const RecheckCommand& command, const fs::path& folder) {
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  LIMN_TRY(const Devices all, load_devices(command.devices));
  LIMN_TRY(const Devices named, matched(all, rig));
  const Result<device::Desktop> desktop = device::Desktop::open();
  LIMN_TRY(DeviceStage::Devices devices, opened_devices(named, desktop));
  LIMN_TRY(const calib::Board board, board_of(rig));
  const calib::Captures captures =
      calib::plan_captures(folder, captured_devices(devices.cameras), captured_devices(devices.projectors),
                           board, "gray", {.inverses = false});
  DeviceStage stage(std::move(devices), board, nullptr);
  PictureWriter writer;
  return captured_once(captures, rig, stage.surroundings(&writer));
}

// The captures folder that the command names or makes.
Result<fs::path> captured(const RecheckCommand& command) {
  const int ways = !command.plan.empty() + !command.captures.empty() + !command.devices.empty();
  if (ways != 1)
    return usage_error("expected one of a captures folder, --plan and --devices, found {}.",
                       ways == 0 ? "none" : "several");
  if (command.prototype && command.plan.empty())
    return usage_error("--prototype: expected --plan; captures and --devices need no such word.");
  if (!command.captures.empty()) return command.captures;
  const fs::path folder = command.out / "captures";
  LIMN_TRY_STATUS(command.plan.empty() ? captured_by_devices(command, folder)
                                       : captured_virtually(command, folder));
  return folder;
}

// How well the rig foretells, and how its board is bent, as its solve noted them.
calib::RecheckOptions options_for(const Rig& rig, const calib::Board& board) {
  calib::RecheckOptions options;
  const Json provenance = provenance_of(rig);
  if (const auto held_out = provenance.find("held_out_px");
      held_out != provenance.end() && held_out->is_number())
    options.rig_px = std::max(k_least_rig_px, held_out->get<double>() / std::sqrt(2.0));
  const auto bend = provenance.find("board_bend_mm");
  if (bend != provenance.end() && provenance.value("board", Json()) == board.text() && bend->is_array() &&
      bend->size() == 2 && bend->at(0).is_number() && bend->at(1).is_number())
    options.bend_m = 1e-3 * Eigen::Vector2d(bend->at(0).get<double>(), bend->at(1).get<double>());
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
  const calib::Recheck& result = checked.result;
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
          {"pictures", checked.pictures}};
}

// The rig with its first candidate's pose re-solved. What was known about errors is no longer so.
Rig repaired(const calib::Recheck& result) {
  Rig rig = result.rig;
  if (result.candidates.empty()) return rig;
  Json provenance = provenance_of(rig);
  const calib::Move& move = result.candidates.front();
  provenance["re_solved"] = {{"made_by", "limn recheck"},
                             {"device", move.device},
                             {"degrees", rounded(move.degrees)},
                             {"mm", rounded(move.mm)}};
  rig.provenance_json = provenance.dump();
  rig.covariance_json.clear();
  return rig;
}

Status write_rig(const calib::Recheck& result, const RecheckCommand& command) {
  LIMN_TRY_STATUS(save_rig(result.rig, command.out));
  const fs::path folder = fs::is_directory(command.rig) ? command.rig : command.rig.parent_path();
  const fs::path response = folder / "response.json";
  std::error_code ignored;
  if (!fs::exists(response, ignored) || fs::equivalent(folder, command.out, ignored)) return {};
  LIMN_TRY(const std::string content, read_file(response));
  return write_file(command.out / "response.json", content);
}

int shown_pictures(const calib::Captures& captures) {
  int pictures = 0;
  for (const calib::Patterns& patterns : captures.patterns) pictures += patterns.count();
  return pictures * static_cast<int>(captures.poses.size());
}

std::string sentence(const calib::Recheck& result) {
  using calib::RecheckVerdict;
  if (result.verdict == RecheckVerdict::sound) return "sound: nothing has moved";
  if (result.verdict == RecheckVerdict::unexplained)
    return "no move of one device explains what is seen: several have moved, or a lens was turned";
  std::string names;
  for (const calib::Move& move : result.candidates) names += (names.empty() ? "" : " or ") + move.device;
  if (result.verdict == RecheckVerdict::nudged) return names + " has moved";
  return names + " has moved relative to the other; a board that stands still (--still) tells which";
}

void print_table(const Rechecked& checked) {
  const calib::Recheck& result = checked.result;
  fmt::print("{:<14} {:>12} {:>10} {:>10}\n", "device", "observations", "before px", "after px");
  for (const calib::CheckedDevice& device : result.devices) {
    if (device.observations == 0)
      fmt::print("{:<14} {:>12}\n", device.name, "not seen");
    else
      fmt::print("{:<14} {:>12} {:>10.3f} {:>10.3f}\n", device.name, device.observations, device.before_px,
                 device.after_px);
  }
  for (const calib::Move& move : result.candidates)
    fmt::print("{}: turned {:.3f} ± {:.3f}°, moved {:.2f} ± {:.2f} mm: {:.2f} px, {:.2f} mm on the board\n",
               move.device, move.degrees, move.degrees_stddev, move.mm, move.mm_stddev, move.px,
               move.mm_on_board);
  if (result.board_moved) fmt::print("the board has been touched: --still is not used\n");
  fmt::print("{} ({} pictures, {:.1f} s at {:.0f} a second)\n", sentence(result), checked.pictures,
             checked.pictures / k_pictures_a_second, k_pictures_a_second);
}

struct Checked {
  Rechecked rechecked;
  std::string json;
};

// What captures say of a rig; into recheck.json in `out`, and the rig of the result is the repaired one.
Result<Checked> check(const Rig& rig,
                      const fs::path& folder,
                      const fs::path& still,
                      const fs::path& out,
                      const std::function<bool()>& goes_on = {}) {
  LIMN_TRY(const calib::Captures captures, calib::load_captures(folder));
  LIMN_TRY(const calib::Observed observed, calib::observe(captures, {}, goes_on));
  const std::vector<std::string>& poses = observed.observations.poses;
  calib::RecheckOptions options = options_for(rig, captures.board);
  options.goes_on = goes_on;
  if (!still.empty()) {
    LIMN_TRY(options.still_boards, still_boards(still, poses));
  }
  Checked checked;
  LIMN_TRY(checked.rechecked.result, calib::recheck(rig, observed.observations, options));
  checked.rechecked.pictures = shown_pictures(captures);
  checked.json = json_of(checked.rechecked, poses).dump(2) + "\n";
  checked.rechecked.result.rig = repaired(checked.rechecked.result);
  LIMN_TRY_STATUS(make_folder(out));
  LIMN_TRY_STATUS(write_file(out / "recheck.json", checked.json));
  return checked;
}

Result<Checked> check(const RecheckCommand& command) {
  LIMN_TRY(const Rig rig, load_rig(command.rig));
  LIMN_TRY(const fs::path folder, captured(command));
  LIMN_TRY(Checked checked, check(rig, folder, command.still, command.out));
  if (checked.rechecked.result.verdict != calib::RecheckVerdict::unexplained)
    LIMN_TRY_STATUS(write_rig(checked.rechecked.result, command));
  return checked;
}

Status told(const calib::Recheck& result) {
  if (result.verdict != calib::RecheckVerdict::unexplained) return {};
  return error("{}. Calibrate again (limn solve).", sentence(result));
}

}  // namespace

Status captured_once(const calib::Captures& captures, const Rig& rig, const Surroundings& around) {
  LIMN_TRY_STATUS(calib::begin_captures(captures));
  const Json latencies_ms = provenance_of(rig).value("display_latency_ms", Json::object());
  for (std::size_t i = 0; i < captures.projectors.size(); ++i)
    if (const auto ms = latencies_ms.find(captures.projectors[i].name);
        ms != latencies_ms.end() && ms->is_number())
      around.use_latency(static_cast<int>(i), 1e-3 * ms->get<double>() + k_guard_s);
  const Status taken = calib::capture_pose(captures, 0, around.stage);
  const Status written = around.written();
  return taken ? written : taken;
}

int recheck_pictures(const Rig& rig) {
  int pictures = 0;
  for (const Imager& projector : rig.projectors)
    if (const auto patterns =
            calib::Patterns::create(k_code_in_place, projector.width, projector.height, k_sparse))
      pictures += patterns->count();
  return pictures;
}

Result<Rechecked> rechecked_in_place(const Rig& rig,
                                     const Surroundings& around,
                                     const fs::path& folder,
                                     const std::function<bool()>& goes_on) {
  LIMN_TRY(const calib::Board board, board_of(rig));
  const auto devices = [](const std::vector<Imager>& imagers) {
    std::vector<calib::CapturedDevice> list;
    for (const Imager& imager : imagers) list.push_back({imager.name, imager.width, imager.height});
    return list;
  };
  const fs::path captures = folder / "captures";
  LIMN_TRY_STATUS(captured_once(calib::plan_captures(captures, devices(rig.cameras), devices(rig.projectors),
                                                     board, k_code_in_place, k_sparse),
                                rig, around));
  LIMN_TRY(Checked checked, check(rig, captures, {}, folder, goes_on));
  LIMN_TRY_STATUS(told(checked.rechecked.result));
  LIMN_TRY_STATUS(save_rig(checked.rechecked.result.rig, folder));
  if (!rig.responses.empty() || !rig.camera_responses.empty())
    LIMN_TRY_STATUS(save_responses({rig.responses, rig.camera_responses}, {}, folder));
  return std::move(checked.rechecked);
}

Result<Rechecked> rechecked(const RecheckCommand& command) {
  LIMN_TRY(Checked checked, check(command));
  LIMN_TRY_STATUS(told(checked.rechecked.result));
  return checked.rechecked;
}

Status run_recheck(const RecheckCommand& command) {
  LIMN_TRY(const Checked checked, check(command));
  if (command.json)
    fmt::print("{}", checked.json);
  else
    print_table(checked.rechecked);
  LIMN_TRY_STATUS(told(checked.rechecked.result));
  if (!command.json) fmt::print("rig in {}\n", command.out.string());
  return {};
}

}  // namespace limn::apps
