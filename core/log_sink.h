#pragma once

#include <functional>
#include <string>

#include "core/log.h"

namespace limn {

using LogSink = std::function<void(LogLevel, const std::string&)>;

/// Lines go to `sink` instead of stderr; an empty one means stderr again. Several threads may call it at
/// once, also just after it was replaced. Progress is not shown while there is a sink.
void set_log_sink(LogSink sink);

}  // namespace limn
