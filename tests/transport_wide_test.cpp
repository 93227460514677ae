#include <cstdlib>

#include <gtest/gtest.h>

#include "transport/wide.h"

namespace weft::transport {
namespace {

TEST(TransportWide, TheEnvironment_ForbidsTheWidePath) {
  ASSERT_EQ(setenv("WEFT_PORTABLE", "1", 1), 0);
  EXPECT_FALSE(wide_is_available());
  ASSERT_EQ(setenv("WEFT_PORTABLE", "0", 1), 0);
  EXPECT_EQ(wide_is_available(), __builtin_cpu_supports("avx512bw") != 0);
  ASSERT_EQ(unsetenv("WEFT_PORTABLE"), 0);
  EXPECT_EQ(wide_is_available(), __builtin_cpu_supports("avx512bw") != 0);
}

}  // namespace
}  // namespace weft::transport
