// A stroke on the page's picture, through the whole path: messages of a guest, the session, and the
// projectors' images, in which the line is searched. Where the light falls is computed here, with the world's
// true poses and a plain intersection of rays with triangles.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "device/gl_context.h"
#include "scene/lines/line_file.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/remote/a_server.h"
#include "tests/support/worlds.h"

namespace limn::remote {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_messages = 12, k_points_each = 6;  // a page sends about so many points in a message
constexpr double k_seen_step = 40;                 // of 255; the light of a line over that before it

// Where a ray meets a mesh first, m along it; infinity: nowhere (Möller and Trumbore).
double first_hit(const scene::Mesh& mesh, const Vector3d& p, const Vector3d& d) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = mesh.positions[triangle[0]].cast<double>(),
                   ab = mesh.positions[triangle[1]].cast<double>() - a,
                   ac = mesh.positions[triangle[2]].cast<double>() - a, normal = d.cross(ac);
    const double determinant = ab.dot(normal);
    if (std::abs(determinant) < 1e-14) continue;
    const Vector3d from_a = p - a, across = from_a.cross(ab);
    const double u = from_a.dot(normal) / determinant, v = d.dot(across) / determinant,
                 t = ac.dot(across) / determinant;
    if (u >= 0 && v >= 0 && u + v <= 1 && t > 1e-6) nearest = std::min(nearest, t);
  }
  return nearest;
}

// A served session on the studio whose prototype stands still, as long as the stroke lasts.
class AServedStroke : public AServer {
 protected:
  void SetUp() override {
    AServer::SetUp();
    world_ = test::studio_world(0.5);
    auto context = device::GlContext::create();
    ASSERT_TRUE(context) << context.message();
    context_.emplace(std::move(*context));
    session::SessionSetup setup;
    setup.rig = world_.rig;
    setup.scene = *world_.scene;
    setup.paint.prepares_lines = true;
    setup.scene.folder = folder_ / "project";
    fs::create_directories(setup.scene.folder);
    telemetry_.emplace(session::Telemetry::create({}).value());
    session_.emplace(session::Session::create(setup, &*telemetry_, nullptr).value());
    auto perception = session::Perception::create(setup.scene, setup.rig).value();
    sim::VirtualRig rig(world_, {.grab_waits_for_light = false, .follows_changes = true});
    const int camera = 0;
    for (std::size_t i = 0; i < 8; ++i)
      session_->update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), i + 1);
    at_ = rig.now();
    health_.add({.name = "camera0", .kind = "camera"});
    ImageProviders providers;
    providers.draw_room = [this](ImageCallback answer) {  // as the tablet view's, with no image
      answer({R"({"why":""})", {0xff, 0xd8}, {}, over_prototype_});
    };
    compose();
    const auto& posed = session_->composed().posed;
    ASSERT_TRUE(posed.world_from_prototype);
    over_prototype_ = world_.rig.cameras[0];  // as the session knows it
    over_prototype_->imager_from_world = over_prototype_->imager_from_world * *posed.world_from_prototype;
    for (const cv::Mat& image : session_->composed().projectors) before_.push_back(image.clone());
    open({}, std::move(providers));
  }
  void TearDown() override { server_.reset(); }

  // A turn of the frame loop.
  void compose() {
    if (server_) {
      server_->apply_edits(&*session_, at_);
      server_->publish_state(*session_, *telemetry_, health_, at_);
    }
    session_->compose_and_record(at_, shifted(at_, 0.03));
  }

  const scene::Mesh& door() const { return world_.scene->prototype->mesh; }
  // The true place of the prototype (its frame, m) that an imager's pixel shows or lights; nullopt: none.
  std::optional<Vector3d> true_place(const Imager& imager, const Vector2d& px) const {
    const auto ray = imager.ray(px);
    if (!ray) return std::nullopt;
    const Pose prototype_from_world = world_.world_from_prototype.inverse();
    const Vector3d p = prototype_from_world * ray->p_origin, d = prototype_from_world.rotation * ray->d;
    const double t = first_hit(door(), p, d);
    return std::isfinite(t) ? std::optional<Vector3d>(p + t * d) : std::nullopt;
  }

  // The arch on the camera's picture, well inside the door, from t = 0 to 1.
  Vector2d drawn_px(double t) const {
    const Pose camera_from_prototype = world_.rig.cameras[0].imager_from_world * world_.world_from_prototype;
    const Vector3d p(0.06 * t, 0.03 * std::sin(3 * t), 0.02);
    return world_.rig.cameras[0].lens.project(camera_from_prototype * p).value();
  }
  static double t_of(int point) { return point / (k_messages * k_points_each - 1.0); }

  // The light of a projector's pixel over that before the stroke, of 255.
  int added(std::size_t projector, int x, int y) const {
    const cv::Mat& now = session_->composed().projectors[projector];
    if (x < 0 || y < 0 || x >= now.cols || y >= now.rows) return 0;
    return now.at<cv::Vec3b>(y, x)[1] - before_[projector].at<cv::Vec3b>(y, x)[1];
  }
  // Whether a projector's image lights a place of the prototype.
  bool is_lit(const Vector3d& p) const {
    for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i) {
      const auto px = world_.rig.projectors[i].project(world_.world_from_prototype * p);
      for (int k = 0; px && k < 25; ++k)
        if (added(i, static_cast<int>(std::lround(px->x())) + k % 5 - 2,
                  static_cast<int>(std::lround(px->y())) + k / 5 - 2) > k_seen_step)
          return true;
    }
    return false;
  }

  // The number of a picture that a guest was sent.
  std::optional<std::uint32_t> sent_picture(RemoteClient* guest) {
    guest->send_text(R"({"type": "pictures", "room": true})");
    for (int i = 0; i < 200; ++i) {
      compose();
      while (const auto message = guest->message(0.01))
        if (!message->is_text) return number_at(message->bytes, 4);
    }
    return std::nullopt;
  }

  struct Times {
    double begun_ms = 0,
           shown_ms = 0;  // after the message was sent: the frame that shows it begins, and is there
  };
  // Sends the k-th message of the stroke and plays until a projector's image has its last point.
  Times send_and_wait(RemoteClient* guest, std::uint32_t picture, int k, const Vector3d& p_last) {
    json px = json::array();
    for (int i = 0; i < k_points_each; ++i) {
      const Vector2d at = drawn_px(t_of(k * k_points_each + i));
      px.push_back({at.x(), at.y()});
    }
    const auto sent_at = Clock::now();
    while (const auto message = guest->message(0.005))  // an old picture is refused
      if (!message->is_text) picture = number_at(message->bytes, 4);
    Times times;
    guest->send_text(json({{"type", "stroke"},
                           {"id", k},
                           {"what", "draw"},
                           {"line", "arch"},
                           {"from", "room"},
                           {"picture", picture},
                           {"px", px}})
                         .dump());
    while (!is_lit(p_last) && seconds_since(sent_at) < 60) {
      times.begun_ms = 1e3 * seconds_since(sent_at);
      compose();
    }
    EXPECT_TRUE(is_lit(p_last)) << "message " << k;
    times.shown_ms = 1e3 * seconds_since(sent_at);
    return times;
  }

  sim::World world_;
  std::optional<device::GlContext> context_;
  std::optional<session::Telemetry> telemetry_;
  std::optional<session::Session> session_;
  session::DeviceHealth health_;
  std::optional<Imager> over_prototype_;
  Stamp at_;
  std::vector<cv::Mat> before_;  // the projectors' images without the stroke
};

double distance(const std::vector<Vector3d>& line, const Vector3d& p) {
  double nearest = 1;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector3d ab = line[i + 1] - line[i];
    nearest = std::min(
        nearest, (line[i] + std::clamp((p - line[i]).dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab - p).norm());
  }
  return nearest;
}

// How far the centre of the light is across the line from a place of it; nullopt: there is little light.
std::optional<double> off_mm(const std::vector<std::pair<Vector3d, double>>& lit,
                             const Vector3d& place,
                             const Vector3d& along) {
  Vector3d sum = Vector3d::Zero();
  double weight = 0;
  for (const auto& [p, light] : lit) {
    if ((p - place).norm() > 3e-3 || std::abs((p - place).dot(along)) > 2e-3) continue;
    sum += light * (p - place);
    weight += light;
  }
  if (weight < 0.1) return std::nullopt;
  const Vector3d off = sum / weight;
  return 1e3 * (off - off.dot(along) * along).norm();
}

TEST_F(AServedStroke, IsLitWhereItWasDrawnAndSoon) {
  std::vector<Vector3d> drawn;  // where the person saw the pen on the true door
  for (int i = 0; i < k_messages * k_points_each; ++i) {
    const auto place = true_place(world_.rig.cameras[0], drawn_px(t_of(i)));
    ASSERT_TRUE(place) << i;
    drawn.push_back(*place);
  }
  const auto guest = this->guest(Role::work);
  const auto picture = sent_picture(guest.get());
  ASSERT_TRUE(picture);
  std::vector<double> took_ms, begun_ms;
  for (int k = 0; k < k_messages; ++k) {
    const Vector3d& p_last = drawn[static_cast<std::size_t>((k + 1) * k_points_each - 1)];
    const Times times = send_and_wait(guest.get(), *picture, k, p_last);
    took_ms.push_back(times.shown_ms);
    begun_ms.push_back(times.begun_ms);
  }
  double worst_mm = 0;
  int measured = 0;
  for (std::size_t i = 0; i < world_.rig.projectors.size(); ++i) {
    std::vector<std::pair<Vector3d, double>> lit;  // places, and their light, linear
    const cv::Mat& image = session_->composed().projectors[i];
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x)
        if (const int light = added(i, x, y); light > 4)
          if (const auto place = true_place(world_.rig.projectors[i], Vector2d(x, y));
              place && distance(drawn, *place) < 4e-3)
            lit.emplace_back(*place, std::pow(light / 255.0, 2.2));
    for (std::size_t k = 2; k + 2 < drawn.size(); k += 2)
      if (const auto off = off_mm(lit, drawn[k], (drawn[k + 1] - drawn[k - 1]).normalized())) {
        worst_mm = std::max(worst_mm, *off);
        ++measured;
      }
  }
  for (auto* ms : {&took_ms, &begun_ms}) std::sort(ms->begin(), ms->end());
  const auto share = [](const std::vector<double>& ms, std::size_t percent) {
    return ms[(ms.size() - 1) * percent / 100];
  };
  fmt::print(
      "stroke: the light is at most {:.2f} mm from where it was drawn ({} places). After a message the frame "
      "that shows it begins within {:.1f} ms (95 %; median {:.1f} ms), and is drawn within {:.0f} ms (median "
      "{:.0f} ms)\n",
      worst_mm, measured, share(begun_ms, 95), share(begun_ms, 50), share(took_ms, 95), share(took_ms, 50));
  EXPECT_GT(measured, 25);
  EXPECT_LT(worst_mm, 0.5);

  // The page's links to the line's files.
  compose();  // the server gets the state before a frame is drawn
  const std::string token = token_of(Role::look);
  for (const char* name : {"lines.csv", "lines.dxf", "lines.step"}) {
    SCOPED_TRACE(name);
    const auto answer = client()->get(std::string("/api/") + name, token);
    ASSERT_EQ(answer.status, 200) << answer.body;
    ASSERT_TRUE(write_file(folder_ / name, answer.body));
    const auto curves = scene::read_line_file(folder_ / name);
    ASSERT_TRUE(curves) << curves.message();
    ASSERT_EQ(curves->size(), 1U);
    EXPECT_EQ(curves->front().name, "arch");
    ASSERT_GT(curves->front().points.size(), 20U);
    for (const Vector3d& p : curves->front().points) EXPECT_LT(distance(drawn, p), 0.5e-3);
  }
}

}  // namespace
}  // namespace limn::remote
