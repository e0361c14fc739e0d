#include "library/python/calls.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace limn::python {
namespace {

constexpr std::chrono::milliseconds k_between_signals{50};
constexpr std::chrono::seconds k_end_waits_for_calls{30};

// All calls of the library, for the program's end.
struct Calls {
  std::mutex mutex;
  std::condition_variable ended;
  int count = 0;
  std::optional<std::thread::id> ending_thread;  // once the program ends
};

// It is never destroyed, because threads may wait in it when the program ends.
Calls* g_calls = new Calls;

Calls& calls() { return *g_calls; }

// In the child of os.fork(), which has none of the other threads: their calls never end there, and one of
// them may have held the mutex.
void forget_calls() { g_calls = new Calls; }

bool is_program_ending() {
  const std::lock_guard lock(calls().mutex);
  return calls().ending_thread.has_value();
}

void end_calls() {
  std::unique_lock lock(calls().mutex);
  calls().ending_thread = std::this_thread::get_id();
  calls().ended.wait_for(lock, k_end_waits_for_calls, [] { return calls().count == 0; });
}

}  // namespace

CallInProgress::CallInProgress() {
  std::unique_lock lock(calls().mutex);
  calls().ended.wait(lock, [] {
    const auto& ending = calls().ending_thread;
    return !ending || *ending == std::this_thread::get_id();
  });
  ++calls().count;
}

CallInProgress::~CallInProgress() {
  const std::lock_guard lock(calls().mutex);
  --calls().count;
  calls().ended.notify_all();
}

namespace {

// Between the thread that works and the one that talks with Python.
class Exchange {
 public:
  explicit Exchange(bool is_reported) : is_reported_(is_reported) {}

  // ---- the working thread ----

  bool report(const Progress& progress) {
    std::unique_lock lock(mutex_);
    if (is_stopped_ || is_program_ending()) return false;
    if (!is_reported_) return true;
    progress_ = progress;
    changed_.notify_all();
    while (progress_ && !is_program_ending()) changed_.wait_for(lock, k_between_signals);
    return !is_stopped_ && !progress_;
  }

  void end() {
    const std::lock_guard lock(mutex_);
    is_ended_ = true;
    changed_.notify_all();
  }

  // ---- Python's thread ----

  // Waits for a report or the end, but only until it is time to look for signals.
  std::optional<Progress> wait() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, k_between_signals, [&] { return progress_ || is_ended_; });
    return progress_;
  }

  void answer(bool goes_on) {
    const std::lock_guard lock(mutex_);
    is_stopped_ = is_stopped_ || !goes_on;
    progress_.reset();
    changed_.notify_all();
  }

  bool is_ended() {
    const std::lock_guard lock(mutex_);
    return is_ended_;
  }

 private:
  const bool is_reported_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Progress> progress_;  // reported and not yet answered
  bool is_stopped_ = false, is_ended_ = false;
};

// A thread that has ended when this ends. Python ends this thread in the middle of the loop below, without
// the GIL, if it is a daemon and the program ends.
class Worker {
 public:
  Worker(Exchange* exchange, std::shared_ptr<const CallInProgress> call, const std::function<void()>& work)
      : exchange_(exchange), thread_([work, call = std::move(call)]() mutable {
          work();
          call.reset();
        }) {}
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    if (!exchange_->is_ended()) exchange_->answer(false);
    thread_.join();
  }

 private:
  Exchange* const exchange_;
  std::thread thread_;
};

// Whether the call goes on. Throws what Python raises.
bool is_going_on(const py::object& function, const std::optional<Progress>& progress) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  return !progress || !function(*progress).is(py::bool_(false));
}

}  // namespace

void run_stoppable(const py::object& progress, const std::function<void(const ReportProgress&)>& call) {
  if (!progress.is_none() && !PyCallable_Check(progress.ptr()))
    throw py::type_error("progress: expected a function or None, found " +
                         std::string(py::str(py::type::handle_of(progress).attr("__name__"))) + ".");
  Exchange exchange(!progress.is_none());
  std::exception_ptr failure;
  std::exception_ptr raised;
  auto in_progress = without_gil([] { return std::make_shared<const CallInProgress>(); });
  const Worker worker(&exchange, std::move(in_progress), [&] {
    try {
      call([&](const Progress& at) { return exchange.report(at); });
    } catch (...) {
      failure = std::current_exception();
    }
    exchange.end();
  });
  while (!exchange.is_ended()) {
    const std::optional<Progress> at = without_gil([&] { return exchange.wait(); });
    bool goes_on = !raised;
    if (goes_on) {
      try {
        goes_on = is_going_on(progress, at);
      } catch (const std::exception&) {  // pthread_exit in a thread that Python ends must pass
        raised = std::current_exception();
        goes_on = false;
      }
    }
    if (at || !goes_on) exchange.answer(goes_on);
  }
  without_gil([] {});  // a thread of a program that has ended meanwhile stays here
  if (raised) std::rethrow_exception(raised);
  if (failure) std::rethrow_exception(failure);
}

namespace {

// They live as long as the interpreter.
PyObject* g_error = nullptr;
PyObject* g_stopped = nullptr;
PyObject* g_log = nullptr;  // the function of set_log(); guarded by the GIL
std::atomic<bool> g_is_logged = false;

// Text of the library, which may name files whose names are no UTF-8.
py::str text_of(const std::string& text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "backslashreplace"));
}

void raise(PyObject* type, const char* message) { PyErr_SetObject(type, text_of(message).ptr()); }

PyObject* new_exception(py::module_& module, const char* name, const char* doc, PyObject* base) {
  PyObject* const type = PyErr_NewExceptionWithDoc(("limn." + std::string(name)).c_str(), doc, base, nullptr);
  if (!type) throw py::error_already_set();
  module.add_object(name, type);
  return type;
}

// Any thread of the library calls it.
void log_to_python(bool is_warning, const std::string& line) {
  if (!g_is_logged) return;
  const py::gil_scoped_acquire gil;
  if (!g_log) return;
  try {
    py::reinterpret_borrow<py::object>(g_log)(is_warning, text_of(line));
  } catch (py::error_already_set& error) {
    error.discard_as_unraisable("limn.set_log");
  }
}

void set_python_log(const py::object& log) {
  if (!log.is_none() && !PyCallable_Check(log.ptr()))
    throw py::type_error("log: expected a function or None, found " +
                         std::string(py::str(py::type::handle_of(log).attr("__name__"))) + ".");
  const auto before = py::reinterpret_steal<py::object>(g_log);
  g_log = log.is_none() ? nullptr : py::object(log).release().ptr();
  g_is_logged = g_log != nullptr;
  // Stays set: g_log alone decides, so that two threads may set it.
  if (g_is_logged) without_gil([] { limn::set_log(log_to_python); });
}

}  // namespace

void add_errors(py::module_& module) {
  g_error = new_exception(
      module, "Error",
      R"(What a person can correct: a file, an option, a machine without OpenGL. The message says where, what
was expected, what was found and what to do; it is the message of the program. Every function may
raise it.)",
      PyExc_RuntimeError);
  g_stopped = new_exception(
      module, "Stopped",
      R"(A long call was stopped by its progress function, which returned False. Nothing was written.)",
      g_error);
  py::register_exception_translator([](std::exception_ptr exception) {
    try {
      if (exception) std::rethrow_exception(std::move(exception));
    } catch (const Stopped& error) {
      raise(g_stopped, error.what());
    } catch (const Error& error) {
      raise(g_error, error.what());
    }
  });
}

void add_log(py::module_& module) {
  module.def(
      "set_log", &set_python_log, py::arg("log"),
      R"(Sets who gets the notes and warnings that the program prints to stderr, for example that the unit of
a mesh was guessed: log(is_warning, line), or None for nobody, which is the default. Several threads
may call it. What it raises goes to sys.unraisablehook. It ends by itself when the interpreter does.)");
  py::module_::import("os").attr("register_at_fork")(py::arg("after_in_child") =
                                                         py::cpp_function(&forget_calls));
  py::module_::import("atexit").attr("register")(py::cpp_function([] {
    set_python_log(py::none());
    PyThreadState* const state = PyEval_SaveThread();
    end_calls();
    PyEval_RestoreThread(state);
  }));
}

}  // namespace limn::python
