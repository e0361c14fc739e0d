#include "apps/check_judge.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "apps/judge.h"
#include "apps/refill.h"
#include "apps/traced_eye.h"
#include "core/log.h"
#include "projector/renderer.h"
#include "scene/drawn.h"
#include "sim/aim.h"
#include "sim/photograph.h"
#include "sim/trace.h"
#include "sim/truth.h"

namespace limn::apps {
namespace {

constexpr double k_gamma = 2.2;  // what the renderer encodes for when no response was measured
constexpr int k_dot_count = 600;
constexpr std::uint64_t k_dot_seed = 20261121;
constexpr double k_off_surface_m = 0.05;
constexpr double k_dark = 0.5 / 255;  // of full light: below, a pixel is not lit
constexpr double k_over = 4;          // levels that a pixel may be off
constexpr double k_edge = 8;  // levels between neighbours: beyond, samples of a pixel show, not its colour
constexpr float k_same_reach = 0.02F;  // of a pixel: reached as far by two projectors
constexpr double k_coat = 0.5;         // light of the coat; a whole display value to 0.1 % of light
constexpr int k_seam_window = 9;       // viewer pixels within which a step is looked for
constexpr double k_seam_blur_px = 1;  // 8-bit levels average out; an eye at the viewer's pixels sees no finer
constexpr double k_min_incidence_cosine =
    0.34;                          // 70 degrees: beyond, a projector's pixel is drawn out threefold
constexpr int k_edge_window = 5;   // viewer pixels: light and screen within 2 of each other meet
constexpr float k_whole = 0.999F;  // of a viewer's pixel
constexpr int k_finer = 2;  // rays a side of a viewer's pixel for even light: a ray sees a projector's pixel,
                            // narrower than the viewer's, and would skip others
constexpr int k_light_end = 9;  // viewer pixels: where light ends within 4, it fades over the last projector
                                // pixel, at 70 degrees some 3 viewer pixels wide, and the eye's blur
constexpr int k_least_outline_px = 50;    // of a part's area; below, an outline says nothing
constexpr double k_difference_gain = 32;  // 4/255 becomes 128

sim::World staged(const Check& check) {
  sim::World world = check.truth;
  world.room = {};
  std::erase_if(world.objects, [](const sim::Object& object) { return object.name != "prototype"; });
  for (sim::Object& object : world.objects) {
    object.albedo.setOnes();
    object.texture.release();
  }
  for (sim::ProjectorEffects& effects : world.projector_effects)
    effects = {.illuminance_at_1m = 1, .gamma = k_gamma, .falloff = false, .incidence = false};
  return world;
}

cv::Mat for_eye(const cv::Mat& light) {
  cv::Mat levels(light.size(), CV_8UC3);
  for (int row = 0; row < light.rows; ++row)
    for (int column = 0; column < light.cols; ++column)
      for (int c = 0; c < 3; ++c)
        levels.at<cv::Vec3b>(row, column)[c] = cv::saturate_cast<std::uint8_t>(
            255 * srgb_of_linear(std::clamp(double(light.at<cv::Vec3f>(row, column)[c]), 0.0, 1.0)));
  return levels;
}

cv::Mat linear_of(const cv::Mat& picture) {
  cv::Mat table(1, 256, CV_32F), light;
  for (int v = 0; v < 256; ++v) table.at<float>(v) = static_cast<float>(std::pow(v / 255.0, k_gamma));
  cv::LUT(picture, table, light);
  return light;
}

cv::Mat grown(const cv::Mat& difference) {
  cv::Mat levels;
  difference.convertTo(levels, CV_8U,
                       difference.depth() == CV_8U ? k_difference_gain : 255 * k_difference_gain);
  return levels;
}

cv::Mat bgr(const cv::Mat& grey) {
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  return colour;
}

// Red where they differ, over the found one dimmed.
cv::Mat label_difference(const cv::Mat& found, const cv::Mat& truth) {
  cv::Mat picture = bgr(found / 3);
  picture.setTo(cv::Scalar(60, 80, 255), found != truth);
  return picture;
}

// Owner pictures as greys: none, prototype's parts in steps.
cv::Mat shades(const cv::Mat& front) {
  cv::Mat grey;
  front.convertTo(grey, CV_8U, 60, 75);
  grey.setTo(0, front < 0);
  return grey;
}

double share_of(const cv::Mat& mask, const cv::Mat& domain) {
  return static_cast<double>(cv::countNonZero(mask & domain)) / std::max(1, cv::countNonZero(domain));
}

cv::Mat any_channel_over(const cv::Mat& light, double threshold) {
  std::vector<cv::Mat> channels;
  cv::split(light, channels);
  return (channels[0] > threshold) | (channels[1] > threshold) | (channels[2] > threshold);
}

// How far a picture is off: mean over `shown` pixels; share of all pixels, and of the shown ones away from
// edges, where a channel is more than k_over levels off.
struct LevelErrors {
  double mean = 0;
  double over = 0;
  double inner_over = 0;
};

cv::Mat square(int side) { return cv::getStructuringElement(cv::MORPH_RECT, {side, side}); }

// Pixels of a picture (levels, CV_32FC3) around which it is nearly even.
cv::Mat even(const cv::Mat& picture) {
  const cv::Mat around = square(3);
  cv::Mat highest, lowest;
  cv::dilate(picture, highest, around);
  cv::erode(picture, lowest, around);
  return ~any_channel_over(highest - lowest, k_edge);
}

// `off` and `expected` in levels, CV_32FC3.
LevelErrors level_errors(const cv::Mat& off, const cv::Mat& expected, const cv::Mat& shown) {
  const cv::Mat wrong = any_channel_over(off, k_over);
  const cv::Scalar mean = cv::mean(off, shown);
  return {(mean[0] + mean[1] + mean[2]) / 3,
          static_cast<double>(cv::countNonZero(wrong)) / static_cast<double>(off.total()),
          share_of(wrong, shown & even(expected))};
}

std::string words_of(const LevelErrors& errors, const cv::Mat& shown) {
  return fmt::format(
      "{} pixels; mean {:.3f}/255; over 4/255: {:.3f} % of the picture, {:.3f} % of the parts off edges. "
      "Difference: 32 times.",
      cv::countNonZero(shown), errors.mean, 100 * errors.over, 100 * errors.inner_over);
}

// By how much the luminance of `less` is below that of `more`, as a share of it; both as an eye sees them.
cv::Mat off_luminance(const cv::Mat& more, const cv::Mat& less) {
  const auto luminance = [](const cv::Mat& picture) {
    cv::Mat table(1, 256, CV_32F), light;
    for (int v = 0; v < 256; ++v) table.at<float>(v) = static_cast<float>(linear_of_srgb(v / 255.0));
    cv::LUT(picture, table, light);
    cv::transform(light, light, cv::Matx13f(0.0722F, 0.7152F, 0.2126F));
    cv::GaussianBlur(light, light, {0, 0}, k_seam_blur_px);
    return light;
  };
  const cv::Mat whole = luminance(more);
  return cv::max((whole - luminance(less)) / cv::max(whole, k_dark), 0);
}

// That 95 % of the values do not exceed.
double p95_of(const cv::Mat& values, const cv::Mat& where) {
  std::vector<float> chosen;
  for (int row = 0; row < values.rows; ++row)
    for (int column = 0; column < values.cols; ++column)
      if (where.at<std::uint8_t>(row, column)) chosen.push_back(values.at<float>(row, column));
  if (chosen.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(chosen.size() - 1));
  std::nth_element(chosen.begin(), chosen.begin() + at, chosen.end());
  return chosen[static_cast<std::size_t>(at)];
}

// One check while it is being judged. What several measures need is made once.
class Judge {
 public:
  explicit Judge(const Check& check) : check_(check), world_(staged(check)) {
    for (const CheckLimit& limit : check.limits) asked_.insert(limit.measure.name);
  }

  Result<CheckResult> run() {
    const auto begun = std::chrono::steady_clock::now();
    LIMN_TRY(renderer_, projector::Renderer::create(check_.told.scene, check_.told.rig));
    if (asked("texture_mm")) LIMN_TRY_STATUS(judge_texture());
    if (asked("parallax_mm")) LIMN_TRY_STATUS(judge_parallax());
    if (asked("shared_mm")) LIMN_TRY_STATUS(judge_shared());
    if (asked("shone_mean_255") || asked("shone_over4_share") || asked("shone_inner_over4_share"))
      LIMN_TRY_STATUS(judge_shone());
    if (asked("spill_share")) LIMN_TRY_STATUS(judge_spill());
    if (asked("drawn_mean_255") || asked("drawn_over4_share") || asked("drawn_inner_over4_share"))
      LIMN_TRY_STATUS(judge_drawn());
    if (asked("mask_iou")) LIMN_TRY_STATUS(judge_mask());
    if (asked("composite_px")) LIMN_TRY_STATUS(judge_composite());
    if (asked("edge_gap_share") || asked("edge_double_share")) LIMN_TRY_STATUS(judge_edge());
    if (asked("depth_order_share")) LIMN_TRY_STATUS(judge_depth_order());
    if (asked("seam_step_p95") || asked("seam_step_max")) LIMN_TRY_STATUS(judge_seams());
    if (asked("black_step_share")) LIMN_TRY_STATUS(judge_black());
    if (asked("refill_share") || asked("refill_flash_share") || asked("refill_still_255"))
      LIMN_TRY_STATUS(judge_refill());
    if (asked("rerun_worst_255")) LIMN_TRY_STATUS(judge_rerun());
    CheckResult result{check_.name, check_.about, {}, std::move(pictures_), 0, ""};
    for (const CheckLimit& limit : check_.limits)
      result.readings.push_back({limit, values_.at(limit.measure.name)});
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return result;
  }

 private:
  bool asked(const std::string& measure) const { return asked_.contains(measure); }

  Error nothing_to_judge(const std::string& measure, const std::string& expected) const {
    return error("{}: limits.{}: expected {}, found none. Change poses or viewer.", check_.name, measure,
                 expected);
  }

  std::vector<cv::Mat> drawn_by(projector::Renderer& renderer, const scene::PosedScene& posed) const {
    std::vector<cv::Mat> pictures;
    for (std::size_t i = 0; i < check_.told.rig.projectors.size(); ++i)
      pictures.push_back(renderer.projector_picture(i, posed, check_.viewer));
    return pictures;
  }

  const std::vector<cv::Mat>& projector_pictures() {
    if (projector_pictures_.empty()) projector_pictures_ = drawn_by(*renderer_, check_.told.posed);
    return projector_pictures_;
  }

  sim::Aim aim() const { return {world_, check_.posed, check_.viewer}; }

  const std::vector<sim::PartPicture>& aims() {
    if (aims_.empty())
      for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i)
        aims_.push_back(aim().projector_picture(i));
    return aims_;
  }

  const TracedEye& eye() {
    if (!eye_) eye_.emplace(world_, check_.viewer, 1);
    return *eye_;
  }
  // For light that is to be even.
  const TracedEye& fine_eye() {
    if (!fine_eye_) {
      fine_eye_.emplace(world_, check_.viewer, k_finer);
      fine_reaches_ = fine_eye_->reaches();
    }
    return *fine_eye_;
  }

  // The scene's prototype with one part instead of the scene's own, and where that is.
  std::pair<scene::Scene, scene::PosedScene> shown_instead(const scene::Mesh& mesh, scene::Mode mode) const {
    scene::Scene scene = check_.told.scene;
    scene::Slot slot;
    slot.name = "judged";
    slot.mode = mode;
    slot.variants = {{"judged", mesh}};
    scene.slots = {slot};
    const Pose& world_from_prototype = *check_.told.posed.world_from_prototype;
    return {scene, {world_from_prototype, {{"judged", "judged", world_from_prototype}}}};
  }

  // That, drawn by a renderer of its own.
  Result<std::vector<cv::Mat>> drawn_instead(const scene::Mesh& mesh, scene::Mode mode) const {
    const auto [scene, posed] = shown_instead(mesh, mode);
    LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(scene, check_.told.rig));
    return drawn_by(renderer, posed);
  }

  // Even light over the whole prototype.
  scene::Mesh coat() const {
    scene::Mesh coat = check_.told.scene.prototype->mesh;
    coat.materials = {scene::Material{
        .base_colour = Eigen::Vector3f::Constant(float(k_coat)), .unlit = true, .texture = {}}};
    coat.triangle_materials.assign(coat.triangles.size(), 0);
    coat.uvs.clear();
    return coat;
  }

  Status judge_texture() {
    const AimedDots dots = aimed_dots(world_, k_dot_count, k_dot_seed);
    if (dots.p_aimed.empty()) return nothing_to_judge("texture_mm", "a place that a projector reaches");
    LIMN_TRY(const auto pictures, drawn_instead(dots.mesh, scene::Mode::surface));
    const Registration found = judged_registration(world_, dots, pictures);
    values_["texture_mm"] = found.rms_mm;
    add_dots("texture", "Surface-locked light", pictures, found, dots.p_aimed);
    return {};
  }

  Status judge_parallax() {
    const AimedDots dots = floating_dots(world_, check_.viewer, k_off_surface_m, k_dot_count, k_dot_seed);
    if (dots.p_aimed.empty())
      return nothing_to_judge("parallax_mm", "a place before which the eye sees a disc");
    LIMN_TRY(const auto pictures, drawn_instead(dots.mesh, scene::Mode::view));
    const Registration found = judged_registration(world_, dots, pictures);
    values_["parallax_mm"] = *std::max_element(found.errors_mm.begin(), found.errors_mm.end());
    add_dots("parallax", "Points 50 mm off the surface", pictures, found, dots.p_centres);
    return {};
  }

  // The picture is the first viewer's.
  Status judge_shared() {
    if (check_.shares.empty()) return nothing_to_judge("shared_mm", "several viewers");
    AimedDots dots = floating_dots(world_, check_.viewer, k_off_surface_m, k_dot_count, k_dot_seed);
    if (dots.p_aimed.empty())
      return nothing_to_judge("shared_mm", "a place before which the shared eye sees a disc");
    LIMN_TRY(const auto pictures, drawn_instead(dots.mesh, scene::Mode::view));
    std::optional<Registration> first;
    std::string shares;
    double squares = 0;
    int viewers = 0;
    for (const scene::SharedEye::Share& share : check_.shares) {
      dots.p_eye = world_.world_from_prototype.inverse() * share.p_world;
      const Registration found = judged_registration(world_, dots, pictures);
      shares += fmt::format(" {}: {:.0f} % of the eye, RMS {:.1f} mm.", share.viewer, 100 * share.share,
                            found.rms_mm);
      if (!first) first = found;
      if (share.share <= 0) continue;
      squares += found.rms_mm * found.rms_mm;
      ++viewers;
    }
    values_["shared_mm"] = std::sqrt(squares / viewers);
    Imager viewer = check_.viewer;
    viewer.imager_from_world =
        looking_at(check_.shares[0].p_world, *scene::middle_of(check_.told.scene, check_.posed),
                   Eigen::Vector3d::UnitZ());
    const TracedEye seeing(world_, viewer, 1);
    add_dots("shared", "Points 50 mm off the surface, as " + check_.shares[0].viewer + " sees them",
             seeing.seen(pictures), viewer, *first, dots.p_centres, shares);
    return {};
  }

  void add_dots(const std::string& file,
                const std::string& title,
                const std::vector<cv::Mat>& pictures,
                const Registration& found,
                const std::vector<Eigen::Vector3d>& places) {
    add_dots(file, title, eye().seen(pictures), check_.viewer, found, places, "");
  }

  void add_dots(const std::string& file,
                const std::string& title,
                const cv::Mat& light,
                const Imager& viewer,
                const Registration& found,
                const std::vector<Eigen::Vector3d>& places,
                const std::string& remark) {
    const cv::Mat actual = for_eye(light);
    cv::Mat expected = bgr(cv::Mat(actual.size(), CV_8U, cv::Scalar(0))), difference = actual / 4;
    const double worst_mm = values_.at(file + "_mm");
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto px = viewer.project(world_.world_from_prototype * places[i]);
      if (!px) continue;
      const cv::Point at(cvRound(px->x()), cvRound(px->y()));
      cv::circle(expected, at, 2, cv::Scalar::all(255), cv::FILLED, cv::LINE_AA);
      const auto colour =
          scene::signed_colour_rgb(std::min(1.0, found.errors_mm[i] / std::max(worst_mm, 1e-9)));
      cv::circle(difference, at, 4, cv::Scalar(colour[2], colour[1], colour[0]), cv::FILLED, cv::LINE_AA);
    }
    pictures_.push_back(
        {file, title,
         fmt::format("{} discs; RMS {:.3f} mm, 95 % {:.3f} mm, unlit {}.{} Difference: red is {:.3f} mm.",
                     found.points, found.rms_mm, found.p95_mm, found.unlit, remark, worst_mm),
         actual, expected, difference});
  }

  // Between what any projector that reaches a pixel best would show alone.
  std::pair<cv::Mat, cv::Mat> bounds_of_light() {
    cv::Mat low(check_.viewer.height, check_.viewer.width, CV_32FC3, cv::Scalar::all(0)), high = low.clone();
    const std::vector<cv::Mat> reaches = eye().reaches();
    cv::Mat best = reaches[0].clone();
    for (const cv::Mat& reach : reaches) best = cv::max(best, reach);
    cv::Mat begun(low.size(), CV_8U, cv::Scalar(0));
    for (std::size_t i = 0; i < reaches.size(); ++i) {
      const cv::Mat alone = eye().seen(i, aims()[i].light);
      const cv::Mat candidate = (reaches[i] > 0) & (reaches[i] >= best - k_same_reach);
      cv::Mat(cv::min(low, alone)).copyTo(low, candidate & begun);
      cv::Mat(cv::max(high, alone)).copyTo(high, candidate & begun);
      alone.copyTo(low, candidate & ~begun);
      alone.copyTo(high, candidate & ~begun);
      begun |= candidate;
    }
    return {low, high};
  }

  Status judge_shone() {
    const cv::Mat actual = eye().seen(projector_pictures());
    const auto [low, high] = bounds_of_light();
    const cv::Mat lit = any_channel_over(actual, k_dark) | any_channel_over(high, k_dark);
    if (cv::countNonZero(lit) == 0)
      return nothing_to_judge("shone_…", "a part on the prototype in the viewer's picture");
    const cv::Mat below = low - actual, above = actual - high;
    cv::Mat off = cv::max(below, above);
    off = cv::max(off, 0.0);
    const cv::Mat expected = (low + high) / 2;
    const LevelErrors errors = level_errors(off * 255, expected * 255, lit);
    values_["shone_mean_255"] = errors.mean;
    values_["shone_over4_share"] = errors.over;
    values_["shone_inner_over4_share"] = errors.inner_over;
    pictures_.push_back({"shone", "Light on the prototype, from the viewer's eye", words_of(errors, lit),
                         for_eye(actual), for_eye(expected), grown(off)});
    return {};
  }

  Status judge_spill() {
    double spilt = 0, all = 0;
    for (std::size_t i = 0; i < aims().size(); ++i) {
      const cv::Mat light = linear_of(projector_pictures()[i]);
      cv::Mat forbidden = light.clone();
      forbidden.setTo(0, aims()[i].cover > 0);
      const cv::Scalar sum = cv::sum(light), lost = cv::sum(forbidden);
      all += sum[0] + sum[1] + sum[2];
      spilt += lost[0] + lost[1] + lost[2];
      const std::string& name = check_.told.rig.projectors[i].name;
      pictures_.push_back(
          {"spill-" + name, "Light of " + name,
           "Expected: alone, before light is shared. Difference: light on what no part asks for, 32 times.",
           for_eye(light), for_eye(aims()[i].light), grown(forbidden)});
    }
    if (all == 0) return nothing_to_judge("spill_share", "light");
    values_["spill_share"] = spilt / all;
    return {};
  }

  Result<const Imager*> camera(const std::string& measure) const {
    if (check_.told.rig.cameras.empty()) return nothing_to_judge(measure, "a camera in the world");
    return &check_.told.rig.cameras.front();
  }

  Status judge_drawn() {
    LIMN_TRY(const Imager* camera, this->camera("drawn_…"));
    const cv::Mat black(camera->height, camera->width, CV_8UC3, cv::Scalar::all(0));
    const cv::Mat actual = renderer_->composite(0, black, check_.told.posed, projector::Composite::full);
    const sim::PartPicture seen = aim().seen(world_.rig.cameras.front());
    const cv::Mat expected = for_eye(seen.light);
    const cv::Mat shown = any_channel_over(actual, 0) | (seen.cover > 0);
    if (cv::countNonZero(shown) == 0) return nothing_to_judge("drawn_…", "a part in camera 0's picture");
    cv::Mat off, levels, expected_levels;
    cv::absdiff(actual, expected, off);
    off.convertTo(levels, CV_32F);
    expected.convertTo(expected_levels, CV_32F);
    const LevelErrors errors = level_errors(levels, expected_levels, shown);
    values_["drawn_mean_255"] = errors.mean;
    values_["drawn_over4_share"] = errors.over;
    values_["drawn_inner_over4_share"] = errors.inner_over;
    pictures_.push_back(
        {"drawn", "Parts at " + camera->name, words_of(errors, shown), actual, expected, grown(off)});
    return {};
  }

  // For each pixel the index of the part that the renderer shows, as sim::DepthOrder has it.
  static cv::Mat front_of(const std::vector<projector::PartCoverage>& coverage, const Imager& imager) {
    cv::Mat front(imager.height, imager.width, CV_16S, cv::Scalar(-1));
    for (std::size_t i = 0; i < coverage.size(); ++i)
      front.setTo(static_cast<double>(i), coverage[i].mask != 0);
    return front;
  }

  Status judge_mask() {
    cv::Mat found(check_.viewer.height, check_.viewer.width, CV_8U, cv::Scalar(0)), truth = found.clone();
    for (const auto& part : renderer_->coverage(check_.told.posed, check_.viewer))
      part.mask.copyTo(found, part.mask != 0);
    const cv::Mat front = aim().order(check_.viewer).front;
    const sim::Truth masks(world_, check_.posed);
    for (std::size_t i = 0; i < check_.posed.parts.size(); ++i)
      masks.part_mask(check_.viewer, check_.posed.parts[i].slot).copyTo(truth, front == static_cast<int>(i));
    if (cv::countNonZero(truth) == 0) return nothing_to_judge("mask_iou", "a part in the viewer's picture");
    values_["mask_iou"] = label_iou(found, truth);
    pictures_.push_back({"mask", "On and off the surface, from the viewer's eye",
                         "White is projected, grey is left to the screen. Difference: red.", bgr(found),
                         bgr(truth), label_difference(found, truth)});
    return {};
  }

  Status judge_composite() {
    LIMN_TRY(const Imager* camera, this->camera("composite_px"));
    const Imager doubled = resized(*camera, 2 * camera->width, 2 * camera->height).value();
    const Imager true_doubled =
        resized(world_.rig.cameras.front(), 2 * camera->width, 2 * camera->height).value();
    const cv::Mat found = front_of(renderer_->coverage(check_.told.posed, doubled), doubled);
    const cv::Mat truth = aim().order(true_doubled).front;
    double worst_px = -1;
    std::string caption = "At twice the resolution.";
    for (std::size_t i = 0; i < check_.posed.parts.size(); ++i) {
      const auto part = static_cast<int>(i);
      const cv::Mat expected = truth == part;
      if (cv::countNonZero(expected) < k_least_outline_px) continue;
      const double off_px = outline_distance_px(found == part, expected) / 2;
      caption += fmt::format(" {}: {:.3f} px.", check_.posed.parts[i].slot, off_px);
      worst_px = std::max(worst_px, off_px);
    }
    if (worst_px < 0) return nothing_to_judge("composite_px", "a part in camera 0's picture");
    values_["composite_px"] = worst_px;
    pictures_.push_back({"composite", "Outlines at " + camera->name, caption + " Difference: red.",
                         bgr(shades(found)), bgr(shades(truth)),
                         label_difference(shades(found), shades(truth))});
    return {};
  }

  // Where at camera 0 light and screen meet within a part, away from the part's outline.
  cv::Mat light_meets_screen(const Imager& camera, const cv::Mat& cover) const {
    const sim::Truth masks(world_, check_.posed);
    const cv::Mat front = aim().order(camera).front, near = square(k_edge_window), inner_of = square(5);
    cv::Mat meets(camera.height, camera.width, CV_8U, cv::Scalar(0));
    for (std::size_t i = 0; i < check_.posed.parts.size(); ++i) {
      const cv::Mat mask = masks.part_mask(camera, check_.posed.parts[i].slot);
      cv::Mat lit, left, inner;
      cv::dilate(mask == 255, lit, near);
      cv::dilate(mask == 128, left, near);
      cv::erode((front == static_cast<int>(i)) & (cover > k_whole), inner, inner_of);
      meets |= lit & left & inner;
    }
    return meets;
  }

  // The camera looks at the light that is right for its own eye, and the screen adds the rest: together they
  // should be the parts.
  Status judge_edge() {
    LIMN_TRY(const Imager* camera, this->camera("edge_…"));
    const Imager& true_camera = world_.rig.cameras.front();
    const sim::PartPicture parts = aim().seen(true_camera);
    const cv::Mat meets = light_meets_screen(true_camera, parts.cover);
    if (cv::countNonZero(meets) == 0)
      return nothing_to_judge("edge_…", "a part in camera 0's picture that is half on, half off the surface");
    std::vector<cv::Mat> pictures;
    for (std::size_t i = 0; i < check_.told.rig.projectors.size(); ++i)
      pictures.push_back(renderer_->projector_picture(i, check_.told.posed, *camera));
    const cv::Mat by_light = for_eye(TracedEye(world_, true_camera, k_finer).seen(pictures));
    const cv::Mat together = renderer_->composite(0, by_light, check_.told.posed, projector::Composite::rest);
    const cv::Mat expected = for_eye(parts.light), gap = off_luminance(expected, together),
                  twice = off_luminance(together, expected);
    values_["edge_gap_share"] = p95_of(gap, meets);
    values_["edge_double_share"] = p95_of(twice, meets);
    cv::Mat levels, shown = together / 4;
    cv::Mat(cv::max(gap, twice)).convertTo(levels, CV_8U, 255 / 0.5);
    bgr(levels).copyTo(shown, meets);
    pictures_.push_back(
        {"edge", "Where light meets screen at " + camera->name,
         fmt::format(
             "{} pixels; 95 %: {:.1f} % of the light missing, {:.1f} % shown twice. Difference: there, "
             "up to white at 50 %.",
             cv::countNonZero(meets), 100 * values_["edge_gap_share"], 100 * values_["edge_double_share"]),
         together, expected, shown});
    return {};
  }

  Status judge_depth_order() {
    LIMN_TRY(const Imager* camera, this->camera("depth_order_share"));
    const cv::Mat found = front_of(renderer_->coverage(check_.told.posed, *camera), *camera);
    const sim::DepthOrder truth = aim().order(world_.rig.cameras.front());
    const int contested = cv::countNonZero(truth.contested);
    if (contested == 0)
      return nothing_to_judge("depth_order_share", "a part before or behind something in camera 0's picture");
    values_["depth_order_share"] = share_of(found == truth.front, truth.contested);
    cv::Mat actual = shades(found), expected = shades(truth.front);
    actual.setTo(30, truth.contested & (found < 0));
    expected.setTo(30, truth.contested & (truth.front < 0));
    pictures_.push_back(
        {"depth-order", "What is in front at " + camera->name,
         fmt::format("{} pixels see a part and something else. Dark grey: the prototype is in front of "
                     "a part. Difference: red.",
                     contested),
         bgr(actual), bgr(expected), label_difference(actual, expected)});
    return {};
  }

  Status judge_seams() {
    LIMN_TRY(const auto pictures, drawn_instead(coat(), scene::Mode::surface));
    const cv::Mat actual = fine_eye().seen(pictures);
    const cv::Mat whole = evenly_lit();
    const Steps steps = steps_of(actual, k_coat, whole);
    if (cv::countNonZero(steps.along) == 0)
      return nothing_to_judge("seam_step_…", "a seam of projectors in the viewer's picture");
    values_["seam_step_p95"] = steps.p95_along;
    values_["seam_step_max"] = steps.worst;
    cv::Mat expected(actual.size(), CV_32FC3, cv::Scalar::all(0));
    expected.setTo(cv::Scalar::all(k_coat), whole);
    pictures_.push_back(
        {"seam", "An even coat of light, from the viewer's eye",
         fmt::format("Steps along seams: 95 % {:.2f} %; worst anywhere {:.2f} %. Difference: the seams blue, "
                     "steps up to white at 8 %.",
                     100 * steps.p95_along, 100 * steps.worst),
         for_eye(actual), for_eye(expected), shown_steps(steps, 0.08)});
    return {};
  }

  // Where nothing is to be shown all projectors are on: their blacks add up. Distance and incidence count,
  // for they decide how much black arrives.
  Status judge_black() {
    sim::World glowing = fine_eye().world;
    Rig rig = check_.told.rig;
    for (std::size_t i = 0; i < glowing.projector_effects.size(); ++i) {
      sim::ProjectorEffects& effects = glowing.projector_effects[i];
      effects = {.illuminance_at_1m = 1,
                 .gamma = k_gamma,
                 .black_level = check_.truth.projector_effects[i].black_level};
      rig.responses.push_back(measured_response(effects, rig.projectors[i].name));
    }
    const cv::Mat whole = evenly_lit(), one_black = mean_black(glowing);
    const double brightest = cv::mean(one_black, whole)[0];
    if (!(brightest > 0)) return nothing_to_judge("black_step_share", "projectors whose black gives light");
    LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(check_.told.scene, rig));
    LIMN_TRY_STATUS(renderer.set_light({.even_black = true}));
    const auto pictures = drawn_by(renderer, {check_.told.posed.world_from_prototype, {}});
    const cv::Mat actual = fine_eye().seen(glowing, pictures);
    const Steps steps = steps_of(actual / one_black, 1, whole);
    if (cv::countNonZero(steps.along) == 0)
      return nothing_to_judge("black_step_share", "a seam of projectors in the viewer's picture");
    values_["black_step_share"] = steps.worst_along;
    const double brightness = 0.1 / brightest;  // for the eye
    cv::Mat even = one_black * static_cast<double>(fine_reaches_.size());
    even.setTo(0, ~whole);
    pictures_.push_back(
        {"black", "The light of black, brightened",
         fmt::format(
             "Steps along seams: 95 % {:.1f} %, worst {:.1f} % of a projector's black. Difference: the seams "
             "blue, steps up to white at 40 %.",
             100 * steps.p95_along, 100 * steps.worst_along),
         for_eye(actual * brightness), for_eye(even * brightness), shown_steps(steps, 0.4)});
    return {};
  }

  // The light of one projector's black in the viewer's pixels, the mean of all as if each reached all that
  // faces it (CV_32FC3).
  cv::Mat mean_black(const sim::World& glowing) {
    const sim::Samples& samples = fine_eye().samples;
    cv::Mat light(samples.height, samples.width, CV_32FC3, cv::Scalar::all(0));
    const std::size_t projectors = glowing.rig.projectors.size();
    for (std::size_t i = 0; i < projectors; ++i) {
      const auto black =
          static_cast<float>(glowing.projector_effects[i].black_level / static_cast<double>(projectors));
      for (std::size_t k = 0; k < light.total(); ++k) {
        if (samples.object[k] < 0) continue;
        const Eigen::Vector3f towards = p_projector(i) - samples.p_world[k];
        const float cosine = samples.n_world[k].dot(towards.normalized());
        light.at<cv::Vec3f>(static_cast<int>(k)) +=
            cv::Vec3f::all(black * std::max(0.0F, cosine) / towards.squaredNorm());
      }
    }
    return binned(light, k_finer);
  }

  Eigen::Vector3f p_projector(std::size_t i) const {
    return world_.rig.projectors[i].imager_from_world.inverse().translation.cast<float>();
  }

  // As limn solve would measure it.
  static Response measured_response(const sim::ProjectorEffects& effects, const std::string& projector) {
    Response response;
    response.projector = projector;
    for (int value = 0; value < 256; ++value)
      response.green.push_back(sim::light_share(effects, 1, value / 255.0));
    response.red = response.blue = response.green;
    response.black_level = Measured{effects.black_level, 0};
    return response;
  }

  // Pixels that the projectors can light evenly: one of them reaches the whole pixel at no grazing angle,
  // away from where all light ends.
  cv::Mat evenly_lit() {
    const sim::Samples& samples = fine_eye().samples;
    cv::Mat lit(check_.viewer.height, check_.viewer.width, CV_8U, cv::Scalar(0));
    for (std::size_t i = 0; i < fine_reaches_.size(); ++i) {
      const Eigen::Vector3f p_light = p_projector(i);
      cv::Mat steep(samples.height, samples.width, CV_32F, cv::Scalar(0));
      for (std::size_t k = 0; k < steep.total(); ++k)
        if (samples.n_world[k].dot((p_light - samples.p_world[k]).normalized()) > k_min_incidence_cosine)
          steep.at<float>(static_cast<int>(k)) = 1;
      lit |= (fine_reaches_[i] > k_whole) & (binned(steep, k_finer) > k_whole);
    }
    cv::erode(lit, lit, square(k_light_end));
    return lit;
  }

  // How far luminance varies around each pixel as a share of `unit`, over `whole`; and where other projectors
  // begin.
  struct Steps {
    cv::Mat step;   // CV_32F
    cv::Mat along;  // CV_8U
    double p95_along = 0, worst_along = 0, worst = 0;
  };

  Steps steps_of(const cv::Mat& light, double unit, const cv::Mat& whole) {
    cv::Mat ratio, weight;
    cv::transform(light, ratio, cv::Matx13f(0.0722F, 0.7152F, 0.2126F) * static_cast<float>(1 / unit));
    whole.convertTo(weight, CV_32F, 1.0 / 255);
    ratio = ratio.mul(weight);
    cv::GaussianBlur(ratio, ratio, {0, 0}, k_seam_blur_px);
    cv::GaussianBlur(weight, weight, {0, 0}, k_seam_blur_px);
    ratio /= cv::max(weight, 1e-6);
    const cv::Mat window = square(k_seam_window);
    const auto range = [&](const cv::Mat& values) {
      cv::Mat highest = values.clone(), lowest = values.clone();
      highest.setTo(-1e9, ~whole);
      lowest.setTo(1e9, ~whole);
      cv::dilate(highest, highest, window);
      cv::erode(lowest, lowest, window);
      cv::Mat difference = highest - lowest;
      difference.setTo(0, ~whole);
      return difference;
    };
    Steps steps{range(ratio), cv::Mat(light.size(), CV_8U, cv::Scalar(0))};
    for (const cv::Mat& reach : fine_reaches_) {
      cv::Mat reached;
      cv::Mat(reach > 0.5).convertTo(reached, CV_32F);
      steps.along |= range(reached) > 0;
    }
    cv::minMaxLoc(steps.step, nullptr, &steps.worst);
    cv::minMaxLoc(steps.step, nullptr, &steps.worst_along, nullptr, nullptr, steps.along);
    steps.p95_along = p95_of(steps.step, steps.along);
    return steps;
  }

  static cv::Mat shown_steps(const Steps& steps, double white) {
    cv::Mat seams(steps.step.size(), CV_8UC3, cv::Scalar::all(0)), grey;
    seams.setTo(cv::Scalar(90, 70, 40), steps.along);
    steps.step.convertTo(grey, CV_8U, 255 / white);
    return cv::max(seams, bgr(grey));
  }

  // In the world as it is, room, noise and all.
  Status judge_refill() {
    const auto [scene, posed] = check_.told.posed.parts.empty()
                                    ? shown_instead(coat(), scene::Mode::surface)
                                    : std::pair(check_.told.scene, check_.told.posed);
    const auto reading =
        judged_refill(check_.truth, scene, posed, check_.viewer, check_.hand, check_.truth.seed);
    if (!reading) return error("{}: {}", check_.name, reading.message());
    values_["refill_share"] = reading->share;
    values_["refill_flash_share"] = reading->flash;
    values_["refill_still_255"] = reading->still_levels;
    std::string shares;
    for (const RefillFrame& frame : reading->frames)
      shares += fmt::format("{} {} {:.0f} %", shares.empty() ? "" : ",", frame.phase, 100 * frame.share);
    pictures_.push_back(
        {"refill", "Light with a hand before a projector",
         fmt::format("Expected: without the hand. Back of what the shadow takes, frame by frame:{}. "
                     "Brighter by {:.1f} % at most. Difference: 32 times.",
                     shares, 100 * reading->flash),
         for_eye(reading->refilled), for_eye(reading->before),
         grown(cv::abs(reading->refilled - reading->before))});
    return {};
  }

  Status judge_rerun() {
    LIMN_TRY(projector::Renderer again, projector::Renderer::create(check_.told.scene, check_.told.rig));
    auto first = projector_pictures();
    auto second = drawn_by(again, check_.told.posed);
    if (!check_.told.rig.cameras.empty()) {
      const Imager& camera = check_.told.rig.cameras.front();
      const cv::Mat black(camera.height, camera.width, CV_8UC3, cv::Scalar::all(0));
      first.push_back(renderer_->composite(0, black, check_.told.posed, projector::Composite::full));
      second.push_back(again.composite(0, black, check_.told.posed, projector::Composite::full));
    }
    values_["rerun_worst_255"] = worst_difference(first, second);
    return {};
  }

  const Check& check_;
  sim::World world_;  // the stage
  std::set<std::string> asked_;
  std::optional<projector::Renderer> renderer_;
  std::vector<cv::Mat> projector_pictures_;
  std::vector<sim::PartPicture> aims_;
  std::optional<TracedEye> eye_, fine_eye_;
  std::vector<cv::Mat> fine_reaches_;
  std::map<std::string, double> values_;
  std::vector<CheckPicture> pictures_;
};

}  // namespace

double CheckReading::strain() const {
  const double used = limit.measure.least ? 1 - value : value,
               allowed = limit.measure.least ? 1 - limit.value : limit.value;
  if (good()) return allowed > 0 ? std::min(1.0, used / allowed) : 0;
  return allowed > 0 ? used / allowed : std::numeric_limits<double>::infinity();
}

bool CheckResult::good() const {
  return problem.empty() &&
         std::all_of(readings.begin(), readings.end(), [](const CheckReading& r) { return r.good(); });
}

Result<CheckResult> judged(const Check& check) {
  if (check.truth.rig.projectors.empty())
    return error("{}: expected a world with a projector, found none.", check.name);
  return Judge(check).run();
}

}  // namespace limn::apps
