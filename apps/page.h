#pragma once

#include <string>

namespace limn::apps {

/// Text as HTML shows it.
std::string escaped(const std::string& text);

}  // namespace limn::apps
