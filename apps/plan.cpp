#include "apps/plan.h"

#include "calib/patterns.h"
#include "core/config.h"

namespace limn::apps {
namespace {

void read_code(const ConfigNode& root, Plan* plan) {
  const auto code = root.find("code");
  if (code) plan->code = code->choice(calib::pattern_codes());
  const auto options = root.find("code_options");
  if (!options) return;
  options->only(calib::code_option_keys(plan->code));
  plan->code_options = calib::read_code_options(*options);
  constexpr int k_any_side = 64;  // the options' range does not depend on the projector
  const auto patterns = calib::Patterns::create(plan->code, k_any_side, k_any_side, plan->code_options);
  if (!patterns) options->problem(patterns.message());
}

}  // namespace

Result<Plan> load_plan(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.plan/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "world", "board", "code", "code_options", "response", "world_from_board"});
  Plan plan;
  plan.world = config.folder() / root.at("world").text();
  const ConfigNode board = root.at("board");
  auto parsed = calib::Board::parse(board.text());
  if (parsed) plan.board = *parsed;
  if (!parsed) board.problem(parsed.message());
  read_code(root, &plan);
  if (const auto response = root.find("response")) plan.response = response->boolean();
  const ConfigNode poses = root.at("world_from_board");
  for (const ConfigNode& pose : poses.items()) plan.world_from_board.push_back(pose.pose());
  if (plan.world_from_board.empty()) poses.problem("expected at least one pose of the board, found none.");
  LIMN_TRY_STATUS(config.status());
  return plan;
}

}  // namespace limn::apps
