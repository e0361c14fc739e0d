#include "projector/pass_times.h"

namespace limn::projector {

PassTimes::~PassTimes() {
  for (const Query& query : queries_) {
    const GLuint names[] = {query.from, query.to};
    glDeleteQueries(2, names);
  }
}

PassTimes::Scope::Scope(PassTimes* times, const char* pass) : times_(times->is_enabled_ ? times : nullptr) {
  if (!times_) return;
  GLuint names[2] = {};
  glCreateQueries(GL_TIMESTAMP, 2, names);
  glQueryCounter(names[0], GL_TIMESTAMP);
  times_->queries_.push_back({pass, names[0], names[1]});
}

PassTimes::Scope::~Scope() {
  if (times_) glQueryCounter(times_->queries_.back().to, GL_TIMESTAMP);
}

std::vector<PassTime> PassTimes::take_times() {
  std::vector<PassTime> times;
  for (const Query& query : queries_) {
    GLuint64 from = 0, to = 0;
    glGetQueryObjectui64v(query.from, GL_QUERY_RESULT, &from);
    glGetQueryObjectui64v(query.to, GL_QUERY_RESULT, &to);
    times.push_back({query.pass, 1e-6 * static_cast<double>(to - from)});
    const GLuint names[] = {query.from, query.to};
    glDeleteQueries(2, names);
  }
  queries_.clear();
  return times;
}

}  // namespace limn::projector
