#pragma once

#include <epoxy/gl.h>

#include <string>
#include <vector>

namespace limn::projector {

/// GPU time of one pass.
struct PassTime {
  std::string pass;
  double ms = 0;
};

/// GPU timer queries around passes, if enabled. Belongs to the current GL context.
class PassTimes {
 public:
  PassTimes() = default;
  PassTimes(const PassTimes&) = delete;
  PassTimes& operator=(const PassTimes&) = delete;
  ~PassTimes();

  void enable(bool wanted) { is_enabled_ = wanted; }

  /// Measures from its construction to its destruction.
  class Scope {
   public:
    Scope(PassTimes* times, const char* pass);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    PassTimes* times_;
  };

  /// Times of all passes since the last call, in their order. Waits for the GPU.
  std::vector<PassTime> take_times();

 private:
  struct Query {
    std::string pass;
    GLuint from = 0, to = 0;
  };
  std::vector<Query> queries_;
  bool is_enabled_ = false;
};

}  // namespace limn::projector
