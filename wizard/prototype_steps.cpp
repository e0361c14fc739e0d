#include "wizard/prototype_steps.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "calib/capture.h"
#include "core/image_io.h"
#include "core/median.h"
#include "device/gl_context.h"
#include "projector/renderer.h"
#include "wizard/error_colormap.h"
#include "wizard/measure/scan_alignment.h"
#include "wizard/measure/scan_files.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_most_printed = 3;  // number of warnings that are printed; all are in align.json
constexpr double k_white = 0.9;            // share of a colour's white part that is not projected

// The error's colour without most of its white, because room light and the projectors' black level add white.
cv::Vec3d light_bgr(double mm) {
  const auto [red, green, blue] = error_rgb(mm);
  const cv::Vec3d bgr(blue, green, red);
  const double most = std::max({bgr[0], bgr[1], bgr[2]}), least = std::min({bgr[0], bgr[1], bgr[2]});
  return (bgr - cv::Vec3d::all(k_white * least)) * (255 / (most - k_white * least));
}

class Steps {
 public:
  Steps(const PrototypeSteps& steps, const WizardBackend& backend, const WizardListener& listener)
      : steps_(steps), backend_(backend), listener_(listener), out_(steps.rig / "scan") {}

  Result<std::optional<PrototypeSeen>> run() {
    step(WizardStep::scan, WizardState::runs, "waiting for the prototype");
    listener_.say("scan: remove the board and put the prototype in its working position");
    LIMN_TRY(const bool is_there, backend_.wait_for_prototype(nullptr));
    if (!is_there) {
      for (const WizardStep skipped : {WizardStep::scan, WizardStep::align, WizardStep::paint})
        step(skipped, WizardState::waits, "skipped");
      return std::optional<PrototypeSeen>();
    }
    LIMN_TRY(rig_, load_rig(steps_.rig));
    LIMN_TRY_STATUS(scan());
    LIMN_TRY_STATUS(align());
    LIMN_TRY_STATUS(paint());
    return std::optional<PrototypeSeen>(std::move(seen_));
  }

 private:
  void step(WizardStep which, WizardState state, const std::string& words) {
    if (listener_.step) listener_.step(which, state, words);
  }
  void end(WizardStep which, const std::string& words, bool is_well = true) {
    listener_.say(fmt::format("{}: {}", to_text(which), words));
    step(which, is_well ? WizardState::done : WizardState::fails, words);
  }

  Status scan() {
    step(WizardStep::scan, WizardState::runs, "capturing");
    calib::CaptureSet captures = steps_.captures;
    captures.folder = out_ / "captures";
    std::error_code ignored;
    fs::remove_all(captures.folder, ignored);  // the prototype may have stood elsewhere
    LIMN_TRY_STATUS(calib::begin_captures(captures));
    calib::CaptureBackend capture = backend_.capture;
    capture.show = [&](int projector, const cv::Mat& image) -> Status {
      if (listener_.wish && *listener_.wish == WizardWish::leave) return error("stopped during the capture.");
      return backend_.capture.show(projector, image);
    };
    const Status captured = calib::capture_pose(captures, 0, capture);
    LIMN_TRY_STATUS(backend_.wait_for_files());
    LIMN_TRY_STATUS(captured);
    step(WizardStep::scan, WizardState::runs, "measuring");
    LIMN_TRY(captures_, calib::load_captures(captures.folder));
    LIMN_TRY(scan_, make_scan(captures_, rig_, {}, out_));
    seen_.points = scan_.points.positions.size();
    seen_.scan_stddev_mm = 1e3 * static_cast<double>(median(scan_.points.stddevs));
    seen_.warnings = scan_.warnings;
    end(WizardStep::scan,
        fmt::format("{} points, median standard deviation {:.3f} mm", seen_.points, seen_.scan_stddev_mm));
    return {};
  }

  Status align() {
    if (steps_.scene.empty()) {
      end(WizardStep::align, "no scene was given");
      return {};
    }
    step(WizardStep::align, WizardState::runs, "");
    AlignOptions command;
    command.scan = out_;
    command.scene = steps_.scene;
    command.rig = steps_.rig;
    command.out = out_;
    for (std::size_t i = 0; i < captures_.cameras.size(); ++i)
      command.frames.push_back(
          captures_.cameras[i].name + "=" +
          calib::image_path(captures_, 0, 0, static_cast<int>(i), captures_.patterns[0].white()).string());
    auto aligned = align_scan(command);
    if (!aligned) {  // perhaps no marker is visible: search without a start
      command.frames.clear();
      aligned = align_scan(command);
    }
    if (!aligned) {
      seen_.warnings.push_back(aligned.message());
      end(WizardStep::align, aligned.message(), false);
      return {};
    }
    world_from_prototype_ = aligned->registration.world_from_prototype;
    seen_.size = aligned->size;
    seen_.align_rms_mm = 1e3 * aligned->registration.rms_m;
    seen_.warnings.insert(seen_.warnings.end(), aligned->warnings.begin(), aligned->warnings.end());
    for (std::size_t i = 0; i < std::min(k_most_printed, aligned->warnings.size()); ++i)
      listener_.say("advice: " + aligned->warnings[i]);
    if (aligned->warnings.size() > k_most_printed)
      listener_.say(fmt::format("advice: {} more warnings are in {}",
                                aligned->warnings.size() - k_most_printed, (out_ / "align.json").string()));
    end(WizardStep::align,
        fmt::format("scan and CAD differ by {:.2f} mm RMS (start: {})", *seen_.align_rms_mm, aligned->how));
    return {};
  }

  // The scene with the CAD if it was aligned, else with the scan's mesh.
  Result<scene::Scene> painted_scene() const {
    scene::Scene scene;
    if (world_from_prototype_) {
      LIMN_TRY(scene, scene::load_usable_scene(steps_.scene));
      return scene;
    }
    scene.prototype = scene::Prototype{};
    scene::Mesh& mesh = scene.prototype->mesh;
    mesh.positions = scan_.mesh.positions;
    mesh.normals = scan_.mesh.normals;
    mesh.triangles = scan_.mesh.triangles;
    mesh.triangle_materials.assign(mesh.triangles.size(), 0);
    return scene;
  }

  // The largest predicted error of all projectors at a point; NaN where it is not known.
  double worst_mm(const Eigen::Vector3d& p_world) const {
    const Imager& camera = rig_.cameras.front();
    const Eigen::Vector3d p_camera = camera.imager_from_world * p_world;
    double worst = std::nan("");
    for (const calib::ErrorMap& map : steps_.maps) {
      const auto place = map.place_of(camera, p_camera);
      if (!place) continue;
      if (const double mm = map.at(*place, p_camera.z()); std::isfinite(mm)) worst = std::fmax(worst, mm);
    }
    return worst;
  }

  Status paint() {
    step(WizardStep::paint, WizardState::runs, "");
    LIMN_TRY([[maybe_unused]] const device::GlContext context, device::GlContext::create());
    LIMN_TRY(const scene::Scene scene, painted_scene());
    LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, rig_));
    scene::PosedScene posed;
    posed.world_from_prototype = world_from_prototype_.value_or(Pose{});
    std::vector<cv::Mat> images;
    std::vector<double> all_mm;
    for (std::size_t i = 0; i < rig_.projectors.size(); ++i) {
      const cv::Mat points = renderer.surface_points(i, posed), shares = renderer.blend(i, posed);
      cv::Mat image(points.size(), CV_8UC3, cv::Scalar::all(0));
      for (int y = 0; y < points.rows; ++y) {
        for (int x = 0; x < points.cols; ++x) {
          const auto& p = points.at<cv::Vec3f>(y, x);
          if (std::isnan(p[0])) continue;
          const double mm = worst_mm(*posed.world_from_prototype * Eigen::Vector3d(p[0], p[1], p[2]));
          if (!std::isfinite(mm)) continue;
          all_mm.push_back(mm);
          const double share =
              std::pow(static_cast<double>(shares.at<cv::Vec2f>(y, x)[0]), 1 / k_display_gamma);
          image.at<cv::Vec3b>(y, x) = light_bgr(mm) * share;
        }
      }
      LIMN_TRY_STATUS(write_png(out_ / ("projector-" + rig_.projectors[i].name + ".png"), image));
      images.push_back(image);
    }
    if (all_mm.empty())
      return error(
          "paint: expected projected light on the prototype in the volume where the boards were held, found "
          "none. Calibrate with boards where it stands, or move it there.");
    seen_.painted_p95_mm = quantile(all_mm, 0.95);
    seen_.painted_good =
        static_cast<double>(
            std::count_if(all_mm.begin(), all_mm.end(), [](double mm) { return mm <= calib::k_good_mm; })) /
        static_cast<double>(all_mm.size());
    LIMN_TRY_STATUS(backend_.show_all(images));
    for (std::size_t i = 0; i < rig_.cameras.size(); ++i) {
      LIMN_TRY(const cv::Mat image, backend_.capture.grab(static_cast<int>(i)));
      LIMN_TRY_STATUS(write_png(out_ / ("painted-" + rig_.cameras[i].name + ".png"), image));
    }
    end(WizardStep::paint,
        fmt::format("predicted error at most {:.2f} mm on 95 % of its surface; {:.0f} % within {:g} mm",
                    seen_.painted_p95_mm, 100 * seen_.painted_good, calib::k_good_mm));
    return {};
  }

  const PrototypeSteps& steps_;
  const WizardBackend& backend_;
  const WizardListener& listener_;
  fs::path out_;
  Rig rig_;
  calib::CaptureSet captures_;
  calib::Scan scan_;
  std::optional<Pose> world_from_prototype_;
  PrototypeSeen seen_;
};

}  // namespace

Result<std::optional<PrototypeSeen>> prototype_seen(const PrototypeSteps& steps,
                                                    const WizardBackend& backend,
                                                    const WizardListener& listener) {
  return Steps(steps, backend, listener).run();
}

}  // namespace limn::wizard
