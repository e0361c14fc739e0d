#include "apps/bench.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace limn::apps {

Status run_bench(const BenchOptions& options) {
  constexpr std::array k_names = {"tracker", "id",         "calib",  "solve",  "projector",
                                  "live",    "prediction", "remote", "tablet", "room"};
  if (std::find(k_names.begin(), k_names.end(), options.name) == k_names.end())
    return usage_error("bench: expected {}, found '{}'.", fmt::join(k_names, ", "), options.name);
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
