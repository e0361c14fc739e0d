#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "device/gl_context.h"

namespace limn::test {

/// Tests that share one current GL context.
class GlTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto made = device::GlContext::create();
    ASSERT_TRUE(made) << made.message();
    context() = std::make_unique<device::GlContext>(std::move(made).value());
  }
  static void TearDownTestSuite() { context().reset(); }

 private:
  static std::unique_ptr<device::GlContext>& context() {
    static std::unique_ptr<device::GlContext> context;
    return context;
  }
};

}  // namespace limn::test
