#include "apps/demo.h"

#include <chrono>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <thread>
#include <vector>

#include "core/file.h"
#include "core/frame.h"
#include "core/image_io.h"
#include "core/print.h"
#include "device/gl_context.h"
#include "device/window.h"
#include "validate/demo_page.h"
#include "validate/demo_session.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

Status write_results(const fs::path& out, const validate::DemoResult& result, const std::string& renderer) {
  for (const validate::DemoImage& image : result.images) {
    LIMN_TRY_STATUS(write_png(out / (image.file + ".png"), image.image));
  }
  LIMN_TRY_STATUS(write_file(out / "demo.json", result.json));
  const validate::DemoPage page{
      "A whole session on a virtual rig whose ground truth is known. Two projectors and a camera were "
      "calibrated from simulated captures, the markers were found in a simulated photograph, the parts were "
      "projected onto the door, and a ray tracer that shares no code with the renderer measured where the "
      "light fell. Drawn by " +
          renderer + ".",
      result.rows, result.images};
  return validate::write_demo_page(page, out / "demo.html");
}

// Shows the images in turn; space shows the next one at once, Escape ends.
void show_in(device::Window& window, const std::vector<validate::DemoImage>& images) {
  constexpr double k_seconds_each = 4;
  auto shown_at = std::chrono::steady_clock::time_point();
  for (std::size_t i = 0; window.is_open();) {
    const auto now = std::chrono::steady_clock::now();
    if (seconds_between(shown_at, now) > k_seconds_each || window.poll_pressed_key() == ' ') {
      window.show(images[i++ % images.size()].image);
      shown_at = now;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(15));
  }
}

}  // namespace

Status run_demo(const DemoOptions& options) {
  LIMN_TRY_STATUS(make_folder(options.out));
  LIMN_TRY(device::GlContext gl, device::GlContext::create());
  std::optional<device::Window> window;  // first, so that a missing display is reported at once
  if (options.window) {
    LIMN_TRY(window, device::Window::open("Limn demo", 1280, 720));
  }
  LIMN_TRY(const validate::DemoResult result, validate::play_demo(options.out, options.keep_captures));
  LIMN_TRY_STATUS(write_results(options.out, result, gl.description()));
  print_out("{}\nDrawn by {}.\n{}\n", validate::text_table(result.rows), gl.description(),
            (options.out / "demo.html").string());
  std::fflush(stdout);
  if (window) show_in(*window, result.images);
  return {};
}

}  // namespace limn::apps
