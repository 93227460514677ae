#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
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
  std::string code;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t comment = std::min(text.find("//", at), text.size());
    code += text.substr(at, comment - at);
    at = std::min(text.find('\n', comment), text.size());
  }
  return code;
}

bool in_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

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

// Runs of letters, digits, underscores and, within numbers, points and signed exponents.
std::vector<std::string> tokens(const std::string& code) {
  std::vector<std::string> found;
  for (std::size_t at = 0; at < code.size();) {
    std::size_t end = at;
    const bool number = is_digit(code[at]) || (code[at] == '.' && is_digit(code[at + 1]));
    const auto goes_on = [&](std::size_t k) {
      const bool exponent = k > at && (code[k - 1] == 'e' || code[k - 1] == 'E');
      return in_word(code[k]) || (number && (code[k] == '.' || (exponent && code[k] == '-')));
    };
    while (end < code.size() && goes_on(end)) {
      ++end;
    }
    if (end > at) {
      found.push_back(code.substr(at, end - at));
    }
    at = std::max(end, at + 1);
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
    for (const std::string& word : tokens(code)) {
      EXPECT_FALSE(reserved.contains(word)) << path.filename() << ": " << word;
      EXPECT_EQ(word.find("__"), std::string::npos) << path.filename() << ": " << word;
    }
  }
  EXPECT_GE(shared_headers, 8);
}

TEST(SharedText, HasNoPointersReferencesOrQualifiedNames) {
  const std::vector<std::string> foreign{"::", "->", "& ", "[[", "*)", "float*", "int*"};
  for (const std::filesystem::path& path : headers()) {
    std::string code = shared_code(path);
    for (std::size_t at = code.find("&&"); at != std::string::npos; at = code.find("&&", at)) {
      code.replace(at, 3, "and");  // the logical one is shared, and the blank behind it
    }
    for (const std::string& text : foreign) {
      EXPECT_EQ(code.find(text), std::string::npos) << path.filename() << ": " << text;
    }
  }
}

TEST(SharedText, WritesEveryFractionAsFloat) {
  // 0.5 is double in C++: the two languages would compute different values.
  int fractions = 0;
  for (const std::filesystem::path& path : headers()) {
    for (const std::string& token : tokens(shared_code(path))) {
      const bool number = is_digit(token[0]) || token[0] == '.';
      if (number && token.find_first_of(".eE") != std::string::npos) {
        EXPECT_EQ(token.back(), 'f') << path.filename() << ": " << token;
        ++fractions;
      }
    }
  }
  EXPECT_GT(fractions, 100);
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
