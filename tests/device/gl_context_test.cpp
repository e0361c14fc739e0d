#include "device/gl_context.h"

#include <epoxy/gl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>

#include "tests/support/matchers.h"

namespace limn::device {
namespace {

TEST(GlContext, IsDesktopGl45AndDraws) {
  const auto context = GlContext::create();
  ASSERT_TRUE(context) << context.message();
  EXPECT_FALSE(context->description().empty());
  EXPECT_GE(epoxy_gl_version(), 45);
  GLuint texture = 0;
  glCreateTextures(GL_TEXTURE_2D, 1, &texture);
  glTextureStorage2D(texture, 1, GL_RGBA8, 2, 2);
  const GLubyte colour[4] = {1, 2, 3, 4};
  glClearTexImage(texture, 0, GL_RGBA, GL_UNSIGNED_BYTE, colour);
  GLubyte read[16] = {};
  glGetTextureImage(texture, 0, GL_RGBA, GL_UNSIGNED_BYTE, sizeof(read), read);
  EXPECT_EQ(read[14], 3);
  EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
  glDeleteTextures(1, &texture);
}

TEST(GlContext, TwoLiveSideBySide) {
  const auto first = GlContext::create();
  ASSERT_TRUE(first);
  {
    const auto second = GlContext::create();
    ASSERT_TRUE(second);
  }
  first->make_current();
  EXPECT_NE(glGetString(GL_VERSION), nullptr);
}

TEST(GlContext, TellsWhetherItIsLost) {
  const auto context = GlContext::create();
  ASSERT_TRUE(context) << context.message();
  EXPECT_FALSE(context->is_lost());
  GLint strategy = 0;
  glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
  EXPECT_EQ(strategy == GL_LOSE_CONTEXT_ON_RESET, context->is_robust());
  std::cout << context->description()
            << (context->is_robust() ? ": reports a loss" : ": does not report a loss") << "\n";
}

// Runs a new process (this program with a single test) in which EGL finds no driver.
TEST(GlContext, WithoutEglTheErrorSaysWhatToDo) {
  if (std::getenv("LIMN_TEST_WITHOUT_EGL")) {
    const auto context = GlContext::create();
    ASSERT_FALSE(context);
    EXPECT_NE(context.message().find("libegl1"), std::string::npos) << context.message();
    EXPECT_NE(context.message().find("4.5"), std::string::npos) << context.message();
    return;
  }
  const pid_t child = fork();
  if (child == 0) {
    setenv("LIMN_TEST_WITHOUT_EGL", "1", 1);
    setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json", 1);
    execl("/proc/self/exe", "gl_context_test", "--gtest_filter=GlContext.WithoutEglTheErrorSaysWhatToDo",
          nullptr);
    _exit(99);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

}  // namespace
}  // namespace limn::device
