#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace weft::fabric {

// A Fiberworks draft as it stands: sections of lines. What they mean is fabric/dtx.h's business.

struct DtxLine {
  std::string text;  // trimmed, not empty
  std::uint32_t line = 0;
};

struct DtxSection {
  std::string name;  // as the file writes it
  std::uint32_t line = 0;
  std::vector<DtxLine> lines;
  std::map<std::string, DtxLine> marks;  // "%%key value", keys in small letters

  [[nodiscard]] bool is_sinking() const { return marks.contains("sinking"); }
};

// Numbers that stand together, as the treadles of one pick.
struct DtxItem {
  std::vector<std::uint32_t> numbers;
  std::uint32_t line = 0;
};

class DtxFile {
 public:
  // Reads the text of a file called `name`. Throws core::Error(kInvalidArgument) as "name:line:
  // ..." when it has no sections or is too long.
  DtxFile(std::string_view text, std::string name);

  // Sections by name in small letters; null when there is none.
  [[nodiscard]] const DtxSection* find(const std::string& name) const;
  // Throws by fail when it is missing or empty, ending in `mend`.
  [[nodiscard]] const DtxSection& required(const std::string& name, const std::string& mend) const;
  [[nodiscard]] const std::vector<DtxSection>& sections() const { return sections_; }

  // The items of a section, divided by blanks; numbers of one item are divided by commas, which
  // blanks may follow. Each number is at most `limit`.
  [[nodiscard]] std::vector<DtxItem> items(const DtxSection& section, std::uint32_t limit) const;
  // The rows of 0 and 1 of a section as columns that are 1, from 1 on; all rows of one length,
  // which `width` becomes. Throws by fail.
  [[nodiscard]] std::vector<std::vector<std::uint32_t>> bits(const DtxSection& section,
                                                             std::uint32_t limit,
                                                             std::uint32_t& width) const;
  // The number that the mark `key` of @@Info states; 0 when it states none.
  [[nodiscard]] std::uint32_t stated(const std::string& key, std::uint32_t limit) const;

  [[noreturn]] void fail(std::uint32_t line, const std::string& what) const;
  [[noreturn]] void fail(const DtxSection& section, std::uint32_t line,
                         const std::string& what) const;

 private:
  void read_line(std::string_view line, std::uint32_t number);

  std::string name_;
  std::vector<DtxSection> sections_;
};

}  // namespace weft::fabric
