#include "apps/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/data_folder.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/names.h"
#include "core/print.h"
#include "device/gl_context.h"
#include "validate/check_file.h"
#include "validate/check_judge.h"
#include "validate/check_page.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

Result<std::vector<fs::path>> shipped_checks() {
  LIMN_TRY(const fs::path folder, data_file("config/checks"));
  std::vector<fs::path> files;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  if (files.empty()) return error("{}: expected check files, found none.", folder.string());
  std::sort(files.begin(), files.end());
  return files;
}

// All checks are read before the first one runs, so that a broken file is reported at once.
Result<std::vector<validate::Check>> read_checks(const std::vector<fs::path>& files) {
  std::vector<validate::Check> checks;
  std::map<std::string, std::string> known;
  for (const fs::path& file : files) {
    LIMN_TRY(validate::Check check, validate::load_check(file));
    const auto [earlier, fresh] = known.emplace(check.name, file.string());
    if (!fresh) {
      return usage_error(
          "{}: expected checks with different file names, because each name is a folder of images, found {} "
          "as well. Rename one.",
          file.string(), earlier->second);
    }
    checks.push_back(std::move(check));
  }
  return checks;
}

nlohmann::ordered_json json_of(const std::vector<validate::CheckResult>& results,
                               const std::string& renderer) {
  nlohmann::ordered_json json = {{"schema", "limn.check-report/1"}, {"renderer", renderer}};
  json["passed"] = std::all_of(results.begin(), results.end(), [](const auto& r) { return r.good(); });
  json["checks"] = nlohmann::ordered_json::array();
  for (const validate::CheckResult& result : results) {
    nlohmann::ordered_json readings = nlohmann::ordered_json::array();
    for (const validate::CheckReading& reading : result.readings) {
      readings.push_back({{"measure", reading.limit.measure.name},
                          {"value", reading.value},
                          {reading.limit.measure.least ? "at_least" : "at_most", reading.limit.value},
                          {"passed", reading.good()}});
    }
    json["checks"].push_back({{"check", result.name},
                              {"passed", result.good()},
                              {"seconds", result.seconds},
                              {"readings", readings}});
    if (!result.problem.empty()) json["checks"].back()["problem"] = result.problem;
  }
  return json;
}

Status write_images(const validate::CheckResult& result, const fs::path& out) {
  if (result.images.empty()) return {};
  const fs::path folder = out / result.name;
  LIMN_TRY_STATUS(make_folder(folder));
  for (const validate::CheckImage& image : result.images) {
    LIMN_TRY_STATUS(write_png(folder / (image.file + "-actual.png"), image.actual));
    LIMN_TRY_STATUS(write_png(folder / (image.file + "-expected.png"), image.expected));
    LIMN_TRY_STATUS(write_png(folder / (image.file + "-difference.png"), image.difference));
  }
  return {};
}

// Share of an image's pixels that differ by more than two levels from another run's image.
Result<double> share_apart(const validate::CheckImage& image, const fs::path& theirs) {
  constexpr double k_same_levels = 2;
  LIMN_TRY(const cv::Mat expected, read_image(theirs));
  if (expected.size() != image.actual.size() || expected.type() != image.actual.type())
    return error(
        "{}: expected an image of {}x{} as in this run, found another kind of {}x{}. Run the same checks.",
        theirs.string(), image.actual.cols, image.actual.rows, expected.cols, expected.rows);
  const int pixels = static_cast<int>(expected.total());
  cv::Mat apart, farthest;
  cv::absdiff(image.actual, expected, apart);
  cv::reduce(apart.reshape(1, pixels), farthest, 1, cv::REDUCE_MAX);  // maximum over channels
  return cv::countNonZero(farthest > k_same_levels) / static_cast<double>(pixels);
}

// Adds one reading: the largest difference of an image from the run in `against`.
void compare(const fs::path& against, validate::CheckResult* result) {
  static const validate::CheckMeasure measure = {
      "apart_share", "pixels that differ by more than two levels from the other run", ""};
  constexpr double k_most = 0.001;
  double worst = 0;
  for (const validate::CheckImage& image : result->images) {
    const auto share = share_apart(image, against / result->name / (image.file + "-actual.png"));
    if (!share) {
      result->problem = share.message();
      return;
    }
    worst = std::max(worst, *share);
  }
  if (!result->images.empty()) result->readings.push_back({{measure, k_most}, worst});
}

Status verdict_of(const std::vector<validate::CheckResult>& results, const fs::path& page) {
  std::vector<std::string> failed;
  std::string problems;
  for (const validate::CheckResult& result : results) {
    if (!result.good()) failed.push_back(result.name);
    if (!result.problem.empty()) problems += "\n  " + result.problem;
  }
  if (failed.empty()) return {};
  return error("check: expected every limit to be met, found otherwise in {}. {} shows them.{}",
               joined_names(failed), page.string(), problems);
}

}  // namespace

Status run_check(const CheckOptions& options) {
  std::vector<fs::path> files = options.files;
  if (files.empty()) {
    LIMN_TRY(files, shipped_checks());
  }
  LIMN_TRY(const std::vector<validate::Check> checks, read_checks(files));
  if (!options.against.empty() && !fs::is_directory(options.against))
    return error("{}: expected the folder of another run (its --out), found none.", options.against.string());
  LIMN_TRY_STATUS(make_folder(options.out));
  LIMN_TRY(const device::GlContext context, device::GlContext::create());
  log_info("check: {}", context.description());
  std::vector<validate::CheckResult> results;
  for (const validate::Check& check : checks) {
    log_info("{} ...", check.name);
    auto result = validate::judge_check(check);
    if (!result) result = validate::CheckResult{check.name, check.about, {}, {}, 0, result.message()};
    if (!options.against.empty()) compare(options.against, &*result);
    LIMN_TRY_STATUS(write_images(*result, options.out));
    results.push_back(std::move(*result));
  }
  const auto json = json_of(results, context.description());
  LIMN_TRY_STATUS(write_file(options.out / "check.json", json_text(json, 2) + "\n"));
  const fs::path page = options.out / "check.html";
  LIMN_TRY_STATUS(validate::write_check_page(results, context.description(), page));
  if (options.json) {
    print_out("{}\n", json_text(json, 2));
  } else {
    print_out("{}{}\n", validate::check_table(results), page.string());
  }
  return verdict_of(results, page);
}

}  // namespace limn::apps
