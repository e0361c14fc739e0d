#include "wizard/capture/capture_plan.h"

#include "calib/capture_set.h"
#include "calib/code/patterns.h"
#include "core/config.h"
#include "core/photometric_response.h"

namespace limn::wizard {
namespace {

// Reads the code and its options. Returns the path of response.json; empty if the plan names none.
std::filesystem::path read_code(const Config& config, Plan* plan) {
  const ConfigNode root = config.root();
  const auto code = root.find("code");
  if (code) plan->code = calib::k_pattern_codes.read(*code);
  const auto options = root.find("code_options");
  if (!options) return {};
  options->only(calib::code_option_keys(plan->code));
  plan->code_options = calib::read_code_options(*options);
  constexpr int k_any_side = 64;  // the options' valid range does not depend on the projector's size
  const auto patterns = calib::Patterns::create(plan->code, k_any_side, k_any_side, plan->code_options);
  if (!patterns) options->problem(patterns.message());
  const auto response = options->find("response");
  if (response && options->find("gamma"))
    options->problem("expected either gamma or response, found both. Remove gamma.");
  return response ? config.folder() / response->text() : std::filesystem::path();
}

}  // namespace

Result<Plan> load_plan(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.plan/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "world", "board", "code", "code_options", "response", "world_from_board",
             "board_measured_mm", "board_measured_stddev_mm"});
  Plan plan;
  plan.world = config.folder() / root.at("world").text();
  const ConfigNode board = root.at("board");
  auto parsed = calib::Board::parse(board.text());
  if (parsed) plan.board = *parsed;
  if (!parsed) board.problem(parsed.message());
  plan.board_measured = calib::read_board_measured(root);
  const std::filesystem::path response_json = read_code(config, &plan);
  if (const auto response = root.find("response")) plan.response = response->boolean();
  const ConfigNode poses = root.at("world_from_board");
  for (const ConfigNode& pose : poses.items()) plan.world_from_board.push_back(pose.pose());
  if (plan.world_from_board.empty()) poses.problem("expected at least one pose of the board, found none.");
  LIMN_TRY_STATUS(config.status());
  if (response_json.empty()) return plan;
  LIMN_TRY(RigResponses responses, load_responses(response_json));
  plan.responses = std::move(responses.projectors);
  if (plan.responses.empty())
    return error("{}: projectors: expected the curves of the plan's projectors, found none. Measure them.",
                 response_json.string());
  return plan;
}

}  // namespace limn::wizard
