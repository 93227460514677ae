#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "proto/names.h"

namespace weft::v1 {
namespace {

// What others have tried to make of a name.
const std::string kHostile[] = {
    "",
    ".",
    "..",
    "../x",
    "a/b",
    "/etc/passwd",
    "a\\b",
    ".hidden",
    std::string("a\0b", 3),
    std::string(1, '\0'),
    "a\nb",
    "a b",
    "a;b",
    "$(id)",
    "-rf",
    "a:b",
    "~",
    "%2e%2e",
    "\xc3\xa4",
    std::string(65, 'a'),
    std::string(100'000, 'a'),
};

TEST(Names, HostileOnesAreNone) {
  for (const std::string& text : kHostile) {
    EXPECT_FALSE(is_fabric_name(text)) << text;
    EXPECT_FALSE(is_tag(text)) << text;
    EXPECT_FALSE(is_user_name(text)) << text;
    EXPECT_FALSE(is_job_id(text)) << text;
    EXPECT_FALSE(begins_job_id(text)) << text;
    EXPECT_FALSE(text != "-rf" && is_id(text)) << text;
  }
}

// The rule is one of characters; this is what it is for.
TEST(Names, EveryOneThatPassesIsOnePathComponentThatLeadsNowhereElse) {
  for (int a = 0; a < 256; ++a) {
    for (int b = 0; b < 256; ++b) {
      const std::string text{static_cast<char>(a), static_cast<char>(b)};
      if (is_fabric_name(text) || is_tag(text) || is_id(text) || is_user_name(text)) {
        const std::filesystem::path path(text);
        EXPECT_EQ(path.filename(), path) << a << " " << b;
        EXPECT_EQ(path.lexically_normal(), path) << a << " " << b;
        EXPECT_NE(text.front(), '.');
      }
    }
  }
}

TEST(Names, GoodOnesPass) {
  EXPECT_TRUE(is_fabric_name("silk-2_a"));
  EXPECT_FALSE(is_fabric_name("Silk"));
  EXPECT_TRUE(is_tag("v1.2-final"));
  EXPECT_FALSE(is_tag("latest"));
  EXPECT_FALSE(is_tag("12"));
  EXPECT_TRUE(is_user_name("Ann.B@mill-7"));
  EXPECT_TRUE(is_job_id("j0123456789ab"));
  EXPECT_FALSE(is_job_id("j0123456789aB"));
  EXPECT_TRUE(begins_job_id("j01"));
  EXPECT_TRUE(is_id(std::string(64, 'Z')));
  EXPECT_TRUE(is_label("gpu=a100"));
  EXPECT_TRUE(is_label("..")) << "a label is never a path";
}

TEST(Names, AWorkersNameIsReadableText) {
  EXPECT_TRUE(is_worker_name("Weberei \xc3\xa4ußen 3"));
  EXPECT_FALSE(is_worker_name(""));
  EXPECT_FALSE(is_worker_name("a\nb"));
  EXPECT_FALSE(is_worker_name("\x1b[2J"));
  EXPECT_FALSE(is_worker_name("\xc3"));
  EXPECT_FALSE(is_worker_name("\xff"));
  EXPECT_FALSE(is_worker_name("\xc0\xaf")) << "an overlong slash";
  EXPECT_FALSE(is_worker_name(std::string(129, 'a')));
}

}  // namespace
}  // namespace weft::v1
