#include "apps/commands/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "apps/room.h"
#include "core/log_error.h"
#include "core/names.h"

namespace limn::apps {
namespace {

// Accepts one of these names.
CLI::Validator one_of(const std::vector<std::string>& names) {
  const auto problem = [names](const std::string& text) {
    const bool is_one = std::find(names.begin(), names.end(), text) != names.end();
    return is_one ? std::string() : fmt::format("expected one of {}, found '{}'.", joined_names(names), text);
  };
  return {problem, fmt::format("{{{}}}", fmt::join(names, ","))};
}

}  // namespace

int report_result(const Status& status) {
  if (status) return 0;
  log_error_line("limn: " + status.message());
  return status.error().wrong_usage ? 2 : 1;
}

CLI::Option* add_option_of_names(CLI::App* command,
                                 const std::string& option,
                                 const std::vector<std::string>& names,
                                 const std::function<void(const std::string&)>& keep,
                                 const std::string& help,
                                 const std::optional<std::string>& present) {
  CLI::Option* added = command->add_option_function<std::string>(option, keep, help)->check(one_of(names));
  return present ? added->default_str(*present) : added;
}

void add_foreign_options(CLI::App* command, wizard::ForeignOptions* options) {
  add_choice(
      command, "--import", &options->import_format, wizard::k_import_formats,
      "Read captures of another program: opencv-gray, Gray code in any order; phase, phase-shifted waves as "
      "--steps, --periods, --cue, --wave and --order describe");
  command
      ->add_option("--projector", options->projector,
                   "With --import: size of the projector in pixels, such as 1024x768")
      ->type_name("WIDTHxHEIGHT");
  command
      ->add_option(
          "--board", options->board,
          "With --import or --cameras-only: board, such as chessboard:9x7:75mm (counted in inner corners), "
          "charuco:11x8:25mm, circles:11x7:20mm or acircles:4x11:20mm")
      ->type_name("BOARD");
  command
      ->add_option_function<std::vector<std::string>>(
          "--shots",
          [options](const std::vector<std::string>& patterns) {
            options->shots = fmt::format("{}", fmt::join(patterns, ","));
          },
          "With --import: name pattern of the images; for several cameras one for each, separated by commas, "
          "such as 'left_*.png,right_*.png' or camera0='left_*',camera1='right_*'")
      ->type_name("PATTERN")
      ->delimiter(',')
      ->default_str(options->shots);
  command
      ->add_option(
          "--order", options->order,
          "With --import: what is known of the images' order, words separated by commas: white-first, "
          "black-first, "
          "white-last, no-white; inverse-second, inverse-first, inverses-behind, inverses-before, "
          "no-inverses; "
          "columns-first, rows-first, columns-only; widest-first, finest-first. The rest is found in the "
          "images")
      ->type_name("WORDS");
  command
      ->add_option(
          "--step", options->step_px,
          "With --import: width of the narrowest stripes in projector pixels (without it: by the number "
          "of images)")
      ->check(CLI::Range(1, 16));
  command->add_option("--steps", options->steps, "With --import phase: images of one wave")
      ->capture_default_str();
  command
      ->add_option("--periods", options->periods,
                   "With --import phase: lengths of the waves in projector pixels, longest first, such as "
                   "1024,128,16; the first covers the projector unless there is a cue")
      ->delimiter(',');
  command
      ->add_option("--row-periods", options->row_periods,
                   "With --import phase: lengths of the waves along the rows (without it: as the columns')")
      ->delimiter(',');
  command->add_flag(
      "--cue", options->is_cued,
      "With --import phase: before each axis's waves, images of a Gray code number the waves of the "
      "first period; with --order inverse-second each is followed by its inverse");
  add_choice(command, "--wave", &options->wave, calib::k_wave_forms,
             "With --import phase: form of the waves, value = wave(2 pi (x / period - step / steps)): cos, "
             "sin, -cos "
             "or -sin (--wave=-sin)");
  command->add_flag("--backward", options->is_backward,
                    "With --import phase: the steps run the other way, + step / steps");
}

void add_board_measured(CLI::App* command, std::string* text) {
  command
      ->add_option(
          "--board-measured", *text,
          "Measured size of the printed board, from its first to its last inner corner, across and down, "
          "with "
          "the "
          "uncertainty in mm: 225.2x149.9mm:0.05 (0.1 when absent). The print's errors are then solved, too")
      ->type_name("WIDTHxHEIGHTmm");
}

void add_room_options(CLI::App* command, RoomOptions* options) {
  command
      ->add_option("--name", options->name, "This machine's name in the room; without it the machine's own")
      ->type_name("NAME");
  command
      ->add_option("--peer", options->peers,
                   "Address of another machine of the room, for networks without multicast; may be repeated")
      ->type_name("ADDRESS");
  command
      ->add_option("--interface", options->interfaces,
                   "Network interface to use; may be repeated; without it all that work")
      ->type_name("NAME");
}

void add_room_of_devices(CLI::App* command, RoomOptions* options) {
  command
      ->add_option(
          "--room", options->room,
          "Name or folder of a room: devices with host in the devices file are at its other machines")
      ->type_name("ROOM");
  add_room_options(command, options);
}

}  // namespace limn::apps
