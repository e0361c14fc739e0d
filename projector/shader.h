#pragma once

#include <epoxy/gl.h>

#include <Eigen/Core>
#include <map>
#include <span>
#include <string>

#include "core/result.h"
#include "projector/gl.h"

namespace limn::projector {

/// File name -> text of everything in shaders/, put into the program at build time.
const std::map<std::string, std::string>& embedded_shaders();

/// A linked vertex and fragment shader, or a compute shader.
class Program {
 public:
  /// By file names in shaders/. `#include "x.glsl"` is replaced by the file once, with `#line` directives, so
  /// that the driver's messages name the true line. Error: the driver's message with file names.
  static Result<Program> link(const std::string& vertex_file, const std::string& fragment_file);

  /// A compute shader, likewise; with names, parted by blanks, that are defined in it.
  static Result<Program> link_compute(const std::string& file, const std::string& defined = "");

  void use() const { glUseProgram(*name_); }
  void set(const char* uniform, int value) const { glProgramUniform1i(*name_, at(uniform), value); }
  void set(const char* uniform, int x, int y) const { glProgramUniform2i(*name_, at(uniform), x, y); }
  void set_id(const char* uniform, unsigned value) const { glProgramUniform1ui(*name_, at(uniform), value); }
  void set_bits(const char* uniform, std::span<const GLuint> bits) const {
    glProgramUniform1uiv(*name_, at(uniform), static_cast<GLsizei>(bits.size()), bits.data());
  }
  void set(const char* uniform, const Eigen::Vector4f& v) const {
    glProgramUniform4fv(*name_, at(uniform), 1, v.data());
  }
  void set(const char* uniform, float value) const { glProgramUniform1f(*name_, at(uniform), value); }
  void set(const char* uniform, const Eigen::Matrix3f& m) const {
    glProgramUniformMatrix3fv(*name_, at(uniform), 1, GL_FALSE, m.data());
  }
  void set(const char* uniform, const Eigen::Matrix4f& m) const {
    glProgramUniformMatrix4fv(*name_, at(uniform), 1, GL_FALSE, m.data());
  }
  /// Binds a texture to a unit and the sampler to it.
  void bind(const char* sampler, int unit, const GlName& texture) const {
    glBindTextureUnit(static_cast<GLuint>(unit), *texture);
    set(sampler, unit);
  }

 private:
  // -1 for a uniform that this program does not use; GL ignores setting it.
  GLint at(const char* uniform) const { return glGetUniformLocation(*name_, uniform); }
  static Result<Program> linked(std::span<const GlName> shaders, const std::string& files);
  GlName name_;
};

}  // namespace limn::projector
