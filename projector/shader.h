#pragma once

#include <epoxy/gl.h>

#include <Eigen/Core>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "projector/defines.h"
#include "projector/gl.h"

namespace limn::projector {

/// File name -> text of all files in shaders/, embedded in the program at build time.
const std::map<std::string, std::string>& embedded_shaders();

/// A linked vertex and fragment shader, or a compute shader. The locations of its uniforms are read once,
/// when it is linked.
class Program {
 public:
  /// Links files of shaders/, compiled with `defines`. The first `#include "x.glsl"` of a file is replaced by
  /// its text, further ones by nothing. `#line` directives make the driver's messages name the true line.
  /// Error: the driver's message with file names.
  static Result<Program> link(const std::string& vertex_file,
                              const std::string& fragment_file,
                              Defines defines = {});

  /// The same for a compute shader, compiled with `defines`.
  static Result<Program> link_compute(const std::string& file, Defines defines = {});

  void use() const { glUseProgram(*name_); }
  // A uniform that this program does not use is ignored.
  void set(const char* uniform, int value) const { glProgramUniform1i(*name_, location_of(uniform), value); }
  void set(const char* uniform, int x, int y) const {
    glProgramUniform2i(*name_, location_of(uniform), x, y);
  }
  void set_id(const char* uniform, unsigned value) const {
    glProgramUniform1ui(*name_, location_of(uniform), value);
  }
  void set_bits(const char* uniform, std::span<const GLuint> bits) const {
    glProgramUniform1uiv(*name_, location_of(uniform), static_cast<GLsizei>(bits.size()), bits.data());
  }
  void set(const char* uniform, const Eigen::Vector4f& v) const {
    glProgramUniform4fv(*name_, location_of(uniform), 1, v.data());
  }
  void set(const char* uniform, const Eigen::Vector3f& v) const {
    glProgramUniform3fv(*name_, location_of(uniform), 1, v.data());
  }
  void set(const char* uniform, const Eigen::Vector2f& v) const {
    glProgramUniform2fv(*name_, location_of(uniform), 1, v.data());
  }
  /// Sets the first entries of an array.
  void set_vectors(const char* uniform, std::span<const Eigen::Vector4f> vectors) const {
    if (vectors.empty()) return;
    glProgramUniform4fv(*name_, location_of(uniform), static_cast<GLsizei>(vectors.size()),
                        vectors.front().data());
  }
  void set(const char* uniform, float value) const {
    glProgramUniform1f(*name_, location_of(uniform), value);
  }
  void set(const char* uniform, const Eigen::Matrix3f& m) const {
    glProgramUniformMatrix3fv(*name_, location_of(uniform), 1, GL_FALSE, m.data());
  }
  void set(const char* uniform, const Eigen::Matrix4f& m) const {
    glProgramUniformMatrix4fv(*name_, location_of(uniform), 1, GL_FALSE, m.data());
  }

 private:
  struct Uniform {
    std::string name;  // for an array without "[0]"
    GLint location = -1;
  };
  // -1 for a uniform that this program does not use; GL ignores setting it.
  GLint location_of(std::string_view uniform) const;
  static Result<Program> link(std::span<const GlName> shaders, const std::string& files);
  GlName name_;
  std::vector<Uniform> uniforms_;  // sorted by name
};

}  // namespace limn::projector
