#pragma once

#include <sstream>
#include <string>

// CHECK(condition) and CHECK_EQ(a, b), ...: we are wrong, not the world. On in release. Prints the
// place and both operands, then aborts. User input never reaches one.

namespace weft::core {

[[noreturn]] void check_failed(const char* file, int line, const std::string& what);

template <class A, class B>
std::string check_operands(const char* text, const A& a, const B& b) {
  std::ostringstream out;
  out << text << " (" << a << " against " << b << ")";
  return out.str();
}

}  // namespace weft::core

#define CHECK(condition)                                        \
  do {                                                          \
    if (!(condition)) {                                         \
      weft::core::check_failed(__FILE__, __LINE__, #condition); \
    }                                                           \
  } while (false)

#define WEFT_CHECK_OP(op, a, b)                                                                  \
  do {                                                                                           \
    const auto& check_a = (a);                                                                   \
    const auto& check_b = (b);                                                                   \
    if (!(check_a op check_b)) {                                                                 \
      weft::core::check_failed(__FILE__, __LINE__,                                               \
                               weft::core::check_operands(#a " " #op " " #b, check_a, check_b)); \
    }                                                                                            \
  } while (false)

#define CHECK_EQ(a, b) WEFT_CHECK_OP(==, a, b)
#define CHECK_NE(a, b) WEFT_CHECK_OP(!=, a, b)
#define CHECK_LT(a, b) WEFT_CHECK_OP(<, a, b)
#define CHECK_LE(a, b) WEFT_CHECK_OP(<=, a, b)
#define CHECK_GT(a, b) WEFT_CHECK_OP(>, a, b)
#define CHECK_GE(a, b) WEFT_CHECK_OP(>=, a, b)
