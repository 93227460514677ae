#include "core/named_thread.h"

#include <utility>

#include <pthread.h>

#include "core/check.h"

namespace weft::core {

std::thread named_thread(const char* name, std::function<void()> work) {
  return std::thread([name, work = std::move(work)] {
    CHECK_EQ(::pthread_setname_np(::pthread_self(), name), 0);
    work();
  });
}

}  // namespace weft::core
