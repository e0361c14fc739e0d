// The program as the system runs it: lost output, closed streams, too little memory.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

struct Ended {
  int code = -1;  // exit code; -1: ended by a signal
  std::string out, err;
};

// Runs a line of bash in which LIMN is the program.
Ended run_in_bash(const std::string& line) {
  const auto folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "line.sh", "LIMN() { \"" LIMN_PROGRAM "\" \"$@\"; }\n" + line + "\n"));
  const std::string command = "bash '" + (folder / "line.sh").string() + "' > '" +
                              (folder / "out.txt").string() + "' 2> '" + (folder / "err").string() + "'";
  const int status = std::system(command.c_str());
  const auto out = read_file(folder / "out.txt"), err = read_file(folder / "err");
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out ? *out : "", err ? *err : ""};
}

// Libraries took most of the time of `limn --version`: the program loads many when it needs them
// (docs/architecture.md). 55 were counted on Debian 12 when this test was written, 279 when all were loaded
// at the start.
TEST(Program, StartsWithFewLibraries) {
  const Ended listed = run_in_bash("LD_TRACE_LOADED_OBJECTS=1 LIMN");
  ASSERT_EQ(listed.code, 0) << listed.err;
  EXPECT_NE(listed.out.find("libopencv_core"), std::string::npos) << listed.out;
  EXPECT_LT(std::count(listed.out.begin(), listed.out.end(), '\n'), 75) << listed.out;
  for (const char* late :
       {"libopencv_imgcodecs", "libopencv_videoio", "libavcodec", "libgdal", "libddsc", "libmrcal",
        "libassimp", "libdraco", "libOpenEXR", "libdcmdata", "libaravis", "libembree", "libcairo",
        "libopencv_aruco", "libopencv_objdetect", "libopencv_dnn"})
    EXPECT_EQ(listed.out.find(late), std::string::npos) << late << " is loaded at the start.\n" << listed.out;
}

TEST(Program, SaysWhenItsOutputCannotBeWritten) {
  const Ended full = run_in_bash("LIMN --help > /dev/full");
  EXPECT_EQ(full.code, 1);
  EXPECT_NE(full.err.find("standard output: expected to write all results, found: No space left"),
            std::string::npos)
      << full.err;
  EXPECT_EQ(run_in_bash("LIMN --help > /dev/null").code, 0);
  EXPECT_EQ(run_in_bash("LIMN --help >&- <&-").code, 0);
  const Ended cut = run_in_bash("{ sleep 0.3; LIMN --help; echo code $? >&2; } | true");
  EXPECT_NE(cut.err.find("found: Broken pipe"), std::string::npos) << cut.err;
  EXPECT_NE(cut.err.find("code 1"), std::string::npos) << cut.err;
}

// With every amount of memory the work is done, or a message says what is missing.
TEST(Program, EndsWithAMessageWhenMemoryIsShort) {
  const auto folder = test::test_folder();
  const std::string world = LIMN_SOURCE_DIR "/config/worlds/studio.json";
  for (const int mib : {600, 700, 800, 1000, 1300}) {
    const Ended ended = run_in_bash("ulimit -v " + std::to_string(1024 * mib) + "; LIMN simulate '" + world +
                                    "' --out '" + (folder / "out").string() + "'");
    EXPECT_TRUE(ended.code == 0 || ended.code == 1) << mib << " MiB: " << ended.code << "\n" << ended.err;
    if (ended.code == 1) {
      EXPECT_NE(ended.err.find("expected"), std::string::npos) << ended.err;
    }
    EXPECT_EQ(ended.err.find("terminate"), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace limn
