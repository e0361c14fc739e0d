#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <optional>
#include <type_traits>
#include <utility>

#include "limn/error.h"

/// How the library is called from Python's threads.
namespace limn::python {
namespace py = pybind11;

/// A call of the library in progress. The program's end waits for them, because the library's variables end
/// with it; a call that begins later, in a daemon thread, never begins.
class CallInProgress {
 public:
  CallInProgress();
  CallInProgress(const CallInProgress&) = delete;
  CallInProgress& operator=(const CallInProgress&) = delete;
  ~CallInProgress();
};

/// Calls `function` while other threads of Python run: everything that may take long or may log. The GIL is
/// not taken back in a destructor, because Python ends the daemon threads of a program that ends where they
/// ask for it.
template <class F>
auto without_gil(F&& function) -> decltype(function()) {
  PyThreadState* const state = PyEval_SaveThread();
  const auto call = [&]() -> decltype(function()) {
    const CallInProgress in_progress;
    return function();
  };
  if constexpr (std::is_void_v<decltype(function())>) {
    try {
      call();
    } catch (...) {
      PyEval_RestoreThread(state);
      throw;
    }
    PyEval_RestoreThread(state);
  } else {
    std::optional<decltype(function())> value;
    try {
      value.emplace(call());
    } catch (...) {
      PyEval_RestoreThread(state);
      throw;
    }
    PyEval_RestoreThread(state);
    return *std::move(value);
  }
}

/// A function that calls `function` in this way.
template <class R, class... Arguments>
auto released(R (*function)(Arguments...)) {
  return [function](Arguments... arguments) { return without_gil([&] { return function(arguments...); }); };
}

/// Runs a long call in a thread of its own, while this thread calls `progress` (a callable, or None) and lets
/// Python handle signals. An exception of `progress` or of a signal handler (KeyboardInterrupt) stops the
/// call, and is what the caller gets once it has stopped; so does False.
void run_stoppable(const py::object& progress, const std::function<void(const ReportProgress&)>& call);

template <class F>
auto stoppable(const py::object& progress, F&& call) {
  std::optional<decltype(call(std::declval<const ReportProgress&>()))> value;
  run_stoppable(progress, [&](const ReportProgress& report) { value.emplace(call(report)); });
  return *std::move(value);
}

/// The classes limn.Error and limn.Stopped, and how exceptions become them.
void add_errors(py::module_& module);
/// set_log(), and what happens when the program ends: nothing more is logged, and calls in other threads are
/// waited for.
void add_log(py::module_& module);

}  // namespace limn::python
