#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/flat.h"
#include "core/sandbox.h"

namespace weft::core {
namespace {

using testing::HasSubstr;

// Stands for weft-open: tests/programs/sandbox_probe.cpp.
SandboxAnswer probe(const InputFile& file, const std::string& what) {
  return read_in_sandbox(file, {"probe", what}, {64 << 20, 1 << 20, 1}, "sandbox_probe");
}

// What asking for `what` throws; its code in `code`.
std::string complaint(const std::string& what, Code* code = nullptr) {
  const InputFile file("contents", "the file");
  try {
    static_cast<void>(probe(file, what));
  } catch (const Error& error) {
    if (code != nullptr) {
      *code = error.code();
    }
    return error.what();
  }
  return "";
}

TEST(Sandbox, HandsBackWhatTheChildReadsFromTheFile) {
  const InputFile file("contents of a file", "the file");
  const SandboxAnswer answer = probe(file, "echo");
  FlatReader reader(answer.bytes());
  EXPECT_EQ(reader.text(), "contents of a file");
  EXPECT_EQ(reader.number(), 18U);
  reader.end();
}

TEST(Sandbox, WhatTheChildThrowsComesBack) {
  Code code{};
  EXPECT_EQ(complaint("refuse", &code), "refused? as asked");
  EXPECT_EQ(code, Code::kFailedPrecondition);
}

TEST(Sandbox, ChildCanNeitherReachTheNetworkNorOpenStartOrSignalAnything) {
  for (const char* what : {"socket", "fork", "execute", "signal", "executable_memory"}) {
    Code code{};
    EXPECT_THAT(complaint(what, &code), HasSubstr("led astray")) << what;
    EXPECT_EQ(code, Code::kDataLoss) << what;
  }
  EXPECT_EQ(complaint("open"), "cannot open: No such file or directory");
  EXPECT_EQ(complaint("descriptors"), "3 4 are open");
}

TEST(Sandbox, CrashOfTheChildIsAnErrorHere) {
  EXPECT_THAT(complaint("crash"), HasSubstr("crashed (signal 4)"));
}

TEST(Sandbox, MemoryTimeAndAnswerAreLimited) {
  std::vector<const char*> greedy{"answer", "endless"};
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  greedy.push_back("memory");  // a sanitizer takes more than any limit for itself
#endif
  for (const char* what : greedy) {
    Code code{};
    EXPECT_NE(complaint(what, &code), "") << what;
    EXPECT_EQ(code, Code::kResourceExhausted) << what;
  }
}

TEST(Sandbox, AnswerThatBreaksOffIsNotTakenForOne) {
  EXPECT_THAT(complaint("break_off"), HasSubstr("ended early"));
}

TEST(Sandbox, WithoutTheFilterTheLimitsRemain) {
  ASSERT_EQ(setenv("WEFT_UNSAFE_OPEN", "1", 1), 0);  // NOLINT(concurrency-mt-unsafe)
  EXPECT_EQ(complaint("open"), "cannot open: Too many open files");
  EXPECT_NE(complaint("endless"), "");
  ASSERT_EQ(unsetenv("WEFT_UNSAFE_OPEN"), 0);  // NOLINT(concurrency-mt-unsafe)
}

TEST(Sandbox, SaysWhereTheProgramShouldBe) {
  const InputFile file("contents", "the file");
  try {
    static_cast<void>(read_in_sandbox(file, {"probe"}, {}, "absent-program"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), Code::kUnavailable);
    EXPECT_THAT(error.what(), HasSubstr("absent-program"));
  }
}

TEST(Sandbox, WorksWithSignalsBlocked) {
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  EXPECT_EQ(complaint("refuse"), "refused? as asked");
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

TEST(InputFile, OnlyPlainFilesAreRead) {
  EXPECT_THROW(InputFile(std::filesystem::path("/dev/zero")), Error);
  EXPECT_THROW(InputFile(std::filesystem::path("/")), Error);
  EXPECT_THROW(InputFile(std::filesystem::path("/absent/file")), Error);
}

TEST(FlatReader, AsksForNoMoreThanThereIs) {
  const std::uint64_t lengths[] = {0, 7, ~std::uint64_t{0}};
  for (std::size_t count = 0; count < sizeof(lengths); ++count) {
    FlatReader reader(std::as_bytes(std::span(lengths)).first(count));
    EXPECT_THROW(
        {
          static_cast<void>(reader.number());
          static_cast<void>(reader.bytes());
          static_cast<void>(reader.bytes());
        },
        Error)
        << count;
  }
}

}  // namespace
}  // namespace weft::core
