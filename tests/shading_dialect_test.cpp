#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/file.h"
#include "shading/dialect.h"

// The shared headers must also be GLSL. These tests read their text for what C++ takes and GLSL
// does not, or reads differently.

namespace weft::shading {
namespace {

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// Code of a shared header, without comments; empty when the header is not shared text.
std::string shared_code(const std::filesystem::path& path) {
  const std::string text = text_of(path);
  if (text.rfind("// Shared text", 0) != 0) {
    return {};
  }
  return std::regex_replace(text, std::regex("//[^\n]*"), "");
}

std::vector<std::filesystem::path> headers() {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(WEFT_SOURCE_DIR "/shading")) {
    if (entry.path().extension() == ".h") {
      paths.push_back(entry.path());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::vector<std::string> words(const std::string& code) {
  std::vector<std::string> found;
  const std::regex word("[A-Za-z_][A-Za-z_0-9]*");
  for (std::sregex_iterator it(code.begin(), code.end(), word), end; it != end; ++it) {
    found.push_back(it->str());
  }
  return found;
}

TEST(SharedText, UsesNoWordThatGlslReserves) {
  const std::set<std::string> reserved{
      "active",    "asm",      "attribute", "auto",     "buffer",    "cast",          "centroid",
      "char",      "class",    "coherent",  "common",   "constexpr", "decltype",      "double",
      "enum",      "extern",   "external",  "filter",   "fixed",     "flat",          "goto",
      "half",      "highp",    "in",        "inline",   "inout",     "input",         "interface",
      "invariant", "layout",   "long",      "lowp",     "mediump",   "namespace",     "new",
      "noinline",  "operator", "out",       "output",   "partition", "patch",         "precise",
      "precision", "public",   "readonly",  "resource", "restrict",  "sample",        "shared",
      "short",     "signed",   "sizeof",    "smooth",   "static",    "static_assert", "subroutine",
      "superp",    "template", "this",      "typedef",  "typename",  "uniform",       "union",
      "unsigned",  "using",    "varying",   "volatile", "writeonly"};
  int shared_headers = 0;
  for (const std::filesystem::path& path : headers()) {
    const std::string code = shared_code(path);
    shared_headers += code.empty() ? 0 : 1;
    for (const std::string& word : words(code)) {
      EXPECT_FALSE(reserved.contains(word)) << path.filename() << ": " << word;
      EXPECT_EQ(word.find("__"), std::string::npos) << path.filename() << ": " << word;
    }
  }
  EXPECT_GE(shared_headers, 8);
}

TEST(SharedText, HasNoPointersReferencesOrQualifiedNames) {
  const std::regex foreign("::|->|[^&]&[^&]|\\bfloat\\*|\\*[a-z_]+\\)|\\[\\[");
  for (const std::filesystem::path& path : headers()) {
    const std::string code = shared_code(path);
    std::smatch match;
    EXPECT_FALSE(std::regex_search(code, match, foreign)) << path.filename() << ": " << match.str();
  }
}

TEST(SharedText, WritesEveryFractionAsFloat) {
  // 0.5 is double in C++: the two languages would compute different values.
  const std::regex number("(\\d+\\.\\d*|\\.\\d+)([eE][+-]?\\d+)?(f?)");
  for (const std::filesystem::path& path : headers()) {
    const std::string code = shared_code(path);
    for (std::sregex_iterator it(code.begin(), code.end(), number), end; it != end; ++it) {
      EXPECT_EQ((*it)[3].str(), "f") << path.filename() << ": " << it->str();
    }
  }
}

TEST(SharedText, OnlyTheDialectTellsTheLanguagesApart) {
  for (const std::filesystem::path& path : headers()) {
    const std::string text = text_of(path);
    const bool asks = text.find("__cplusplus") != std::string::npos;
    EXPECT_EQ(asks, path.filename() == "dialect.h") << path.filename();
  }
}

}  // namespace
}  // namespace weft::shading
