#include "apps/bench.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace limn::apps {

std::span<const std::string_view> bench_names() {
  static constexpr std::array<std::string_view, 10> k_names = {
      "tracker", "id", "calib", "solve", "projector", "live", "prediction", "remote", "tablet", "room"};
  return k_names;
}

Status run_bench(const BenchOptions& options) {
  const auto names = bench_names();
  if (std::find(names.begin(), names.end(), options.name) == names.end())
    return usage_error("bench: expected {}, found '{}'.", fmt::join(names, ", "), options.name);
  std::error_code problem;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", problem);
  const auto program = self.parent_path() / "tests" / "bench" / (options.name + "_bench");
  if (problem || !std::filesystem::exists(program))
    return error(
        "bench {}: expected the program {}, found none. Build the target {}_bench (tracker and live need "
        "libapriltag-dev, see packages.txt); ./limn bench does so.",
        options.name, program.string(), options.name);
  std::vector<std::string> words = options.arguments;
  words.insert(words.begin(), program.string());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(program.c_str(), argv.data());
  return error("bench {}: cannot run {}: {}", options.name, program.string(), std::strerror(errno));
}

}  // namespace limn::apps
