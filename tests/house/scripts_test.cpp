// The scripts that install packages and build, with programs of the system replaced by short scripts.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

struct Ended {
  int code = -1;  // exit code; -1: ended by a signal
  std::string out, err;
};

// A folder with programs that are called instead of the system's.
class Scripts : public testing::Test {
 protected:
  void replace(const std::string& program, const std::string& script) const {
    ASSERT_TRUE(write_file(folder / program, "#!/bin/bash\n" + script + "\n"));
    fs::permissions(folder / program, fs::perms::owner_all);
  }

  // Runs a line of bash. Only the replaced programs and those of `also` are found.
  Ended run_in_bash(const std::string& line, const std::vector<std::string>& also = {}) const {
    for (const std::string& program : also) fs::create_symlink("/usr/bin/" + program, folder / program);
    EXPECT_TRUE(write_file(folder / "line.sh", line + "\n"));
    const std::string in = folder.string();
    const std::string command = "PATH='" + in + "' OS_RELEASE='" + in + "/os-release' /bin/bash '" + in +
                                "/line.sh' > '" + in + "/out' 2> '" + in + "/err'";
    const int status = std::system(command.c_str());
    const auto out = read_file(folder / "out"), err = read_file(folder / "err");
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out ? *out : "", err ? *err : ""};
  }

  const fs::path folder = test::test_folder();
  const std::string source = ". " LIMN_SOURCE_DIR "/tools/build.sh; ";
};

TEST_F(Scripts, APackageMayHaveAnotherNameInEachRelease) {
  ASSERT_TRUE(write_file(folder / "list", "# a list\nbread [bookworm]\n rolls [trixie] # new\nbutter\n"));
  const std::string line = source + "packages_of '" + (folder / "list").string() + "'";
  const auto names_in = [&](const char* release) {
    EXPECT_TRUE(write_file(folder / "os-release", std::string("VERSION_CODENAME=") + release + "\n"));
    fs::remove(folder / "cat");
    fs::remove(folder / "sed");
    return run_in_bash(line, {"cat", "sed"}).out;
  };
  EXPECT_EQ(names_in("bookworm"), "bread\nbutter\n");
  EXPECT_EQ(names_in("trixie"), "rolls\nbutter\n");
  EXPECT_EQ(names_in(""), "butter\n");
}

TEST_F(Scripts, WithoutSudoTheyNameThePackagesThatRootMustInstall) {
  ASSERT_TRUE(write_file(folder / "list", "bread\nbutter\n"));
  ASSERT_TRUE(write_file(folder / "os-release", "VERSION_CODENAME=trixie\n"));
  replace("dpkg-query", R"([ "${@: -1}" = bread ] && echo install ok installed)");
  replace("id", "echo 1000");
  const Ended ended =
      run_in_bash(source + "install_packages '" + (folder / "list").string() + "'", {"cat", "sed", "grep"});
  EXPECT_EQ(ended.code, 1);
  test::expect_contains(ended.err, "no sudo");
  test::expect_contains(ended.err,
                        "Run as root: apt-get install --no-install-recommends --no-remove butter\n");
}

TEST_F(Scripts, OnDebianSaysWhatItNeeds) {
  const std::string home = "LIMN_ROOTS='" + (folder / "roots").string() + "' ";
  const std::string script = home + "/bin/bash " LIMN_SOURCE_DIR "/tools/on_debian ";
  const std::vector<std::string> programs = {"dirname", "readlink", "awk"};
  replace("apt-get", "");
  const Ended wrong = run_in_bash(script + "sarge", programs);
  EXPECT_EQ(wrong.code, 2);
  test::expect_contains(wrong.err, "tools/on_debian [--keep] bookworm|trixie [COMMAND ...], found 'sarge'");
  const Ended nowhere = run_in_bash(script + "trixie");
  EXPECT_EQ(nowhere.code, 1);
  test::expect_contains(nowhere.err, "Set LIMN_DEBIAN_MIRROR");
  const Ended bare = run_in_bash("LIMN_DEBIAN_MIRROR=http://localhost " + script + "trixie");
  EXPECT_EQ(bare.code, 1);
  test::expect_contains(bare.err, "apt-get install mmdebstrap");
  EXPECT_FALSE(fs::exists(folder / "roots"));
}

TEST_F(Scripts, OtherVersionsOfTheFormatterCheckNoFiles) {
  const std::string lint = "/bin/bash " LIMN_SOURCE_DIR "/tools/lint";
  replace("git", "printf 'core/other.cpp\\0'");
  replace("pyflakes3", "echo 'a bad file'; exit 1");
  replace("clang-format", "echo 'Debian clang-format version 19.1.7 (3+b1)'");
  const Ended bad = run_in_bash(lint, {"dirname", "readlink", "sed", "xargs"});
  EXPECT_EQ(bad.code, 1);
  EXPECT_EQ(bad.out, "a bad file\n");
  replace("pyflakes3", "");
  const Ended other = run_in_bash(lint);
  EXPECT_EQ(other.code, 0);
  test::expect_contains(other.err, "expected clang-format 14 (Debian 12), found 19");
  fs::remove(folder / "clang-format");
  const Ended missing = run_in_bash(lint);
  EXPECT_EQ(missing.code, 1);
  test::expect_contains(missing.err, "found none");
}

}  // namespace
}  // namespace limn
