#include "apps/patterns.h"

#include <functional>
#include <opencv2/core/mat.hpp>

#include "calib/code/patterns.h"
#include "calib/response/response_patterns.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/print.h"
#include "wizard/measure/pixel_size.h"

namespace limn::apps {
namespace {

Status write_images(const std::filesystem::path& out, int count, const std::function<cv::Mat(int)>& image) {
  LIMN_TRY_STATUS(make_folder(out));
  Progress progress("patterns", count);
  for (int i = 0; i < count; ++i) {
    LIMN_TRY_STATUS(write_png(out / calib::image_name(i), image(i)));
    progress.step(i + 1);
  }
  return {};
}

Status write_response(const PatternsOptions& options, const wizard::PixelSize& size) {
  const int count = static_cast<int>(calib::response_images().size());
  LIMN_TRY_STATUS(write_images(options.out, count,
                               [&](int i) { return calib::draw_response(i, size.width, size.height); }));
  LIMN_TRY_STATUS(calib::save_response_patterns(size.width, size.height, options.out / "patterns.json"));
  print_out("{} response images of {}x{} in {}\n", count, size.width, size.height, options.out.string());
  return {};
}

// The patterns corrected by the response that the options name.
Result<calib::Patterns> by_response(const PatternsOptions& options, const calib::Patterns& patterns) {
  if (options.linearise.empty()) return patterns;
  if (options.code != calib::PatternCode::phase)
    return usage_error("--linearise: expected --code phase, found {}, which shows only black and white.",
                       calib::to_text(options.code));
  LIMN_TRY(const RigResponses responses, load_responses(options.linearise));
  if (options.name.empty() && responses.projectors.size() != 1)
    return usage_error("--linearise {}: expected one projector in it, found {}. Choose one with --name.",
                       options.linearise.string(), responses.projectors.size());
  const std::string name = options.name.empty() ? responses.projectors[0].projector : options.name;
  const auto made = calib::linearised(patterns, responses.projectors, name);
  if (!made) return error("{}: {}", options.linearise.string(), made.message());
  return made;
}

}  // namespace

Status run_patterns(const PatternsOptions& options) {
  LIMN_TRY(const wizard::PixelSize size, wizard::parse_pixel_size(options.projector));
  const auto plain = calib::Patterns::create(options.code, size.width, size.height, options.code_options);
  if (!plain) return usage_error("{}", plain.message());
  if (options.response) return write_response(options, size);
  LIMN_TRY(const calib::Patterns patterns, by_response(options, *plain));
  LIMN_TRY_STATUS(write_images(options.out, patterns.count(), [&](int i) { return patterns.image(i); }));
  LIMN_TRY_STATUS(calib::save_patterns(patterns, options.out / "patterns.json"));
  print_out("{} images of {}x{} in {}\n", patterns.count(), size.width, size.height, options.out.string());
  return {};
}

}  // namespace limn::apps
