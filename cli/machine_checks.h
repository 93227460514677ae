#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/clock.h"
#include "security/endpoint.h"

namespace weft::cli {

// What one look at the machine found.
struct MachineCheck {
  enum class State { kGood, kNote, kWarning, kBroken };
  std::string name;  // "disk of the cache"
  State state = State::kGood;
  std::string found;  // what is so
  std::string mend;   // what to do about it; empty when nothing need be done
};

// "good", "note", "warning", "broken".
[[nodiscard]] const char* to_string(MachineCheck::State state);

// Each never throws: what cannot be looked at is a finding, too.
[[nodiscard]] MachineCheck check_processor();
[[nodiscard]] MachineCheck check_memory();
[[nodiscard]] MachineCheck check_open_files();
// Room and time of a sync where `folder` is or would be; a file is written there and removed.
[[nodiscard]] MachineCheck check_disk(const std::string& what, const std::filesystem::path& folder);
// Has weft-open read a picture.
[[nodiscard]] MachineCheck check_sandbox();
[[nodiscard]] MachineCheck check_devices();
[[nodiscard]] MachineCheck check_clock();
// Whether something could listen at the port of 127.0.0.1. `is_ours`: what listens is known.
[[nodiscard]] MachineCheck check_port(const std::string& what, std::uint16_t port, bool is_ours);
// That of the folder that `endpoint` names, if any; one that ends within 30 days is a warning.
[[nodiscard]] MachineCheck check_certificate(const security::Endpoint& endpoint,
                                             core::Clock::Time now);

}  // namespace weft::cli
