#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <unordered_map>

#include "core/digest.h"

struct sqlite3;
struct sqlite3_stmt;

namespace weft::coordinator {

// One connection to an SQLite file. Used by one thread at a time. What fails throws
// core::Error: kFailedPrecondition when another process has the file, kAlreadyExists when a row
// with that key is there, else kUnavailable.
class Connection {
 public:
  // Opens the file, or creates it.
  explicit Connection(const std::filesystem::path& file);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  Connection(Connection&&) = delete;
  Connection& operator=(Connection&&) = delete;

  // Runs statements that give no rows.
  void run(const char* sql);
  // By the statement that was stepped last.
  [[nodiscard]] std::uint64_t changed_rows() const;

 private:
  friend class Statement;
  [[noreturn]] void fail() const;

  // A statement that was prepared before and is not in use, or a new one.
  [[nodiscard]] sqlite3_stmt* take(const char* sql);
  void give_back(sqlite3_stmt* statement);

  std::string file_;
  sqlite3* handle_ = nullptr;
  std::unordered_map<std::string, sqlite3_stmt*> idle_;  // by text
};

// One prepared statement: bind its parameters in order, then step through its rows. Its text is
// compiled once for a connection.
class Statement {
 public:
  Statement(Connection& connection, const char* sql);
  ~Statement();
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  Statement(Statement&&) = delete;
  Statement& operator=(Statement&&) = delete;

  Statement& text(const std::string& value);
  Statement& blob(const std::string& value);
  Statement& number(std::uint64_t value);
  Statement& real(double value);
  Statement& null();

  // Whether there is a(nother) row.
  bool step();
  // Begins again, with other parameters.
  void reset();

  // Columns of the row, from 0.
  [[nodiscard]] std::string bytes_of(int column) const;
  [[nodiscard]] std::uint64_t number_of(int column) const;
  [[nodiscard]] std::int64_t signed_of(int column) const;
  [[nodiscard]] double real_of(int column) const;
  // Throws core::Error(kDataLoss) when the column holds no digest.
  [[nodiscard]] core::Digest digest_of(int column) const;

 private:
  void check(int result);

  Connection& connection_;
  sqlite3_stmt* handle_ = nullptr;
  int bound_ = 0;
};

}  // namespace weft::coordinator
