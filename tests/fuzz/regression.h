#pragma once

namespace limn::test {

/// The folder with the seeds of this program's target. CMake writes the value of each program.
extern const char* const k_fuzz_corpus;
/// How many mutations of the seeds the regression test runs.
extern const int k_fuzz_runs;

}  // namespace limn::test
