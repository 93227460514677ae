#include "coordinator/journal/sqlite.h"

#include <optional>

#include <sqlite3.h>

#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::size_t kIdleLimit = 128;  // statements kept compiled

}  // namespace

Connection::Connection(const std::filesystem::path& file) : file_(file.string()) {
  const int result =
      sqlite3_open_v2(file_.c_str(), &handle_,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
  if (result != SQLITE_OK) {
    const std::string why = sqlite3_errstr(result);
    sqlite3_close(handle_);
    throw core::Error(core::Code::kUnavailable, "cannot open the journal " + file_ + ": " + why);
  }
}

Connection::~Connection() {
  for (const auto& [sql, statement] : idle_) {
    sqlite3_finalize(statement);
  }
  sqlite3_close(handle_);
}

sqlite3_stmt* Connection::take(const char* sql) {
  const auto found = idle_.find(sql);
  if (found != idle_.end()) {
    sqlite3_stmt* const statement = found->second;
    idle_.erase(found);
    return statement;
  }
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v3(handle_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr) !=
      SQLITE_OK) {
    fail();
  }
  return statement;
}

void Connection::give_back(sqlite3_stmt* statement) {
  sqlite3_reset(statement);
  sqlite3_clear_bindings(statement);
  const bool is_kept =
      idle_.size() < kIdleLimit && idle_.try_emplace(sqlite3_sql(statement), statement).second;
  if (!is_kept) {
    sqlite3_finalize(statement);
  }
}

void Connection::run(const char* sql) {
  if (sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    fail();
  }
}

std::uint64_t Connection::changed_rows() const {
  return static_cast<std::uint64_t>(sqlite3_changes64(handle_));
}

void Connection::fail() const {
  const int code = sqlite3_errcode(handle_);
  const std::string what = "the journal " + file_ + ": " + sqlite3_errmsg(handle_);
  if (code == SQLITE_BUSY || code == SQLITE_LOCKED) {
    throw core::Error(core::Code::kFailedPrecondition,
                      what + "; another coordinator uses this state folder: stop it first");
  }
  if (code == SQLITE_CONSTRAINT) {
    throw core::Error(core::Code::kAlreadyExists, what);
  }
  throw core::Error(core::Code::kUnavailable, what + "; check the disk, then start again");
}

Statement::Statement(Connection& connection, const char* sql)
    : connection_(connection), handle_(connection.take(sql)) {}

Statement::~Statement() { connection_.give_back(handle_); }

Statement& Statement::text(const std::string& value) {
  check(sqlite3_bind_text64(handle_, ++bound_, value.data(), value.size(), SQLITE_TRANSIENT,
                            SQLITE_UTF8));
  return *this;
}

Statement& Statement::blob(const std::string& value) {
  // The pointer of an empty blob must not be null, or SQLite stores NULL.
  const char* const data = value.empty() ? "" : value.data();
  check(sqlite3_bind_blob64(handle_, ++bound_, data, value.size(), SQLITE_TRANSIENT));
  return *this;
}

Statement& Statement::number(std::uint64_t value) {
  check(sqlite3_bind_int64(handle_, ++bound_, static_cast<sqlite3_int64>(value)));
  return *this;
}

Statement& Statement::real(double value) {
  check(sqlite3_bind_double(handle_, ++bound_, value));
  return *this;
}

Statement& Statement::null() {
  check(sqlite3_bind_null(handle_, ++bound_));
  return *this;
}

bool Statement::step() {
  const int result = sqlite3_step(handle_);
  if (result != SQLITE_ROW && result != SQLITE_DONE) {
    connection_.fail();
  }
  return result == SQLITE_ROW;
}

void Statement::reset() {
  sqlite3_reset(handle_);
  bound_ = 0;
}

std::string Statement::bytes_of(int column) const {
  const void* const data = sqlite3_column_blob(handle_, column);
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(handle_, column));
  return size == 0 ? std::string() : std::string(static_cast<const char*>(data), size);
}

std::uint64_t Statement::number_of(int column) const {
  return static_cast<std::uint64_t>(sqlite3_column_int64(handle_, column));
}

std::int64_t Statement::signed_of(int column) const {
  return sqlite3_column_int64(handle_, column);
}

double Statement::real_of(int column) const { return sqlite3_column_double(handle_, column); }

core::Digest Statement::digest_of(int column) const {
  const std::optional<core::Digest> digest = core::Digest::from_binary(bytes_of(column));
  if (!digest) {
    throw core::Error(core::Code::kDataLoss, "the journal holds a digest of a wrong size");
  }
  return *digest;
}

void Statement::check(int result) {
  if (result != SQLITE_OK) {
    connection_.fail();
  }
}

}  // namespace weft::coordinator
