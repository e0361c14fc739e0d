#pragma once

#include <epoxy/gl.h>

#include <string>
#include <vector>

namespace limn::projector {

/// How long the GPU took for one pass.
struct PassTime {
  std::string pass;
  double ms = 0;
};

/// GPU timer queries around passes, where they are asked for. Belongs to the current GL context.
class PassTimes {
 public:
  PassTimes() = default;
  PassTimes(const PassTimes&) = delete;
  PassTimes& operator=(const PassTimes&) = delete;
  ~PassTimes();

  void enable(bool wanted) { is_enabled_ = wanted; }

  /// Ends with the object.
  class Scope {
   public:
    Scope(PassTimes* times, const char* pass);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    PassTimes* times_;
  };

  /// Of all passes since the last call, in their order; waits for the GPU.
  std::vector<PassTime> taken();

 private:
  struct Query {
    std::string pass;
    GLuint from = 0, to = 0;
  };
  std::vector<Query> queries_;
  bool is_enabled_ = false;
};

}  // namespace limn::projector
