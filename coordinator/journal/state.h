#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "coordinator/journal/journal.h"
#include "coordinator/journal/records.h"
#include "coordinator/journal/sqlite.h"

// The inside of a journal; for this folder alone.

namespace weft::coordinator {

struct Journal::State {
  explicit State(const std::filesystem::path& file) : connection(file) {}

  void open();
  void commit_loop();
  void answer_loop();
  void write_all(const std::vector<Record>& records);
  [[nodiscard]] std::optional<core::Error> problem_of(Ticket ticket) const;  // REQUIRES: it is over
  [[nodiscard]] bool is_over(Ticket ticket) const { return durable >= ticket || !failure.empty(); }

  std::mutex connection_mutex;  // locked before `mutex` where both are
  Connection connection;
  JournalCatalogue catalogue{connection, connection_mutex};
  std::optional<RecordWriter> writer;
  std::uint32_t epoch = 0;

  std::mutex mutex;  // of everything below
  std::condition_variable appended_more;
  std::condition_variable committed;
  std::vector<Record> waiting;
  std::deque<std::pair<Ticket, Done>> unanswered;  // in the order of the tickets
  Ticket appended = 0;
  Ticket durable = 0;
  std::string failure;
  std::uint64_t size_bytes = 0;
  bool stopping = false;
  bool has_committed_all = false;  // the committer has ended
  std::thread committer;
  std::thread answerer;
};

}  // namespace weft::coordinator
