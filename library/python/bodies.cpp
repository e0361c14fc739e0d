#include "limn/bodies.h"

#include <utility>

#include "library/python/calls.h"
#include "library/python/record.h"

namespace limn::python {
namespace {

// What one camera's image shows, in Python's order: (camera, markers).
using Pair = std::pair<Imager, std::vector<Marker>>;

// Borrows the pairs.
std::vector<View> views_of(const std::vector<Pair>& pairs) {
  std::vector<View> views;
  for (const auto& [camera, markers] : pairs) views.push_back({&camera, markers});
  return views;
}

constexpr const char* k_covariance =
    R"(Of a small change (w, v): w (rad) is a rotation about the world's axes, R' = Exp(w) R; v (m) is
added to the translation. Shape (6, 6).)";

void add_body(py::module_& module) {
  Record<BodyMarker>(module, "BodyMarker", "A marker on a body.")
      .field("family", &BodyMarker::family, "Its family.")
      .field("id", &BodyMarker::id, "Its id, a str.")
      .field("size_m", &BodyMarker::size_m, "Side of the black square, at its outer edges: m.")
      .field("body_from_marker", &BodyMarker::body_from_marker, "Where it is on the body.")
      .init(
          [](std::string family, std::string id, double size_m, const Pose& body_from_marker) {
            return BodyMarker{std::move(family), std::move(id), size_m, body_from_marker};
          },
          py::arg("family"), py::arg("id"), py::arg("size_m"),
          py::arg_v("body_from_marker", Pose{}, "Pose()"))
      .ended();
  Record<Body>(module, "Body", "A rigid thing with markers on it.")
      .field("name", &Body::name, "Its name.")
      .field("markers", &Body::markers, "Its markers, a tuple of BodyMarker.")
      .init(
          [](std::string name, std::vector<BodyMarker> markers) {
            return Body{std::move(name), std::move(markers)};
          },
          py::arg("name"), py::arg("markers"))
      .ended();
}

void add_track(py::module_& module) {
  Record<Track>(module, "Track", "A body's pose at a moment.")
      .field("body", &Track::body, "The body's name.")
      .field("world_from_body", &Track::world_from_body, "The pose.")
      .array<6, 6>("covariance", &Track::covariance, k_covariance)
      .field("marker_count", &Track::marker_count, "Markers in the newest images.")
      .field("rms_px", &Track::rms_px, "Residual of the markers' corners.")
      .field("captured_at_s", &Track::captured_at_s,
             "When the newest image that showed the body was taken: s.")
      .field("at_s", &Track::at_s, "The moment of the pose: s.")
      .field(
          "tracking", &Track::tracking,
          R"('measured': seen in the newest images; 'extrapolated': predicted from earlier images, for a limited
time; 'lost': not seen for longer: the pose is the last one and must not be shown.)")
      .init(
          [](std::string body, const Pose& world_from_body, const Numbers<double, 6, 6>& covariance,
             int marker_count, double rms_px, double captured_at_s, double at_s, Tracking tracking) {
            return Track{std::move(body),
                         world_from_body,
                         covariance.values,
                         marker_count,
                         rms_px,
                         captured_at_s,
                         at_s,
                         tracking};
          },
          py::arg("body"), py::arg("world_from_body"), py::arg("covariance"), py::arg("marker_count") = 0,
          py::arg("rms_px") = 0.0, py::arg("captured_at_s") = 0.0, py::arg("at_s") = 0.0,
          py::arg_v("tracking", Tracking::measured, "'measured'"))
      .ended();
}

void add_tracker(py::module_& module) {
  const Motion hand;
  py::class_<Tracker>(
      module, "Tracker",
      R"(Follows bodies over time: what `limn live` does with its cameras. Times are seconds on any clock
that never goes back (of the cameras' stamps: the middle of the exposure). For one thread at a time.

    tracker = limn.Tracker([body])
    tracker.update([(camera, detector.detect(image, camera))], captured_at_s)
    for track in tracker.predict(shown_at_s): ...)")
      .def(py::init([](std::vector<Body> bodies, double jerk, double turn_jerk, double drift,
                       double turn_drift, double starts_per_s, double stops_per_s,
                       double extrapolation_limit_s) {
             return Tracker(std::move(bodies), {jerk, turn_jerk, drift, turn_drift, starts_per_s, stops_per_s,
                                                extrapolation_limit_s});
           }),
           py::arg("bodies"), py::kw_only(), py::arg("jerk") = hand.jerk,
           py::arg("turn_jerk") = hand.turn_jerk, py::arg("drift") = hand.drift,
           py::arg("turn_drift") = hand.turn_drift, py::arg("starts_per_s") = hand.starts_per_s,
           py::arg("stops_per_s") = hand.stops_per_s,
           py::arg("extrapolation_limit_s") = hand.extrapolation_limit_s,
           R"(How bodies are expected to move (the defaults suit a hand): jerk: white jerk of a moving body,
m²/s⁵; higher follows sooner and jitters more. turn_jerk: rad²/s⁵. drift: random walk of a body that
stands, m per square root of a second. turn_drift: rad per square root of a second. starts_per_s:
how often a still body begins to move. stops_per_s: how often a moving one comes to rest.
extrapolation_limit_s: not seen for longer: lost. Error: two bodies of one name, a body without
markers, a size that is not positive.)")
      .def(
          "update",
          [](Tracker& tracker, const std::vector<Pair>& views, double captured_at_s) {
            tracker.update(views_of(views), captured_at_s);
          },
          py::arg("views"), py::arg("captured_at_s"),
          R"(Adds the images that were taken at one moment: (camera, markers) of all cameras that took one.
Images older than the newest ones change nothing.)")
      .def("predict", &Tracker::predict, py::arg("at_s"),
           R"(The poses of all bodies that have been seen, at a moment: usually when the light will be shown.
Covariances grow with the time since the newest image.)");
}

}  // namespace

void add_bodies(py::module_& module) {
  add_body(module);
  add_track(module);
  module.def(
      "load_body",
      [](const std::filesystem::path& path, const std::string& name) {
        return without_gil([&] { return load_body(path, name); });
      },
      py::arg("path"), py::arg("name"),
      R"(Reads limn.body/1 (`limn markers --learn-body` writes it) or limn.markers/1 (`limn align --body`);
both in docs/formats.md. Error: a file that cannot be read; the message names the entry.)");
  module.def(
      "families_of", [](const std::vector<Body>& bodies) { return families_of(bodies); }, py::arg("bodies"),
      "The families that a detector needs for these bodies, each once.");
  module.def(
      "locate_bodies",
      [](const std::vector<Body>& bodies, const std::vector<Pair>& views) {
        return without_gil([&] { return locate_bodies(bodies, views_of(views)); });
      },
      py::arg("bodies"), py::arg("views"),
      R"(The poses of bodies in the images of one moment alone, without history; views: (camera, markers) of
each camera. Bodies that no camera sees are absent; captured_at_s and at_s are 0. Cameras stand
where their imager_from_world says. Errors: as of Tracker.)");
  add_tracker(module);
}

}  // namespace limn::python
