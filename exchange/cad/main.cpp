// limn-cad: reads a STEP or IGES file with OpenCASCADE and writes its surfaces as GLB; reads and writes
// curves. It is a program of its own, because OpenCASCADE is large, and because it may crash or never end on
// a damaged file.
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <charconv>
#include <csignal>
#include <fstream>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>
#include <opencascade/Message.hxx>
#include <opencascade/Message_Messenger.hxx>
#include <opencascade/Standard_Failure.hxx>
#include <opencascade/Standard_OutOfMemory.hxx>
#include <opencascade/XCAFDoc_ShapeTool.hxx>
#include <optional>
#include <string>
#include <string_view>

#include "core/file.h"
#include "core/json_text.h"
#include "exchange/cad/cad_output.h"
#include "exchange/cad/read_cad_model.h"
#include "exchange/cad/read_curves.h"
#include "exchange/cad/write_curves.h"
#include "exchange/curves/curve_list.h"
#include "scene/files/source_file.h"

namespace limn::cad {
namespace {

constexpr const char* k_help =
    "Usage: limn-cad FILE --out OUT [--as part|parts|variants] [--chord-mm 0.1] [--angle-deg 20] [--json]\n"
    "                [--solid-seconds S] [--most-triangles N] [--progress] [--memory-mb N]\n"
    "       limn-cad FILE --curves [--edges] [--chord-mm 0.01]\n"
    "       limn-cad CURVES.json --out OUT.step\n\n"
    "Reads a STEP or IGES file and writes its surfaces as triangles (GLB, in metres). `limn` starts this\n"
    "program by itself wherever it reads such a file; `limn import cad --help` says more.\n"
    "With --curves it prints the file's curves as points (limn.curves/1); such a list becomes a STEP "
    "file.\n\n"
    "  --out OUT          File to write, such as door.glb; for parts and variants a folder\n"
    "  --as WORD          part: one file; parts: one for each solid at each place; variants: one for each "
    "solid\n"
    "  --chord-mm MM      Largest distance between surfaces and triangles\n"
    "  --angle-deg DEG    Largest angle between the normals at the ends of a triangle's side\n"
    "  --solid-seconds S  Take a larger chord error for a solid that needs more processor time (4)\n"
    "  --most-triangles N Refuse a file of more (10000000)\n"
    "  --curves           Print the curves that bound no surface instead\n"
    "  --edges            Also the edges of surfaces\n"
    "  --json             Print the report limn.cad/1 instead of lines\n"
    "  --progress         Print lines \"progress PERCENT WHAT\" first\n"
    "  --memory-mb N      Take at most so much memory\n";

// Exit codes (scene/files/cad_program.cpp): 1: a message says what is wrong with the file; 4: with something
// else.
constexpr int k_wrong_file = 1, k_wrong_usage = 2, k_no_memory = 3, k_not_done = 4;

struct Options {
  std::filesystem::path file, out;
  TakenAs as = TakenAs::part;
  Tessellation how;
  std::optional<double> chord_mm = {};  // as given
  bool curves = false, edges = false, json = false, progress = false, help = false;
  double memory_mb = 0;  // 0: no limit
};

Status read_number(const std::string& option, std::string_view text, double least, double most, double* out) {
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), *out);
  if (problem == std::errc() && end == text.data() + text.size() && *out >= least && *out <= most) return {};
  return usage_error("{}: expected a number from {} to {}, found '{}'.", option, least, most, text);
}

Status read_value(const std::string& option, const std::string& value, Options* options) {
  if (option == "--out") {
    options->out = value;
    return {};
  }
  if (option == "--as") {
    const auto as = k_taken_as.find(value);
    if (!as) return usage_error("--as: expected part, parts or variants, found '{}'.", value);
    options->as = *as;
    return {};
  }
  if (option == "--chord-mm") {
    double chord_mm = 0;
    LIMN_TRY_STATUS(read_number(option, value, 1e-4, 1000, &chord_mm));
    options->chord_mm = options->how.chord_mm = chord_mm;
    return {};
  }
  if (option == "--angle-deg") return read_number(option, value, 1, 90, &options->how.angle_deg);
  if (option == "--most-triangles") {
    double most = 0;
    LIMN_TRY_STATUS(read_number(option, value, 1, 1e8, &most));
    options->how.most_triangles = static_cast<std::size_t>(most);
    return {};
  }
  if (option == "--solid-seconds") return read_number(option, value, 0.01, 1e6, &options->how.solid_seconds);
  if (option == "--memory-mb") return read_number(option, value, 16, 1e6, &options->memory_mb);
  return usage_error("expected an option of limn-cad (limn-cad --help), found '{}'.", option);
}

Result<Options> read_options(const std::vector<std::string>& words) {
  Options options;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--help" || word == "-h") {
      options.help = true;
      return options;
    }
    if (word == "--json") {
      options.json = true;
    } else if (word == "--curves") {
      options.curves = true;
    } else if (word == "--edges") {
      options.edges = true;
    } else if (word == "--progress") {
      options.progress = true;
    } else if (!word.starts_with("--")) {
      options.file = word;
    } else if (i + 1 == words.size()) {
      return usage_error("{}: expected a value, found none.", word);
    } else {
      LIMN_TRY_STATUS(read_value(word, words[++i], &options));
    }
  }
  if (options.file.empty() || (options.out.empty() && !options.curves))
    return usage_error(
        "expected a STEP or IGES file and --out (limn-cad --help), found neither or one of them.");
  return options;
}

// Whether this process has come near the memory that it may take.
bool is_near_limit(double memory_mb) {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return memory_mb > 0 && static_cast<double>(used.ru_maxrss) > 0.6 * 1024 * memory_mb;
}

std::string sentences_of(const nlohmann::ordered_json& report) {
  std::string text =
      fmt::format("{}{}{}, unit {}: {} solids ({} meshes), {} triangles, chord error {:.3g} mm\n",
                  report["format"].get<std::string>(), report["application_protocol"] == "" ? "" : " ",
                  report["application_protocol"].get<std::string>(), report["unit"].get<std::string>(),
                  report["solids"].size(), report["meshes"].get<std::size_t>(),
                  report["triangles"].get<std::size_t>(), report["chord_error_mm"].get<double>());
  for (const auto& file : report["files"]) text += file["file"].get<std::string>() + "\n";
  return text;
}

// What a library prints must not come between the results: it goes to standard error.
int results_apart() {
  const int results = dup(STDOUT_FILENO);
  dup2(STDERR_FILENO, STDOUT_FILENO);
  return results;
}

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// What is wrong, and the exit code for it; nullopt: all is written.
struct Problem {
  std::string message;
  int code;
};

const Problem k_no_results = {"standard output: expected to write the results, found it closed or full.",
                              k_not_done};

std::optional<Problem> print_curves(const Options& options, int results, ProgressLines* progress) {
  CurveSampling how{.with_edges = options.edges};
  if (options.chord_mm) how.chord_mm = *options.chord_mm;
  const auto list = read_curves(options.file, how, progress);
  if (!list) return Problem{list.message(), k_wrong_file};
  if (!write_all(results, exchange::encode_curve_list(*list) + "\n")) return k_no_results;
  return std::nullopt;
}

std::optional<Problem> write_list(const Options& options, ProgressLines* progress) {
  const auto text = read_file(options.file);
  if (!text) return Problem{text.message(), k_wrong_file};
  const auto list = exchange::decode_curve_list(*text, options.file.string());
  if (!list) return Problem{list.message(), k_wrong_file};
  const Status written = write_curves(*list, options.out, progress);
  if (!written) return Problem{written.message(), k_not_done};
  return std::nullopt;
}

std::optional<Problem> run(const Options& options, int results) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  XCAFDoc_ShapeTool::SetAutoNaming(Standard_False);
  const Handle(ProgressLines) progress = new ProgressLines(options.progress ? results : -1);
  if (const Status is_file = scene::check_regular_file(options.file); !is_file)
    return Problem{is_file.message(), k_not_done};
  if (options.curves) return print_curves(options, results, progress.get());
  if (options.file.extension() == ".json") return write_list(options, progress.get());
  const auto model = read_cad_model(options.file, options.how, progress.get());
  if (!model) return Problem{model.message(), k_wrong_file};
  if (!model->changed_file.empty())
    return Problem{
        fmt::format("{}: expected that its files stay as they are while limn-cad reads them, found "
                    "'{}' changed. Try again.",
                    options.file.string(), model->changed_file),
        k_not_done};
  progress->begin_stage("writing", 95, 100);
  const auto written = write_parts(*model, options.as, options.how, options.out);
  if (!written) return Problem{written.message(), k_not_done};
  const nlohmann::ordered_json report = cad_report(*model, options.how, *written);
  for (const auto& warning : report["warnings"])
    if (!options.json) std::cerr << "limn-cad: warning: " << warning.get<std::string>() << '\n';
  if (!write_all(results, options.json ? json_text(report) + "\n" : sentences_of(report)))
    return k_no_results;
  return std::nullopt;
}

std::string unreadable(const Options& options, const char* found) {
  return fmt::format("{}: expected a whole CAD file, found one that cannot be read ({}). Export it again.",
                     options.file.string(), found);
}

int run_limited(const Options& options) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // ends with the program that started it
  rlimit limits{0, 0};
  setrlimit(RLIMIT_CORE, &limits);
  if (options.memory_mb > 0) {
    limits.rlim_cur = limits.rlim_max = static_cast<rlim_t>(options.memory_mb * 1024 * 1024);
    setrlimit(RLIMIT_AS, &limits);
  }
  const int results = results_apart();
  Problem problem{"", k_wrong_file};
  try {
    auto found = run(options, results);
    if (!found) return 0;
    problem = std::move(*found);
  } catch (const Standard_OutOfMemory&) {
    return k_no_memory;
  } catch (const std::bad_alloc&) {
    return k_no_memory;
  } catch (const Standard_Failure& failure) {
    problem.message = unreadable(options, failure.DynamicType()->Name());
  } catch (const std::exception& failure) {
    problem.message = unreadable(options, failure.what());
  }
  if (problem.code == k_wrong_file && is_near_limit(options.memory_mb)) return k_no_memory;
  std::cerr << "limn-cad: " << problem.message << '\n';
  return problem.code;
}

}  // namespace
}  // namespace limn::cad

int main(int argc, char** argv) try {
  const auto options = limn::cad::read_options({argv + 1, argv + argc});
  if (!options) {
    std::cerr << "limn-cad: " << options.message() << '\n';
    return limn::cad::k_wrong_usage;
  }
  if (options->help) {
    std::cout << limn::cad::k_help;
    return 0;
  }
  return limn::cad::run_limited(*options);
} catch (const std::exception&) {  // no memory for the command line or for a message
  return limn::cad::k_no_memory;
}
