#include "apps/plan.h"

#include "calib/patterns.h"
#include "core/config.h"

namespace limn::apps {

Result<Plan> load_plan(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, "limn.plan/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "world", "board", "code", "response", "world_from_board"});
  Plan plan;
  plan.world = config.folder() / root.at("world").text();
  const ConfigNode board = root.at("board");
  auto parsed = calib::Board::parse(board.text());
  if (parsed) plan.board = *parsed;
  if (!parsed) board.problem(parsed.message());
  plan.code = root.at("code").choice(calib::pattern_codes());
  if (const auto response = root.find("response")) plan.response = response->boolean();
  const ConfigNode poses = root.at("world_from_board");
  for (const ConfigNode& pose : poses.items()) plan.world_from_board.push_back(pose.pose());
  if (plan.world_from_board.empty()) poses.problem("expected at least one pose of the board, found none.");
  LIMN_TRY_STATUS(config.status());
  return plan;
}

}  // namespace limn::apps
