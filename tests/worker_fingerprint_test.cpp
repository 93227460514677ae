#include <cstdlib>

#include <gtest/gtest.h>

#include "worker/baker.h"

namespace weft::worker {
namespace {

TEST(WorkerFingerprint, IsTheSameOfWideAndPortableKernels) {
  const core::Digest first = numerics_fingerprint();
  ASSERT_EQ(setenv("WEFT_PORTABLE", "1", 1), 0);
  const core::Digest portable = numerics_fingerprint();
  ASSERT_EQ(unsetenv("WEFT_PORTABLE"), 0);
  EXPECT_EQ(first, portable);
}

}  // namespace
}  // namespace weft::worker
