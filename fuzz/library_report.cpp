#include "fuzz/library_report.h"

#include <string>

namespace weft::fuzz {

namespace {

enum class Owner { kLibrary, kNobody, kUs };

// A frame is "    #1 0x7f… in NAME (/path/of/module+0x123) (BuildId: …)" where no source is known.
Owner owner_of(std::string_view frame, std::string_view program) {
  if (frame.find("/libsanitizer/") != std::string_view::npos) {
    return Owner::kNobody;
  }
  const std::size_t module = frame.find(" (/");
  if (module == std::string_view::npos) {
    return Owner::kUs;
  }
  const std::string_view path = frame.substr(module + 2);
  // The sanitizer's own functions, which stand for malloc and memcpy; and who calls those for all.
  if (path.starts_with(std::string(program) + "+")) {
    return Owner::kNobody;
  }
  for (const std::string_view everybodys : {"/libc.so", "/libstdc++.so", "/libasan.so"}) {
    if (path.substr(0, path.find("+0x")).find(everybodys) != std::string_view::npos) {
      return Owner::kNobody;
    }
  }
  return Owner::kLibrary;
}

// Whether `line` heads a stack of who took or gave back the memory.
bool tells_of_memory(std::string_view line) {
  return line.find("allocated by thread") != std::string_view::npos ||
         line.find("freed by thread") != std::string_view::npos;
}

}  // namespace

bool is_in_library(std::string_view report, std::string_view program) {
  std::size_t stacks = 0;
  std::size_t stacks_of_memory = 0;
  bool is_told_of_memory = false;
  bool is_decided = true;  // for the stack whose frames are being read
  while (!report.empty()) {
    const std::size_t end = report.find('\n');
    const std::string_view line = report.substr(0, end);
    report.remove_prefix(end == std::string_view::npos ? report.size() : end + 1);
    const std::size_t first = line.find_first_not_of(' ');
    if (first == std::string_view::npos || line[first] != '#') {
      is_told_of_memory = is_told_of_memory || tells_of_memory(line);
      continue;
    }
    if (line.substr(first).starts_with("#0 ")) {
      if (!is_decided) {
        return false;
      }
      is_decided = false;
      ++stacks;
      stacks_of_memory += is_told_of_memory ? 1 : 0;
      is_told_of_memory = false;
    }
    const Owner owner = is_decided ? Owner::kNobody : owner_of(line, program);
    if (owner == Owner::kUs) {
      return false;
    }
    is_decided = is_decided || owner == Owner::kLibrary;
  }
  // The first stack is that of the access.
  return is_decided && stacks > stacks_of_memory && stacks_of_memory > 0;
}

}  // namespace weft::fuzz
