#include "session/recording.h"

#include <cstring>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "device/jpeg.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t k_most_queued = 40;  // frames; 240 MB of colour 1920x1080

std::int64_t nanoseconds(Stamp at) { return at.time_since_epoch().count(); }

Status copy_folder(const fs::path& from, const fs::path& to) {
  std::error_code problem;
  fs::create_directories(to, problem);
  if (!problem)
    fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::overwrite_existing, problem);
  if (!problem) return {};
  return error("{}: expected a folder that can be copied to {}, found: {}.", from.string(), to.string(),
               problem.message());
}

Status save_whole_rig(const Rig& rig, const fs::path& folder) {
  LIMN_TRY_STATUS(save_rig(rig, folder));
  if (rig.responses.empty() && rig.camera_responses.empty()) return {};
  return save_responses({rig.responses, rig.camera_responses}, {}, folder);
}

nlohmann::ordered_json feed_json(const tracker::FeedSetup& feed) {
  nlohmann::ordered_json json = {{"name", feed.name}, {"delay_s", feed.delay_s}};
  if (feed.world_from_feed) json["world_from_feed"] = to_json(*feed.world_from_feed);
  json["bodies"] = nlohmann::ordered_json::array();
  for (const tracker::FeedBody& body : feed.bodies) {
    json["bodies"].push_back(
        {{"sensor", body.sensor}, {"body", body.body}, {"needs_position_only", body.needs_position_only}});
    if (body.body_from_sensor) json["bodies"].back()["body_from_sensor"] = to_json(*body.body_from_sensor);
  }
  return json;
}

tracker::FeedSetup read_feed_setup(const ConfigNode& node) {
  node.only({"name", "delay_s", "world_from_feed", "bodies"});
  tracker::FeedSetup feed{node.at("name").text(), {}, std::nullopt, node.at("delay_s").number()};
  if (const auto pose = node.find("world_from_feed")) feed.world_from_feed = pose->pose();
  for (const ConfigNode& item : node.at("bodies").items()) {
    item.only({"sensor", "body", "needs_position_only", "body_from_sensor"});
    feed.bodies.push_back({item.at("sensor").text(), item.at("body").text(), std::nullopt,
                           item.at("needs_position_only").boolean()});
    if (const auto pose = item.find("body_from_sensor")) feed.bodies.back().body_from_sensor = pose->pose();
  }
  return feed;
}

// A list for each feed. Numbers have all their digits, so that a replay gets the same ones.
nlohmann::ordered_json feeds_json(const FeedInput& input) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& of_feed : input.poses) {
    json.push_back(nlohmann::ordered_json::array());
    for (const auto& [pose, arrived_at] : of_feed) {
      const Eigen::Vector3d& p = pose.feed_from_sensor.translation;
      const Eigen::Quaterniond& q = pose.feed_from_sensor.rotation;
      nlohmann::ordered_json item = {{"sensor", pose.sensor}, {"arrived_at_ns", nanoseconds(arrived_at)}};
      if (pose.is_lost) item["lost"] = true;
      if (!pose.is_lost) item["p_m"] = {p.x(), p.y(), p.z()};
      if (!pose.is_lost && pose.has_rotation) item["rotation_wxyz"] = {q.w(), q.x(), q.y(), q.z()};
      if (pose.time_s) item["time_s"] = *pose.time_s;
      if (pose.stddev_m) item["stddev_m"] = *pose.stddev_m;
      if (pose.stddev_rad) item["stddev_rad"] = *pose.stddev_rad;
      json.back().push_back(std::move(item));
    }
  }
  return json;
}

nlohmann::ordered_json setup_json(const SessionSetup& setup) {
  const tracker::MotionModel& motion = setup.watch.motion;
  const ComposeOptions& paint = setup.paint;
  nlohmann::ordered_json feeds = nlohmann::ordered_json::array();
  for (const tracker::FeedSetup& feed : setup.watch.feeds) feeds.push_back(feed_json(feed));
  return {{"schema", "limn.session/1"},
          {"rig", "rig"},
          {"scene", "scene"},
          {"full_scan_every", setup.watch.full_scan_every},
          {"motion",
           {{"jerk", motion.jerk},
            {"turn_jerk", motion.turn_jerk},
            {"drift", motion.drift},
            {"turn_drift", motion.turn_drift},
            {"starts_per_s", motion.starts_per_s},
            {"stops_per_s", motion.stops_per_s},
            {"extrapolation_limit_s", motion.extrapolation_limit_s}}},
          {"triple_pose", tracker::k_triple_poses.text(setup.watch.triple_pose)},
          {"prediction", tracker::k_predictions.text(paint.prediction)},
          {"marker_light", tracker::k_marker_lights.text(paint.marker_light)},
          {"fade_s", paint.fade_s},
          {"label_s", paint.label_s},
          {"lost_s", paint.lost_s},
          {"stereo_mm", paint.stereo_mm},
          {"stereo_projectors", paint.stereo_projectors},
          {"refill", paint.refill},
          {"screens", setup.screens},
          {"feeds", feeds}};
}

}  // namespace

Status save_deviation(const scene::DeviationLayer& layer, const fs::path& folder) {
  LIMN_TRY_STATUS(make_folder(folder));
  return write_file(folder / k_deviation_file, scene::bytes_of(layer));
}

Result<std::shared_ptr<const scene::DeviationLayer>> load_deviation(const fs::path& folder) {
  LIMN_TRY(const std::string bytes, read_file(folder / k_deviation_file));
  auto layer = scene::deviation_layer_of(bytes);
  if (!layer) return error("{}: {}", (folder / k_deviation_file).string(), layer.message());
  return std::make_shared<const scene::DeviationLayer>(std::move(*layer));
}

Status save_setup(const SessionSetup& setup, const fs::path& folder) {
  LIMN_TRY_STATUS(make_folder(folder));
  LIMN_TRY_STATUS(save_whole_rig(setup.rig, folder / "rig"));
  LIMN_TRY_STATUS(copy_folder(setup.scene.folder, folder / "scene"));
  if (setup.deviation) LIMN_TRY_STATUS(save_deviation(*setup.deviation, folder));
  return write_file(folder / "session.json", json_text(setup_json(setup), 2) + "\n");
}

Recorder::Recorder(const fs::path& folder) : folder_(folder), images_(k_most_queued) {}

Result<std::unique_ptr<Recorder>> Recorder::create(const fs::path& folder, const SessionSetup& setup) {
  if (fs::exists(folder / "session.json"))
    return error(
        "{}: expected a folder without a session, found one. Name another folder; nothing was changed.",
        folder.string());
  std::error_code ignored;
  const bool is_fresh = !fs::exists(folder, ignored) || fs::is_empty(folder, ignored);
  auto begun = begin(folder, setup);
  if (!begun && is_fresh)
    for (const auto& entry : fs::directory_iterator(folder, ignored)) fs::remove_all(entry.path(), ignored);
  return begun;
}

Result<std::unique_ptr<Recorder>> Recorder::begin(const fs::path& folder, const SessionSetup& setup) {
  LIMN_TRY_STATUS(save_setup(setup, folder));
  for (const Imager& camera : setup.rig.cameras)
    LIMN_TRY_STATUS(make_folder(folder / "frames" / camera.name));
  std::unique_ptr<Recorder> out(new Recorder(folder));
  out->events_.open(folder / "events.jsonl");
  if (!out->events_)
    return error(
        "{}: expected a file that can be written, found none. Check the permissions and the free disk space.",
        (folder / "events.jsonl").string());
  return out;
}

void Recorder::record_frames(std::span<const Frame> frames, const FeedInput& input) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  nlohmann::ordered_json event;
  if (!queue_images(frames, &event["watch"])) return;
  if (input.has_poses()) event["feeds"] = feeds_json(input);
  for (const tracker::CameraDetections& found : input.detections)
    event["detections"].push_back(tracker::to_json(found));
  if (!input.images.empty() && !queue_images(input.images, &event["images"])) return;
  write(event);
}

bool Recorder::queue_images(std::span<const Frame> frames, nlohmann::ordered_json* list) {
  *list = nlohmann::ordered_json::array();
  for (const Frame& frame : frames) {
    const std::string file =
        fmt::format("frames/{}/{:06}.{}", frame.camera, frames_++, frame.jpeg ? "jpg" : "png");
    if (!(frame.jpeg ? images_.offer(folder_ / file, frame.jpeg)
                     : images_.offer(folder_ / file, frame.image))) {
      end("the disk is full or too slow for the cameras' images");
      return false;
    }
    list->push_back(
        {{"camera", frame.camera}, {"file", file}, {"captured_at_ns", nanoseconds(frame.captured_at)}});
  }
  return true;
}

void Recorder::record_scene(const scene::Scene& scene) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  const std::string copy = fmt::format("scene-{}", ++scenes_);
  if (!copy_folder(scene.folder, folder_ / copy)) return end("the scene's files could not be copied");
  write({{"scene", copy}});
}

Rig Recorder::record_rig(Rig rig, std::size_t moments) {
  const std::lock_guard lock(mutex_);
  if (ended_) return rig;
  const std::string copy = fmt::format("rig-{}", ++rigs_);
  const Status saved = save_whole_rig(rig, folder_ / copy);
  Result<Rig> read = saved ? load_rig(folder_ / copy) : Result<Rig>(saved.error());
  if (!read) {
    end("the corrected rig could not be written");
    return rig;
  }
  write({{"rig", copy}, {"moments", moments}});
  return std::move(*read);
}

void Recorder::record_deviation(const scene::DeviationLayer& layer, std::size_t moments) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  const std::string file = fmt::format("deviation-{}", ++deviations_);
  if (!write_file(folder_ / file, scene::bytes_of(layer)))
    return end("the deviation from the CAD could not be written");
  write({{"deviation", file}, {"moments", moments}});
}

void Recorder::record_edit(const scene::Edit& edit, const std::string& source, std::size_t moments) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  write({{"edit", {{"action", edit.action}, {"slot", edit.slot}, {"value", edit.value}}},
         {"source", source},
         {"moments", moments}});
}

void Recorder::record_tablet(const std::string& guest,
                             const std::optional<Eigen::Vector3d>& p_eye_world,
                             Stamp at) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  nlohmann::ordered_json eye = {{"guest", guest}, {"at_ns", nanoseconds(at)}};
  if (p_eye_world) eye["p_world"] = {p_eye_world->x(), p_eye_world->y(), p_eye_world->z()};
  write({{"eye", eye}});
}

void Recorder::record_dark_projectors(const std::vector<std::string>& names) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  write({{"dark", names}});
}

void Recorder::record_images(const ComposedFrame& composed, std::size_t moments) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  write({{"paint", pose_log(composed)},
         {"moments", moments},
         {"pictures", fmt::format("{:016x}", fingerprint(composed.eye_images()))}});
}

void Recorder::write(const nlohmann::ordered_json& event) {
  events_ << json_text(event) << '\n';
  if (!events_.flush()) end("the disk is full");
}

void Recorder::end(const std::string& why) { ended_ = why; }

std::optional<std::string> Recorder::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

Status Recorder::finish() { return images_.finish(); }

std::uint64_t fingerprint(std::span<const cv::Mat> images) {
  std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a's offset, here over words of eight bytes
  const auto add = [&](std::uint64_t word) {
    hash = (hash ^ word) * 0x100000001b3;
    hash ^= hash >> 29;
  };
  for (const cv::Mat& image : images) {
    const std::size_t length = static_cast<std::size_t>(image.cols) * image.elemSize();
    for (int row = 0; row < image.rows; ++row) {
      const std::uint8_t* bytes = image.ptr(row);
      for (std::size_t i = 0; i < length; i += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, bytes + i, std::min<std::size_t>(8, length - i));
        add(word);
      }
    }
    add(length);
  }
  return hash;
}

nlohmann::ordered_json pose_log(const ComposedFrame& composed) {
  nlohmann::ordered_json json = {{"painted_at_ns", nanoseconds(composed.painted_at)},
                                 {"shown_at_ns", nanoseconds(composed.shown_at)}};
  json["tracks"] = nlohmann::ordered_json::array();
  for (const Track& track : composed.tracks)
    json["tracks"].push_back({{"body", track.body},
                              {"sight", static_cast<int>(track.tracking)},
                              {"world_from_body", to_json(track.world_from_body)}});
  json["parts"] = nlohmann::ordered_json::array();
  for (const scene::PosedPart& part : composed.posed.parts)
    json["parts"].push_back(
        {{"slot", part.slot}, {"variant", part.variant}, {"world_from_part", to_json(part.world_from_part)}});
  if (const auto& p = composed.p_guest_eye_world) json["guest_eye"] = {p->x(), p->y(), p->z()};
  return json;
}

FeedInput recorded_feeds(const nlohmann::ordered_json& event) {
  FeedInput input;
  if (event.contains("detections"))
    for (const auto& found : event.at("detections"))
      input.detections.push_back(tracker::camera_detections_of(found));
  if (!event.contains("feeds")) return input;
  for (const auto& list : event.at("feeds")) {
    input.poses.emplace_back();
    for (const auto& item : list) {
      ForeignPose pose;
      pose.sensor = item.at("sensor");
      pose.is_lost = item.value("lost", false);
      pose.has_rotation = pose.is_lost || item.contains("rotation_wxyz");
      const auto optional = [&](const char* key, std::optional<double>* to) {
        if (item.contains(key)) *to = item.at(key).get<double>();
      };
      optional("time_s", &pose.time_s);
      optional("stddev_m", &pose.stddev_m);
      optional("stddev_rad", &pose.stddev_rad);
      for (int i = 0; !pose.is_lost && i < 3; ++i)
        pose.feed_from_sensor.translation[i] = item.at("p_m").at(static_cast<std::size_t>(i)).get<double>();
      if (!pose.is_lost && pose.has_rotation) {
        const auto& q = item.at("rotation_wxyz");  // not normalised again: that could change the last digit
        pose.feed_from_sensor.rotation = {q.at(0).get<double>(), q.at(1).get<double>(), q.at(2).get<double>(),
                                          q.at(3).get<double>()};
      }
      const Stamp arrived_at =
          Stamp{} + std::chrono::nanoseconds(item.at("arrived_at_ns").get<std::int64_t>());
      input.poses.back().push_back({std::move(pose), arrived_at});
    }
  }
  return input;
}

Result<Frame> load_frame(const fs::path& file) {
  Frame frame;
  if (file.extension() != ".jpg") {
    LIMN_TRY(frame.image, read_image(file));
    return frame;
  }
  LIMN_TRY(std::string bytes, read_file(file));
  Result<Frame> decoded = device::decode_frame(std::move(bytes));
  if (!decoded) return error("{}: {}", file.string(), decoded.message());
  return decoded;
}

Result<SessionSetup> load_setup(const fs::path& folder) {
  LIMN_TRY(const Config config, Config::load(folder / "session.json", "limn.session/1"));
  const ConfigNode root = config.root();
  root.only({"schema", "rig", "scene", "full_scan_every", "motion", "triple_pose", "prediction",
             "marker_light", "fade_s", "label_s", "lost_s", "stereo_mm", "stereo_projectors", "refill",
             "screens", "feeds"});
  SessionSetup setup;
  setup.watch.full_scan_every = root.at("full_scan_every").integer();
  if (setup.watch.full_scan_every < 1) root.at("full_scan_every").problem("expected 1 or more, found less.");
  const ConfigNode motion = root.at("motion");
  tracker::MotionModel& model = setup.watch.motion;
  model.jerk = motion.at("jerk").positive();
  model.turn_jerk = motion.at("turn_jerk").positive();
  model.drift = motion.at("drift").positive();
  model.turn_drift = motion.at("turn_drift").positive();
  model.starts_per_s = motion.at("starts_per_s").positive();
  model.stops_per_s = motion.at("stops_per_s").positive();
  model.extrapolation_limit_s = motion.at("extrapolation_limit_s").positive();
  setup.paint.motion = model;
  if (const auto method = root.find("triple_pose"))
    setup.watch.triple_pose = tracker::k_triple_poses.read(*method);
  setup.paint.prediction = tracker::k_predictions.read(root.at("prediction"));
  setup.paint.marker_light = tracker::k_marker_lights.read(root.at("marker_light"));
  setup.paint.fade_s = root.at("fade_s").positive();
  setup.paint.label_s = root.at("label_s").positive();
  setup.paint.lost_s = root.at("lost_s").positive();
  setup.paint.stereo_mm = root.at("stereo_mm").number();
  if (const auto projectors = root.find("stereo_projectors"))
    for (const ConfigNode& name : projectors->items()) setup.paint.stereo_projectors.push_back(name.text());
  setup.paint.refill = root.at("refill").boolean();
  if (const auto screens = root.find("screens"))
    for (const ConfigNode& name : screens->items()) setup.screens.push_back(name.text());
  if (const auto feeds = root.find("feeds"))
    for (const ConfigNode& feed : feeds->items()) setup.watch.feeds.push_back(read_feed_setup(feed));
  const fs::path rig = root.at("rig").path_inside(), scene = root.at("scene").path_inside();
  LIMN_TRY_STATUS(config.status());
  LIMN_TRY(setup.rig, load_rig(rig));
  std::vector<scene::SkippedVariant> skipped_variants;  // the session has left them out, too
  LIMN_TRY(setup.scene, scene::load_scene(scene, &skipped_variants));
  if (fs::exists(folder / k_deviation_file)) {
    LIMN_TRY(setup.deviation, load_deviation(folder));
  }
  return setup;
}

}  // namespace limn::session
