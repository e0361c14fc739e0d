#include "projector/shader.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <vector>

namespace limn::projector {
namespace {

// A shader's text with its includes inserted, and the files in the order of their numbers in #line.
struct Unrolled {
  std::string text;
  std::vector<std::string> files;
};

Status unroll(const std::string& file, Unrolled* out) {
  const auto found = embedded_shaders().find(file);
  if (found == embedded_shaders().end())
    return error("shaders/{}: expected this file, found none. Build again.", file);
  const std::size_t number = out->files.size();
  out->files.push_back(file);
  std::istringstream lines(found->second);
  std::string line;
  if (number > 0) out->text += fmt::format("#line 1 {}\n", number);
  for (int at = 1; std::getline(lines, line); ++at) {
    if (line.rfind("#include \"", 0) != 0) {
      out->text += line + "\n";
      continue;
    }
    const std::string included = line.substr(10, line.rfind('"') - 10);
    if (std::find(out->files.begin(), out->files.end(), included) != out->files.end()) {
      out->text += "\n";
      continue;
    }
    LIMN_TRY_STATUS(unroll(included, out));
    out->text += fmt::format("#line {} {}\n", at + 1, number);
  }
  return {};
}

std::string numbered(const std::vector<std::string>& files) {
  std::string text;
  for (std::size_t i = 0; i < files.size(); ++i) text += fmt::format("{} is shaders/{}; ", i, files[i]);
  return text;
}

Result<GlName> compile(GLenum stage, const std::string& file, Defines defines = {}) {
  Unrolled source;
  LIMN_TRY_STATUS(unroll(file, &source));
  std::string definitions;
  for (std::size_t i = 0; i < k_define_names.size(); ++i)
    if (defines.contains(static_cast<Define>(i)))
      definitions += fmt::format("#define {}\n", k_define_names[i]);
  if (!definitions.empty())  // after the first line, which is #version
    source.text.insert(source.text.find('\n') + 1, definitions + "#line 2 0\n");
  GlName shader(glCreateShader(stage), [](GLuint n) { glDeleteShader(n); });
  const char* text = source.text.c_str();
  glShaderSource(*shader, 1, &text, nullptr);
  glCompileShader(*shader);
  GLint ok = 0;
  glGetShaderiv(*shader, GL_COMPILE_STATUS, &ok);
  if (ok) return shader;
  char message[4096] = "";
  glGetShaderInfoLog(*shader, sizeof(message), nullptr, message);
  return error("shaders/{}: the graphics driver does not compile it ({}): {}", file, numbered(source.files),
               message);
}

// Calls `use` with the name and location of each uniform. Uniforms in blocks are skipped, because they have
// no location.
template <class Use>
void for_each_uniform(GLuint program, const Use& use) {
  GLint count = 0;
  glGetProgramiv(program, GL_ACTIVE_UNIFORMS, &count);
  for (GLuint i = 0; i < static_cast<GLuint>(count); ++i) {
    char name[128] = "";
    GLint size = 0;
    GLenum type = 0;
    glGetActiveUniform(program, i, sizeof(name), nullptr, &size, &type, name);
    const GLint location = glGetUniformLocation(program, name);
    if (location >= 0) use(std::string_view(name), location);
  }
}

}  // namespace

Result<Program> Program::link(const std::string& vertex_file,
                              const std::string& fragment_file,
                              Defines defines) {
  std::array<GlName, 2> shaders;
  LIMN_TRY(shaders[0], compile(GL_VERTEX_SHADER, vertex_file, defines));
  LIMN_TRY(shaders[1], compile(GL_FRAGMENT_SHADER, fragment_file, defines));
  return link(shaders, vertex_file + " and " + fragment_file);
}

Result<Program> Program::link_compute(const std::string& file, Defines defines) {
  std::array<GlName, 1> shaders;
  LIMN_TRY(shaders[0], compile(GL_COMPUTE_SHADER, file, defines));
  return link(shaders, file);
}

Result<Program> Program::link(std::span<const GlName> shaders, const std::string& files) {
  Program program;
  program.name_ = GlName(glCreateProgram(), [](GLuint n) { glDeleteProgram(n); });
  for (const GlName& shader : shaders) glAttachShader(*program.name_, *shader);
  glLinkProgram(*program.name_);
  GLint ok = 0;
  glGetProgramiv(*program.name_, GL_LINK_STATUS, &ok);
  if (ok) {
    for_each_uniform(*program.name_, [&](std::string_view name, GLint location) {
      program.uniforms_.push_back({std::string(name.substr(0, name.find('['))), location});
    });
    std::sort(program.uniforms_.begin(), program.uniforms_.end(),
              [](const Uniform& a, const Uniform& b) { return a.name < b.name; });
    return program;
  }
  char message[4096] = "";
  glGetProgramInfoLog(*program.name_, sizeof(message), nullptr, message);
  return error("shaders/{}: the graphics driver does not link: {}", files, message);
}

GLint Program::location_of(std::string_view uniform) const {
  const auto found = std::lower_bound(uniforms_.begin(), uniforms_.end(), uniform,
                                      [](const Uniform& u, std::string_view name) { return u.name < name; });
  return found != uniforms_.end() && found->name == uniform ? found->location : -1;
}

}  // namespace limn::projector
