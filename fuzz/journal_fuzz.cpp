#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/clock.h"
#include "core/error.h"
#include "fuzz/own_folder.h"
#include "fuzz/target.h"

namespace {

namespace coordinator = weft::coordinator;

// In memory where the machine has a place for it; of this process alone.
const std::filesystem::path& folder() {
  static const std::filesystem::path path = [] {
    spdlog::set_level(spdlog::level::off);
    (void)std::atexit([] { std::filesystem::remove_all(folder()); });
    return weft::fuzz::make_own_folder();
  }();
  return path;
}

}  // namespace

// A coordinator that starts on the journal that a crash, a disk or a stranger left behind: it
// starts with what is right in it, or says that it cannot.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path state = folder() / "state";
  std::filesystem::remove_all(state);
  std::filesystem::create_directories(state);
  std::ofstream(state / "journal.db", std::ios::binary) << weft::fuzz::text_of(data, size);
  try {
    coordinator::SchedulerOptions options;
    options.state_folder = state;
    options.commit = [](auto&&...) -> weft::core::Digest {
      throw weft::core::Error(weft::core::Code::kUnavailable, "nothing is committed here");
    };
    coordinator::Scheduler scheduler(std::move(options), weft::core::system_clock());
    for (const weft::v1::Job& job : scheduler.jobs(false, 1000)) {
      static_cast<void>(scheduler.job(job.id()));
    }
  } catch (const weft::core::Error&) {
  }
  return 0;
}
