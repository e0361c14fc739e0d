#pragma once

#include <optional>
#include <string>
#include <vector>

namespace limn::apps {

/// The lists that the completions of the shells ask for at completion time: `families`, `rooms`, `slots`
/// (SLOT=VARIANT of the scene or world that `words`, the command line so far, names), `benches`. nullopt: no
/// such list. What cannot be read is left out.
std::optional<std::vector<std::string>> completion_list(const std::string& list,
                                                        const std::vector<std::string>& words);

}  // namespace limn::apps
