#include "coordinator/journal/journal.h"

#include <algorithm>
#include <limits>
#include <string>

#include "coordinator/journal/schema.h"
#include "coordinator/journal/state.h"
#include "core/error.h"
#include "core/named_thread.h"

namespace weft::coordinator {

namespace {

// What the write-ahead log is cut back to whenever it has been copied into the file.
constexpr const char* kPragmas =
    "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; "
    "PRAGMA journal_size_limit=67108864; PRAGMA cache_size=-65536;";

std::uint64_t used_bytes(Connection& connection) {
  Statement s(connection,
              "SELECT (page_count - freelist_count) * page_size FROM pragma_page_count(), "
              "pragma_freelist_count(), pragma_page_size()");
  return s.step() ? s.number_of(0) : 0;
}

// Counts this start.
std::uint32_t next_epoch(Connection& connection) {
  connection.run("UPDATE meta SET value = value + 1 WHERE key = 'epoch'");
  Statement counted(connection, "SELECT value FROM meta WHERE key = 'epoch'");
  const std::int64_t epoch = counted.step() ? counted.signed_of(0) : 0;
  if (epoch < 1 || epoch > std::numeric_limits<std::uint32_t>::max()) {
    throw core::Error(
        core::Code::kDataLoss,
        "the journal does not say how often it was opened: it is damaged; restore the "
        "state folder from a backup, or begin with a new one");
  }
  return static_cast<std::uint32_t>(epoch);
}

}  // namespace

void Journal::State::open() {
  connection.run(kPragmas);
  connection.run("BEGIN EXCLUSIVE");
  make_schema(connection);
  epoch = next_epoch(connection);
  connection.run("COMMIT");
  writer.emplace(connection);
  size_bytes = used_bytes(connection);
}

void Journal::State::write_all(const std::vector<Record>& records) {
  const std::lock_guard connection_lock(connection_mutex);
  connection.run("BEGIN IMMEDIATE");
  for (const Record& record : records) {
    writer->write(record);
  }
  connection.run("COMMIT");
  const std::uint64_t used = used_bytes(connection);
  const std::lock_guard lock(mutex);
  size_bytes = used;
}

// Group commit: while one transaction is being synced, the next one's records gather.
void Journal::State::commit_loop() {
  std::unique_lock lock(mutex);
  while (failure.empty()) {
    appended_more.wait(lock, [&] { return stopping || !waiting.empty(); });
    if (waiting.empty()) {
      break;
    }
    const std::vector<Record> records = std::move(waiting);
    waiting.clear();
    const Ticket ticket = appended;
    lock.unlock();
    std::string problem;
    try {
      write_all(records);
    } catch (const std::exception& error) {
      problem = error.what();
    }
    lock.lock();
    if (problem.empty()) {
      durable = ticket;
    } else {
      failure = problem;
    }
    committed.notify_all();
  }
  has_committed_all = true;
  committed.notify_all();
}

// Answers in a thread of its own, so that the next commit need not wait for it.
void Journal::State::answer_loop() {
  std::unique_lock lock(mutex);
  for (;;) {
    committed.wait(lock, [&] {
      return has_committed_all || (!unanswered.empty() && is_over(unanswered.front().first));
    });
    std::vector<std::pair<Done, std::optional<core::Error>>> answers;
    while (!unanswered.empty() && (has_committed_all || is_over(unanswered.front().first))) {
      answers.emplace_back(std::move(unanswered.front().second),
                           problem_of(unanswered.front().first));
      unanswered.pop_front();
    }
    if (answers.empty() && has_committed_all) {
      return;
    }
    lock.unlock();
    for (const auto& [done, problem] : answers) {
      done(problem);
    }
    lock.lock();
  }
}

std::optional<core::Error> Journal::State::problem_of(Ticket ticket) const {
  if (durable >= ticket) {
    return std::nullopt;
  }
  return core::Error(core::Code::kUnavailable, failure.empty() ? "the journal closes" : failure);
}

Journal::Journal(const std::filesystem::path& file) : state_(std::make_unique<State>(file)) {
  state_->open();
  state_->committer = core::named_thread("weft-journal", [this] { state_->commit_loop(); });
  state_->answerer = core::named_thread("weft-answer", [this] { state_->answer_loop(); });
}

Journal::~Journal() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->stopping = true;
  }
  state_->appended_more.notify_all();
  state_->committer.join();
  state_->answerer.join();
}

std::uint32_t Journal::epoch() const { return state_->epoch; }

Journal::Ticket Journal::append(std::vector<Record> records) {
  const std::lock_guard lock(state_->mutex);
  if (!state_->failure.empty()) {
    throw core::Error(core::Code::kUnavailable, state_->failure);
  }
  if (records.empty()) {
    return state_->appended;  // what the caller knows may rest on records that are not durable yet
  }
  state_->waiting.insert(state_->waiting.end(), std::make_move_iterator(records.begin()),
                         std::make_move_iterator(records.end()));
  state_->appended_more.notify_one();
  return ++state_->appended;
}

void Journal::wait(Ticket ticket) {
  std::unique_lock lock(state_->mutex);
  state_->committed.wait(lock, [&] { return state_->is_over(ticket); });
  if (const std::optional<core::Error> problem = state_->problem_of(ticket)) {
    throw core::Error(*problem);
  }
}

void Journal::when_durable(Ticket ticket, Done done) {
  std::optional<core::Error> problem;
  {
    const std::lock_guard lock(state_->mutex);
    if (!state_->is_over(ticket)) {
      auto& unanswered = state_->unanswered;
      const auto place =
          std::upper_bound(unanswered.begin(), unanswered.end(), ticket,
                           [](Ticket t, const auto& entry) { return t < entry.first; });
      unanswered.emplace(place, ticket, std::move(done));
      return;
    }
    problem = state_->problem_of(ticket);
  }
  done(problem);
}

std::uint64_t Journal::size_bytes() const {
  const std::lock_guard lock(state_->mutex);
  return state_->size_bytes;
}

JournalCatalogue& Journal::catalogue() { return state_->catalogue; }

}  // namespace weft::coordinator
