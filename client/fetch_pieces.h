#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/coordinator.h"
#include "client/fetch_version.h"
#include "client/part_file.h"
#include "client/piece_index.h"
#include "storage/pieces.h"

namespace weft::client {

// Gives a stream of so many bytes as long as a slow line needs; one that takes longer hangs.
void set_deadline(grpc::ClientContext& context, std::uint64_t bytes);

// Waits between tries of a stream that breaks off, and ends them when nothing comes any more.
class Patience {
 public:
  Patience(Coordinator& coordinator, std::string doing)
      : coordinator_(coordinator), doing_(std::move(doing)) {}
  // Throws what the last stream's status says when there is no use in another try.
  void wait(const grpc::Status& status, bool has_progressed);

 private:
  Coordinator& coordinator_;
  std::string doing_;
  int tries_left_ = 0;
  std::chrono::milliseconds wait_{0};
};

// The pieces of a version's file; nothing when the coordinator knows of none. Throws core::Error as
// find_version, and kDataLoss when they cannot be the version's.
[[nodiscard]] std::optional<std::vector<storage::Piece>> manifest_of(Coordinator& coordinator,
                                                                     const v1::Version& version);

// Fills an unfinished file, from its end on, with pieces that are here and pieces that are fetched.
class PieceFetch {
 public:
  PieceFetch(Coordinator& coordinator, const v1::Version& version,
             const std::vector<storage::Piece>& pieces, PartFile& part, PieceIndex here)
      : coordinator_(coordinator),
        version_(version),
        pieces_(pieces),
        part_(part),
        here_(std::move(here)) {}

  // Throws as fetch_version.
  void run(const FetchReport& report, FetchOutcome& outcome);

 private:
  void keep_what_is_good(FetchOutcome& outcome);
  void add(const storage::Piece& piece, std::string_view bytes, const FetchReport& report);
  [[nodiscard]] std::vector<storage::Piece> next_missing() const;
  grpc::Status run_once(const FetchReport& report, FetchOutcome& outcome);

  Coordinator& coordinator_;
  const v1::Version& version_;
  const std::vector<storage::Piece>& pieces_;
  PartFile& part_;
  PieceIndex here_;
  std::size_t next_ = 0;  // pieces before it are in the file
};

}  // namespace weft::client
