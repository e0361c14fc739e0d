// What the projectors' images cost: milliseconds for each pass, by GPU timer queries; whole frames of a
// moving and of a still scene, compared with simple reference passes of the same run; and the gain by
// compensation. Usage: limn bench projector [--frames N (5)]
#include <epoxy/gl.h>
#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <opencv2/imgproc.hpp>

#include "core/median.h"
#include "device/gl_context.h"
#include "projector/gl.h"
#include "projector/renderer.h"
#include "sim/world.h"
#include "tracker/marker_image.h"

namespace limn::test {
namespace {

using projector::GlName;

constexpr int k_width = 1280, k_height = 800;

double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Median time of `work`, including the GPU's.
double median_ms(int count, const std::function<void()>& work) {
  std::vector<double> times;
  for (int i = 0; i <= count; ++i) {
    const double start = now_ms();
    work();
    glFinish();
    if (i > 0) times.push_back(now_ms() - start);  // the first run warms up
  }
  return median(std::move(times));
}

GLuint shader_of(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  LIMN_CHECK(ok != 0);
  return shader;
}

GlName program_of(const char* vertex, const char* fragment) {
  const GLuint program = glCreateProgram();
  for (const GLuint shader : {shader_of(GL_VERTEX_SHADER, vertex), shader_of(GL_FRAGMENT_SHADER, fragment)}) {
    glAttachShader(program, shader);
    glDeleteShader(shader);
  }
  glLinkProgram(program);
  return {program, [](GLuint n) { glDeleteProgram(n); }};
}

// The corners of the scene's triangles, three for each, in a box that nearly fills clip space.
std::vector<Eigen::Vector3f> all_corners(const scene::Scene& scene, const scene::PosedScene& posed) {
  std::vector<Eigen::Vector3f> corners;
  const auto add = [&](const scene::Mesh& mesh, const Pose& world_from_mesh) {
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t i : triangle)
        corners.emplace_back((world_from_mesh * mesh.positions[i].cast<double>()).cast<float>());
  };
  add(scene.prototype->mesh, *posed.world_from_prototype);
  for (const scene::PosedPart& part : posed.parts)
    for (const scene::Variant& variant : scene.find_slot(part.slot)->variants)
      if (variant.name == part.variant) add(variant.mesh, part.world_from_part);
  Eigen::AlignedBox3f box;
  for (const auto& p : corners) box.extend(p);
  for (auto& p : corners) p = ((p - box.center()).cwiseQuotient(box.sizes()) * 1.9F).eval();
  return corners;
}

// The simplest passes of each kind, into an image of the projector's size, for comparison.
class Yardsticks {
 public:
  explicit Yardsticks(const std::vector<Eigen::Vector3f>& corners)
      : triangle_count_(static_cast<int>(corners.size() / 3)) {
    corners_ = projector::make_buffer(corners.data(), corners.size() * sizeof(corners[0]));
    vertices_ = projector::make_vertex_array();
    glVertexArrayVertexBuffer(*vertices_, 0, *corners_, 0, sizeof(Eigen::Vector3f));
    glVertexArrayAttribFormat(*vertices_, 0, 3, GL_FLOAT, GL_FALSE, 0);
    glVertexArrayAttribBinding(*vertices_, 0, 0);
    glEnableVertexArrayAttrib(*vertices_, 0);
    triangles_ = program_of(
        "#version 450 core\nlayout(location = 0) in vec3 a; out vec3 v;\n"
        "void main() { v = a; gl_Position = vec4(a.xy, 0.4 * a.z, 1); }",
        "#version 450 core\nin vec3 v; out vec4 o;\nvoid main() { o = vec4(0.5 + 0.5 * v, 1); }");
    warp_ = program_of(
        "#version 450 core\nvoid main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 "
        ": -1, 0, 1); }",
        "#version 450 core\nuniform sampler2D s_map, s_picture; out vec4 o;\n"
        "void main() { o = texture(s_picture, texelFetch(s_map, ivec2(gl_FragCoord.xy), 0).xy); }");
    for (GlName* texture : {&from_, &into_})
      *texture = projector::make_texture(GL_TEXTURE_2D, GL_RGBA8, k_width, k_height);
    glTextureParameteri(*from_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(*from_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    map_ = cv::Mat(k_height, k_width, CV_32FC2);
    for (int row = 0; row < k_height; ++row)
      for (int column = 0; column < k_width; ++column)  // a smooth warp by some px
        map_.at<cv::Vec2f>(row, column) = {static_cast<float>(column + 4 * std::sin(row / 90.0)),
                                           static_cast<float>(row + 4 * std::cos(column / 110.0))};
    cv::Mat shares = map_.clone();
    for (auto& share : cv::Mat_<cv::Vec2f>(shares))
      share = {(share[0] + 0.5F) / k_width, (share[1] + 0.5F) / k_height};
    gpu_map_ = projector::make_texture(GL_TEXTURE_2D, GL_RG32F, k_width, k_height);
    projector::upload(gpu_map_, shares);
    framebuffer_ = projector::make_framebuffer();
    depth_ = projector::make_depth_buffer(k_width, k_height);
    glNamedFramebufferTexture(*framebuffer_, GL_COLOR_ATTACHMENT0, *into_, 0);
    glNamedFramebufferRenderbuffer(*framebuffer_, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, *depth_);
  }

  void clear() const {
    glBindFramebuffer(GL_FRAMEBUFFER, *framebuffer_);
    glViewport(0, 0, k_width, k_height);
    glClearColor(0, 0, 0, 1);
    glClearDepth(1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  }
  void copy() const { image_ = projector::read_back(framebuffer_, k_width, k_height, CV_8UC4, GL_BGRA); }
  void draw_triangles() const {
    clear();
    glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glUseProgram(*triangles_);
    glBindVertexArray(*vertices_);
    glDrawArrays(GL_TRIANGLES, 0, 3 * triangle_count_);
    glDisable(GL_DEPTH_TEST);
  }
  void draw_warp() const {
    glBindFramebuffer(GL_FRAMEBUFFER, *framebuffer_);
    glViewport(0, 0, k_width, k_height);
    glUseProgram(*warp_);
    glBindTextureUnit(0, *gpu_map_);
    glBindTextureUnit(1, *from_);
    glProgramUniform1i(*warp_, glGetUniformLocation(*warp_, "s_map"), 0);
    glProgramUniform1i(*warp_, glGetUniformLocation(*warp_, "s_picture"), 1);
    glBindVertexArray(*vertices_);
    glDrawArrays(GL_TRIANGLES, 0, 3);
  }
  void remap() const {
    static const cv::Mat image(k_height, k_width, CV_8UC4, cv::Scalar(10, 80, 200, 255));
    cv::remap(image, image_, map_, cv::noArray(), cv::INTER_LINEAR);
  }

 private:
  int triangle_count_;
  GlName corners_, vertices_, triangles_, warp_, from_, into_, gpu_map_, framebuffer_, depth_;
  cv::Mat map_;
  mutable cv::Mat image_;
};

int run(int frames) {
  auto context = device::GlContext::create();
  if (!context) {
    fmt::print(stderr, "{}\n", context.message());
    return 1;
  }
  auto loaded = sim::load_world(LIMN_SOURCE_DIR "/config/worlds/studio.json", tracker::marker_image);
  if (!loaded) {
    fmt::print(stderr, "{}\n", loaded.message());
    return 1;
  }
  const sim::World world = std::move(loaded).value();
  auto renderer = projector::Renderer::create(*world.scene, world.rig);
  if (!renderer) {
    fmt::print(stderr, "{}\n", renderer.message());
    return 1;
  }
  const scene::PosedScene posed = sim::true_poses(world);
  const Imager viewer = *world.scene->viewers.at(0).fixed;
  const std::vector<Eigen::Vector3f> corners = all_corners(*world.scene, posed);
  const std::size_t triangles = corners.size() / 3;
  const std::size_t projectors = world.rig.projectors.size();
  fmt::print("{}; {} triangles, {}x{}; ms, median of {}\n\n", context->description(), triangles, k_width,
             k_height, frames);

  const Yardsticks yardsticks(corners);
  const double copy = median_ms(frames, [&] { yardsticks.clear(), yardsticks.copy(); });
  const double draw = median_ms(frames, [&] { yardsticks.draw_triangles(); });
  const double warp = median_ms(frames, [&] { yardsticks.draw_warp(); });
  fmt::print("  reference passes                            ms\n");
  fmt::print("  clear and copy                          {:6.2f}\n", copy);
  fmt::print("  {} triangles                         {:6.2f}\n", triangles, draw);
  fmt::print("  warp by a map, whole image              {:6.2f}\n", warp);
  fmt::print("  cv::remap                               {:6.2f}\n\n",
             median_ms(frames, [&] { yardsticks.remap(); }));

  renderer->set_quick_motion(true);  // as in a session
  int step = 0;
  const auto moved = [&] {  // the part moves a little, as in a hand
    scene::PosedScene out = posed;
    out.parts[0].world_from_part.translation.x() += 1e-3 * (++step % 7);
    return out;
  };
  const auto prototype_moved = [&] {
    scene::PosedScene out = moved();
    out.world_from_prototype->translation.x() += 1e-3 * (step % 7);
    return out;
  };
  renderer->time_passes(true);
  std::map<std::string, std::vector<double>> passes;
  std::vector<std::string> order;
  for (int i = 0; i <= frames; ++i) {
    renderer->draw_projector(0, prototype_moved(), viewer);
    for (const projector::PassTime& time : renderer->pass_times()) {
      if (!passes.contains(time.pass)) order.push_back(time.pass);
      if (i > 0)
        passes[time.pass].push_back(time.ms);
      else
        passes[time.pass];
    }
  }
  renderer->time_passes(false);
  fmt::print("  passes of a frame with one projector's image\n");
  for (const std::string& pass : order) {
    fmt::print("  {:<38}  {:6.2f}\n", pass, median(passes[pass]));
  }
  // Whatever all projectors share, mainly the ids, is drawn once for all of them.
  const double sum = static_cast<double>(projectors) * (copy + draw + warp);
  fmt::print(
      "\n  frames of {} projectors                      ms   divided by triangles + warp + copy for each\n",
      projectors);
  const auto frame = [&](const char* name, const std::function<scene::PosedScene()>& place) {
    const double ms = median_ms(frames, [&] {
      const scene::PosedScene placed = place();
      for (std::size_t i = 0; i < projectors; ++i) (void)renderer->projector_image(i, placed, viewer);
    });
    fmt::print("  {:<38}  {:6.2f}  {:5.2f}\n", name, ms, ms / sum);
    return ms;
  };
  frame("prototype and part move", prototype_moved);
  frame("a part moves", moved);
  const double still = frame("nothing moves", [&] { return posed; });
  fmt::print("  nothing moves, divided by clear and copy        {:5.2f}\n",
             still / (static_cast<double>(projectors) * copy));

  // Composites: each image is new. The passes for comparison have the camera's size.
  const Imager& camera = world.rig.cameras[0];
  const cv::Mat image(camera.height, camera.width, CV_8UC3, cv::Scalar(60, 70, 80));
  const double scale = 1.0 * camera.width * camera.height / (k_width * k_height);
  fmt::print("\n  composites, {}x{}                        ms   divided by a copy of this size\n",
             camera.width, camera.height);
  const auto composite = [&](const char* name, const std::function<scene::PosedScene()>& place) {
    const double ms =
        median_ms(frames, [&] { (void)renderer->composite(0, image, place(), projector::Composite::full); });
    fmt::print("  {:<38}  {:6.2f}  {:5.2f}\n", name, ms, ms / (copy * scale));
  };
  composite("a part moves", moved);
  composite("nothing moves", [&] { return posed; });
  return 0;
}

}  // namespace
}  // namespace limn::test

int main(int argc, char** argv) {
  int frames = 5;
  for (int i = 1; i < argc; ++i) {
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (std::strcmp(argv[i], "--frames") != 0 ||
        std::from_chars(value, value + std::strlen(value), frames).ec != std::errc() || frames < 1) {
      fmt::print(stderr, "projector_bench: expected --frames N (1 or more), found '{} {}'\n", argv[i], value);
      return 2;
    }
    ++i;
  }
  return limn::test::run(frames);
}
