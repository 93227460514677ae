// Stands for weft-open in tests/core_sandbox_test.cpp: does what a parser that was led astray might
// do, as the request asks.

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/error.h"
#include "core/sandbox_child.h"

namespace {

namespace core = weft::core;

volatile int endless_count = 0;

void forbidden(const std::string& what) {
  if (what == "socket") {
    ::socket(AF_INET, SOCK_STREAM, 0);
  } else if (what == "fork") {
    ::fork();
  } else if (what == "execute") {
    ::execl("/bin/true", "true", nullptr);
  } else if (what == "signal") {
    ::kill(::getppid(), SIGTERM);
  } else if (what == "executable_memory") {
    ::mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  } else if (what == "crash") {
    __builtin_trap();  // not raise: that would be a call of the kernel
  } else if (what == "break_off") {
    ::_exit(0);
  }
}

void greedy(const std::string& what, core::FlatWriter& answer) {
  if (what == "memory") {
    std::vector<std::string> heap;
    while (true) {
      heap.emplace_back(std::size_t{1} << 20, 'x');
    }
  }
  if (what == "answer") {
    const std::string text(std::size_t{1} << 20, 'x');
    while (true) {
      answer.text(text);
    }
  }
  while (what == "endless") {
    endless_count = endless_count + 1;
  }
}

std::string descriptors() {
  std::string open;
  std::array<char, 1> byte{};
  for (int descriptor = 0; descriptor < 64; ++descriptor) {
    // Those of /dev/null end at once, too.
    if (::pread(descriptor, byte.data(), 0, 0) == 0 && ::lseek(descriptor, 0, SEEK_END) > 0) {
      open += std::to_string(descriptor) + " ";
    }
  }
  return open + "are open";
}

void probe(std::span<const std::byte> file, const std::vector<std::string>& arguments,
           core::FlatWriter& answer) {
  const std::string& what = arguments.at(0);
  if (what == "echo") {
    answer.text({reinterpret_cast<const char*>(file.data()), file.size()});
    answer.number(file.size());
  } else if (what == "refuse") {
    throw core::Error(core::Code::kFailedPrecondition, "refused\x1b as asked");
  } else if (what == "open") {
    ::open("/etc/passwd", O_RDONLY);
    throw core::Error(core::Code::kNotFound,
                      "cannot open: " + std::generic_category().message(errno));
  } else if (what == "descriptors") {
    throw core::Error(core::Code::kNotFound, descriptors());
  }
  forbidden(what);
  greedy(what, answer);
}

}  // namespace

int main(int argc, char** argv) {
  return core::serve_sandbox(argc, argv, {{"probe", {[] {}, probe}}});
}
