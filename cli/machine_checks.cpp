#include "cli/machine_checks.h"

#include <array>
#include <cstdlib>
#include <functional>
#include <string_view>
#include <thread>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/sysinfo.h>
#include <sys/timex.h>
#include <unistd.h>

#include "cli/progress.h"
#include "core/error.h"
#include "core/file.h"
#include "render/gpu/device_info.h"
#include "render/png.h"
#include "security/tls_folder.h"

namespace weft::cli {

namespace {

using State = MachineCheck::State;

constexpr std::uint64_t kMiB = 1U << 20U;
constexpr std::uint64_t kGiB = std::uint64_t{1} << 30U;
constexpr std::uint64_t kFilesWanted = 1024;
// The coordinator syncs its journal for every group of events.
constexpr double kSlowSyncSeconds = 0.1;
constexpr std::chrono::days kRenewalTime{30};

// One grey pixel.
constexpr std::array<unsigned char, 67> kPicture{
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
    0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00,
    0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00, 0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78,
    0x9c, 0x63, 0x68, 0x00, 0x00, 0x00, 0x82, 0x00, 0x81, 0x77, 0xcd, 0x72, 0xb6, 0x00,
    0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

// What cannot be looked at is broken, in the words of the one who tried.
MachineCheck guarded(const std::string& name, const std::function<MachineCheck()>& look) {
  try {
    return look();
  } catch (const std::exception& error) {
    return {name, State::kBroken, error.what(), ""};
  }
}

// `folder`, or what there is of it.
std::filesystem::path existing_part(std::filesystem::path folder) {
  std::error_code failure;
  while (!folder.empty() && folder != folder.root_path() &&
         !std::filesystem::is_directory(folder, failure)) {
    folder = folder.parent_path();
  }
  return folder.empty() ? std::filesystem::path(".") : folder;
}

}  // namespace

const char* to_string(State state) {
  switch (state) {
    case State::kGood:
      return "good";
    case State::kNote:
      return "note";
    case State::kWarning:
      return "warning";
    case State::kBroken:
      return "broken";
  }
  return "";
}

MachineCheck check_processor() {
  const std::string name = "processor";
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const bool has_what_it_takes = __builtin_cpu_supports("avx2") != 0 &&
                                 __builtin_cpu_supports("fma") != 0 &&
                                 __builtin_cpu_supports("bmi2") != 0;
  if (!has_what_it_takes) {
    return {name, State::kBroken, "it lacks AVX2, FMA or BMI2 (x86-64-v3)",
            "use a machine with a processor of 2013 or later; of a virtual machine, let it show "
            "the host's processor"};
  }
  return {name, State::kGood,
          fmt::format("{} threads, AVX2{}", cores,
                      __builtin_cpu_supports("avx512f") != 0 ? ", AVX-512" : ""),
          ""};
}

MachineCheck check_memory() {
  const std::string name = "memory";
  return guarded(name, [&]() -> MachineCheck {
    // /proc/meminfo in kB; what could be had without swapping is not in sysinfo().
    const std::string text = core::read_file("/proc/meminfo", kMiB);
    const auto value = [&](const std::string& key) {
      const std::size_t at = text.find(key);
      return at == std::string::npos
                 ? std::uint64_t{0}
                 : std::strtoull(text.c_str() + at + key.size(), nullptr, 10) * 1024;
    };
    const std::uint64_t available = value("MemAvailable:");
    const std::string found = fmt::format("{} of {} available", format_bytes(available),
                                          format_bytes(value("MemTotal:")));
    if (available < kGiB) {
      return {name, State::kWarning, found,
              "a small fabric takes 1 GiB: end other programs; 'weft run --dry-run' says what a "
              "fabric needs"};
    }
    return {name, State::kGood, found, ""};
  });
}

MachineCheck check_open_files() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  const std::string found = limit.rlim_cur == RLIM_INFINITY
                                ? "no limit"
                                : fmt::format("{} at the same time", limit.rlim_cur);
  if (limit.rlim_cur < kFilesWanted) {
    return {"open files", State::kWarning, found, "raise the limit with 'ulimit -n 1024'"};
  }
  return {"open files", State::kGood, found, ""};
}

MachineCheck check_disk(const std::string& what, const std::filesystem::path& folder) {
  const std::string name = "disk of " + what;
  return guarded(name, [&]() -> MachineCheck {
    if (folder.empty()) {
      return {name, State::kWarning, "there is no folder for it", "set HOME"};
    }
    const std::filesystem::path there = existing_part(folder);
    struct statvfs room {};
    if (statvfs(there.c_str(), &room) != 0) {
      return {name, State::kBroken, there.string() + " cannot be looked at",
              "check that its disk is mounted"};
    }
    const std::uint64_t free_bytes = std::uint64_t{room.f_bavail} * room.f_frsize;
    const std::filesystem::path probe =
        there / fmt::format(".weft-doctor-{}", static_cast<int>(getpid()));
    const core::Stopwatch since_start;
    core::write_file_atomically(probe, std::string(64 * 1024, 'w'));
    const double seconds = since_start.seconds();
    std::error_code ignored;  // it is of no use to anybody, nor does it harm
    std::filesystem::remove(probe, ignored);
    const std::string found = fmt::format("{}: {} free, a sync takes {:.1f} ms", there.string(),
                                          format_bytes(free_bytes), 1000 * seconds);
    if (free_bytes < kGiB) {
      return {name, free_bytes < 64 * kMiB ? State::kBroken : State::kWarning, found,
              "make room: a fabric takes from some MiB to some GiB"};
    }
    if (seconds > kSlowSyncSeconds) {
      return {name, State::kWarning, found,
              "keep it on a local disk: what is written here is synced often"};
    }
    return {name, State::kGood, found, ""};
  });
}

MachineCheck check_sandbox() {
  const std::string name = "sandbox";
  return guarded(name, [&]() -> MachineCheck {
    const std::string_view bytes(reinterpret_cast<const char*>(kPicture.data()), kPicture.size());
    const render::PlainPicture picture = render::read_plain_png(bytes, "a test picture", 16);
    if (picture.values.size() != 1 || picture.values.front() != 0x80) {
      return {name, State::kBroken, "weft-open read a test picture wrongly",
              "install weft again: its programs must be of one version"};
    }
    return {name, State::kGood, "weft-open reads files, confined", ""};
  });
}

MachineCheck check_devices() {
  const std::string name = "devices that draw";
  try {
    const std::vector<render::gpu::DeviceInfo> devices = render::gpu::list_devices();
    const render::gpu::DeviceInfo& first = devices.front();
    const std::string found =
        fmt::format("{} ({}), {}", first.name, render::gpu::kind_name(first.kind), first.driver);
    if (first.kind == render::gpu::DeviceInfo::Kind::kSoftware) {
      return {name, State::kNote, found + "; no GPU: the CPU draws",
              "with a GPU, install its Vulkan driver; without one this is right"};
    }
    return {name, State::kGood, found, ""};
  } catch (const std::exception& error) {
    return {name, State::kWarning, error.what(), "until then, the CPU draws"};
  }
}

MachineCheck check_clock() {
  timex state{};
  if (adjtimex(&state) < 0) {
    return {"clock", State::kNote, "the kernel does not say whether it is synchronised", ""};
  }
  if ((static_cast<unsigned>(state.status) & STA_UNSYNC) != 0) {
    return {"clock", State::kNote, "it is not synchronised with others",
            "where several machines work together: install chrony or systemd-timesyncd, because "
            "certificates have dates"};
  }
  return {"clock", State::kGood,
          fmt::format("synchronised, to {:.0f} ms", static_cast<double>(state.maxerror) / 1000),
          ""};
}

MachineCheck check_port(const std::string& what, std::uint16_t port, bool is_ours) {
  const std::string name = "port of " + what;
  if (is_ours) {
    return {name, State::kGood, fmt::format("{} is in use by it", port), ""};
  }
  const int socket_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  setsockopt(socket_fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool is_free =
      bind(socket_fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(socket_fd);
  if (is_free) {
    return {name, State::kGood, fmt::format("{} is free", port), ""};
  }
  return {name, State::kNote, fmt::format("{} is taken", port),
          "to start one here, name another port with --listen"};
}

MachineCheck check_certificate(const security::Endpoint& endpoint, core::Clock::Time now) {
  const std::string name = "certificate";
  if (endpoint.tls_folder.empty()) {
    return {name, State::kGood, "none is set: this machine talks to itself only", ""};
  }
  return guarded(name, [&]() -> MachineCheck {
    const security::Certificate certificate = security::check_tls_folder(
        security::TlsFolder{endpoint.tls_folder}, security::TlsUse::kCall, now);
    const std::string found = fmt::format("'{}', until {}", certificate.name,
                                          security::date_text(certificate.valid_until));
    if (certificate.valid_until - now < kRenewalTime) {
      return {name, State::kWarning, found,
              fmt::format("issue a new one: weft certs issue {}", certificate.name)};
    }
    return {name, State::kGood, found, ""};
  });
}

}  // namespace weft::cli
