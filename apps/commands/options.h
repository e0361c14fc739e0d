#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"
#include "wizard/measure/foreign_options.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace limn::apps {

struct RoomOptions;  // apps/room.h

/// Prints the error, if there is one. Returns the exit code: 0, 1 or (wrong usage) 2.
int report_result(const Status& status);

/// Adds an option that accepts one of these names and hands it to `keep`. `present`: the default in the help.
CLI::Option* add_option_of_names(CLI::App* command,
                                 const std::string& option,
                                 const std::vector<std::string>& names,
                                 const std::function<void(const std::string&)>& keep,
                                 const std::string& help,
                                 const std::optional<std::string>& present = {});

/// An option whose value is one of an enum's names.
template <class Enum, std::size_t Count>
CLI::Option* add_choice(CLI::App* command,
                        const std::string& option,
                        std::optional<Enum>* value,
                        const EnumNames<Enum, Count>& names,
                        const std::string& help) {
  const auto keep = [value, &names](const std::string& text) { *value = names.find(text); };
  return add_option_of_names(command, option, names.all(), keep, help);
}

/// The same; the help shows the present value as the default.
template <class Enum, std::size_t Count>
CLI::Option* add_choice(CLI::App* command,
                        const std::string& option,
                        Enum* value,
                        const EnumNames<Enum, Count>& names,
                        const std::string& help) {
  const auto keep = [value, &names](const std::string& text) { *value = names.find(text).value(); };
  return add_option_of_names(command, option, names.all(), keep, help, names.text(*value));
}

/// The options of captures that another program took; --poses is the caller's. They live in `options`.
void add_foreign_options(CLI::App* command, wizard::ForeignOptions* options);
/// --board-measured.
void add_board_measured(CLI::App* command, std::string* text);
/// How a command enters a room, beside the room's name.
void add_room_options(CLI::App* command, RoomOptions* options);
/// --room of commands with a devices file, and add_room_options().
void add_room_of_devices(CLI::App* command, RoomOptions* options);

}  // namespace limn::apps
