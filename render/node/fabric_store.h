#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "client/fabric_cache.h"
#include "render/load_fabric.h"
#include "security/endpoint.h"

namespace weft::render {

// Bytes of memory that a verified database takes when it is loaded: its arrays, and what tracing
// rays through its segments needs.
[[nodiscard]] std::uint64_t fabric_memory_bytes(const std::filesystem::path& database);

// Published fabrics, on disk and in memory. Those in memory stay there between orders, and go, the
// ones used longest ago first, when another needs their room. One order at a time; what it only
// asks (resident, resident_bytes), any thread.
class FabricStore {
 public:
  // `memory_limit_bytes`: of fabrics and pictures together.
  FabricStore(const security::Endpoint& coordinator, client::FabricCache cache,
              std::uint64_t memory_limit_bytes);

  // Frees what is not needed so that `bytes` and the fabrics fit the limit. Throws
  // core::Error(kResourceExhausted) with the figures when the bytes alone exceed it.
  void reserve(std::uint64_t bytes, const std::string& what);

  // A fabric for the order whose bytes were reserved last, loaded when it is not in memory. It and
  // all that were taken since reserve() stay. Throws core::Error: kResourceExhausted with the
  // figures when it does not fit, and what finding, fetching and loading it throw.
  [[nodiscard]] const LoadedFabric& take(const std::string& reference, Fabric::Wanted wanted,
                                         const client::FetchReport& report);

  [[nodiscard]] std::uint64_t memory_limit_bytes() const { return memory_limit_bytes_; }
  [[nodiscard]] const client::FabricCache& cache() const { return cache_; }
  // Content digests, hexadecimal, last used first.
  [[nodiscard]] std::vector<std::string> resident() const;
  [[nodiscard]] std::uint64_t resident_bytes() const;

 private:
  struct Resident {
    std::string digest;
    Fabric::Wanted wanted;
    LoadedFabric fabric;
    std::uint64_t bytes = 0;
    bool in_use = false;  // by the order that is being drawn
  };
  Resident* find(const std::string& digest, Fabric::Wanted wanted);
  // Frees until `bytes` more fit, as far as that goes.
  void make_room(std::uint64_t bytes);
  [[nodiscard]] std::filesystem::path fetch(const v1::Version& version,
                                            const client::FetchReport& report);

  client::Coordinator coordinator_;
  client::FabricCache cache_;
  std::uint64_t memory_limit_bytes_;
  std::uint64_t reserved_bytes_ = 0;
  mutable std::mutex mutex_;       // guards residents_ against those who ask
  std::list<Resident> residents_;  // last used first
};

}  // namespace weft::render
