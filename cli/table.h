#pragma once

#include <string>
#include <vector>

namespace weft::cli {

// Rows of text under a header, for people. Columns are as wide as their widest entry; the last one
// is not padded.
class Table {
 public:
  explicit Table(std::vector<std::string> header);
  // REQUIRES: as many entries as the header has. Line breaks in an entry become spaces.
  void add(std::vector<std::string> row);
  [[nodiscard]] std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace weft::cli
