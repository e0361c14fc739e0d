// The program's own shared libraries: absent, damaged, and of another version of Limn.
#include "core/program_library.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

std::string message_about(const std::filesystem::path& file) {
  ::setenv("LIMN_TEST_LIBRARY", file.c_str(), 1);
  const auto function = library_function({.file = "liblimn_answer.so",
                                          .variable = "LIMN_TEST_LIBRARY",
                                          .purpose = "the answers",
                                          .build_package = "libanswer-dev"},
                                         "limn_answer");
  ::unsetenv("LIMN_TEST_LIBRARY");
  return function ? "" : function.message();
}

bool says(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }

TEST(ProgramLibrary, OneThatIsAbsentOrDamagedIsNamed) {
  const auto folder = test::test_folder();
  EXPECT_TRUE(says(message_about(folder / "none.so"), "none.so: expected the answers, found: "));
  ASSERT_TRUE(write_file(folder / "damaged.so",
                         "\x7f"
                         "ELF"));
  const std::string message = message_about(folder / "damaged.so");
  EXPECT_TRUE(says(message, "damaged.so: expected the answers, found: ")) << message;
  EXPECT_TRUE(says(message, "Install Limn again")) << message;
}

TEST(ProgramLibrary, OneOfAnotherVersionIsRefused) {
  const std::string message = message_about(LIMN_OTHER_LIBRARY);
  EXPECT_TRUE(says(message, "found version 0.0.1. Install Limn again")) << message;
}

}  // namespace
}  // namespace limn
